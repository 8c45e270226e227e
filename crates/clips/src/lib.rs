//! Frames in time: scan clips, motion clips, delta clips; splits; and the folders that stages meet in.
//!
//! Invariant: a [`ScanSet`] holds vertices, rate and subject only; truth lies in a [`TruthSet`], a folder
//! of its own that nothing but evaluation opens.
//! What is wrong with a clip is found by [`inspection`].

mod clip;
mod clip_file;
mod error;
mod id;
pub mod inspection;
mod raw;
mod sets;
mod split;

pub use clip::{DeltaClip, MotionClip, ScanClip};
pub use clip_file::ClipFile;
pub use error::ClipError;
pub use id::ClipId;
pub use raw::{RawFrame, RawScans, interpolate_missing};
pub use sets::{ClipEntry, FitSet, FittedSubject, ScanSet, TrueSubject, TruthSet};
pub use split::{Part, Split, SplitConfig};

/// Result of this crate.
pub type Result<T> = std::result::Result<T, ClipError>;
