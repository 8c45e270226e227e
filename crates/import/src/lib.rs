//! The customs office: the only room that reads foreign formats. Everything that comes in is checked against
//! [`ImportLimits`] before memory is taken for it, and leaves as clips of ours.
//!
//! 4D scans ([`scans`]), motions ([`motion`]), single OBJ meshes whose vertex order does not matter ([`read_mesh`]), and
//! NumPy's arrays ([`arrays`]).

mod archive;
pub mod arrays;
mod error;
pub mod motion;
mod natural;
mod obj;
mod place;
pub mod scans;

pub use archive::Archive;
pub use error::ImportError;
pub use natural::natural_cmp;
pub use obj::{ImportLimits, ObjFrame, read_mesh, read_obj_frame};
pub use place::Place;

/// Result of this crate.
pub type Result<T> = std::result::Result<T, ImportError>;
