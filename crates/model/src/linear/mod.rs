//! The closed-form ladder that a network has to beat: body alone, mean, ridge, autoregressions (Dyna eq. 20) and a
//! linear readout of damped resonators. All predict coefficients of the deltas in one orthonormal basis, so that squared
//! errors are those of vertices. Ridge strengths are chosen on validation clips by free rollout.

mod ar2;
mod dyna;
#[cfg(test)]
mod dyna_tests;
mod file;
mod ladder;
mod own;
mod readout;
mod score;
mod solve;
#[cfg(test)]
mod tests;

pub use ar2::{Ar2Config, fit_ar2};
pub use dyna::{DynaConfig, fit_dyna};
pub use ladder::{FeatureSet, Ladder, LadderConfig, LadderModel, LadderPredictor, LadderScore, Rule, dyna_descriptor};
pub use readout::{ReadoutConfig, Selected, fit_readout};
pub use score::{Score, SoftScore};
