use softtissue_clips::ClipError;
use softtissue_store::StoreError;
use std::path::{Path, PathBuf};

/// Why a foreign file is refused; one sentence with file, place and remedy.
#[derive(Debug, thiserror::Error)]
pub enum ImportError {
    /// From the disk.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// From our own clips.
    #[error(transparent)]
    Clip(#[from] ClipError),
    /// A line that cannot be read.
    #[error("{path}, line {line}: {reason}")]
    Line {
        /// Which file.
        path: PathBuf,
        /// Which line, from 1.
        line: usize,
        /// What is wrong and what to do.
        reason: String,
    },
    /// A part of a file: an array, a member of an archive.
    #[error("{path}, {part}: {reason}")]
    Part {
        /// Which file.
        path: PathBuf,
        /// Which part.
        part: String,
        /// What is wrong and what to do.
        reason: String,
    },
    /// A file or folder as a whole.
    #[error("{path}: {reason}")]
    File {
        /// Which file or folder.
        path: PathBuf,
        /// What is wrong and what to do.
        reason: String,
    },
    /// The user asked to stop.
    #[error("stopped; nothing was left half-written")]
    Stopped,
}

impl ImportError {
    pub(crate) fn file(path: &Path, reason: impl Into<String>) -> Self {
        Self::File { path: path.to_owned(), reason: reason.into() }
    }
}
