//! Moving people made from code: motions, physical flesh and a scanner, with known truth.
//!
//! The stream: [`subject`] draws people, [`motion`] makes them move (14 motions of Dyna's protocol),
//! [`flesh`] adds soft tissue by finite elements, [`scanner`] looks at them, and [`dataset`] writes what the
//! scanner saw into one folder and what was true into another.
//!
//! Units: metres, seconds, radians. Right-handed, Y up, facing +Z. This room knows nothing of networks.

mod checks;
pub mod dataset;
mod error;
pub mod flesh;
pub mod motion;
pub mod scanner;
pub mod subject;

pub use error::SynthError;

/// Result of this crate.
pub type Result<T> = std::result::Result<T, SynthError>;
