//! What the network sees of poses and heights (sec. 3.2), on the host.

use glam::{Mat3, Quat, Vec3};
use softtissue_body::{BodyModel, Skeleton, SkinWeights};
use softtissue_clips::MotionClip;
use softtissue_geometry::rotation_from_axis_angle;

/// Heights are multiplied by this, 1/m.
const HEIGHT_SCALE: f32 = 20.0;
/// `alpha` and `beta` of the differences' logarithmic scale (sec. 3.2).
const ALPHA: f32 = 1000.0;
const BETA: f32 = 0.25;
/// What differences of poses are multiplied by: between two frames they are a few hundredths. The paper has no such
/// factor and a hundred thousand steps.
const DIFFERENCE_SCALE: f32 = 10.0;
/// What changes of these differences are multiplied by: an acceleration of 1 g moves the root by 3 mm more in a frame than
/// in the one before, which is what shakes flesh, and would be a hundredth of the numbers round it.
const CHANGE_SCALE: f32 = 10.0;
/// Numbers of a quaternion.
pub const QUATERNION: usize = 4;
/// Numbers of the root's motion between two frames: a quaternion and a translation.
pub const ROOT: usize = 7;

/// `sign(x) ln(alpha |x| + 1) beta` (sec. 3.2): small differences count.
pub fn log_scaled(x: f32) -> f32 {
    x.signum() * (ALPHA * x.abs()).ln_1p() * BETA
}

/// Heights of the newest frame and the differences before it, `[M, history]`; `heights` are of `history` frames, the
/// newest last.
pub fn height_features(heights: &[&[f32]]) -> Vec<f32> {
    let newest = heights.last().expect("at least one frame of heights");
    let mut features = Vec::with_capacity(newest.len() * heights.len());
    for v in 0..newest.len() {
        features.push(HEIGHT_SCALE * newest[v]);
        features.extend(heights.windows(2).map(|pair| log_scaled(pair[1][v] - pair[0][v])));
    }
    features
}

/// A motion as quaternions.
#[derive(Clone, Debug)]
pub struct PoseTrack {
    joints: usize,
    /// Rotations relative to the parent, `[T, J]`.
    rotations: Vec<Quat>,
    /// `[T]`, metres.
    translations: Vec<Vec3>,
}

/// The quaternion of a rotation with a real part of at least zero: both signs mean the same rotation.
fn canonical(rotation: Mat3) -> Quat {
    let q = Quat::from_mat3(&rotation).normalize();
    if q.w < 0.0 { -q } else { q }
}

impl PoseTrack {
    /// Of a motion.
    pub fn new(motion: &MotionClip) -> Self {
        let rotations = motion.rotations.points().iter().map(|w| canonical(rotation_from_axis_angle(*w))).collect();
        Self { joints: motion.rotations.points_per_frame(), rotations, translations: motion.translations.clone() }
    }

    /// Frames.
    pub fn len(&self) -> usize {
        self.translations.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.translations.is_empty()
    }

    fn rotation(&self, t: usize, joint: usize) -> Quat {
        self.rotations[t * self.joints + joint]
    }

    /// Quaternions of the joints below the root in the frames `frames`, joint by joint: `[J - 1, frames, 4]`. Frames
    /// before the first are the first.
    pub fn poses(&self, frames: impl Iterator<Item = isize> + Clone) -> Vec<f32> {
        let at = |t: isize| t.max(0) as usize;
        let joints = 1..self.joints;
        joints.flat_map(|j| frames.clone().flat_map(move |t| self.rotation(at(t), j).to_array())).collect()
    }

    /// How poses changed since the frame before (eq. 1), `p_t p_{t-1}^-1` less the identity: of the joints below the
    /// root `[J - 1, frames, 4]`, and of the root `[frames, 7]`, its translation in its own frame. Before the first frame
    /// the body is taken to have stood still. Of all frames but the last it is the change to the next frame's difference
    /// that is given.
    pub fn differences(&self, frames: impl Iterator<Item = isize> + Clone) -> (Vec<f32>, Vec<f32>) {
        let of = |t: isize, j: usize| -> [f32; QUATERNION] {
            if t <= 0 {
                return [0.0; QUATERNION];
            }
            let (now, before) = (self.rotation(t as usize, j), self.rotation(t as usize - 1, j));
            let (now, before) = (Mat3::from_quat(now), Mat3::from_quat(before).transpose());
            // the root has no parent whose frame its turn could be seen in, so its own it is
            let change = canonical(if j == 0 { before * now } else { now * before });
            [change.x, change.y, change.z, change.w - 1.0].map(|x| DIFFERENCE_SCALE * x)
        };
        let root = |t: isize| {
            let moved = match t {
                ..=0 => Vec3::ZERO,
                _ => {
                    let before = t as usize - 1;
                    let moved = self.translations[t as usize] - self.translations[before];
                    DIFFERENCE_SCALE * (self.rotation(before, 0).inverse() * moved)
                }
            };
            of(t, 0).into_iter().chain(moved.to_array())
        };
        let roots = with_changes(frames.clone().flat_map(root).collect(), ROOT);
        let joint = |j| with_changes(frames.clone().flat_map(|t| of(t, j)).collect(), QUATERNION);
        ((1..self.joints).flat_map(joint).collect(), roots)
    }
}

