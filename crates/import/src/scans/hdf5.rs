//! DFAUST's `registrations_{f,m}.hdf5` and Dyna's `dyna_{female,male}.h5`: a flat root with a dataset
//! `SUBJECT_SEQUENCE` of shape `(V, 3, T)` for each clip, and `faces (F, 3)`, 0-based. Number types, chunks and
//! compression vary. Read by ranges of frames; no other file is opened, whatever a link or an external storage names.

use crate::{ImportError, ImportLimits, Result};
use glam::Vec3;
use hdf5_reader::{Dataset, Datatype, Hdf5File, OpenOptions, SliceInfo, SliceInfoElem};
use softtissue_geometry::Frames;
use softtissue_store::StoreError;
use std::path::{Path, PathBuf};

/// Decoded bytes of one chunk and of one read at most.
const READ_BYTES: usize = 64 << 20;
/// Numbers of a dataset for each byte of the file at most. Vertices hardly compress: what inflates further is a bomb.
const INFLATION: u64 = 64;
/// Datasets that are listed at most.
const DATASETS: usize = 10_000;

/// An opened file and the clips that it lists.
pub(crate) struct Hdf5Scans {
    path: PathBuf,
    file: Hdf5File,
    /// Names of the datasets that hold clips, in file order.
    pub names: Vec<String>,
    has_faces: bool,
}

/// A dataset that holds a clip.
pub(crate) struct Hdf5Clip {
    path: PathBuf,
    dataset: Dataset,
    pub vertices: usize,
    pub frames: usize,
    order: Axes,
}

/// Which axis is which.
#[derive(Clone, Copy, PartialEq)]
enum Axes {
    /// `(V, 3, T)`, as DFAUST and Dyna have it.
    FramesLast,
    /// `(T, V, 3)`.
    FramesFirst,
}

impl Hdf5Scans {
    /// Opens a file and lists its root.
    ///
    /// # Errors
    /// No HDF5 file, a damaged one, or one without a clip.
    pub fn open(path: &Path) -> Result<Self> {
        let meta = std::fs::metadata(path).map_err(|e| StoreError::io("read", path, e))?;
        if !meta.is_file() || meta.len() == 0 {
            return Err(ImportError::file(path, "it is empty or no regular file; check the path"));
        }
        let options = OpenOptions {
            chunk_cache_bytes: READ_BYTES,
            max_chunk_bytes: READ_BYTES,
            max_read_bytes: READ_BYTES,
            max_object_header_bytes: 1 << 20,
            ..OpenOptions::default()
        };
        let broken = |e: hdf5_reader::error::Error| {
            ImportError::file(path, format!("it is no readable HDF5 file ({})", one_line(&e)))
        };
        let file = Hdf5File::open_with_options(path, options).map_err(broken)?;
        let (_, names) = file.root_group().and_then(|g| g.member_names()).map_err(broken)?;
        if names.len() > DATASETS {
            return Err(ImportError::file(path, format!("its root lists more than {DATASETS} datasets")));
        }
        let has_faces = names.iter().any(|n| n == "faces");
        let names: Vec<String> = names.into_iter().filter(|n| n != "faces").collect();
        if names.is_empty() {
            return Err(ImportError::file(
                path,
                "its root lists no dataset SUBJECT_SEQUENCE; is it of DFAUST or Dyna?",
            ));
        }
        Ok(Self { path: path.to_owned(), file, names, has_faces })
    }

    /// Opens a dataset and checks its shape against the limits and the file's length; reads no vertex.
    pub fn clip(&self, name: &str, limits: &ImportLimits) -> Result<Hdf5Clip> {
        let bad = |reason: String| self.refuse(name, reason);
        let dataset = self.dataset(name)?;
        let (vertices, frames, order) = match *dataset.shape() {
            [v, 3, t] => (v, t, Axes::FramesLast),
            [t, v, 3] => (v, t, Axes::FramesFirst),
            ref shape => return Err(bad(format!("shape {shape:?}, expected (vertices, 3, frames)"))),
        };
        if vertices == 0 || vertices > limits.vertices as u64 {
            return Err(bad(format!("{vertices} vertices, expected 1 to {}", limits.vertices)));
        }
        match frames {
            0 => return Err(bad("it holds no frame; leave it out".into())),
            1 => return Err(bad("it holds one frame, which has no velocity; a clip needs at least two".into())),
            t if t > limits.frames as u64 => return Err(bad(format!("{t} frames are more than {}", limits.frames))),
            _ => {}
        }
        let points = vertices.saturating_mul(frames);
        if points > limits.clip_points as u64 {
            return Err(bad(format!("{points} points are more than {} for a clip; split it", limits.clip_points)));
        }
        let length = std::fs::metadata(&self.path).map_err(|e| StoreError::io("read", &self.path, e))?.len();
        if points * 3 > length * INFLATION {
            return Err(bad(format!(
                "it declares {} numbers in a file of {length} bytes, which no scan does",
                points * 3
            )));
        }
        Ok(Hdf5Clip { path: self.path.clone(), dataset, vertices: vertices as usize, frames: frames as usize, order })
    }

