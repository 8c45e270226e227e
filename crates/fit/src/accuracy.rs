use glam::{Quat, Vec3};
use serde::Serialize;
use softtissue_body::{BodyModel, Pose};
use softtissue_clips::{DeltaClip, MotionClip, ScanClip};

/// One clip's truth and what the fit made of its scan.
pub struct ClipComparison<'a> {
    /// Fitted shape and motion.
    pub fitted: (&'a [f32], &'a MotionClip),
    /// True shape and motion.
    pub truth: (&'a [f32], &'a MotionClip),
    /// Scan deltas and true deltas.
    pub deltas: (&'a DeltaClip, &'a DeltaClip),
    /// The scan and the posed vertices before the scanner.
    pub scan: (&'a ScanClip, &'a ScanClip),
}

/// Errors of a fit against truth, over all joints, soft vertices and frames of the clips that were added.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct FitAccuracy {
    /// Median angle between fitted and true rotation of a joint relative to its parent, degrees.
    pub joint_deg_median: f64,
    /// The same, 95th percentile.
    pub joint_deg_p95: f64,
    /// Median distance between fitted and true position of a joint, mm.
    pub joint_mm_median: f64,
    /// The same, 95th percentile.
    pub joint_mm_p95: f64,
    /// Mean distance between scan delta and true delta on soft vertices, mm.
    pub delta_mm_mean: f64,
    /// The same, 95th percentile.
    pub delta_mm_p95: f64,
    /// Mean length of the true deltas on soft vertices, mm: what there was to find.
    pub true_delta_mm_mean: f64,
    /// Mean distance between scan and clean posed vertex on soft vertices, mm: what the scanner hides.
    pub scanner_mm_mean: f64,
}

/// Gathers errors clip by clip.
#[derive(Clone, Debug, Default)]
pub struct AccuracySum {
    joint_deg: Vec<f32>,
    joint_mm: Vec<f32>,
    delta_mm: Vec<f32>,
    true_delta_mm: f64,
    scanner_mm: f64,
}

impl AccuracySum {
    /// Adds a clip. Panics if frame or vertex counts differ.
    pub fn add(&mut self, body: &BodyModel, clip: &ClipComparison) {
        let (fitted, truth) = (clip.fitted.1, clip.truth.1);
        assert_eq!(fitted.len(), truth.len(), "frames of motion");
        let joints = [clip.fitted.0, clip.truth.0].map(|beta| body.shaped(beta).joints);
        for t in 0..truth.len() {
            let [a, b] =
                [fitted, truth].map(|m| Pose { rotations: m.rotations.frame(t), translation: m.translations[t] });
            self.joint_deg.extend(a.rotations.iter().zip(b.rotations).map(|(x, y)| angle(*x, *y).to_degrees()));
            let [p, q] = [body.posed_joints(&joints[0], a), body.posed_joints(&joints[1], b)];
            self.joint_mm.extend(p.iter().zip(&q).map(|(p, q)| 1e3 * p.distance(*q)));
        }
        let soft = body.regions.soft();
        let (found, real) = (&clip.deltas.0.deltas, &clip.deltas.1.deltas);
        let (scan, clean) = (&clip.scan.0.vertices, &clip.scan.1.vertices);
        assert!(
            found.len() == real.len() && scan.len() == clean.len() && scan.len() == found.len(),
            "frames of deltas"
        );
        for t in 0..found.len() {
            for v in soft.iter().map(|v| *v as usize) {
                self.delta_mm.push(1e3 * found.frame(t)[v].distance(real.frame(t)[v]));
                self.true_delta_mm += 1e3 * f64::from(real.frame(t)[v].length());
                self.scanner_mm += 1e3 * f64::from(scan.frame(t)[v].distance(clean.frame(t)[v]));
            }
        }
    }

    /// The errors of all clips added; zeros if there was none.
    pub fn finish(mut self) -> FitAccuracy {
        let count = self.delta_mm.len().max(1) as f64;
        let delta_mm_mean = self.delta_mm.iter().map(|x| f64::from(*x)).sum::<f64>() / count;
        FitAccuracy {
            joint_deg_median: percentile(&mut self.joint_deg, 0.5),
            joint_deg_p95: percentile(&mut self.joint_deg, 0.95),
            joint_mm_median: percentile(&mut self.joint_mm, 0.5),
            joint_mm_p95: percentile(&mut self.joint_mm, 0.95),
            delta_mm_mean,
            delta_mm_p95: percentile(&mut self.delta_mm, 0.95),
            true_delta_mm_mean: self.true_delta_mm / count,
            scanner_mm_mean: self.scanner_mm / count,
        }
    }
}

fn angle(a: Vec3, b: Vec3) -> f32 {
    let between = Quat::from_scaled_axis(a) * Quat::from_scaled_axis(b).inverse();
    2.0 * between.xyz().length().atan2(between.w.abs())
}

fn percentile(values: &mut [f32], share: f64) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let at = ((share * values.len() as f64) as usize).min(values.len() - 1);
    f64::from(*values.select_nth_unstable_by(at, f32::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figure::{figure, smooth_pose};
    use softtissue_clips::ClipId;
    use softtissue_geometry::Frames;

    #[test]
    fn known_errors_are_measured() {
        let body = figure(5, 6);
        let id = ClipId::new("a", "walk", 0);
        let (rotations, translation) = smooth_pose(1, 0.0, 0.3);
        let motion = |rotations: &[Vec3], translation| MotionClip {
            id: id.clone(),
            fps: 60.0,
            rotations: Frames::from_points(24, rotations.to_vec()),
            translations: vec![translation],
        };
        let truth = motion(&rotations, translation);
        let turned = Quat::from_rotation_z(2f32.to_radians()) * Quat::from_scaled_axis(rotations[0]);
        let mut wrong = rotations.clone();
        wrong[0] = turned.to_scaled_axis();
        let fitted = motion(&wrong, translation + Vec3::Y * 0.004);
        let deltas = |x: f32| DeltaClip {
            id: id.clone(),
            fps: 60.0,
            deltas: Frames::from_points(body.vertex_count(), vec![Vec3::X * x; body.vertex_count()]),
        };
        let scan = |x: f32| ScanClip { id: id.clone(), fps: 60.0, vertices: deltas(x).deltas };
        let mut sum = AccuracySum::default();
        sum.add(
            &body,
            &ClipComparison {
                fitted: (&[0.0], &fitted),
                truth: (&[0.0], &truth),
                deltas: (&deltas(0.005), &deltas(0.003)),
                scan: (&scan(0.0), &scan(0.001)),
            },
        );
        let accuracy = sum.finish();
        assert_eq!(accuracy.joint_deg_median, f64::from(angle(rotations[1], rotations[1])));
        // one joint of 24 is wrong: more than the 95th percentile sees
        assert!(accuracy.joint_deg_p95 < 1e-2, "{accuracy:?}");
        assert!(accuracy.joint_mm_p95 > 4.0);
        assert!((accuracy.delta_mm_mean - 2.0).abs() < 1e-3 && (accuracy.delta_mm_p95 - 2.0).abs() < 1e-3);
        assert!((accuracy.true_delta_mm_mean - 3.0).abs() < 1e-3 && (accuracy.scanner_mm_mean - 1.0).abs() < 1e-3);
        assert!((f64::from(angle(wrong[0], rotations[0]).to_degrees()) - 2.0).abs() < 1e-2);
        assert_eq!(AccuracySum::default().finish(), FitAccuracy::default());
    }
}
