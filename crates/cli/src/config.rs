//! Every setting in one place. Each section's defaults live beside the code that uses them.

use serde::{Deserialize, Serialize};
use softtissue_bundle::descriptor::{DescriptorConfig, FeatureKind};
use softtissue_clips::SplitConfig;
use softtissue_fit::FitConfig;
use softtissue_model::PcaConfig;
use softtissue_model::linear::LadderConfig;
use softtissue_synth::dataset::SynthConfig;
use softtissue_train::{LoopConfig, RegressorTraining, SubspaceTraining};

/// The whole configuration.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    /// The one number all random draws come from. Default 1.
    pub seed: u64,
    /// Where tensors live: `flex`, `ndarray` or `wgpu`. Default `flex`.
    pub device: String,
    /// Licence that the bundle carries, which follows that of the scans. Default `CC0-1.0`, for generated scans.
    pub licence: String,
    /// Generated scans.
    pub synth: SynthConfig,
    /// Who is left out.
    pub split: SplitConfig,
    /// Shape, pose and deltas.
    pub fit: FitConfig,
    /// The deltas' subspace.
    pub subspace: SubspaceConfig,
    /// How a motion is described.
    pub descriptor: DescriptorConfig,
    /// Closed-form baselines.
    pub ladder: LadderConfig,
    /// The recurrent regressor.
    pub regressor: RegressorSection,
    /// The loop that drives both trainings.
    pub train: LoopConfig,
    /// What is measured.
    pub eval: EvalConfig,
}

/// The deltas' subspace.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SubspaceConfig {
    /// Latent sizes to train. Default 25, 50, 100.
    pub sizes: Vec<usize>,
    /// Whether mirrored deltas are added. Default true.
    pub mirror: bool,
    /// Principal components.
    pub pca: PcaConfig,
    /// Autoencoders.
    pub training: SubspaceTraining,
}

/// What stands round the recurrent unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ShortcutKind {
    /// A linear layer on the regressor's input, trained along: the published form.
    Linear,
    /// A ridge readout of damped resonators, which stays as it is; the network learns what it leaves.
    Resonators,
}

/// The recurrent regressor.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RegressorSection {
    /// Latent size that is regressed; one of `subspace.sizes`. Default 100.
    pub latents: usize,
    /// `resonators` (default) or `linear`.
    pub shortcut: ShortcutKind,
    /// Folds over motions in which the resonators' predictions on training clips are made by a readout that has not
    /// seen them. Default 4.
    pub cross_fit_folds: usize,
    /// Whether mirrored clips are added. Default true.
    pub mirror: bool,
    /// The network and its training.
    pub training: RegressorTraining,
}

/// What is measured beside the held-out clips.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct EvalConfig {
    /// Length of the rollout that shows whether energy gathers, seconds. Default 600; 0 leaves it out.
    pub bounded_seconds: f32,
    /// Subjects whose hop-then-stand is simulated to measure rest and free decay, heaviest first. Default 2.
    pub decay_subjects: usize,
    /// Clips to play in the report. Default 2.
    pub playback_clips: usize,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            seed: 1,
            device: "flex".into(),
            licence: "CC0-1.0".into(),
            synth: SynthConfig::default(),
            split: SplitConfig::default(),
            fit: FitConfig::default(),
            subspace: SubspaceConfig::default(),
            descriptor: DescriptorConfig::default(),
            ladder: LadderConfig::default(),
            regressor: RegressorSection::default(),
            train: LoopConfig::default(),
            eval: EvalConfig::default(),
        }
    }
}

impl Default for SubspaceConfig {
    fn default() -> Self {
        Self {
            sizes: vec![25, 50, 100],
            mirror: true,
            pca: PcaConfig::default(),
            training: SubspaceTraining::default(),
        }
    }
}

impl Default for RegressorSection {
    fn default() -> Self {
        Self {
            latents: 100,
            shortcut: ShortcutKind::Resonators,
            cross_fit_folds: 4,
            mirror: true,
            training: RegressorTraining::default(),
        }
    }
}

impl Default for EvalConfig {
    fn default() -> Self {
        Self { bounded_seconds: 600.0, decay_subjects: 2, playback_clips: 2 }
    }
}

impl Config {
    /// Refuses settings that cannot work together; the sentence says which and what to do.
    pub fn check(&self) -> Result<(), String> {
        let rates = [
            ("subspace.training.learning_rate", self.subspace.training.learning_rate),
            ("regressor.training.learning_rate", self.regressor.training.learning_rate),
        ];
        for (key, rate) in rates {
            if !(rate.is_finite() && rate > 0.0 && rate <= 1.0) {
                return Err(format!("{key} is {rate}; write a number above 0 and at most 1"));
            }
        }
        if !self.subspace.sizes.contains(&self.regressor.latents) {
            return Err(format!(
                "regressor.latents is {}, which is none of subspace.sizes {:?}; add it there or choose one of them",
                self.regressor.latents, self.subspace.sizes
            ));
        }
        if self.subspace.sizes.iter().any(|s| *s == 0) {
            return Err("subspace.sizes holds 0; a subspace has at least one number".into());
        }
        if self.descriptor.fps != self.synth.fps {
            return Err(format!(
                "descriptor.fps is {} but synth.fps is {}; set both to the rate of the clips",
                self.descriptor.fps, self.synth.fps
            ));
        }
        let eval = &self.eval;
        if !(eval.bounded_seconds.is_finite() && (0.0..=3600.0).contains(&eval.bounded_seconds)) {
            return Err(format!("eval.bounded_seconds is {}; write 0 to 3600", eval.bounded_seconds));
        }
        self.fit.check().map_err(|e| e.to_string())
    }

    /// The name under which the learned method is reported: the published form, or ours.
    pub fn method_name(&self) -> &'static str {
        let published =
            self.descriptor.features == FeatureKind::Pose && self.regressor.shortcut == ShortcutKind::Linear;
        if published { "softsmpl" } else { softtissue_eval::OURS }
    }
}
