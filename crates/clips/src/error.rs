use crate::ClipId;
use softtissue_store::StoreError;
use std::path::PathBuf;

/// What is wrong with a clip, a set of clips or a split; one sentence each.
#[derive(Debug, thiserror::Error)]
pub enum ClipError {
    /// From the disk or a file's form.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// A clip's content is refused.
    #[error("{path}: {reason}")]
    Bad {
        /// Which file.
        path: PathBuf,
        /// What is wrong and what to do.
        reason: String,
    },
    /// The set has no such clip.
    #[error("there is no clip {id} in {path}: `softtissue inspect` lists what is there")]
    NoClip {
        /// Which clip.
        id: ClipId,
        /// Which set.
        path: PathBuf,
    },
    /// A split that would let training see what it is tested on, or that leaves a part empty.
    #[error("the split is not usable: {reason}")]
    Split {
        /// What is wrong and what to do.
        reason: String,
    },
    /// A raw scan that its source cannot give.
    #[error("{0}")]
    Raw(#[source] Box<dyn std::error::Error + Send + Sync>),
    /// A text that names no clip.
    #[error("{text:?} names no clip: write subject/motion or subject/motion.take")]
    Id {
        /// The text.
        text: String,
    },
}
