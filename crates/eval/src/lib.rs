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
mod over_time;
mod people;
mod probe;
pub mod protocol;
pub mod report;
mod shapes;
mod subspace;
pub mod surfaces;
mod tally;
mod timing;
pub mod viewer;

pub use error::{EvalError, MethodError};
pub use fit::judge_fit;
pub use gates::{Gate, OURS, acceptance, without_gru};
pub use judge::{Channel, Scene, judge};
pub use method::{BodyAlone, Codec, FrameTime, Method};
pub use metrics::{
    ClipMetrics, ComponentMetrics, DataMetrics, DecayFigures, DecayMetrics, FitMetrics, LeakMetrics, MethodMetrics,
    Metrics, ProbeMetrics, RegionMetrics, SCHEMA, SubspaceMetrics,
};
pub use over_time::{ClipCurves, curves};
pub use people::{PersonFigures, PersonMetrics};
pub use probe::{DecayTrace, LongRollout, StopProbe, judge_bounded, judge_stops, training_peaks};
pub use shapes::{BmiMetrics, judge_bmi, judge_shapes};
pub use subspace::{CodecCurves, CodecPair, SubspaceTable, judge_subspace};
pub use tally::{ClipTally, MOVING, MethodTally, RegionSignal, Tally};
pub use timing::{TimingMetrics, judge_timing};

/// Result of this crate.
pub type Result<T, E = EvalError> = std::result::Result<T, E>;
