use crate::{AvatarError, Result};
use serde::{Deserialize, Serialize};
use softtissue_implicit::SampleConfig;

/// What the next surface is predicted from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Conditioning {
    /// The method: heights, their differences, the next pose and the pose differences.
    #[default]
    Autoregressive,
    /// The next pose alone (the paper's Pose).
    Pose,
    /// Sixteen poses through a temporal convolutional network (PoseTCN).
    PoseTcn,
    /// The method without heights (Pose + dPose).
    PoseDifferences,
}

impl Conditioning {
    /// Name in settings, files and tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Autoregressive => "autoregressive",
            Self::Pose => "pose",
            Self::PoseTcn => "pose-tcn",
            Self::PoseDifferences => "pose-differences",
        }
    }

    /// Whether differences of poses are seen.
    pub fn sees_differences(self) -> bool {
        matches!(self, Self::Autoregressive | Self::PoseDifferences)
    }

    /// Whether heights are fed back.
    pub fn sees_heights(self) -> bool {
        self == Self::Autoregressive
    }
}

/// The network's size.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct NetworkConfig {
    /// Observer points, spread evenly over the body's vertices: they hold the heights, and the decoder stands on them.
    /// Default 1000; the paper's 3928 for the decoder, and heights at all 6890.
    pub observers: usize,
    /// Frames of heights `T` that a prediction sees. Default 3, as published.
    pub history: usize,
    /// Poses that `pose-tcn` sees, a power of two. Default 16, as published.
    pub tcn_frames: usize,
    /// Channels that the poses, and apart from them their differences, are compressed to. Default 8; the paper's 32.
    pub compressed: usize,
    /// Texels along a side of the atlas; a power of two of at least `2^(levels - 1)`. Default 32; the paper's 256.
    pub atlas: usize,
    /// Channels of the UNet's levels, each of half the side of the one before. Default 16, 24, 32; the authors' code has
    /// 64, 128, 256, 256, 256.
    pub channels: Vec<usize>,
    /// Numbers of an observer's dynamic feature. Default 16; the paper's 64.
    pub latents: usize,
    /// Width of the decoder. Default 32; the paper's 128.
    pub decoder: usize,
    /// Width of the layer that moves each observer's plane along its normal, by its dynamic features and its own heights,
    /// before the decoder bends the surface; 0 leaves it out. Default 32; the paper has none.
    pub offsets: usize,
    /// Part of the newest heights that the next surface starts from where heights are seen, 0 to 1. Default 1; the paper's
    /// 0, from which a network has to learn first that a surface stays where it is.
    pub carried: f32,
    /// Nearest observers of a query point. Default 6; the paper's 20; 1 is the closest-point decoder that it argues
    /// against.
    pub neighbours: usize,
    /// Frequencies of the Fourier features of distance and cosine. Default 4, as published.
    pub frequencies: usize,
    /// Distances below this are rounded off, metres: at a vertex the cosine has no derivative. Default 0.005; the paper
    /// does not say.
    pub softening: f32,
    /// Dynamic features of face, hands and feet are held at the first frame's of a rollout, when
    /// learning and when playing. Default true, as published.
    pub frozen: bool,
}

/// Factors of the loss (eq. 3).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LossWeights {
    /// Of the distance at scan points, 1/m. Default 100, which makes it centimetres; the paper's 1 is without a unit. At 1 in
    /// metres a few thousand steps learn normals and no heights.
    pub surface: f64,
    /// Of the difference of the gradient and the scan's normal. Default 1, as published.
    pub normal: f64,
    /// Of the eikonal term. Default 1, as published.
    pub eikonal: f64,
    /// Of the off-surface term. Default 0.1, as published.
    pub off_surface: f64,
    /// Decay of the off-surface term, 1/m. Default 50, as published.
    pub decay: f64,
}

/// The first stage: single frames, seen with the true heights of those before.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TeacherConfig {
    /// Steps of a whole training. Default 4000; the paper's 90000.
    pub steps: u64,
    /// Learning rate at the start; falls to zero by a cosine. Default 3e-3; the paper's 1e-4.
    pub learning_rate: f64,
    /// Points on the scan, for the surface and the normal term. Default 500; the paper's 10000.
    pub surface: usize,
    /// Points near the scan, for the eikonal term. Default 200; the paper's 10000.
    pub near: usize,
    /// Points in the box round the scan, for the eikonal and the off-surface term. Default 100; the paper's 2000.
    pub within: usize,
}

