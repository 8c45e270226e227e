//! 4D scans from elsewhere: HDF5 as DFAUST and Dyna have it, OBJ and PLY sequences, arrays of vertices. What is
//! registered to the template becomes a set of ours ([`import_scans`]); raw scans, whose points have no correspondence,
//! are handed out frame by frame to be registered ([`RawScanSource`]). [`MeshSequences`] are clips to look at.
//!
//! The order of vertices is the correspondence, so it is kept as it stands in the file; materials are never opened.

mod conventions;
mod files;
mod frame_mesh;
mod hdf5;
mod import;
mod npz;
mod ply;
mod raw;
mod sequence;
mod source;
mod survey;

pub use conventions::{Conventions, Units, UpAxis};
pub use frame_mesh::FrameMesh;
pub use import::import_scans;
pub use ply::read_ply;
pub use raw::RawScanSource;
pub use sequence::{MeshSequence, MeshSequences};
pub use source::{ScanImportConfig, ScanSource};
pub use survey::ClipSurvey;
