//! The wrists of CMU's 3dsMax-friendly BVH files.
//!
//! Their `LeftWrist` holds the turn of Acclaim's `lwrist` and the bend of its `lhand` in one joint (`lhand` lies at the
//! same place and never turns), but in the wrong order and with two axes exchanged: where Acclaim has
//! `wrist Ry(p), then hand Rx(a) Rz(b)`, and `Rx(a) Rz(b) Ry(p) = Rz(z) Rx(x) Ry(y)`, the file's channels are `z, -y, -x`
//! on the left and `z, y, x` on the right. Everything else agrees with the Acclaim files to the last digit.

use super::foreign::ForeignMotion;
use glam::{DMat3, DQuat, DVec3};

/// Wrist, the joint without turn at its place, and the sign of the exchanged channels.
const SIDES: [(&str, &str, f64); 2] = [("LeftWrist", "lhand", -1.0), ("RightWrist", "rhand", 1.0)];

/// Puts the wrists right in a motion of these files, and says whether it is one.
pub(super) fn mend(motion: &mut ForeignMotion) -> bool {
    let Some(wrists) = wrists(motion) else { return false };
    let joints = motion.skeleton.len();
    for frame in motion.rotations.chunks_exact_mut(joints) {
        for (wrist, sign) in wrists {
            frame[wrist] = mended(frame[wrist], sign);
        }
    }
    true
}

fn wrists(motion: &ForeignMotion) -> Option<[(usize, f64); 2]> {
    let skeleton = &motion.skeleton;
    let index = |name: &str| skeleton.names.iter().position(|n| n == name);
    index("LHipJoint")?;
    index("LeftCollar")?;
    let mut found = [(0, 0.0); 2];
    for (slot, (wrist, hand, sign)) in found.iter_mut().zip(SIDES) {
        let (wrist, hand) = (index(wrist)?, index(hand)?);
        let here = skeleton.parents[hand] == Some(wrist) && skeleton.offsets[hand] == DVec3::ZERO;
        let still = motion.rotations.iter().skip(hand).step_by(skeleton.len()).all(|q| q.w.abs() > 1.0 - 1e-12);
        if !(here && still) {
            return None;
        }
        *slot = (wrist, sign);
    }
    Some(found)
}

fn mended(turn: DQuat, sign: f64) -> DQuat {
    let m = DMat3::from_quat(turn);
    // the channels, from Rz(z) Rx(x) Ry(y)
    let x = m.y_axis.z.clamp(-1.0, 1.0).asin();
    let (z, y) = ((-m.y_axis.x).atan2(m.y_axis.y), (-m.x_axis.z).atan2(m.z_axis.z));
    let m = DMat3::from_rotation_z(z) * DMat3::from_rotation_x(sign * y) * DMat3::from_rotation_y(sign * x);
    // what they mean, from Rx(a) Rz(b) Ry(p)
    let b = (-m.y_axis.x).clamp(-1.0, 1.0).asin();
    let (a, p) = (m.y_axis.z.atan2(m.y_axis.y), m.z_axis.x.atan2(m.x_axis.x));
    DQuat::from_rotation_y(p) * DQuat::from_rotation_x(a) * DQuat::from_rotation_z(b)
}
