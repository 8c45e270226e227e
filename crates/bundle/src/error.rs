use crate::descriptor::DescriptorError;
use softtissue_body::BodyError;
use softtissue_store::StoreError;
use std::path::{Path, PathBuf};

/// Why a bundle is refused; one sentence each, with file, place and remedy.
#[derive(Debug, thiserror::Error)]
pub enum BundleError {
    /// From the disk or a file's form.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// From the body inside.
    #[error(transparent)]
    Body(#[from] BodyError),
    /// From the motion descriptor's settings.
    #[error(transparent)]
    Descriptor(#[from] DescriptorError),
    /// Written by a later version of this program.
    #[error("{path} has bundle format {found}, this program reads up to {supported}: update the program")]
    Newer {
        /// The manifest.
        path: PathBuf,
        /// Its version.
        found: u64,
        /// The newest version this program reads.
        supported: u64,
    },
    /// Made for another mesh.
    #[error("{path} is for a mesh of topology {found}, not {expected}: use the body that the bundle was trained on")]
    Topology {
        /// The manifest.
        path: PathBuf,
        /// The bundle's topology hash.
        found: String,
        /// The topology hash it should have.
        expected: String,
    },
    /// A file is not the one that the manifest lists.
    #[error("{path} is damaged: its SHA-256 is {found}, the manifest says {expected}; copy or export the bundle again")]
    Hash {
        /// Which file.
        path: PathBuf,
        /// What its bytes give.
        found: String,
        /// What the manifest says.
        expected: String,
    },
    /// The player does not give what the bundle says it gave.
    #[error(
        "{path} fails its self-check: vertex {vertex} in frame {frame} is {difference_mm:.4} mm off, allowed {tolerance_mm:.4}; export the bundle again"
    )]
    SelfCheck {
        /// The bundle.
        path: PathBuf,
        /// Frame of the check's motion.
        frame: usize,
        /// Vertex of the body.
        vertex: u32,
        /// By how much, millimetres.
        difference_mm: f32,
        /// What is allowed, millimetres.
        tolerance_mm: f32,
    },
    /// Anything else that is wrong with the content.
    #[error("{path} is not usable: {reason}")]
    Refused {
        /// Which file.
        path: PathBuf,
        /// What is wrong and what to do.
        reason: String,
    },
    /// The user asked to stop.
    #[error("stopped; nothing was written")]
    Stopped,
    /// Something handed to the player does not fit it.
    #[error("the player was given {0}")]
    Input(String),
}

impl BundleError {
    pub(crate) fn refused(path: &Path, reason: impl Into<String>) -> Self {
        Self::Refused { path: path.to_owned(), reason: plain(&reason.into()) }
    }
}

/// Words that a file holds, as they may be repeated: without control characters.
pub(crate) fn plain(words: &str) -> String {
    words.replace(char::is_control, " ")
}
