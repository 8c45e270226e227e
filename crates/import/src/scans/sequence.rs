use super::files::{FrameFiles, read_frame};
use super::import::notes;
use super::source::{Content, SourceClip};
use super::{Conventions, ScanSource};
use crate::{ImportError, Result};
use glam::Vec3;
use softtissue_clips::{ClipEntry, ClipId};
use softtissue_geometry::Frames;
use softtissue_monitor::Monitor;

/// Clips of a source as moving meshes whose vertices keep their order, of whatever topology: to look at, not to learn from.
pub struct MeshSequences<'a> {
    source: &'a ScanSource,
    conventions: Conventions,
    entries: Vec<ClipEntry>,
    notes: Vec<String>,
}

/// Frames of a clip and the triangles that they share.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshSequence {
    /// Points `[T, V, 3]`, metres, Y up.
    pub frames: Frames,
    /// Triangles, 0-based.
    pub triangles: Vec<[u32; 3]>,
}

impl<'a> MeshSequences<'a> {
    /// Lists the clips of a source with their frames, in order.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub fn new(source: &'a ScanSource) -> Result<Self> {
        let conventions = source.conventions()?;
        let (fps, assumed) = source.fps()?;
        let entry = |clip: &SourceClip| Ok(ClipEntry { id: clip.id.clone(), frames: source.frame_count(clip)?, fps });
        let entries = source.clips().iter().map(entry).collect::<Result<_>>()?;
        let notes = notes(&conventions, fps, assumed);
        Ok(Self { source, conventions, entries, notes })
    }

    /// The clips.
    pub fn clips(&self) -> &[ClipEntry] {
        &self.entries
    }

    /// What was guessed or assumed, a sentence each.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// Vertices of a clip's first frame.
    ///
    /// # Errors
    /// A clip that is not there, or a frame that cannot be read.
    pub fn vertex_count(&self, id: &ClipId) -> Result<usize> {
        Ok(self.clip(id)?.first_frame(&self.source.config().limits)?.len())
    }

    /// Some frames of a clip, in the order of `wanted`; one that is missing in its folder shows the one before.
    ///
    /// # Errors
    /// A clip that is not there, frames that cannot be read, that have no faces, or whose vertices or faces change from
    /// frame to frame, and [`ImportError::Stopped`].
    pub fn read(&self, id: &ClipId, wanted: &[usize], monitor: &dyn Monitor) -> Result<MeshSequence> {
        let (clip, limits) = (self.clip(id)?, &self.source.config().limits);
        let stray = |frames: usize| wanted.iter().find(|t| **t >= frames).copied();
        let (mut frames, triangles) = match &clip.content {
            Content::Hdf5(file, name) => {
                let opened = file.clip(name, limits)?;
                if let Some(t) = stray(opened.frames) {
                    return Err(clip.refuse(format!("it has {} frames, none of number {t}", opened.frames)));
                }
                let mut frames = Frames::new(opened.vertices);
                for t in wanted {
                    if monitor.should_stop() {
                        return Err(ImportError::Stopped);
                    }
                    frames.push(opened.read(*t..t + 1)?.frame(0));
                }
                (frames, file.faces(limits)?.unwrap_or_default())
            }
            Content::Npz(npz) => {
                let all = npz.read(limits)?;
                if let Some(t) = stray(all.len()) {
                    return Err(clip.refuse(format!("it has {} frames, none of number {t}", all.len())));
                }
                let mut frames = Frames::new(all.points_per_frame());
                wanted.iter().for_each(|t| frames.push(all.frame(*t)));
                (frames, npz.faces(limits)?.unwrap_or_default())
            }
            Content::Files(files) => self.read_files(clip, files, wanted, monitor)?,
        };
        let count = frames.points_per_frame();
        if triangles.is_empty() {
            return Err(clip.refuse("it has points but no faces, so that there is no surface to show".into()));
        }
        if let Some(i) = triangles.iter().flatten().find(|i| **i as usize >= count) {
            return Err(clip.refuse(format!("its faces name vertex {i} of {count}")));
        }
        frames.points_mut().iter_mut().for_each(|p| *p = self.conventions.point(*p));
        Ok(MeshSequence { frames, triangles })
    }

    fn clip(&self, id: &ClipId) -> Result<&SourceClip> {
        let found = self.source.clips().iter().find(|c| c.id == *id);
        found.ok_or_else(|| ImportError::file(self.source.path(), format!("it holds no clip {id}")))
    }

    fn read_files(
        &self,
        clip: &SourceClip,
        files: &FrameFiles,
        wanted: &[usize],
        monitor: &dyn Monitor,
    ) -> Result<(Frames, Vec<[u32; 3]>)> {
        let (mut points, mut first): (Vec<Vec3>, Option<super::FrameMesh>) = (Vec::new(), None);
        for t in wanted {
            if monitor.should_stop() {
                return Err(ImportError::Stopped);
            }
            let before = files.slots.iter().take(t + 1).rev().flatten().next();
            let Some(path) = before else { return Err(clip.refuse(format!("frame {t} is missing"))) };
            let mesh = read_frame(path, &self.source.config().limits)?;
            points.extend(&mesh.positions);
            let like = first.get_or_insert_with(|| mesh.clone());
            if mesh.positions.len() != like.positions.len() || mesh.faces != like.faces {
                return Err(ImportError::file(
                    path,
                    "its vertices or faces are not those of the frames before: register raw scans first (`softtissue import \
                     scans --register`)",
                ));
            }
        }
        let Some(mesh) = first.filter(|m| !m.positions.is_empty()) else {
            return Err(clip.refuse("no frame of it was asked for".into()));
        };
        Ok((Frames::from_points(mesh.positions.len(), points), mesh.triangles()))
    }
}

