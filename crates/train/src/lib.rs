//! Losses, step, loop, checkpoint and resume. Knows nothing of the command line.
//!
//! A [`Trainee`] computes steps; [`train_to_end`] drives one: it logs, validates, saves, rolls back, stops.
//! Every random draw comes from a counter, so a stopped and resumed run gives the bytes of an unbroken one.

mod adam;
mod adam_solver;
mod bptt;
mod checkpoint;
mod delta_autoencoder_step;
pub mod device;
mod error;
mod feedback_step;
mod fit_adam;
mod log;
pub mod losses;
pub mod parity;
mod pose_step;
mod regressor_step;
mod schedule;
mod stage;
mod subspace_step;
mod tensorboard;
mod train_loop;
mod trainee;
mod vertex_error;

pub use adam::{Adam, AdamConfig, GradientMap, load_module, module_gradients, module_state};
pub use adam_solver::AdamSolver;
pub use bptt::GruTrace;
pub use checkpoint::{Checkpoint, CheckpointFolder, read_state, write_state};
pub use delta_autoencoder_step::{AutoencoderStart, DeltaAutoencoderTrainee, DeltaAutoencoderTraining, DeltaMetric};
pub use error::TrainError;
pub use feedback_step::{FeedbackClip, FeedbackGround, FeedbackTrainee, FeedbackTraining};
pub use fit_adam::{AdamFit, AdamPoseFit};
pub use log::RunLog;
pub use pose_step::{PoseTrainee, PoseTraining};
pub use regressor_step::{LossSpace, MotionSequence, RegressorTrainee, RegressorTraining};
pub use schedule::cosine;
pub use stage::{Clips, Stage};
pub use subspace_step::{DeltaFrames, DeltaSurface, SubspaceTrainee, SubspaceTraining};
pub use tensorboard::EventWriter;
pub use train_loop::{Finished, LoopConfig, train_to_end};
pub use trainee::{NamedArray, State, StepStats, Trainee};

/// Result of this crate.
pub type Result<T> = std::result::Result<T, TrainError>;
