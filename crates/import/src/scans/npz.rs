use crate::arrays::{Array, ArrayLimits, Npz};
use crate::place::excerpt;
use crate::{ImportError, ImportLimits, Place, Result};
use softtissue_geometry::Frames;
use std::path::{Path, PathBuf};

/// Names that an array of vertices goes by.
const VERTICES: [&str; 3] = ["vertices", "verts", "v"];
/// Names that a rate goes by.
const RATES: [&str; 4] = ["fps", "mocap_framerate", "mocap_frame_rate", "framerate"];

/// An npz file with vertices `(T, V, 3)` and, if they are there, `faces (F, 3)` and `fps`.
pub(crate) struct NpzClip {
    path: PathBuf,
    limits: ArrayLimits,
}

impl NpzClip {
    /// Checks that there are vertices; reads none.
    pub fn open(path: &Path, limits: &ImportLimits) -> Result<Self> {
        let clip = Self { path: path.to_owned(), limits: array_limits(limits) };
        clip.vertices_name(&clip.archive()?)?;
        Ok(clip)
    }

    /// Where it stands.
    pub fn place(&self) -> Place {
        Place::file(&self.path)
    }

    fn archive(&self) -> Result<Npz> {
        Npz::open(&self.path, &self.limits)
    }

    fn vertices_name(&self, npz: &Npz) -> Result<&'static str> {
        VERTICES.into_iter().find(|name| npz.contains(name)).ok_or_else(|| {
            let names: Vec<String> = npz.names().take(20).map(excerpt).collect();
            ImportError::file(&self.path, format!("it holds no array `vertices`, but {}", names.join(", ")))
        })
    }

    /// All frames, as stored.
    pub fn read(&self, limits: &ImportLimits) -> Result<Frames> {
        let npz = self.archive()?;
        let array = npz.require(self.vertices_name(&npz)?)?;
        array.expect_shape(&[None, None, Some(3)])?;
        let (frames, vertices) = (array.shape()[0], array.shape()[1]);
        if frames < 2 {
            return Err(array.refuse(format!("{frames} frames have no velocity; a clip needs at least two")));
        }
        let points = frames.saturating_mul(vertices);
        if frames > limits.frames || vertices == 0 || vertices > limits.vertices || points > limits.clip_points {
            return Err(array.refuse(format!(
                "{frames} frames of {vertices} vertices, at most {} of 1 to {}, {} points in all, are read; split it",
                limits.frames, limits.vertices, limits.clip_points
            )));
        }
        Ok(Frames::from_numbers(vertices, &array.f32s()?))
    }

    /// `faces`, where the file has them.
    pub fn faces(&self, limits: &ImportLimits) -> Result<Option<Vec<[u32; 3]>>> {
        let npz = self.archive()?;
        let Some(array) = ["faces", "f"].into_iter().find_map(|name| npz.get(name).transpose()).transpose()? else {
            return Ok(None);
        };
        array.expect_shape(&[None, Some(3)])?;
        if array.shape()[0] > limits.faces {
            return Err(array.refuse(format!("{} faces are more than {}", array.shape()[0], limits.faces)));
        }
        let index = |i: &i64| u32::try_from(*i).map_err(|_| array.refuse(format!("its index {i} is out of range")));
        let indices: Vec<u32> = array.integers()?.iter().map(index).collect::<Result<_>>()?;
        Ok(Some(indices.as_chunks::<3>().0.to_vec()))
    }

    /// The rate, where the file says.
    pub fn fps(&self) -> Result<Option<f32>> {
        let npz = self.archive()?;
        let found = RATES.into_iter().find_map(|name| npz.get(name).transpose()).transpose()?;
        let rate = |array: Array| {
            let fps = array.number()? as f32;
            if fps > 0.0 && fps <= 1000.0 {
                Ok(fps)
            } else {
                Err(array.refuse(format!("the rate {fps} is not between 0 and 1000 frames a second; pass --fps")))
            }
        };
        found.map(rate).transpose()
    }
}

fn array_limits(limits: &ImportLimits) -> ArrayLimits {
    let usual = ArrayLimits::default();
    let bytes = (limits.clip_points as u64).saturating_mul(24);
    ArrayLimits { file_bytes: limits.file_bytes, array_bytes: usual.array_bytes.min(bytes), ..usual }
}
