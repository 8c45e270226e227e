//! Measures, baselines, protocols and the report: says how good a method is, and shows it.
//!
//! A method is known by the [`Method`] trait alone, so that learned models, closed-form baselines and players of
//! bundles are judged by the same code on the same clips. Truth, where there is any, is opened here and nowhere else.
//! What every figure means is told in `docs/measures.md`.

mod error;
mod fit;
mod gates;
mod judge;
pub mod measures;
mod method;
mod metrics;
mod probe;
pub mod protocol;
pub mod report;
mod subspace;
mod tally;

pub use error::{EvalError, MethodError};
pub use fit::judge_fit;
pub use gates::{Gate, OURS, acceptance, without_gru};
pub use judge::{Channel, Scene, judge};
pub use method::{BodyAlone, Codec, Method};
pub use metrics::{
    ClipMetrics, ComponentMetrics, DataMetrics, DecayFigures, DecayMetrics, FitMetrics, LeakMetrics, MethodMetrics,
    Metrics, ProbeMetrics, RegionMetrics, SCHEMA, SubspaceMetrics,
};
pub use probe::{DecayTrace, LongRollout, StopProbe, judge_bounded, judge_shapes, judge_stops, training_peaks};
pub use subspace::{CodecPair, judge_subspace};
pub use tally::{ClipTally, MOVING, MethodTally, RegionSignal, Tally};

/// Result of this crate.
pub type Result<T, E = EvalError> = std::result::Result<T, E>;
