use crate::{EvalError, FitMetrics, Result, Scene};
use glam::Vec3;
use rayon::prelude::*;
use softtissue_body::{BodyModel, Pose, ShapedBody};
use softtissue_clips::{ClipId, MotionClip};
use softtissue_geometry::rotation_from_axis_angle;
use softtissue_monitor::Monitor;

#[derive(Default)]
struct Samples {
    joint_deg: Vec<f32>,
    joint_mm: Vec<f32>,
    delta_mm: Vec<f32>,
    noise_mm: Vec<f32>,
}

/// The fit against truth over the given clips: joint angles relative to the parent, posed joints, scan deltas on soft
/// vertices and, where the scans are at hand, what the scanner added. `None` without truth.
pub fn judge_fit(scene: &Scene, clips: &[ClipId], monitor: &dyn Monitor) -> Result<Option<FitMetrics>> {
    if scene.truth.is_none() {
        return Ok(None);
    }
    monitor.begin("judge the fit", clips.len() as u64, "clips");
    let samples: Result<Vec<Samples>> = clips
        .par_iter()
        .map(|id| {
            if monitor.should_stop() {
                return Err(EvalError::Stopped);
            }
            let samples = clip_samples(scene, id)?;
            monitor.advance(1, &id.to_string());
            Ok(samples)
        })
        .collect();
    monitor.end();
    let mut all = Samples::default();
    for s in samples? {
        all.joint_deg.extend(s.joint_deg);
        all.joint_mm.extend(s.joint_mm);
        all.delta_mm.extend(s.delta_mm);
        all.noise_mm.extend(s.noise_mm);
    }
    Ok(Some(FitMetrics {
        delta_mm_mean: mean(&all.delta_mm),
        scan_noise_mm: mean(&all.noise_mm),
        joint_deg_median: percentile(&mut all.joint_deg, 0.5),
        joint_deg_p95: percentile(&mut all.joint_deg, 0.95),
        joint_mm_median: percentile(&mut all.joint_mm, 0.5),
        joint_mm_p95: percentile(&mut all.joint_mm, 0.95),
        delta_mm_p95: percentile(&mut all.delta_mm, 0.95),
        frames_per_second: None,
    }))
}

fn clip_samples(scene: &Scene, id: &ClipId) -> Result<Samples> {
    let truth = scene.truth.ok_or_else(|| EvalError::Refused("there is no truth to hold the fit against".into()))?;
    let (true_motion, motion) = (truth.motion(id)?, scene.fit.motion(id)?);
    let (true_deltas, scan_deltas, _) = scene.deltas(id)?;
    if motion.len() != true_motion.len() || motion.len() != true_deltas.len() {
        let sizes = format!("{} frames, expected {}", motion.len(), true_motion.len());
        return Err(EvalError::Size { clip: id.clone(), what: "the fitted motion".into(), sizes });
    }
    let beta = scene.beta(id)?;
    let true_beta = truth.subject(&id.subject).ok_or_else(|| {
        EvalError::Refused(format!("the truth folder does not know the subject {}; make the scans again", id.subject))
    })?;
    let (own, real) = (scene.body.shaped(&beta), scene.body.shaped(&true_beta.beta));
    let soft = scene.body.regions.soft();
    let mut samples = Samples::default();
    for t in 0..motion.len() {
        for (a, b) in motion.rotations.frame(t).iter().zip(true_motion.rotations.frame(t)) {
            samples.joint_deg.push(angle_between(*a, *b).to_degrees());
        }
        let joints = [posed_joints(scene.body, &own, &motion, t), posed_joints(scene.body, &real, &true_motion, t)];
        samples.joint_mm.extend(joints[0].iter().zip(&joints[1]).map(|(a, b)| (*a - *b).length() * 1e3));
        let (scan, real) = (scan_deltas.frame(t), true_deltas.frame(t));
        samples.delta_mm.extend(soft.iter().map(|&v| (scan[v as usize] - real[v as usize]).length() * 1e3));
    }
    if let Some(scans) = scene.scans {
        let (scan, clean) = (scans.scan(id)?.vertices, truth.clean(id)?.vertices);
        crate::judge::check_size(id, "the clean scan", &clean, scan.len(), scan.points_per_frame())?;
        for (s, c) in scan.iter().zip(clean.iter()) {
            samples.noise_mm.extend(soft.iter().map(|&v| (s[v as usize] - c[v as usize]).length() * 1e3));
        }
    }
    Ok(samples)
}

fn posed_joints(body: &BodyModel, shaped: &ShapedBody, motion: &MotionClip, t: usize) -> Vec<Vec3> {
    let pose = Pose { rotations: motion.rotations.frame(t), translation: motion.translations[t] };
    let transforms = body.joint_transforms(&shaped.joints, pose);
    transforms.iter().zip(&shaped.joints).map(|(posed_from_rest, j)| posed_from_rest.transform_point3(*j)).collect()
}

/// Angle of the rotation that takes one into the other, radians.
fn angle_between(a: Vec3, b: Vec3) -> f32 {
    let difference = rotation_from_axis_angle(a).transpose() * rotation_from_axis_angle(b);
    softtissue_geometry::axis_angle_from_rotation(difference).length()
}

fn mean(values: &[f32]) -> Option<f64> {
    (!values.is_empty()).then(|| values.iter().map(|x| f64::from(*x)).sum::<f64>() / values.len() as f64)
}

/// The value below which a share `p` of the samples lies (nearest rank).
fn percentile(values: &mut [f32], p: f64) -> Option<f64> {
    let rank = ((values.len() as f64 * p).ceil() as usize).clamp(1, values.len().max(1)) - 1;
    (!values.is_empty()).then(|| f64::from(*values.select_nth_unstable_by(rank, f32::total_cmp).1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_and_percentiles() {
        assert!((angle_between(Vec3::new(0.3, 1.0, -0.4), Vec3::new(0.3, 1.0, -0.4))).abs() < 1e-3);
        assert!((angle_between(Vec3::X * 0.3, Vec3::X * 0.5) - 0.2).abs() < 1e-5);
        let mut values: Vec<f32> = (1..=100).rev().map(|x| x as f32).collect();
        assert_eq!(percentile(&mut values, 0.5), Some(50.0));
        assert_eq!(percentile(&mut values, 0.95), Some(95.0));
        assert_eq!(percentile(&mut [3.0], 0.95), Some(3.0));
        assert_eq!(percentile(&mut [], 0.5), None);
    }
}
