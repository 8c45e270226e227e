use softtissue_body::BodyError;
use softtissue_clips::{ClipError, ClipId};
use softtissue_store::StoreError;

/// What can go wrong while judging or reporting; one sentence each.
#[derive(Debug, thiserror::Error)]
pub enum EvalError {
    /// From the disk or a file's form.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// From a clip, a set of clips or a split.
    #[error(transparent)]
    Clip(#[from] ClipError),
    /// From the body.
    #[error(transparent)]
    Body(#[from] BodyError),
    /// A method that could not predict a clip.
    #[error("{method} failed on {clip}: {source}")]
    Method {
        /// Which method.
        method: String,
        /// On which clip.
        clip: ClipId,
        /// Why.
        source: MethodError,
    },
    /// Two things that are compared have different sizes.
    #[error("{clip}: {what} has {sizes}; make it again from the same scans and body")]
    Size {
        /// Which clip.
        clip: ClipId,
        /// What was compared.
        what: String,
        /// The size found and the one expected.
        sizes: String,
    },
    /// A protocol that cannot be run on these clips, or metrics that cannot be written or read.
    #[error("{0}")]
    Refused(String),
    /// The user asked to stop.
    #[error("stopped before the evaluation ended; nothing was written")]
    Stopped,
}

/// What a method's own failure is carried in.
pub type MethodError = Box<dyn std::error::Error + Send + Sync>;
