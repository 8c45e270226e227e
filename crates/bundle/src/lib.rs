//! The shipped model format and the player that runs it without a machine-learning framework.
//!
//! What a model computes is defined by the plain arrays here: the [`descriptor`] (poses to features) and a [`Model`]
//! (features to deltas, frame by frame). This room may use geometry and body only; it must never know the framework,
//! training or the body's generator.

mod acquaintance;
mod advance;
mod ahead;
mod answer;
mod arrays;
mod autoregressive;
mod batch;
mod blocks;
mod bundle;
mod controls;
mod correctives;
pub mod descriptor;
mod detail;
mod error;
mod fade;
mod feedback;
mod file;
mod half;
mod held_pose;
mod limits;
mod looping;
mod manifest;
mod mass;
mod matrix;
mod model;
mod network;
mod player;
mod posing;
mod precision;
mod regressor;
mod report;
mod resonators;
mod retarget;
mod rollout;
mod subspace;
mod times;
mod trust;

pub use acquaintance::Acquaintance;
pub use autoregressive::{Ar2, AutoregressiveModel, AutoregressiveState, PersonDynamics};
pub use batch::Batch;
pub use bundle::{Bundle, BundleInfo, SelfCheck};
pub use controls::{Control, Controls};
pub use detail::Detail;
pub use error::BundleError;
pub use fade::Fade;
pub use feedback::{FeedbackModel, FeedbackPerson, FeedbackState};
pub use file::{BundleFiles, MANIFEST_FILE};
pub use limits::Limits;
pub use looping::{LOOP_MISMATCH_M, LoopReport};
pub use manifest::FORMAT_VERSION;
pub use mass::MassLaw;
pub use matrix::Matrix;
pub use model::{Model, ModelState, RecurrentModel, RecurrentState};
pub use network::{Gru, Linear, ResidualUnit, ThreeLayers};
pub use player::Player;
pub use precision::{Precision, PrecisionLoss, REFINED};
pub use regressor::{BodyRegressor, Recurrent, Regressor, RegressorState};
pub use report::{RolloutReport, StepReport};
pub use resonators::{Hardening, Resonator, ResonatorBank};
pub use subspace::{Decoder, DeltaBasis, Encoder, Subspace, SubspaceScratch};
pub use times::{StepPart, StepTimes};
pub use trust::{LEAST_SHAPE_REACH, SeenClip, Trust};

/// Result of this crate.
pub type Result<T> = std::result::Result<T, BundleError>;
