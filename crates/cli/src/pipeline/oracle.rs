//! The simulator itself as a method: what could be known of a person whose flesh was never seen.

use softtissue_clips::MotionClip;
use softtissue_eval::{Method, MethodError};
use softtissue_geometry::Frames;
use softtissue_synth::dataset::{Bodies, SynthConfig, mean_flesh};

/// Flesh of the mean material on the person's shape, simulated. What a method lacks beside it, it could have learned;
/// what this lacks is hidden in the person.
pub struct Oracle {
    config: SynthConfig,
    bodies: Bodies,
}

/// Its name in tables.
pub const ORACLE: &str = "oracle";

impl Oracle {
    /// Of the scans' own generator.
    pub fn new(config: &SynthConfig) -> softtissue_synth::Result<Self> {
        Ok(Self { config: config.clone(), bodies: Bodies::generate(config)? })
    }
}

impl Method for Oracle {
    fn name(&self) -> &str {
        ORACLE
    }
    fn main_channel_only(&self) -> bool {
        true
    }
    fn rollout(&self, _: &str, beta: &[f32], motion: &MotionClip) -> Result<Frames, MethodError> {
        Ok(mean_flesh(&self.config, &self.bodies, beta, motion)?.deltas)
    }
}