/// The second stage: short rollouts on the network's own heights; no gradient passes from frame to frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RolloutConfig {
    /// Steps of a whole training. Default 500; the paper's 7500.
    pub steps: u64,
    /// Frames of a rollout, 1 to 8. Default 4, which holds drift back within a few hundred steps; the paper's 2.
    pub frames: usize,
    /// Learning rate at the start; falls to zero by a cosine. Default 5e-4; the paper's 1e-5.
    pub learning_rate: f64,
    /// Points on the scan. Default 300; the paper's 1000.
    pub surface: usize,
    /// Points near the scan. Default 250; the paper's 1000.
    pub near: usize,
    /// Points in the box round the scan. Default 150; the paper's 500.
    pub within: usize,
}

/// A stage of training.
#[derive(Clone, Debug, PartialEq)]
pub struct StageConfig {
    /// Name in settings and files.
    pub name: &'static str,
    /// Steps.
    pub steps: u64,
    /// Frames that a step rolls out; 1 is teacher forcing.
    pub frames: usize,
    /// Learning rate at the start.
    pub learning_rate: f64,
    /// Points of a frame.
    pub sampling: SampleConfig,
}

/// Which poses drive body, training and evaluation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PoseSource {
    /// Those that the fit found: the paper's "refined poses".
    #[default]
    Fitted,
    /// The rough channel of the scans: a degree or two off, as the poses of a marker system are.
    Rough,
}

/// AutoAvatar (Bai et al. 2022): one person's network.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct AvatarConfig {
    /// Whom to learn. Default empty: the heaviest person who trains.
    pub subject: String,
    /// `fitted` (default) or `rough`.
    pub poses: PoseSource,
    /// Motions whose second half is left out to judge by: the interpolation set. Default none.
    pub interpolation: Vec<String>,
    /// What is learned, in turn: `autoregressive`, and the baselines `pose`, `pose-tcn`, `pose-differences`. Default
    /// autoregressive, pose; the latter makes the first frames where a motion is all there is.
    pub networks: Vec<Conditioning>,
    /// Points of a raw scan that is made, before holes; of generated scans only. Default 10000.
    pub raw_points: usize,
    /// Points kept of each scan for training, drawn once. Default 3000.
    pub kept_points: usize,
    /// Points of a scan further than this from every observer are left out, metres. Default 0.1, as published
    /// for the evaluation.
    pub outlier: f32,
    /// The network.
    pub network: NetworkConfig,
    /// Factors of the loss.
    pub loss: LossWeights,
    /// Standard deviation of the points near the scan from it along each axis, metres. Default 0.1, as published.
    pub deviation: f32,
    /// How far the box of points stands off the scan, metres. Default 0.1: as far as a surface is sought. The paper does
    /// not pad.
    pub padding: f32,
    /// The first stage.
    pub teacher: TeacherConfig,
    /// The second stage.
    pub rollout: RolloutConfig,
    /// Cells along the longest side of the grid that surfaces are drawn from. Default 64; the paper's 256.
    pub grid: usize,
}

impl Default for NetworkConfig {
    fn default() -> Self {
        Self {
            observers: 1000,
            history: 3,
            tcn_frames: 16,
            compressed: 8,
            atlas: 32,
            channels: vec![16, 24, 32],
            latents: 16,
            decoder: 32,
            offsets: 32,
            carried: 1.0,
            neighbours: 6,
            frequencies: 4,
            softening: 0.005,
            frozen: true,
        }
    }
}

impl Default for LossWeights {
    fn default() -> Self {
        Self { surface: 100.0, normal: 1.0, eikonal: 1.0, off_surface: 0.1, decay: 50.0 }
    }
}

impl Default for TeacherConfig {
    fn default() -> Self {
        Self { steps: 4000, learning_rate: 3e-3, surface: 500, near: 200, within: 100 }
    }
}

impl Default for RolloutConfig {
    fn default() -> Self {
        Self { steps: 500, frames: 4, learning_rate: 5e-4, surface: 300, near: 250, within: 150 }
    }
}

impl Default for AvatarConfig {
    fn default() -> Self {
        Self {
            subject: String::new(),
            poses: PoseSource::default(),
            interpolation: Vec::new(),
            networks: vec![Conditioning::Autoregressive, Conditioning::Pose],
            raw_points: 10_000,
            kept_points: 3000,
            outlier: 0.1,
            network: NetworkConfig::default(),
            loss: LossWeights::default(),
            deviation: 0.1,
            padding: 0.1,
            teacher: TeacherConfig::default(),
            rollout: RolloutConfig::default(),
            grid: 64,
        }
    }
}

