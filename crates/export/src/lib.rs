//! Animated glTF and OBJ sequences out of posed vertices. Knows no burn and no network.

mod animation;
mod error;
mod gltf;
mod morph;
mod obj;

pub use animation::Animation;
pub use error::ExportError;
pub use gltf::{GltfConfig, GltfReport, write_gltf};
pub use obj::write_obj_sequence;

/// Result of this crate.
pub type Result<T> = std::result::Result<T, ExportError>;
