use softtissue_bundle::descriptor::DescriptorError;
use softtissue_clips::ClipError;
use softtissue_store::StoreError;

/// What can go wrong when a model is fitted, saved or run; one sentence each.
#[derive(Debug, thiserror::Error)]
pub enum ModelError {
    /// From the disk or a file's form.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// From a clip.
    #[error(transparent)]
    Clip(#[from] ClipError),
    /// From the descriptor's settings.
    #[error(transparent)]
    Descriptor(#[from] DescriptorError),
    /// The data do not allow the fit.
    #[error("{0}")]
    Data(String),
    /// A setting out of range.
    #[error("{0}")]
    Config(String),
    /// The user asked to stop.
    #[error("stopped before the end")]
    Stopped,
}