impl ScanSource {
    fn frame_count(&self, clip: &SourceClip) -> Result<usize> {
        let limits = &self.config().limits;
        Ok(match &clip.content {
            Content::Files(files) => files.slots.len(),
            Content::Hdf5(file, name) => file.clip(name, limits)?.frames,
            Content::Npz(npz) => npz.read(limits)?.len(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scans::ScanImportConfig;
    use softtissue_monitor::Silent;
    use std::path::Path;

    /// A pyramid 1.7 m high that moves along x by 0.1 a frame.
    fn write_frames(root: &Path, faces: impl Fn(usize) -> &'static str) {
        let folder = root.join("anna/hips");
        std::fs::create_dir_all(&folder).unwrap();
        for t in 0..4 {
            let x = 0.1 * t as f32;
            let vertices = format!("v {x} 0 0\nv {} 0 0\nv {x} 0 1\nv {x} 1.7 0\n", x + 1.0);
            std::fs::write(folder.join(format!("f{t:03}.obj")), vertices + faces(t)).unwrap();
        }
    }

    const FACES: &str = "f 1 2 3\nf 1 4 2\nf 2 4 3\nf 3 4 1\n";

    #[test]
    fn chosen_frames_come_with_their_triangles() {
        let dir = tempfile::tempdir().unwrap();
        write_frames(dir.path(), |_| FACES);
        let source = ScanSource::open(dir.path(), &ScanImportConfig::default()).unwrap();
        let sequences = MeshSequences::new(&source).unwrap();
        let id = ClipId::new("anna", "hips", 0);
        let entry = &sequences.clips()[0];
        assert_eq!((&entry.id, entry.frames, entry.fps), (&id, 4, 60.0));
        assert_eq!(sequences.vertex_count(&id).unwrap(), 4);
        let read = sequences.read(&id, &[1, 3], &Silent).unwrap();
        assert_eq!(read.triangles.len(), 4);
        let first: Vec<f32> = read.frames.iter().map(|f| f[0].x).collect();
        assert_eq!(first, [0.1, 0.3]);
        let says = |wanted: &[usize], id: &ClipId| sequences.read(id, wanted, &Silent).unwrap_err().to_string();
        assert!(says(&[], &id).contains("no frame of it"));
        assert!(says(&[0], &ClipId::new("bert", "hips", 0)).contains("bert/hips.0"));
    }

    #[test]
    fn raw_scans_and_points_have_no_surface_that_moves() {
        let dir = tempfile::tempdir().unwrap();
        write_frames(dir.path(), |t| if t < 2 { FACES } else { "f 1 2 3\n" });
        let read = |wanted: &[usize]| {
            let source = ScanSource::open(dir.path(), &ScanImportConfig::default()).unwrap();
            let sequences = MeshSequences::new(&source).unwrap();
            sequences.read(&ClipId::new("anna", "hips", 0), wanted, &Silent)
        };
        assert!(read(&[0, 1]).is_ok());
        let refused = read(&[0, 1, 2]).unwrap_err().to_string();
        assert!(refused.contains("f002.obj") && refused.contains("--register"), "{refused}");
        write_frames(dir.path(), |_| "");
        assert!(read(&[0, 1]).unwrap_err().to_string().contains("no faces"));
    }
}
