use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// What can go wrong between us and the disk. Each message is one sentence naming the file and the remedy.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// The file or folder is not there.
    #[error("{path} does not exist: check the path")]
    Missing {
        /// What was looked for.
        path: PathBuf,
    },
    /// The operating system refused (permission, disk full, a file where a folder should be, ...).
    #[error("cannot {action} {path}: {source}")]
    Io {
        /// The verb: "read", "write", "create", ...
        action: &'static str,
        /// Where.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The bytes are not what this program writes or accepts.
    #[error("{path} is not usable: {reason}")]
    Corrupt {
        /// Which file.
        path: PathBuf,
        /// What is wrong, with place and remedy.
        reason: String,
    },
    /// The file asks for more than the limits allow.
    #[error("{path} is too large: {reason}")]
    Limit {
        /// Which file.
        path: PathBuf,
        /// Which limit, how much was asked for.
        reason: String,
    },
}

impl StoreError {
    /// An I/O error at `path`. When reading, "not found" becomes [`StoreError::Missing`], and a folder in the place of
    /// a file [`StoreError::Corrupt`]: neither is the disk's fault.
    pub fn io(action: &'static str, path: &Path, source: std::io::Error) -> Self {
        if action == "read" && source.kind() == ErrorKind::NotFound {
            return Self::Missing { path: path.to_owned() };
        }
        if action == "read" && matches!(source.kind(), ErrorKind::IsADirectory | ErrorKind::NotADirectory) {
            return Self::corrupt(path, format!("{source}; check the path"));
        }
        Self::Io { action, path: path.to_owned(), source }
    }

    /// A file whose content is refused. Words of the file that the reason quotes may hold anything: control characters
    /// are left out.
    pub fn corrupt(path: &Path, reason: impl Into<String>) -> Self {
        Self::Corrupt { path: path.to_owned(), reason: reason.into().replace(char::is_control, " ") }
    }

    /// Whether the fault lies with the disk (full, read-only, no permission) rather than with content.
    pub fn is_disk(&self) -> bool {
        matches!(self, Self::Io { .. })
    }
}
