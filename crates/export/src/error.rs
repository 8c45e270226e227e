use softtissue_store::StoreError;
use std::path::PathBuf;

/// Why an animation cannot be written; one sentence each.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// From the disk.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The animation itself.
    #[error("the animation cannot be exported: {reason}")]
    Animation {
        /// What is wrong and what to do.
        reason: String,
    },
    /// The place to write to.
    #[error("{path} cannot be written: {reason}")]
    Target {
        /// Where.
        path: PathBuf,
        /// What is wrong and what to do.
        reason: String,
    },
    /// A model that has no such form.
    #[error("the model of method {method} has no ONNX form: softtissue and softsmpl have one")]
    Model {
        /// Its method.
        method: String,
    },
    /// The user asked to stop; nothing was left half-written.
    #[error("stopped before the export was done")]
    Stopped,
}
