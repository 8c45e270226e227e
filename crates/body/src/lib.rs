//! The parametric body (SMPL conventions): `M(beta, theta) = W(T + Bs(beta) + Bp(theta) + D, J(beta), theta)`
//! (Loper et al. 2015; SoftSMPL eqs. 1-2), the inverse of its skinning, and analytic derivatives.
//!
//! Units: metres, radians. Right-handed, Y up, facing +Z. This room knows nothing of training or foreign files.

mod build;
mod correctives;
mod derivative;
mod error;
mod file;
mod mirror;
mod model;
mod regions;
mod skinning;

#[cfg(feature = "procedural")]
pub mod procedural;

pub use build::{BODY_DENSITY, BodyBuild};
pub use derivative::Jacobian;
pub use error::BodyError;
pub use model::{BodyModel, JointRegressor, Mirror, Skeleton, SkinWeights, UvAtlas};
pub use regions::{Region, RegionMap};
pub use skinning::{Pose, SMALLEST_DETERMINANT, ShapedBody};

/// Result of this crate.
pub type Result<T> = std::result::Result<T, BodyError>;
