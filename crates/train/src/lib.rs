//! Losses, step, loop, checkpoint and resume. Knows nothing of the command line.
//!
//! A [`Trainee`] computes steps; [`train_to_end`] drives one: it logs, validates, saves, rolls back, stops.
//! Every random draw comes from a counter, so a stopped and resumed run gives the bytes of an unbroken one.

mod checkpoint;
mod error;
mod log;
mod tensorboard;
mod train_loop;
mod trainee;

pub use checkpoint::{Checkpoint, CheckpointFolder};
pub use error::TrainError;
pub use log::RunLog;
pub use tensorboard::EventWriter;
pub use train_loop::{Finished, LoopConfig, train_to_end};
pub use trainee::{NamedArray, State, StepStats, Trainee};

/// Result of this crate.
pub type Result<T> = std::result::Result<T, TrainError>;
