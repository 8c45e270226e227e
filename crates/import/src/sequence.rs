use crate::obj::{ImportLimits, ObjFrame, read_obj_frame};
use crate::{ImportError, Result, natural_cmp};
use glam::Vec3;
use serde::{Deserialize, Serialize};
use softtissue_clips::{ClipEntry, ClipId, ScanClip, ScanSet};
use softtissue_geometry::{Frames, Topology};
use softtissue_monitor::Monitor;
use std::collections::HashSet;
use std::path::{Path, PathBuf};

/// Length unit of foreign coordinates.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Units {
    /// Metres.
    Metres,
    /// Centimetres.
    Centimetres,
    /// Millimetres.
    Millimetres,
}

impl Units {
    /// Metres in one unit.
    pub fn metres(self) -> f32 {
        match self {
            Self::Metres => 1.0,
            Self::Centimetres => 0.01,
            Self::Millimetres => 0.001,
        }
    }
}

/// How a folder of OBJ sequences is read.
#[derive(Clone, Copy, Debug)]
pub struct SequenceConfig {
    /// Frames a second of every sequence.
    pub fps: f32,
    /// Unit of the coordinates.
    pub units: Units,
    /// Limits.
    pub limits: ImportLimits,
}

/// A person's extent along Y, in any pose that a protocol asks for, metres.
const PLAUSIBLE_HEIGHT: std::ops::RangeInclusive<f32> = 0.4..=2.8;

/// Reads `source/SUBJECT/MOTION[.TAKE]/*.obj` into a scan set at `out`. Every frame must have the template's
/// vertex count and, where it has faces, its connectivity: order of vertices is correspondence.
pub fn import_obj_sequences(
    source: &Path,
    template: &Topology,
    config: &SequenceConfig,
    out: &Path,
    monitor: &dyn Monitor,
) -> Result<ScanSet> {
    if !(config.fps.is_finite() && config.fps > 0.0 && config.fps <= 1000.0) {
        return Err(ImportError::file(
            source,
            format!("the rate {} is not between 0 and 1000 frames a second; pass --fps", config.fps),
        ));
    }
    let sequences = find_sequences(source)?;
    ScanSet::begin(out)?;
    monitor.begin("import", sequences.len() as u64, "clips");
    let template_edges: HashSet<[u32; 2]> = template.edges().into_iter().collect();
    let mut entries = Vec::new();
    for (id, folder) in sequences {
        if monitor.should_stop() {
            return Err(ImportError::Stopped);
        }
        let vertices = read_sequence(&folder, template, &template_edges, config)?;
        let clip = ScanClip { id: id.clone(), fps: config.fps, vertices };
        clip.write(&ScanSet::scan_path(out, &id))?;
        monitor.advance(1, &id.to_string());
        entries.push(ClipEntry { id, frames: clip.vertices.len(), fps: config.fps });
    }
    monitor.end();
    let provenance =
        serde_json::json!({"source": "OBJ sequences", "units": config.units, "up": "y", "fps": config.fps});
    Ok(ScanSet::finish(out, template.vertex_count, &template.hash(), provenance, entries)?)
}

fn find_sequences(source: &Path) -> Result<Vec<(ClipId, PathBuf)>> {
    let (mut sequences, mut seen) = (Vec::new(), HashSet::new());
    for (subject, folder) in folders(source)? {
        for (motion, folder) in folders(&folder)? {
            let id = format!("{subject}/{motion}").parse::<ClipId>().map_err(|_| {
                ImportError::file(
                    &folder,
                    "its name and its subject's must be letters, digits, _ and -, with .TAKE at the end where there \
                     are several; rename it",
                )
            })?;
            if !seen.insert(id.clone()) {
                return Err(ImportError::file(
                    &folder,
                    format!("it is a second clip named {id}; give it another take"),
                ));
            }
            sequences.push((id, folder));
        }
    }
    if sequences.is_empty() {
        return Err(ImportError::file(source, "it holds no SUBJECT/MOTION folder with OBJ files"));
    }
    Ok(sequences)
}

