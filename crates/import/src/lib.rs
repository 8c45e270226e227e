//! The customs office: the only room that reads foreign formats. Everything that comes in is checked against
//! [`ImportLimits`] before memory is taken for it, and leaves as clips of ours.
//!
//! 4D scans ([`scans`]), motions ([`motion`]), bodies ([`import_smpl`], [`import_anny`]), single OBJ meshes whose vertex
//! order does not matter ([`read_mesh`]), NumPy's arrays ([`arrays`]) and Python's pickles ([`pickle`]).

mod archive;
pub mod arrays;
mod body;
mod error;
pub mod motion;
mod natural;
mod obj;
pub mod pickle;
mod place;
pub mod scans;

pub use archive::Archive;
pub use body::{AnnyConfig, ImportedBody, SmplConfig, examine_body, import_anny, import_smpl};
pub use error::ImportError;
pub use natural::natural_cmp;
pub use obj::{ImportLimits, ObjFrame, read_mesh, read_obj_frame};
pub use place::Place;

/// Result of this crate.
pub type Result<T> = std::result::Result<T, ImportError>;
