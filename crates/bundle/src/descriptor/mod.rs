//! Motion descriptors: what the regressors see of a motion, computed causally frame by frame.
//!
//! Training, evaluation and the player run this same code: [`Descriptor::run`] is a loop over
//! [`Descriptor::step`], so a feature cannot differ between them. A feature at frame `t` uses poses up to `t`
//! only; [`DescriptorConfig::look_ahead`] shifts whole frames and is zero by default.

mod angles;
mod config;
mod disentangled;
mod encoder;
mod filter;
mod forces;
mod pose;
mod root;
mod scaling;
mod steps;

pub use config::{DescriptorConfig, FeatureKind};
pub use encoder::{EncoderScratch, PoseEncoder, pose_numbers};
pub use filter::LowPass;
pub use scaling::{FeatureBlock, FeatureScaling};
pub use steps::{Descriptor, DescriptorError, DescriptorParts, DescriptorState};
