//! Animated glTF, USD, point caches and OBJ sequences out of posed vertices, and the network of a bundle as ONNX. Knows no burn.

mod animation;
mod error;
mod gltf;
mod morph;
mod obj;
mod onnx;
mod point_cache;
mod usd;

pub use animation::{Animation, Uv};
pub use error::ExportError;
pub use gltf::{GltfConfig, GltfReport, write_gltf};
pub use obj::{ObjFolder, SurfaceFrame, write_obj_sequence};
pub use onnx::{OnnxForm, write_onnx};
pub use point_cache::{PointCache, write_point_cache};
pub use usd::write_usd;

/// Result of this crate.
pub type Result<T> = std::result::Result<T, ExportError>;