impl NetworkConfig {
    pub(crate) fn check(&self) -> Result<()> {
        for (key, count, range) in [
            // Where one is not seen the others stand in for it.
            ("observers", self.observers, 2..=1_000_000),
            ("history", self.history, 1..=16),
            ("compressed", self.compressed, 1..=1024),
            ("latents", self.latents, 1..=1024),
            ("decoder", self.decoder, 1..=4096),
            ("neighbours", self.neighbours, 1..=256),
            ("frequencies", self.frequencies, 1..=16),
            ("channels", self.channels.len(), 1..=10),
        ] {
            within(&format!("network.{key}"), count, range)?;
        }
        for &channels in &self.channels {
            within("network.channels", channels, 1..=4096)?;
        }
        // An atlas has four texels along a side, and the last level one.
        let finest = (1 << (self.channels.len() - 1)).max(4);
        if !self.atlas.is_power_of_two() || self.atlas > 1024 || self.atlas < finest {
            return Err(AvatarError::Config(format!(
                "autoavatar.network.atlas is {}; with {} levels it must be a power of two from {finest} to 1024",
                self.atlas,
                self.channels.len()
            )));
        }
        if !(2..=256).contains(&self.tcn_frames) || !self.tcn_frames.is_power_of_two() {
            return Err(AvatarError::Config(format!(
                "autoavatar.network.tcn_frames is {}; write a power of two from 2 to 256",
                self.tcn_frames
            )));
        }
        if self.offsets > 4096 || !(0.0..=1.0).contains(&self.carried) {
            return Err(AvatarError::Config(format!(
                "autoavatar.network.offsets is {} and carried {}; write a number up to 4096 and one from 0 to 1",
                self.offsets, self.carried
            )));
        }
        if !(self.softening > 0.0 && self.softening <= 0.1) {
            return Err(AvatarError::Config(format!(
                "autoavatar.network.softening is {}; write a number above 0 and at most 0.1",
                self.softening
            )));
        }
        Ok(())
    }
}

impl StageConfig {
    fn check(&self) -> Result<()> {
        let (name, sampling) = (self.name, &self.sampling);
        within(&format!("{name}.frames"), self.frames, 1..=8)?;
        for (key, count) in [("surface", sampling.surface), ("near", sampling.near), ("within", sampling.within)] {
            within(&format!("{name}.{key}"), count, 1..=100_000)?;
        }
        if !(self.learning_rate > 0.0 && self.learning_rate <= 1.0) {
            return Err(AvatarError::Config(format!(
                "autoavatar.{name}.learning_rate is {}; write a number above 0 and at most 1",
                self.learning_rate
            )));
        }
        Ok(())
    }
}

impl AvatarConfig {
    /// Both stages, in order.
    pub fn stages(&self) -> [StageConfig; 2] {
        let (teacher, rollout) = (&self.teacher, &self.rollout);
        let sampling = |surface, near, within| SampleConfig {
            surface,
            near,
            within,
            deviation: self.deviation,
            padding: self.padding,
        };
        [
            StageConfig {
                name: "teacher",
                steps: teacher.steps,
                frames: 1,
                learning_rate: teacher.learning_rate,
                sampling: sampling(teacher.surface, teacher.near, teacher.within),
            },
            StageConfig {
                name: "rollout",
                steps: rollout.steps,
                frames: rollout.frames,
                learning_rate: rollout.learning_rate,
                sampling: sampling(rollout.surface, rollout.near, rollout.within),
            },
        ]
    }

    /// Refuses settings that cannot work; the sentence names the setting.
    ///
    /// # Errors
    /// A number out of its range.
    pub fn check(&self) -> Result<()> {
        self.network.check()?;
        self.stages().iter().try_for_each(StageConfig::check)?;
        within("raw_points", self.raw_points, 100..=1_000_000)?;
        within("kept_points", self.kept_points, 100..=1_000_000)?;
        within("grid", self.grid, 8..=1024)?;
        within("networks", self.networks.len(), 1..=4)?;
        if let Some(twice) = (1..self.networks.len()).find(|i| self.networks[..*i].contains(&self.networks[*i])) {
            let name = self.networks[twice].name();
            return Err(AvatarError::Config(format!("autoavatar.networks names {name} twice; name it once")));
        }
        for (key, metres) in [("outlier", self.outlier), ("deviation", self.deviation), ("padding", self.padding)] {
            if !(metres > 0.0 && metres <= 1.0) {
                return Err(AvatarError::Config(format!(
                    "autoavatar.{key} is {metres}; write a number above 0 and at most 1"
                )));
            }
        }
        let weights = &self.loss;
        for (key, x) in [
            ("surface", weights.surface),
            ("normal", weights.normal),
            ("eikonal", weights.eikonal),
            ("off_surface", weights.off_surface),
            ("decay", weights.decay),
        ] {
            if !(0.0..=1e6).contains(&x) {
                return Err(AvatarError::Config(format!(
                    "autoavatar.loss.{key} is {x}; write a number from 0 to 1000000"
                )));
            }
        }
        Ok(())
    }
}

fn within(key: &str, count: usize, range: std::ops::RangeInclusive<usize>) -> Result<()> {
    if range.contains(&count) {
        return Ok(());
    }
    let (low, high) = (range.start(), range.end());
    Err(AvatarError::Config(format!("autoavatar.{key} is {count}; write a number from {low} to {high}")))
}
