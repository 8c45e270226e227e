//! Which exit code an error ends with.

use softtissue_avatar::AvatarError;
use softtissue_body::BodyError;
use softtissue_bundle::BundleError;
use softtissue_clips::ClipError;
use softtissue_eval::EvalError;
use softtissue_export::ExportError;
use softtissue_fit::FitError;
use softtissue_import::ImportError;
use softtissue_model::ModelError;
use softtissue_page::PageError;
use softtissue_store::StoreError;
use softtissue_synth::SynthError;
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
    error.chain().find_map(of_cause).unwrap_or(Exit::Internal)
}

/// The code of one cause. Errors that only carry another are passed over: their source comes next in the chain.
fn of_cause(cause: &(dyn std::error::Error + 'static)) -> Option<Exit> {
    if cause.is::<UsageError>() {
        return Some(Exit::Usage);
    }
    if cause.is::<InputError>() {
        return Some(Exit::BadInput);
    }
    let train = cause.downcast_ref().map(of_train);
    train
        .or_else(|| cause.downcast_ref().map(of_clip))
        .or_else(|| cause.downcast_ref().map(of_body))
        .or_else(|| cause.downcast_ref().map(of_store))
        .or_else(|| cause.downcast_ref().map(of_synth))
        .or_else(|| cause.downcast_ref().map(of_fit))
        .or_else(|| cause.downcast_ref().map(of_import))
        .or_else(|| cause.downcast_ref().map(of_bundle))
        .or_else(|| cause.downcast_ref().map(of_model))
        .or_else(|| cause.downcast_ref().map(of_eval))
        .or_else(|| cause.downcast_ref().map(of_export))
        .or_else(|| cause.downcast_ref().map(of_page))
        .or_else(|| cause.downcast_ref().map(of_avatar))
}

fn of_synth(error: &SynthError) -> Exit {
    match error {
        SynthError::Body(e) => of_body(e),
        SynthError::Clip(e) => of_clip(e),
        SynthError::Store(e) => of_store(e),
        SynthError::UnknownMotion { .. } | SynthError::Config { .. } => Exit::Usage,
        SynthError::Skeleton { .. } | SynthError::Foreign { .. } => Exit::BadInput,
        SynthError::Flesh { .. } => Exit::Internal,
        SynthError::Stopped => Exit::Interrupted,
    }
}

fn of_fit(error: &FitError) -> Exit {
    match error {
        FitError::Clip(e) => of_clip(e),
        FitError::Body(e) => of_body(e),
        FitError::Store(e) => of_store(e),
        FitError::Config { .. } | FitError::Registration { .. } => Exit::Usage,
        FitError::Solver { .. } => Exit::Diverged,
        FitError::Stopped => Exit::Interrupted,
        _ => Exit::BadInput,
    }
}

fn of_import(error: &ImportError) -> Exit {
    match error {
        ImportError::Store(e) => of_store(e),
        ImportError::Clip(e) => of_clip(e),
        ImportError::Line { .. } | ImportError::Part { .. } | ImportError::File { .. } => Exit::BadInput,
        ImportError::Stopped => Exit::Interrupted,
    }
}

fn of_bundle(error: &BundleError) -> Exit {
    match error {
        BundleError::Store(e) => of_store(e),
        BundleError::Body(e) => of_body(e),
        BundleError::Stopped => Exit::Interrupted,
        _ => Exit::BadInput,
    }
}

fn of_model(error: &ModelError) -> Exit {
    match error {
        ModelError::Store(e) => of_store(e),
        ModelError::Clip(e) => of_clip(e),
        ModelError::Config(_) | ModelError::Descriptor(_) => Exit::Usage,
        ModelError::Data(_) => Exit::BadInput,
        ModelError::Stopped => Exit::Interrupted,
    }
}

fn of_eval(error: &EvalError) -> Exit {
    match error {
        EvalError::Store(e) => of_store(e),
        EvalError::Clip(e) => of_clip(e),
        EvalError::Body(e) => of_body(e),
        EvalError::Method { .. } => Exit::Internal,
        EvalError::Size { .. } | EvalError::Refused(_) => Exit::BadInput,
        EvalError::Stopped => Exit::Interrupted,
    }
}

fn of_export(error: &ExportError) -> Exit {
    match error {
        ExportError::Store(e) => of_store(e),
        ExportError::Target { .. } => Exit::Usage,
        ExportError::Animation { .. } | ExportError::Model { .. } => Exit::BadInput,
        ExportError::Stopped => Exit::Interrupted,
    }
}

fn of_page(error: &PageError) -> Exit {
    match error {
        PageError::Store(e) => of_store(e),
        PageError::Bundle(e) => of_bundle(e),
        PageError::NoPlayer | PageError::Port { .. } => Exit::Usage,
        PageError::Serving { .. } => Exit::Internal,
    }
}

fn of_avatar(error: &AvatarError) -> Exit {
    match error {
        AvatarError::Store(e) => of_store(e),
        AvatarError::Clip(e) => of_clip(e),
        AvatarError::Train(e) => of_train(e),
        AvatarError::Config(_) => Exit::Usage,
        AvatarError::Data(_) => Exit::BadInput,
        AvatarError::Stopped => Exit::Interrupted,
    }
}

fn of_store(error: &StoreError) -> Exit {
    if error.is_disk() { Exit::Disk } else { Exit::BadInput }
}

fn of_clip(error: &ClipError) -> Exit {
    match error {
        ClipError::Store(e) => of_store(e),
        ClipError::Split { .. } | ClipError::Id { .. } => Exit::Usage,
        ClipError::Raw(e) => e.downcast_ref().map_or(Exit::BadInput, of_import),
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
