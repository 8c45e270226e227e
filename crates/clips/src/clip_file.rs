use crate::clip::open;
use crate::{ClipError, ClipId, Result};
use softtissue_geometry::Frames;
use softtissue_store::TensorFile;
use std::ops::Range;
use std::path::Path;

/// A scan or delta clip on disk whose frames are read when they are asked for, numbers as they stand: nothing refuses
/// what is not finite.
#[derive(Debug)]
pub struct ClipFile {
    /// Who, what, which take.
    pub id: ClipId,
    /// Frames a second.
    pub fps: f32,
    /// Frames `T`.
    pub frames: usize,
    /// Points of each, `V`.
    pub points: usize,
    file: TensorFile,
    array: &'static str,
}

impl ClipFile {
    /// Opens a scan clip.
    pub fn scan(path: &Path) -> Result<Self> {
        Self::open(path, "scan", "vertices")
    }
    /// Opens a delta clip.
    pub fn deltas(path: &Path) -> Result<Self> {
        Self::open(path, "delta", "deltas")
    }

    fn open(path: &Path, kind: &str, array: &'static str) -> Result<Self> {
        let (file, id, fps) = open(kind, path)?;
        let shape = file.require_shape(array, 3)?;
        let (frames, points) = (shape[0], shape[1]);
        if frames == 0 || points == 0 || shape[2] != 3 {
            let reason = format!("{array} has shape {shape:?}, expected frames x points x 3; make it again");
            return Err(ClipError::Bad { path: path.to_owned(), reason });
        }
        Ok(Self { id, fps, frames, points, file, array })
    }

    /// Frames that one read takes, some 16 MB.
    pub fn frames_a_read(&self) -> usize {
        ((16 << 20) / (12 * self.points)).clamp(1, 512)
    }

    /// Some frames, `[range, V]`.
    pub fn read(&self, range: Range<usize>) -> Result<Frames> {
        Ok(Frames::from_numbers(self.points, &self.file.f32_rows(self.array, range)?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ScanClip;
    use glam::Vec3;

    #[test]
    fn frames_come_back_one_by_one_and_what_is_not_finite_too() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("c.safetensors");
        let mut points: Vec<Vec3> = (0..12).map(|i| Vec3::splat(i as f32)).collect();
        points[7].y = f32::NAN;
        let clip = ScanClip { id: ClipId::new("a", "b", 0), fps: 30.0, vertices: Frames::from_points(3, points) };
        clip.write(&path).unwrap();
        let file = ClipFile::scan(&path).unwrap();
        assert_eq!((file.frames, file.points, file.fps), (4, 3, 30.0));
        assert_eq!(file.read(1..2).unwrap().points(), clip.vertices.frame(1));
        assert!(file.read(2..3).unwrap().points()[1].y.is_nan());
        assert!(ClipFile::deltas(&path).is_err());
    }
}
