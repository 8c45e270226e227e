use super::SmplConfig;
use crate::arrays::{Array, Npz};
use crate::pickle::{Id, Pickle, PickledArrays, SparseRows};
use crate::place::excerpt;
use crate::{Place, Result};
use std::path::Path;

/// The named parts of a body model, wherever they lie.
pub enum Fields<'a> {
    /// A dictionary in a pickle.
    Pickle {
        /// The pickle.
        arrays: PickledArrays<'a>,
        /// Its file.
        path: &'a Path,
    },
    /// An npz archive, whose arrays may hold pickles.
    Npz {
        /// The archive.
        npz: &'a Npz,
        /// Limits.
        config: &'a SmplConfig,
    },
}

impl Fields<'_> {
    /// The whole file, for messages.
    pub fn file(&self) -> Place {
        match self {
            Self::Pickle { path, .. } => Place::file(path),
            Self::Npz { npz, .. } => Place::file(npz.path()),
        }
    }

    /// A part, for messages.
    pub fn place(&self, key: &str) -> Place {
        Place { part: format!("array {key}"), ..self.file() }
    }

    /// An array, where there is one.
    pub fn array(&self, key: &str) -> Result<Option<Array>> {
        let place = self.place(key);
        match self {
            Self::Pickle { arrays, .. } => {
                arrays.pickle.value(arrays.pickle.root(), key).map(|id| arrays.array(id, &place)).transpose()
            }
            Self::Npz { npz, config } => {
                let Some(array) = npz.get(key)? else { return Ok(None) };
                if array.pickle().is_none() {
                    return Ok(Some(array));
                }
                within(&array, config, &place, |arrays, root| arrays.array(root, &place)).map(Some)
            }
        }
    }

    /// An array.
    pub fn require(&self, key: &str) -> Result<Array> {
        self.array(key)?.ok_or_else(|| self.missing(key))
    }

    fn missing(&self, key: &str) -> crate::ImportError {
        let keys: Vec<String> = match self {
            Self::Pickle { arrays, .. } => arrays.pickle.keys(arrays.pickle.root()).into_iter().map(excerpt).collect(),
            Self::Npz { npz, .. } => npz.names().take(40).map(excerpt).collect(),
        };
        let holds = if keys.is_empty() { "nothing by name".into() } else { keys.join(", ") };
        self.place(key).refuse(format!("it is missing; is the file a body model? It holds {holds}"))
    }

    /// A matrix by rows, dense or sparse.
    pub fn rows(&self, key: &str) -> Result<SparseRows> {
        let place = self.place(key);
        let sparse = match self {
            Self::Pickle { arrays, .. } => match arrays.pickle.value(arrays.pickle.root(), key) {
                Some(id) => SparseRows::read(arrays, id, &place)?,
                None => None,
            },
            Self::Npz { npz, config } => match npz.get(key)? {
                Some(array) if array.pickle().is_some() => within(&array, config, &place, |arrays, root| {
                    SparseRows::read(arrays, arrays.unboxed(root), &place)
                })?,
                _ => None,
            },
        };
        if let Some(rows) = sparse {
            return Ok(rows);
        }
        SparseRows::dense(&self.require(key)?)
    }
}

/// Reads the pickle inside an array of objects.
fn within<T>(
    array: &Array,
    config: &SmplConfig,
    place: &Place,
    read: impl FnOnce(&PickledArrays<'_>, Id) -> Result<T>,
) -> Result<T> {
    let bytes = array.pickle().unwrap_or_default();
    let pickle = Pickle::read(bytes, &config.pickle).map_err(|reason| place.refuse(reason))?;
    read(&PickledArrays { pickle: &pickle, limits: &config.arrays }, pickle.root())
}
