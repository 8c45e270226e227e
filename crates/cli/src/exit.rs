//! Which exit code an error ends with.

use softtissue_body::BodyError;
use softtissue_clips::ClipError;
use softtissue_store::StoreError;
use softtissue_train::TrainError;
use std::process::ExitCode;

/// Ways to end, as the manual lists them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exit {
    /// Our fault.
    Internal = 1,
    /// The command line or the settings are wrong.
    Usage = 2,
    /// A file or folder that was given is not usable.
    BadInput = 3,
    /// Training left the finite numbers.
    Diverged = 4,
    /// The disk refused.
    Disk = 5,
    /// A checkpoint is damaged or of another run.
    Checkpoint = 6,
    /// Stopped by Ctrl-C with a checkpoint saved.
    Interrupted = 130,
    /// Stopped by SIGTERM with a checkpoint saved.
    Terminated = 143,
}

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> Self {
        Self::from(exit as u8)
    }
}

/// A mistake in the command line or the settings.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct UsageError(pub String);

/// Input that is refused by a verb itself.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct InputError(pub String);

/// The exit code of an error, by the first cause that tells.
pub fn exit_of(error: &anyhow::Error) -> Exit {
    for cause in error.chain() {
        if cause.is::<UsageError>() {
            return Exit::Usage;
        }
        if cause.is::<InputError>() {
            return Exit::BadInput;
        }
        if let Some(e) = cause.downcast_ref::<TrainError>() {
            return of_train(e);
        }
        if let Some(e) = cause.downcast_ref::<ClipError>() {
            return of_clip(e);
        }
        if let Some(e) = cause.downcast_ref::<BodyError>() {
            return of_body(e);
        }
        if let Some(e) = cause.downcast_ref::<StoreError>() {
            return of_store(e);
        }
    }
    Exit::Internal
}

fn of_store(error: &StoreError) -> Exit {
    if error.is_disk() { Exit::Disk } else { Exit::BadInput }
}

fn of_clip(error: &ClipError) -> Exit {
    match error {
        ClipError::Store(e) => of_store(e),
        ClipError::Split { .. } | ClipError::Id { .. } => Exit::Usage,
        ClipError::Bad { .. } | ClipError::NoClip { .. } => Exit::BadInput,
    }
}

fn of_body(error: &BodyError) -> Exit {
    match error {
        BodyError::Store(e) => of_store(e),
        BodyError::Generator(_) => Exit::Internal,
        _ => Exit::BadInput,
    }
}

fn of_train(error: &TrainError) -> Exit {
    match error {
        TrainError::Store(e) => of_store(e),
        TrainError::Clip(e) => of_clip(e),
        TrainError::Body(e) => of_body(e),
        TrainError::Diverged { .. } => Exit::Diverged,
        TrainError::Stopped { .. } => Exit::Interrupted,
        TrainError::Checkpoint { .. } => Exit::Checkpoint,
        TrainError::Config(_) => Exit::Usage,
        TrainError::Numeric(_) => Exit::BadInput,
    }
}
