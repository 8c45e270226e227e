use super::files::{FrameFiles, read_frame};
use super::frame_mesh::Template;
use super::hdf5::Hdf5Clip;
use super::source::{Content, SourceClip};
use super::{Conventions, ScanSource};
use crate::{ImportError, ImportLimits, Result};
use glam::Vec3;
use serde_json::{Value, json};
use softtissue_clips::{ClipEntry, ScanClip, ScanSet, interpolate_missing};
use softtissue_geometry::{Frames, Topology};
use softtissue_monitor::Monitor;
use std::path::Path;

/// Brings registered scans into a set at `out`. Every frame must have the template's vertex count and, where faces are
/// at hand, its connectivity. What was guessed is said and stands in the set's provenance.
///
/// # Errors
/// The first frame, clip or file that is refused, by name; nothing is left that looks finished.
pub fn import_scans(source: &ScanSource, template: &Topology, out: &Path, monitor: &dyn Monitor) -> Result<ScanSet> {
    let conventions = source.conventions()?;
    let (fps, assumed) = source.fps()?;
    let template = Template::new(template);
    ScanSet::begin(out)?;
    monitor.begin("import", source.clips().len() as u64, "clips");
    let (mut entries, mut filled, mut unchecked) = (Vec::new(), serde_json::Map::new(), 0);
    for clip in source.clips() {
        if monitor.should_stop() {
            return Err(ImportError::Stopped);
        }
        let limits = &source.config().limits;
        let reader = ClipReader { clip, template: &template, conventions: &conventions, limits };
        let (vertices, missing, has_faces) = reader.read(monitor)?;
        unchecked += usize::from(!has_faces);
        let id = clip.id.clone();
        if !missing.is_empty() {
            filled.insert(id.to_string(), json!(missing));
        }
        let scan = ScanClip { id: id.clone(), fps, vertices };
        scan.write(&ScanSet::scan_path(out, &id))?;
        monitor.advance(1, &id.to_string());
        entries.push(ClipEntry { id, frames: scan.vertices.len(), fps });
    }
    monitor.end();
    let mut notes = notes(&conventions, fps, assumed);
    if unchecked > 0 {
        notes.push(format!("{unchecked} clips come without faces: only their vertex count could be checked"));
    }
    if !filled.is_empty() {
        notes.push(format!("frames were missing in {} clips and are interpolated", filled.len()));
    }
    notes.iter().for_each(|note| monitor.say(&format!("  import: {note}")));
    let provenance = provenance(source, &conventions, fps, &notes, &filled);
    let count = template.topology.vertex_count;
    Ok(ScanSet::finish(out, count, &template.topology.hash(), provenance, entries)?)
}

/// What was guessed or assumed, a sentence each.
pub(crate) fn notes(conventions: &Conventions, fps: f32, assumed: bool) -> Vec<String> {
    let mut notes: Vec<String> = conventions.guessed.iter().map(|g| format!("guessed that {g}")).collect();
    if assumed {
        notes.push(format!("assumed {fps} frames a second, since no file says (--fps says otherwise)"));
    }
    notes
}

/// Where scans came from, for a set's index.
pub(crate) fn provenance(
    source: &ScanSource,
    conventions: &Conventions,
    fps: f32,
    notes: &[String],
    filled: &serde_json::Map<String, Value>,
) -> Value {
    let name = source.path().file_name().map(|n| n.to_string_lossy().into_owned());
    json!({
        "source": source.format(), "name": name, "units": conventions.units, "up": conventions.up, "fps": fps,
        "notes": notes, "interpolated_frames": filled,
    })
}

struct ClipReader<'a> {
    clip: &'a SourceClip,
    template: &'a Template<'a>,
    conventions: &'a Conventions,
    limits: &'a ImportLimits,
}

impl ClipReader<'_> {
    /// Frames in our conventions, which of them were missing, and whether connectivity could be checked.
    fn read(&self, monitor: &dyn Monitor) -> Result<(Frames, Vec<usize>, bool)> {
        match &self.clip.content {
            Content::Files(files) => self.read_files(files, monitor),
            Content::Hdf5(file, name) => {
                let clip = file.clip(name, self.limits)?;
                self.template.check_count(clip.vertices).map_err(|reason| self.clip.refuse(reason))?;
                let faces = file.faces(self.limits)?;
                self.check_triangles(faces.as_deref())?;
                Ok((self.read_hdf5(&clip, monitor)?, vec![], faces.is_some()))
            }
            Content::Npz(clip) => {
                let mut frames = clip.read(self.limits)?;
                self.template.check_count(frames.points_per_frame()).map_err(|reason| self.clip.refuse(reason))?;
                let faces = clip.faces()?;
                self.check_triangles(faces.as_deref())?;
                for t in 0..frames.len() {
                    self.convert(frames.frame_mut(t))
                        .map_err(|reason| self.clip.refuse(format!("frame {t}: {reason}")))?;
                }
                Ok((frames, vec![], faces.is_some()))
            }
        }
    }

    fn check_triangles(&self, faces: Option<&[[u32; 3]]>) -> Result<()> {
        let faces = faces.unwrap_or_default().iter().map(|f| f.as_slice());
        self.template.check_faces(faces).map_err(|reason| self.clip.refuse(reason))
    }

    /// Metres, Y up, and tall as a person.
    fn convert(&self, frame: &mut [Vec3]) -> std::result::Result<(), String> {
        frame.iter_mut().for_each(|p| *p = self.conventions.point(*p));
        self.conventions.check_height(frame)
    }

    fn read_hdf5(&self, clip: &Hdf5Clip, monitor: &dyn Monitor) -> Result<Frames> {
        let mut frames = Frames::new(clip.vertices);
        let step = clip.frames_a_read();
        for start in (0..clip.frames).step_by(step) {
            if monitor.should_stop() {
                return Err(ImportError::Stopped);
            }
            let mut part = clip.read(start..(start + step).min(clip.frames))?;
            for t in 0..part.len() {
                self.convert(part.frame_mut(t))
                    .map_err(|reason| self.clip.refuse(format!("frame {}: {reason}", start + t)))?;
                frames.push(part.frame(t));
            }
        }
        Ok(frames)
    }

    fn read_files(&self, files: &FrameFiles, monitor: &dyn Monitor) -> Result<(Frames, Vec<usize>, bool)> {
        let count = self.template.topology.vertex_count;
        if files.slots.len().saturating_mul(count) > self.limits.clip_points {
            let reason = format!("{} frames are too many for one clip; split it", files.slots.len());
            return Err(self.clip.refuse(reason));
        }
        let mut frames = Frames::zeros(count, files.slots.len());
        let mut has_faces = true;
        for (t, path) in files.slots.iter().enumerate() {
            let Some(path) = path else { continue };
            if monitor.should_stop() {
                return Err(ImportError::Stopped);
            }
            let bad = |reason: String| ImportError::file(path, reason);
            let mesh = read_frame(path, self.limits)?;
            self.template.check_count(mesh.positions.len()).map_err(bad)?;
            self.template.check_faces(mesh.faces.iter().map(Vec::as_slice)).map_err(bad)?;
            has_faces &= !mesh.faces.is_empty();
            let frame = frames.frame_mut(t);
            frame.copy_from_slice(&mesh.positions);
            self.convert(frame).map_err(bad)?;
        }
        let missing = files.missing();
        interpolate_missing(&mut frames, &missing);
        Ok((frames, missing, has_faces))
    }
}
