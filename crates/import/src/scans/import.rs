use super::files::{FrameFiles, read_frame};
use super::frame_mesh::{Oddities, Template};
use super::hdf5::Hdf5Clip;
use super::source::{Content, SourceClip};
use super::{Conventions, ScanSource};
use crate::{ImportError, ImportLimits, Result};
use glam::Vec3;
use serde_json::{Value, json};
use softtissue_clips::{ClipEntry, ClipId, ScanClip, ScanSet, interpolate_missing};
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
    let mut odd = OddClips::default();
    for clip in source.clips() {
        if monitor.should_stop() {
            return Err(ImportError::Stopped);
        }
        let limits = &source.config().limits;
        let reader = ClipReader { clip, template: &template, conventions: &conventions, limits };
        let Read { frames: vertices, missing, has_faces, oddities } = reader.read(monitor)?;
        unchecked += usize::from(!has_faces);
        let id = clip.id.clone();
        odd.take(&id, oddities);
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
        notes.push(format!(
            "{unchecked} clips come without faces: vertices of another order are found where they tear the body only"
        ));
    }
    notes.extend(odd.notes());
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

/// What was odd about the faces of all clips.
#[derive(Default)]
struct OddClips {
    flipped: Vec<ClipId>,
    crowded: Vec<(ClipId, [u32; 2])>,
}

impl OddClips {
    fn take(&mut self, id: &ClipId, found: Oddities) {
        self.flipped.extend(found.flipped.then(|| id.clone()));
        self.crowded.extend(found.crowded_edge.map(|edge| (id.clone(), edge)));
    }

    /// A sentence for each kind.
    fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        if let Some(first) = self.flipped.first() {
            let count = self.flipped.len();
            notes
                .push(format!("the faces of {count} clips ({first} first) are wound inwards; the template's are used"));
        }
        if let Some((first, [a, b])) = self.crowded.first() {
            let count = self.crowded.len();
            notes.push(format!(
                "in {count} clips ({first} first) more than two faces share an edge (that of vertices {a} and {b}); the \
                 template's faces are used"
            ));
        }
        notes
    }
}

/// A clip in our conventions.
struct Read {
    frames: Frames,
    /// Which frames were missing.
    missing: Vec<usize>,
    /// Whether connectivity could be checked.
    has_faces: bool,
    oddities: Oddities,
}

struct ClipReader<'a> {
    clip: &'a SourceClip,
    template: &'a Template<'a>,
    conventions: &'a Conventions,
    limits: &'a ImportLimits,
}

impl ClipReader<'_> {
    fn read(&self, monitor: &dyn Monitor) -> Result<Read> {
        match &self.clip.content {
            Content::Files(files) => self.read_files(files, monitor),
            Content::Hdf5(file, name) => {
                let clip = file.clip(name, self.limits)?;
                self.template.check_count(clip.vertices).map_err(|reason| self.clip.refuse(reason))?;
                let faces = file.faces(self.limits)?;
                let oddities = self.check_triangles(faces.as_deref())?;
                let frames = self.read_hdf5(&clip, monitor)?;
                Ok(Read { frames, missing: vec![], has_faces: faces.is_some(), oddities })
            }
            Content::Npz(clip) => {
                let mut frames = clip.read(self.limits)?;
                self.template.check_count(frames.points_per_frame()).map_err(|reason| self.clip.refuse(reason))?;
                let faces = clip.faces(self.limits)?;
                let oddities = self.check_triangles(faces.as_deref())?;
                for t in 0..frames.len() {
                    self.convert(frames.frame_mut(t), t == 0)
                        .map_err(|reason| self.clip.refuse(format!("frame {t}: {reason}")))?;
                }
                Ok(Read { frames, missing: vec![], has_faces: faces.is_some(), oddities })
            }
        }
    }

    fn check_triangles(&self, faces: Option<&[[u32; 3]]>) -> Result<Oddities> {
        let faces = faces.unwrap_or_default().iter().map(|f| f.as_slice());
        self.template.check_faces(faces).map_err(|reason| self.clip.refuse(reason))
    }

    /// Metres, Y up, and tall as a person; and, of a first frame or one from a file of its own, in the template's order.
    fn convert(&self, frame: &mut [Vec3], whole: bool) -> std::result::Result<(), String> {
        frame.iter_mut().for_each(|p| *p = self.conventions.point(*p));
        self.conventions.check_height(frame)?;
        if whole { self.template.check_shape(frame) } else { Ok(()) }
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
                self.convert(part.frame_mut(t), start + t == 0)
                    .map_err(|reason| self.clip.refuse(format!("frame {}: {reason}", start + t)))?;
                frames.push(part.frame(t));
            }
        }
        Ok(frames)
    }

    fn read_files(&self, files: &FrameFiles, monitor: &dyn Monitor) -> Result<Read> {
        let count = self.template.topology.vertex_count;
        if files.slots.len().saturating_mul(count) > self.limits.clip_points {
            let reason = format!("{} frames are too many for one clip; split it", files.slots.len());
            return Err(self.clip.refuse(reason));
        }
        let mut frames = Frames::zeros(count, files.slots.len());
        let (mut has_faces, mut oddities) = (true, Oddities::default());
        let mut last_faces: Option<Vec<Vec<u32>>> = None;
        for (t, path) in files.slots.iter().enumerate() {
            let Some(path) = path else { continue };
            if monitor.should_stop() {
                return Err(ImportError::Stopped);
            }
            let bad = |reason: String| ImportError::file(path, reason);
            let mesh = read_frame(path, self.limits)?;
            self.template.check_count(mesh.positions.len()).map_err(bad)?;
            has_faces &= !mesh.faces.is_empty();
            // as a rule every frame has the same faces
            if last_faces.as_ref() != Some(&mesh.faces) {
                let found = self.template.check_faces(mesh.faces.iter().map(Vec::as_slice)).map_err(bad)?;
                oddities.flipped |= found.flipped;
                oddities.crowded_edge = oddities.crowded_edge.or(found.crowded_edge);
                last_faces = Some(mesh.faces);
            }
            let frame = frames.frame_mut(t);
            frame.copy_from_slice(&mesh.positions);
            self.convert(frame, true).map_err(bad)?;
        }
        let missing = files.missing();
        interpolate_missing(&mut frames, &missing);
        Ok(Read { frames, missing, has_faces, oddities })
    }
}
