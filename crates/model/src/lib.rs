//! Subspace, descriptor and regressor as trainable modules that turn themselves into a bundle.

mod autoencoder;
mod error;
mod feedback;
mod gru;
mod layer;
pub mod linear;
mod pca;
mod pose_autoencoder;
mod pose_set;
mod predictor;
mod regressor;
mod standardisation;
mod training_clip;
mod transfer;
mod tuning;

use softtissue_bundle as plain;

pub use autoencoder::{Autoencoder, AutoencoderConfig, Decoder, Dropout, Encoder, ResidualUnit, power_of_two};
pub use error::ModelError;
pub use feedback::{DeltaAutoencoder, FeedbackRegressor, PrincipalStart, ThreeLayers};
pub use gru::{Gru, GruFrame, GruRollout};
pub use layer::host;
pub use pca::{FrameSource, Pca, PcaConfig, coefficients_of, deltas_of, truncated};
pub use pose_autoencoder::{Perceptron, PoseAutoencoder, PoseAutoencoderConfig};
pub use pose_set::{PoseFrames, PoseSet, PoseSetConfig};
pub use predictor::Predictor;
pub use regressor::{Regressor, RegressorConfig, ShortcutStart};
pub use standardisation::Standardisation;
pub use training_clip::TrainingClip;
pub use transfer::{SubjectRegressor, transferred};
pub use tuning::{RegionTuning, Tuning, TuningConfig, tune_flesh};
