//! Scans, meshes and motions of foreign formats.

use super::choice::Asked;
use super::clips::posed;
use super::shown::{Shown, title};
use crate::args::MotionSourceArgs;
use crate::exit::InputError;
use crate::verbs::foreign_motion::moved;
use crate::verbs::near::BodyFinder;
use anyhow::Result;
use softtissue_body::Skeleton;
use softtissue_clips::{ClipEntry, ClipId};
use softtissue_eval::viewer::{Layer, ViewClip};
use softtissue_geometry::Frames;
use softtissue_import::ImportLimits;
use softtissue_import::read_obj_frame;
use softtissue_import::scans::{Conventions, FrameMesh, MeshSequences, ScanImportConfig, ScanSource, read_ply};
use softtissue_monitor::Monitor;
use std::path::Path;

/// Whether a folder has anything that scans could lie in: folders, or files of several frames.
pub fn may_hold_scans(path: &Path) -> bool {
    let mut entries = std::fs::read_dir(path).into_iter().flatten().flatten().map(|e| e.path());
    let whole =
        |p: &Path| p.extension().is_some_and(|e| ["hdf5", "h5", "npz"].iter().any(|k| e.eq_ignore_ascii_case(k)));
    entries.any(|p| p.is_dir() || whole(&p))
}

/// Registered scans, or any meshes whose vertices keep their order.
pub fn scans(path: &Path, asked: &Asked, monitor: &dyn Monitor) -> Result<Shown> {
    let source = ScanSource::open(path, &ScanImportConfig { fill_gaps: true, ..ScanImportConfig::default() })?;
    let sequences = MeshSequences::new(&source)?;
    let listed = sequences.clips();
    let Some(first) = listed.first() else {
        return Err(InputError(format!("{} holds no clip", path.display())).into());
    };
    let ids: Vec<ClipId> = listed.iter().map(|c| c.id.clone()).collect();
    let chosen = asked.choose(listed, &ids, sequences.vertex_count(&first.id)?, path)?;
    let mut notes = chosen.notes;
    let (mut clips, mut faces) = (Vec::new(), Vec::new());
    for (id, pick) in &chosen.clips {
        let wanted: Vec<usize> = pick.frames().collect();
        let read = sequences.read(id, &wanted, monitor)?;
        if clips.is_empty() {
            faces = read.triangles;
        } else if faces != read.triangles {
            notes.push(format!("{id} is left out: its faces are not those of {}.", chosen.clips[0].0));
            continue;
        }
        clips.push(ViewClip {
            name: id.to_string(),
            fps: first.fps / pick.every as f32,
            start_s: pick.start as f32 / first.fps,
            layers: vec![scan(read.frames)],
        });
    }
    notes.extend(sequences.notes().iter().map(|note| sentence(note)));
    let about = format!("{}: {} clips.", source.format(), listed.len());
    Ok(Shown { title: title(path), about, notes, faces, regions: None, reference: None, clips })
}

fn scan(frames: Frames) -> Layer {
    Layer { key: "scan", label: "Scan".into(), over: None, frames }
}

fn sentence(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).chain(['.']).collect())
}

/// One OBJ or PLY mesh.
pub fn mesh(path: &Path, asked: &Asked, is_ply: bool) -> Result<Shown> {
    let limits = ImportLimits::default();
    let mesh: FrameMesh = if is_ply { read_ply(path, &limits)? } else { read_obj_frame(path, &limits)?.into() };
    let faces = mesh.triangles();
    if faces.is_empty() {
        let message = format!("{} is a cloud of points, which has no surface to show", path.display());
        return Err(InputError(message).into());
    }
    let conventions = Conventions::of(&mesh.positions, None, None);
    let points = mesh.positions.iter().map(|p| conventions.point(*p)).collect();
    let frames = Frames::from_points(mesh.positions.len(), points);
    let entry = ClipEntry { id: ClipId::new("mesh", "still", 0), frames: 1, fps: 1.0 };
    asked.only(&entry, mesh.positions.len(), path)?;
    let clip = ViewClip { name: title(path), fps: 1.0, start_s: 0.0, layers: vec![scan(frames)] };
    Ok(Shown {
        title: title(path),
        about: format!("Mesh of {} vertices and {} triangles.", mesh.positions.len(), faces.len()),
        notes: conventions.guessed.iter().map(|g| format!("Guessed that {g}.")).collect(),
        faces,
        regions: None,
        reference: None,
        clips: vec![clip],
    })
}

/// A motion, put onto the mean body.
pub fn motion(path: &Path, foreign: &MotionSourceArgs, asked: &Asked, finder: &BodyFinder) -> Result<Shown> {
    let read = foreign.read(path)?;
    let joints = Skeleton::smpl().len();
    let body = finder.of_joints(joints).ok_or_else(|| {
        InputError(format!("the body of --body has no skeleton of {joints} joints, onto which motions are put"))
    })?;
    let moved = moved(path, &read, &body, &body.shaped(&[]), None)?;
    let mut shown = posed(path, "Foreign motion, put onto the mean body", &moved.clip, &body, asked)?;
    shown.notes.push(format!("{}.", moved.line));
    Ok(shown)
}