/// Rows of `width` numbers, each but the last replaced by how much the next is more.
fn with_changes(mut rows: Vec<f32>, width: usize) -> Vec<f32> {
    for i in 0..rows.len().saturating_sub(width) {
        rows[i] = CHANGE_SCALE * (rows[i + width] - rows[i]);
    }
    rows
}

/// How much each joint below the root means to each vertex (eq. 2), `[M, J - 1]`: `(W w_i)_j`, where `W` joins every
/// joint to itself and to those next to it in the kinematic tree.
pub fn localisation(body: &BodyModel, vertices: &[u32]) -> Vec<f32> {
    let near = neighbours(&body.skeleton);
    vertices.iter().flat_map(|v| local_weights(&near, &body.skin[*v as usize])).collect()
}

/// `[J][J]`.
fn neighbours(skeleton: &Skeleton) -> Vec<Vec<bool>> {
    let count = skeleton.len();
    let parent = |j: usize| skeleton.parents[j].map(usize::from);
    (0..count).map(|a| (0..count).map(|b| a == b || parent(a) == Some(b) || parent(b) == Some(a)).collect()).collect()
}

fn local_weights(near: &[Vec<bool>], skin: &SkinWeights) -> Vec<f32> {
    let mut local = vec![0.0; near.len()];
    for (joint, weight) in skin.joints.iter().zip(skin.weights) {
        for (sum, near) in local.iter_mut().zip(&near[usize::from(*joint)]) {
            *sum += if *near { weight } else { 0.0 };
        }
    }
    local.split_off(1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use softtissue_clips::ClipId;
    use softtissue_geometry::Frames;

    #[test]
    fn the_logarithm_is_odd_and_steep_at_zero() {
        assert_eq!(log_scaled(0.0), 0.0);
        assert!((log_scaled(0.001) - 0.25 * 2.0f32.ln()).abs() < 1e-6);
        assert_eq!(log_scaled(-0.004), -log_scaled(0.004));
    }

    #[test]
    fn heights_come_with_their_differences() {
        let frames: [&[f32]; 3] = [&[0.001, 0.0], &[0.002, 0.0], &[0.002, -0.01]];
        let found = height_features(&frames);
        let wanted = [0.04, log_scaled(0.001), 0.0, -0.2, 0.0, log_scaled(-0.01)];
        assert!(found.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-6), "{found:?}");
    }

    fn turning() -> PoseTrack {
        let rotations = Frames::from_points(2, vec![Vec3::ZERO, Vec3::ZERO, Vec3::Y * 1.5707964, Vec3::X * 0.2]);
        let translations = vec![Vec3::ZERO, Vec3::Z * 0.1];
        PoseTrack::new(&MotionClip { id: ClipId::new("s", "m", 0), fps: 60.0, rotations, translations })
    }

    #[test]
    fn differences_are_turns_since_the_frame_before() {
        let track = turning();
        let (joints, root) = track.differences([0isize, 1].into_iter());
        let half = 0.1f32;
        let wanted = [half.sin(), 0.0, 0.0, half.cos() - 1.0].map(|x| 10.0 * x);
        assert!(joints[4..].iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-5), "{joints:?}");
        // there was no difference before, so that all of it is the change
        assert!(joints[..4].iter().zip(wanted).all(|(a, b)| (a - 10.0 * b).abs() < 1e-4), "{joints:?}");
        assert_eq!(root.len(), 2 * ROOT);
        // the translation is seen from the frame before, which looked along +Z
        assert!((root[13] - 1.0).abs() < 1e-6 && (root[6] - 10.0).abs() < 1e-5, "{root:?}");
    }

    #[test]
    fn a_vertex_sees_its_joint_and_those_next_to_it() {
        let skeleton = Skeleton::smpl();
        let near = neighbours(&skeleton);
        let knee = skeleton.index("left_knee").expect("a joint");
        let skin = SkinWeights { joints: [knee as u8, 0, 0, 0], weights: [1.0, 0.0, 0.0, 0.0] };
        let local = local_weights(&near, &skin);
        let seen: Vec<&str> = (1..24).filter(|j| local[j - 1] > 0.0).map(|j| skeleton.names[j].as_str()).collect();
        assert_eq!(seen, ["left_hip", "left_knee", "left_ankle"]);
    }
}
