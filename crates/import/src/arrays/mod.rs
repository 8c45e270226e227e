//! NumPy's files: `.npy` (versions 1 to 3) and `.npz`, stored or deflated. Nothing is taken on trust: a header's shape
//! is held against the bytes that follow it before anything is converted, and no pickle in them is executed.
//!
//! Source: the NumPy enhancement proposal 1, "A simple file format for NumPy arrays".

mod array;
mod element;
mod header;
mod limits;
mod npz;

pub use array::Array;
pub use element::{ElementKind, ElementType};
pub use limits::ArrayLimits;
pub use npz::{Npz, read_npy};
