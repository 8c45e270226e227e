//! Files that cannot be half-written, and readers that allocate nothing a file merely claims.
//!
//! Every room writes through [`write_atomic`] (temporary name, sync, rename) and keeps its arrays in
//! [`TensorFile`]s: the safetensors layout (an 8-byte little-endian header length, a JSON header,
//! then raw little-endian data), read under explicit [`Limits`]. The reader refuses what the format
//! forbids but common readers let pass: duplicate keys, overlapping or gapped offsets, trailing
//! bytes, shapes whose product overflows.

mod atomic;
mod error;
mod hash;
mod tensor_file;

pub use atomic::{create_dir, read_json, read_limited, write_atomic, write_json_atomic};
pub use error::StoreError;
pub use hash::{Sha256, sha256_bytes, sha256_file};
pub use tensor_file::{DType, Limits, TensorFile, TensorFileWriter};

/// Result of this crate.
pub type Result<T> = std::result::Result<T, StoreError>;
