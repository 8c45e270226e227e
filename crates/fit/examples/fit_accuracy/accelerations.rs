use glam::Vec3;
use softtissue_body::{BodyModel, Pose};
use softtissue_clips::MotionClip;
use softtissue_fit::ClipComparison;
use std::fmt;

/// Second differences over four frames of the soft vertices of the body without deltas.
#[derive(Default)]
pub struct Accelerations {
    squared_error: f64,
    squared_truth: f64,
}

impl Accelerations {
    pub fn add(&mut self, body: &BodyModel, clip: &ClipComparison) {
        let (found, real) = (posed(body, clip.fitted), posed(body, clip.truth));
        for t in 2..real.len().saturating_sub(2) {
            for v in body.regions.soft().iter().map(|v| *v as usize) {
                let second = |x: &[Vec<Vec3>]| (x[t + 2][v] - 2.0 * x[t][v] + x[t - 2][v]) / 4.0;
                let (a, b) = (second(&found), second(&real));
                self.squared_error += f64::from(a.distance_squared(b));
                self.squared_truth += f64::from(b.length_squared());
            }
        }
    }
}

fn posed(body: &BodyModel, (beta, motion): (&[f32], &MotionClip)) -> Vec<Vec<Vec3>> {
    let shaped = body.shaped(beta);
    let pose = |t: usize| Pose { rotations: motion.rotations.frame(t), translation: motion.translations[t] };
    (0..motion.len()).map(|t| body.posed(&shaped, pose(t), None)).collect()
}

impl fmt::Display for Accelerations {
    fn fmt(&self, out: &mut fmt::Formatter) -> fmt::Result {
        let share = (self.squared_error / self.squared_truth).sqrt();
        writeln!(out, "acceleration of the skinned soft vertices: error {share:.3} of the true one")
    }
}
