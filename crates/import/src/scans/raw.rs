use super::files::read_frame;
use super::frame_mesh::turn_outwards;
use super::hdf5::Hdf5Clip;
use super::import::{notes, provenance};
use super::source::Content as Listed;
use super::{Conventions, ScanSource};
use crate::{ImportError, Result};
use glam::Vec3;
use softtissue_clips::{ClipEntry, ClipError, ClipId, RawFrame, RawScans};
use softtissue_geometry::vertex_normals;
use std::path::PathBuf;

/// Raw scans of a source, read frame by frame when they are asked for, in metres with Y up.
pub struct RawScanSource {
    conventions: Conventions,
    limits: crate::ImportLimits,
    clips: Vec<(ClipEntry, Content)>,
    notes: Vec<String>,
    provenance: serde_json::Value,
}

enum Content {
    /// A file a frame, `None` where one is missing.
    Files(Vec<Option<PathBuf>>),
    /// A dataset and its triangles, which are empty where the file has none.
    Hdf5(Box<Hdf5Clip>, Vec<[u32; 3]>),
}

impl RawScanSource {
    /// Takes the sequences of a source as raw scans, whatever their topology.
    ///
    /// # Errors
    /// An npz file, which cannot be read by frames, or a first frame that cannot be read.
    pub fn new(source: &ScanSource) -> Result<Self> {
        let conventions = source.conventions()?;
        let (fps, assumed) = source.fps()?;
        let limits = source.config().limits;
        let mut clips = Vec::new();
        for clip in source.clips() {
            let (frames, content) = match &clip.content {
                Listed::Files(files) => (files.slots.len(), Content::Files(files.slots.clone())),
                Listed::Hdf5(file, name) => {
                    let opened = file.clip(name, &limits)?;
                    let faces = file.faces(&limits)?.unwrap_or_default();
                    if let Some(face) = faces.iter().flatten().find(|i| **i as usize >= opened.vertices) {
                        return Err(clip.refuse(format!("its faces name vertex {face} of {}", opened.vertices)));
                    }
                    (opened.frames, Content::Hdf5(Box::new(opened), faces))
                }
                Listed::Npz(_) => {
                    return Err(clip.refuse("npz cannot be registered anew; write PLY frames or HDF5".into()));
                }
            };
            clips.push((ClipEntry { id: clip.id.clone(), frames, fps }, content));
        }
        let notes = notes(&conventions, fps, assumed);
        let mut raw = Self { conventions, limits, clips, notes, provenance: serde_json::Value::Null };
        if let Some((entry, content)) = raw.clips.first()
            && raw.read(content, 0)?.is_some_and(|(_, turned)| turned)
        {
            raw.notes.push(format!("faces or normals of {} look inwards and are turned round", entry.id));
        }
        raw.provenance = provenance(source, &raw.conventions, fps, &raw.notes, &serde_json::Map::new());
        Ok(raw)
    }

    /// What was guessed or assumed, a sentence each.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// A frame, and whether its normals looked inwards.
    fn read(&self, content: &Content, t: usize) -> Result<Option<(RawFrame, bool)>> {
        let (points, normals, path) = match content {
            Content::Files(slots) => {
                let Some(path) = slots.get(t).and_then(Option::as_ref) else { return Ok(None) };
                let mesh = read_frame(path, &self.limits)?;
                let normals = mesh.normals_or_from_faces();
                (mesh.positions, normals, path.as_path())
            }
            Content::Hdf5(clip, faces) => {
                let points = clip.read(t..t + 1)?.frame(0).to_vec();
                let normals = if faces.is_empty() { vec![] } else { vertex_normals(&points, faces) };
                (points, normals, clip.path())
            }
        };
        let points: Vec<Vec3> = points.into_iter().map(|p| self.conventions.point(p)).collect();
        let normals = normals.into_iter().map(|n| self.conventions.up.y_up(n).normalize_or_zero());
        let mut normals: Vec<Vec3> = normals.collect();
        let turned = turn_outwards(&points, &mut normals);
        self.conventions
            .check_height(&points)
            .map_err(|reason| ImportError::file(path, format!("frame {t}: {reason}")))?;
        Ok(Some((RawFrame { points, normals }, turned)))
    }
}

impl RawScans for RawScanSource {
    fn clips(&self) -> Vec<ClipEntry> {
        self.clips.iter().map(|(entry, _)| entry.clone()).collect()
    }

    fn frame(&self, id: &ClipId, t: usize) -> softtissue_clips::Result<Option<RawFrame>> {
        let Some((_, content)) = self.clips.iter().find(|(entry, _)| entry.id == *id) else { return Ok(None) };
        let read = self.read(content, t).map_err(|e| ClipError::Raw(Box::new(e)))?;
        Ok(read.map(|(frame, _)| frame))
    }

    fn provenance(&self) -> serde_json::Value {
        self.provenance.clone()
    }
}