    /// `faces`, where the file has them.
    pub fn faces(&self, limits: &ImportLimits) -> Result<Option<Vec<[u32; 3]>>> {
        if !self.has_faces {
            return Ok(None);
        }
        let bad = |reason: String| self.refuse("faces", reason);
        let dataset = self.dataset("faces")?;
        let shape = dataset.shape();
        if shape.len() != 2 || shape[1] != 3 || shape[0] > limits.faces as u64 {
            return Err(bad(format!("shape {shape:?}, expected (faces, 3), at most {}", limits.faces)));
        }
        let all = SliceInfo::all(2);
        let read = match dataset.dtype() {
            Datatype::FixedPoint { size: 8, signed: true, .. } => integers::<i64>(&dataset, &all),
            Datatype::FixedPoint { size: 8, signed: false, .. } => integers::<u64>(&dataset, &all),
            Datatype::FixedPoint { size: 4, signed: true, .. } => integers::<i32>(&dataset, &all),
            Datatype::FixedPoint { size: 4, signed: false, .. } => integers::<u32>(&dataset, &all),
            Datatype::FixedPoint { size: 2, signed: true, .. } => integers::<i16>(&dataset, &all),
            Datatype::FixedPoint { size: 2, signed: false, .. } => integers::<u16>(&dataset, &all),
            other => return Err(bad(format!("its numbers are {other:?}, expected integers"))),
        };
        let numbers = read.map_err(|e| bad(unreadable(&e)))?;
        let indices: Option<Vec<u32>> = numbers.iter().map(|i| u32::try_from(*i).ok()).collect();
        let indices = indices.ok_or_else(|| bad("it holds a negative or too large index".into()))?;
        Ok(Some(indices.as_chunks::<3>().0.to_vec()))
    }

    /// A refusal that names a dataset.
    pub fn refuse(&self, name: &str, reason: String) -> ImportError {
        refuse(&self.path, name, reason)
    }

    fn dataset(&self, name: &str) -> Result<Dataset> {
        let group = self.file.root_group().map_err(|e| ImportError::file(&self.path, unreadable(&e)))?;
        group.dataset(name).map_err(|e| self.refuse(name, unreadable(&e)))
    }
}

impl Hdf5Clip {
    /// Frames of a range, `[range, V]`, as stored.
    pub fn read(&self, range: std::ops::Range<usize>) -> Result<Frames> {
        let (start, end) = (range.start as u64, range.end as u64);
        let all = |n: u64| SliceInfoElem::Slice { start: 0, end: n, step: 1 };
        let part = SliceInfoElem::Slice { start, end, step: 1 };
        let v = self.vertices as u64;
        let selections = match self.order {
            Axes::FramesLast => vec![all(v), all(3), part],
            Axes::FramesFirst => vec![part, all(v), all(3)],
        };
        let selection = SliceInfo { selections };
        let bad = |reason: String| refuse(&self.path, self.dataset.name(), reason);
        let read = match self.dataset.dtype() {
            Datatype::FloatingPoint { size: 4, .. } => floats::<f32>(&self.dataset, &selection),
            Datatype::FloatingPoint { size: 8, .. } => floats::<f64>(&self.dataset, &selection),
            other => return Err(bad(format!("its numbers are {other:?}, expected floats of 4 or 8 bytes"))),
        };
        let numbers = read.map_err(|e| bad(unreadable(&e)))?;
        let count = range.len();
        if numbers.len() != 3 * self.vertices * count {
            return Err(bad("it gives fewer numbers than its shape says: it is damaged".into()));
        }
        let mut frames = Frames::zeros(self.vertices, count);
        for t in 0..count {
            for (v, p) in frames.frame_mut(t).iter_mut().enumerate() {
                *p = Vec3::from_array(std::array::from_fn(|c| match self.order {
                    Axes::FramesLast => numbers[(3 * v + c) * count + t],
                    Axes::FramesFirst => numbers[(t * self.vertices + v) * 3 + c],
                }));
                if !p.is_finite() {
                    let t = range.start + t;
                    return Err(bad(format!("frame {t}, vertex {v} is {p}, not finite; mend or leave out the clip")));
                }
            }
        }
        Ok(frames)
    }

    /// Which file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Frames that one read takes, so that its decoded bytes stay within the limit.
    pub fn frames_a_read(&self) -> usize {
        (READ_BYTES / 4 / (24 * self.vertices)).clamp(1, 128)
    }
}

fn floats<T: hdf5_reader::H5Type + Copy + Narrow>(
    dataset: &Dataset,
    selection: &SliceInfo,
) -> hdf5_reader::error::Result<Vec<f32>> {
    Ok(dataset.read_slice::<T>(selection)?.iter().map(|x| x.narrow()).collect())
}

fn integers<T: hdf5_reader::H5Type + Copy + TryInto<i64>>(
    dataset: &Dataset,
    selection: &SliceInfo,
) -> hdf5_reader::error::Result<Vec<i64>> {
    Ok(dataset.read_slice::<T>(selection)?.iter().map(|x| (*x).try_into().unwrap_or(-1)).collect())
}

/// A float in our precision.
trait Narrow {
    fn narrow(self) -> f32;
}

impl Narrow for f32 {
    fn narrow(self) -> f32 {
        self
    }
}

impl Narrow for f64 {
    fn narrow(self) -> f32 {
        self as f32
    }
}

fn unreadable(error: &hdf5_reader::error::Error) -> String {
    format!("it cannot be read ({}); is it a plain dataset inside this file?", one_line(error))
}

/// The reader's message; names in a damaged file may hold anything.
fn one_line(error: &hdf5_reader::error::Error) -> String {
    error.to_string().replace(char::is_control, " ")
}

fn refuse(path: &Path, name: &str, reason: String) -> ImportError {
    ImportError::file(path, format!("dataset {}: {reason}", name.replace(char::is_control, " ")))
}
