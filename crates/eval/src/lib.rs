//! Measures, baselines, protocols and the report: says how good a method is, and shows it.
//!
//! A method is known by the [`Method`] trait alone, so that learned models, closed-form baselines and players of
//! bundles are judged by the same code on the same clips. Truth, where there is any, is opened here and nowhere else.
//! What every figure means is told in `docs/measures.md`.

mod error;
pub mod measures;
mod method;

pub use error::{EvalError, MethodError};
pub use method::{BodyAlone, Codec, Method};

/// Result of this crate.
pub type Result<T, E = EvalError> = std::result::Result<T, E>;
