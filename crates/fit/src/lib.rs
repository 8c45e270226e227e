//! Shape, pose and soft-tissue deltas from registered scans, and the registration of raw ones.
//!
//! - Raw scans, without correspondence, become registered ones by [`register_set`].
//! - Pose: Levenberg-Marquardt on an analytic gradient, in the unposed frame by default (Casas-Otaduy 2018 eq. 4) or
//!   the posed one (SoftSMPL 2020 eq. 4). The Gauss-Newton matrix is summed over bone twists and carried down the
//!   chain once a frame, so its cost does not grow with the skeleton's depth.
//!   Weak priors share out what the surface hardly tells.
//! - A second pass solves all frames of a clip together, with a cost on the squared accelerations of the joints
//!   (`fit.limb_hz`, `fit.trunk_hz`, `fit.root_hz`): what swings fast through joints that the surface hardly sees, the trunk's above
//!   all, is flesh, and stays in the deltas.
//! - Another solver of the poses can stand in for this crate's through [`PoseSolver`], by [`fit_set_with`].
//! - Shape: from the first frames of a subject's training clips, poses free.
//! - Deltas: SoftSMPL eq. 3, with what is static in a subject (AutoAvatar 2022, appendix A) taken out by default.
//! - [`TriangleForm`]: the deltas as deformations of triangles and back, as Dyna (2015) has them; `fit.delta_form =
//!   "triangles"` sends all deltas through it.
//! - Two weights: `fit_weight` is high on rigid parts and steers the pose fit; `rigidity_weight` (Casas-Otaduy eq. 7)
//!   is high on flesh in spite of its name and weighs losses later.
//!
//! Nothing of a left-out clip reaches a clip of a subject that trains; a subject without training clips is known from
//! the starts of its own.

mod accumulate;
mod accuracy;
mod banded;
mod cholesky;
mod config;
mod cross;
mod error;
mod motion;
mod normal;
mod objective;
mod packed;
mod pose_state;
mod registration;
mod set;
mod shape;
mod smooth;
mod solve;
mod solver;
mod sparse;
mod start;
mod subject;
mod taken;
mod template;
mod triangles;
mod weights;

pub use accuracy::{AccuracySum, ClipComparison, FitAccuracy};
pub use config::{AdamFitConfig, DeltaForm, FitConfig, ObjectiveKind, Solver};
pub use error::FitError;
pub use motion::{FittedMotion, fit_motion};
pub use objective::{Objective, WeightedBody};
pub use packed::PackedBody;
pub use registration::{ClipRegistration, RegistrationConfig, register_set};
pub use set::{ClipQuality, FittedPeople, fit_set, fit_set_with};
pub use solver::{LevenbergMarquardt, PoseProblem, PoseSolver, StartPoses};
pub use triangles::{TriangleDeltas, TriangleForm};
pub use weights::region_weights;

/// Result of this crate.
pub type Result<T> = std::result::Result<T, FitError>;

#[cfg(test)]
mod checks;
#[cfg(test)]
#[path = "../tests/fit/figure.rs"]
#[allow(dead_code, reason = "shared with the integration tests, which use all of it")]
mod figure;
#[cfg(test)]
mod smooth_checks;
