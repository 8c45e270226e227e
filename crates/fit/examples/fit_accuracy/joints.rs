use glam::{Quat, Vec3};
use softtissue_clips::MotionClip;
use std::fmt;

/// Errors of each joint's rotation relative to its parent.
pub struct Joints {
    joints: Vec<Squares>,
    frames: usize,
}

/// Sums over frames of squared angles, radians, and of their second differences.
#[derive(Clone, Default)]
struct Squares {
    moving: f64,
    standing: f64,
    acceleration_error: f64,
    true_acceleration: f64,
}

impl Joints {
    pub fn new(count: usize) -> Self {
        Self { joints: vec![Squares::default(); count], frames: 0 }
    }

    /// Adds a clip of at least one frame.
    pub fn add(&mut self, found: &MotionClip, truth: &MotionClip) {
        let frames = truth.len();
        self.frames += frames;
        for (j, sums) in self.joints.iter_mut().enumerate() {
            let of = |m: &MotionClip| -> Vec<Quat> {
                (0..frames).map(|t| Quat::from_scaled_axis(m.rotations.frame(t)[j])).collect()
            };
            let (found, truth) = (of(found), of(truth));
            let errors: Vec<Vec3> = found.iter().zip(&truth).map(|(a, b)| turn(*b, *a)).collect();
            let mean = errors.iter().sum::<Vec3>() / frames as f32;
            sums.moving += errors.iter().map(|e| f64::from(e.distance_squared(mean))).sum::<f64>();
            sums.standing += frames as f64 * f64::from(mean.length_squared());
            for e in errors.windows(3) {
                sums.acceleration_error += f64::from((e[2] - 2.0 * e[1] + e[0]).length_squared());
            }
            for q in truth.windows(3) {
                sums.true_acceleration += f64::from((turn(q[1], q[2]) - turn(q[0], q[1])).length_squared());
            }
        }
    }
}

/// Rotation vector from one rotation to another, at most half a turn.
fn turn(from: Quat, to: Quat) -> Vec3 {
    let d = to * from.inverse();
    (if d.w < 0.0 { -d } else { d }).to_scaled_axis()
}

impl fmt::Display for Joints {
    fn fmt(&self, out: &mut fmt::Formatter) -> fmt::Result {
        writeln!(
            out,
            "joint: rms error that moves, that stands, degrees; rms acceleration error, true, degrees a frame squared"
        )?;
        for (j, sums) in self.joints.iter().enumerate() {
            let rms = |sum: f64| (sum / self.frames.max(1) as f64).sqrt().to_degrees();
            let Squares { moving, standing, acceleration_error, true_acceleration } = sums;
            let [a, b, c, d] = [moving, standing, acceleration_error, true_acceleration].map(|sum| rms(*sum));
            writeln!(out, "  {j:2} {a:6.2} {b:6.2}   {c:6.2} {d:6.2}")?;
        }
        Ok(())
    }
}
