use crate::{AdamPoseFit, TrainError};
use burn::tensor::Device;
use softtissue_clips::{ClipId, ScanClip};
use softtissue_fit::{AdamFitConfig, FitError, FittedMotion, PoseProblem, PoseSolver};
use softtissue_geometry::Frames;
use softtissue_monitor::Monitor;

/// `fit.solver = "adam"`: [`AdamPoseFit`] over batches of a clip's frames, each from that frame's own start. A batch's
/// frames steady each other in both directions; the last frame of the batch before is held.
#[derive(Clone, Debug)]
pub struct AdamSolver {
    config: AdamFitConfig,
    device: Device,
}

impl AdamSolver {
    /// `device` is a plain one.
    pub fn new(config: AdamFitConfig, device: Device) -> Self {
        Self { config, device }
    }
}

impl PoseSolver for AdamSolver {
    fn solve_clip(
        &self,
        problem: &PoseProblem,
        scan: &ScanClip,
        monitor: &dyn Monitor,
    ) -> softtissue_fit::Result<FittedMotion> {
        let PoseProblem { body, shaped, template, fit_weight, objective } = *problem;
        let starts = objective.start_poses(scan)?;
        let fit = AdamPoseFit::new(body, shaped, Some(template), fit_weight, objective.kind(), &self.device)
            .with_priors(objective.pose_prior(), objective.smoothness());
        let (mut rotations, mut translations, mut values) = (Frames::new(body.joint_count()), vec![], vec![]);
        let (name, frames) = (scan.id.to_string(), scan.vertices.len());
        for first in (0..frames).step_by(self.config.batch) {
            let batch = first..(first + self.config.batch).min(frames);
            let before = first.checked_sub(1).map(|last| rotations.frame(last).to_vec());
            let (turns, moves) = (starts.rotations.slice(batch.clone()), &starts.translations[batch.clone()]);
            let scans = scan.vertices.slice(batch.clone());
            let found = fit
                .fit(&self.config, before.as_deref(), &turns, moves, &scans, &StopOnly(monitor))
                .map_err(|error| failed(&scan.id, &error))?;
            if monitor.should_stop() {
                return Err(FitError::Stopped);
            }
            let last = found.values.last().cloned().unwrap_or_default();
            if let Some(bad) = last.iter().position(|value| !value.is_finite()) {
                let reason =
                    format!("adam left the finite numbers at frame {}; lower fit.adam.learning_rate", first + bad);
                return Err(FitError::Solver { clip: scan.id.clone(), reason });
            }
            found.rotations.iter().for_each(|frame| rotations.push(frame));
            translations.extend(found.translations);
            values.extend(last);
            monitor.advance(batch.len() as u64, &name);
        }
        let evaluations = vec![self.config.iterations as usize + 1; frames];
        Ok(FittedMotion::new(&rotations, &translations, values, evaluations))
    }
}

fn failed(clip: &ClipId, error: &TrainError) -> FitError {
    FitError::Solver { clip: clip.clone(), reason: error.to_string() }
}

/// A batch's iterations are no part of the clip's progress, which counts frames; a stop reaches it all the same.
struct StopOnly<'a>(&'a dyn Monitor);

impl Monitor for StopOnly<'_> {
    fn begin(&self, _: &str, _: u64, _: &'static str) {}
    fn advance(&self, _: u64, _: &str) {}
    fn end(&self) {}
    fn say(&self, _: &str) {}
    fn should_stop(&self) -> bool {
        self.0.should_stop()
    }
}
