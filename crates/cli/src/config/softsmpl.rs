//! Settings of `method = "softsmpl"` (Santesteban et al. 2020).

use super::{at_least_one, within};
use serde::{Deserialize, Serialize};
use softtissue_model::{PoseSetConfig, RegressorConfig};
use softtissue_train::losses::TrajectoryWeights;
use softtissue_train::{AdamConfig, LossSpace, PoseTraining, RegressorTraining};
use std::path::PathBuf;

/// SoftSMPL. Its subspace is `subspace`, its latent size `regressor.latents`, its mirroring `regressor.mirror`, its
/// low-pass `descriptor.cutoff_hz`; its features and its linear shortcut are its own.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SoftsmplConfig {
    /// Whether the motion is described by the learned pose (sec. 5.1). Default true; false takes the joints' rotations in
    /// its place and is reported as `softsmpl/without-static`.
    pub static_disentangling: bool,
    /// Whether every motion is played by every other person's own regressor, to train on as well (sec. 5.2). Default true;
    /// false is reported as `softsmpl/without-transfer`.
    pub transfer: bool,
    /// Steps of each person's own regressor. Default 600.
    pub transfer_steps: u64,
    /// Whether the root's angular velocity is added to the published features. Default false.
    pub root_angular_velocity: bool,
    /// The learned pose.
    pub poses: PosesConfig,
    /// The regressors.
    pub training: SoftsmplTraining,
}

/// The learned pose.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PosesConfig {
    /// Motion clips whose poses are learned from as well, as `softtissue import motion` writes them. None by default. A motion
    /// that is judged should not be among them.
    pub motions: Vec<PathBuf>,
    /// What it is learned from.
    pub set: PoseSetConfig,
    /// The pose autoencoder.
    pub training: PoseTraining,
}

/// How the regressors are trained: as published, but for the number of steps and the space of the loss.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SoftsmplTraining {
    /// Steps of the common regressor, which the learning rate falls over. Default 1000; the paper's 100 epochs of 320
    /// clips (40, mirrored, by four people) are 3200.
    pub steps: u64,
    /// Clips in a batch, each whole and from a zero state. Default 10, as published.
    pub batch: usize,
    /// Learning rate at the start; falls to zero by a cosine. Default 1e-3, as in the paper, where it stays.
    pub learning_rate: f64,
    /// Width of the recurrent state. Default 256.
    pub width: usize,
    /// Factor of the position term. Default 1, as published, as for the next two.
    pub position: f64,
    /// Factor of the velocity term.
    pub velocity: f64,
    /// Factor of the acceleration term.
    pub acceleration: f64,
    /// Where the error is measured: `coefficients` (default) or `latent`, as published.
    pub space: LossSpace,
}

impl Default for SoftsmplConfig {
    fn default() -> Self {
        Self {
            static_disentangling: true,
            transfer: true,
            transfer_steps: 600,
            root_angular_velocity: false,
            poses: PosesConfig::default(),
            training: SoftsmplTraining::default(),
        }
    }
}

impl Default for SoftsmplTraining {
    fn default() -> Self {
        Self {
            steps: 1000,
            batch: 10,
            learning_rate: 1e-3,
            width: 256,
            position: 1.0,
            velocity: 1.0,
            acceleration: 1.0,
            space: LossSpace::Coefficients,
        }
    }
}

impl SoftsmplTraining {
    /// For the trainee, over a number of steps.
    pub fn over(&self, steps: u64) -> RegressorTraining {
        RegressorTraining {
            network: RegressorConfig { width: self.width },
            steps,
            batch: self.batch,
            learning_rate: self.learning_rate,
            terms: TrajectoryWeights {
                position: self.position,
                velocity: self.velocity,
                acceleration: self.acceleration,
            },
            space: self.space,
            adam: AdamConfig::default(),
        }
    }
}

impl SoftsmplConfig {
    /// What stands after the method's name where a part of it is switched off.
    pub fn ablation(&self) -> Option<&'static str> {
        match (self.static_disentangling, self.transfer) {
            (true, true) => None,
            (false, true) => Some("without-static"),
            (true, false) => Some("without-transfer"),
            (false, false) => Some("without-both"),
        }
    }

    /// Refuses settings that cannot work.
    pub fn check(&self) -> Result<(), String> {
        let Self { poses: PosesConfig { set, training: pose, .. }, training, .. } = self;
        for (key, count) in [
            ("poses.set.components", set.components),
            ("poses.training.batch", pose.batch),
            ("poses.training.network.latents", pose.network.latents),
            ("poses.training.network.width", pose.network.width),
            ("training.batch", training.batch),
            ("training.width", training.width),
        ] {
            at_least_one(&format!("softsmpl.{key}"), count)?;
        }
        for (key, value, most) in [
            ("poses.set.recombined", set.recombined, 100.0),
            ("poses.set.habit", set.habit, 3.0),
            ("poses.training.adam.beta_1", pose.adam.beta_1, 1.0 - 1e-9),
            ("poses.training.adam.beta_2", pose.adam.beta_2, 1.0 - 1e-9),
            ("training.position", training.position, 1e6),
            ("training.velocity", training.velocity, 1e6),
            ("training.acceleration", training.acceleration, 1e6),
        ] {
            within(&format!("softsmpl.{key}"), value, 0.0..=most)?;
        }
        within("softsmpl.poses.training.adam.epsilon", pose.adam.epsilon, 1e-300..=1.0)?;
        for (key, rate) in [("poses.training", pose.learning_rate), ("training", training.learning_rate)] {
            within(&format!("softsmpl.{key}.learning_rate"), rate, 1e-12..=1.0)?;
        }
        Ok(())
    }
}
