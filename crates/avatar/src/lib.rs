//! AutoAvatar (Bai et al. 2022): an autoregressive neural field of a person's surface, learned from raw scans and poses
//! without registration.
//!
//! The stream: signed heights over the vertices of the posed body are the state; heights and poses of a few frames
//! become feature maps in the texture atlas, a UNet makes dynamic features of them, and a decoder gives the signed
//! distance of any point from the features of its nearest vertices. The next heights are read off that field.
//!
//! Units: metres, radians. Right-handed, Y up. This room never sees truth, nor the command line.

mod avatar;
#[cfg(test)]
mod backends;
#[cfg(test)]
mod checks;
mod clip;
mod config;
mod decoder;
mod error;
mod features;
mod layer;
mod loss;
mod model;
mod network;
mod predictor;
mod queries;
mod rows;
mod trainee;
mod unet;

pub use avatar::{AvatarBody, AvatarField, Playback};
pub use clip::{AvatarClip, ClipRequest};
pub use config::{
    AvatarConfig, Conditioning, LossWeights, NetworkConfig, PoseSource, RolloutConfig, StageConfig, TeacherConfig,
};
pub use error::AvatarError;
pub use features::PoseTrack;
pub use model::{AvatarInfo, AvatarModel, LearnedNetwork};
pub use network::AvatarNetwork;
pub use predictor::{AvatarPredictor, Candidate, REACH};
pub use trainee::AvatarTrainee;

/// Result of this crate.
pub type Result<T> = std::result::Result<T, AvatarError>;
