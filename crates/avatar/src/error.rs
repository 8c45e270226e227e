use softtissue_clips::ClipError;
use softtissue_store::StoreError;
use softtissue_train::TrainError;

/// What can go wrong with an avatar; one sentence each.
#[derive(Debug, thiserror::Error)]
pub enum AvatarError {
    /// From the disk or a file's form.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// From a clip or a raw scan.
    #[error(transparent)]
    Clip(#[from] ClipError),
    /// From the loop, a checkpoint or a state.
    #[error(transparent)]
    Train(#[from] TrainError),
    /// A setting out of range.
    #[error("{0}")]
    Config(String),
    /// The scans or motions do not allow it.
    #[error("{0}")]
    Data(String),
    /// The user asked to stop.
    #[error("stopped before the end")]
    Stopped,
}

impl From<softtissue_implicit::ImplicitError> for AvatarError {
    fn from(error: softtissue_implicit::ImplicitError) -> Self {
        Self::Data(error.to_string())
    }
}
