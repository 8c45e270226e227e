use softtissue_body::BodyError;
use softtissue_clips::ClipError;
use softtissue_store::StoreError;
use std::path::PathBuf;

/// What can go wrong in training; one sentence each.
#[derive(Debug, thiserror::Error)]
pub enum TrainError {
    /// From the disk or a file's form.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// From a clip or a split.
    #[error(transparent)]
    Clip(#[from] ClipError),
    /// From the body.
    #[error(transparent)]
    Body(#[from] BodyError),
    /// The loss left the finite numbers.
    #[error(
        "{stage} diverged at step {step} (loss {loss}): the state of step {rolled_back_to} is saved; lower {stage}'s learning rate and resume"
    )]
    Diverged {
        /// Which stage.
        stage: String,
        /// At which step.
        step: u64,
        /// The loss.
        loss: f64,
        /// The last good step.
        rolled_back_to: u64,
    },
    /// The user stopped the work; it is saved.
    #[error("stopped in {stage} after {step} steps; `--resume` goes on from there")]
    Stopped {
        /// Which stage.
        stage: String,
        /// Steps done.
        step: u64,
    },
    /// A checkpoint that is broken or of another run.
    #[error("the checkpoint {path} does not fit: {reason}")]
    Checkpoint {
        /// Which checkpoint.
        path: PathBuf,
        /// Why, and what to do.
        reason: String,
    },
    /// Settings that cannot work.
    #[error("{0}")]
    Config(String),
    /// The numerics refused (too few frames, singular system, device without a feature, ...).
    #[error("{0}")]
    Numeric(String),
}
