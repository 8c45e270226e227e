//! Subspace, descriptor and regressor as trainable modules that turn themselves into a bundle.

mod autoencoder;
mod gru;
mod layer;
mod regressor;

use softtissue_bundle as plain;

pub use autoencoder::{Autoencoder, AutoencoderConfig, Decoder, Dropout, Encoder, ResidualUnit, power_of_two};
pub use gru::{Gru, GruFrame, GruRollout};
pub use layer::host;
pub use regressor::{Regressor, RegressorConfig, ShortcutStart};
