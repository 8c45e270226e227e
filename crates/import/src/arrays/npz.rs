use super::{Array, ArrayLimits};
use crate::place::excerpt;
use crate::{Archive, Place, Result};
use softtissue_store::read_limited;
use std::path::Path;

/// Reads an `.npy` file.
///
/// # Errors
/// No such file, a head that is refused, or fewer or more data than it states.
pub fn read_npy(path: &Path, limits: &ArrayLimits) -> Result<Array> {
    let bytes = read_limited(path, limits.file_bytes.min(limits.array_bytes))?;
    Array::from_npy(Place::file(path), bytes, limits)
}

/// An `.npz` file: arrays by name, read when they are asked for.
pub struct Npz {
    archive: Archive,
    limits: ArrayLimits,
}

impl Npz {
    /// Reads the list of arrays.
    ///
    /// # Errors
    /// As [`Archive::open`].
    pub fn open(path: &Path, limits: &ArrayLimits) -> Result<Self> {
        Ok(Self { archive: Archive::open(path, limits)?, limits: *limits })
    }

    /// Where the file lies.
    pub fn path(&self) -> &Path {
        self.archive.path()
    }

    /// Names of the arrays, in order of bytes.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.archive.names().filter_map(|name| name.strip_suffix(".npy"))
    }

    /// Whether there is an array of this name.
    pub fn contains(&self, name: &str) -> bool {
        self.archive.contains(&format!("{name}.npy"))
    }

    /// An array by name.
    ///
    /// # Errors
    /// It is missing or refused.
    pub fn require(&self, name: &str) -> Result<Array> {
        let place = Place::part(self.archive.path(), format!("array {name}"));
        if !self.contains(name) {
            let names: Vec<String> = self.names().take(40).map(excerpt).collect();
            return Err(place.refuse(format!("it is missing; the file holds {}", names.join(", "))));
        }
        Array::from_npy(place, self.archive.read(&format!("{name}.npy"))?, &self.limits)
    }

    /// An array by name, where there is one.
    ///
    /// # Errors
    /// It is there and refused.
    pub fn get(&self, name: &str) -> Result<Option<Array>> {
        if self.contains(name) { self.require(name).map(Some) } else { Ok(None) }
    }
}