fn folders(path: &Path) -> Result<Vec<(String, PathBuf)>> {
    let mut found: Vec<(String, PathBuf)> = names(path)?.into_iter().filter(|(_, p)| p.is_dir()).collect();
    found.sort_by(|a, b| natural_cmp(&a.0, &b.0));
    Ok(found)
}

fn names(path: &Path) -> Result<Vec<(String, PathBuf)>> {
    let entries = std::fs::read_dir(path).map_err(|e| softtissue_store::StoreError::io("read", path, e))?;
    Ok(entries.flatten().map(|e| (e.file_name().to_string_lossy().into_owned(), e.path())).collect())
}

fn read_sequence(
    folder: &Path,
    template: &Topology,
    edges: &HashSet<[u32; 2]>,
    config: &SequenceConfig,
) -> Result<Frames> {
    let is_obj = |name: &str| name.len() > 4 && name[name.len() - 4..].eq_ignore_ascii_case(".obj");
    let mut files: Vec<(String, PathBuf)> = names(folder)?
        .into_iter()
        .filter(|(name, p)| name.is_char_boundary(name.len().saturating_sub(4)) && is_obj(name) && p.is_file())
        .collect();
    files.sort_by(|a, b| natural_cmp(&a.0, &b.0));
    match files.len() {
        0 => return Err(ImportError::file(folder, "it holds no frame (*.obj); remove the folder or add its frames")),
        1 => {
            return Err(ImportError::file(
                folder,
                "it holds one frame, which has no velocity; a clip needs at least two",
            ));
        }
        n if n > config.limits.frames => {
            return Err(ImportError::file(folder, format!("{n} frames are more than {}", config.limits.frames)));
        }
        _ => {}
    }
    let mut frames = Frames::new(template.vertex_count);
    for (_, path) in files {
        let frame = read_obj_frame(&path, &config.limits)?;
        check_topology(&path, &frame, template, edges)?;
        let scaled: Vec<Vec3> = frame.positions.iter().map(|p| *p * config.units.metres()).collect();
        check_height(&path, &scaled)?;
        frames.push(&scaled);
    }
    Ok(frames)
}

fn check_topology(path: &Path, frame: &ObjFrame, template: &Topology, edges: &HashSet<[u32; 2]>) -> Result<()> {
    let count = frame.positions.len();
    if count != template.vertex_count {
        return Err(ImportError::file(
            path,
            format!(
                "{count} vertices, but the template has {}; register the scan to the template first",
                template.vertex_count
            ),
        ));
    }
    // Quads may be split along either diagonal, so polygons are compared by their border edges.
    for (f, corners) in frame.faces.iter().enumerate() {
        let border = (0..corners.len()).map(|k| [corners[k], corners[(k + 1) % corners.len()]]);
        let foreign = border.map(|[a, b]| [a.min(b), a.max(b)]).filter(|edge| !edges.contains(edge)).count();
        if foreign > usize::from(corners.len() == 3) {
            return Err(ImportError::file(
                path,
                format!(
                    "face {} joins vertices that the template does not: same count, other connectivity; export in the template's vertex order",
                    f + 1
                ),
            ));
        }
    }
    Ok(())
}

fn check_height(path: &Path, vertices: &[Vec3]) -> Result<()> {
    let (low, high) = vertices.iter().fold((f32::MAX, f32::MIN), |(l, h), p| (l.min(p.y), h.max(p.y)));
    let height = high - low;
    if PLAUSIBLE_HEIGHT.contains(&height) {
        return Ok(());
    }
    let hint = match height {
        h if (40.0..=280.0).contains(&h) => "bring it in by `softtissue import scans --units centimetres`",
        h if (400.0..=2800.0).contains(&h) => "bring it in by `softtissue import scans --units millimetres`",
        _ => "coordinates are expected in metres with Y up; turn or scale it, or use `softtissue import scans --units`",
    };
    Err(ImportError::file(path, format!("the body is {height:.2} m tall: {hint}")))
}
