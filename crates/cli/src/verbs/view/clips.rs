//! Single clips of ours.

use super::choice::Asked;
use super::sets::{part_of_scan, scans};
use super::shown::{Shown, no_body};
use crate::exit::InputError;
use crate::verbs::near::BodyFinder;
use anyhow::Result;
use softtissue_body::BodyModel;
use softtissue_clips::{ClipEntry, ClipFile, MotionClip, ScanSet};
use softtissue_eval::viewer::{Layer, ViewClip};
use softtissue_geometry::Frames;
use softtissue_monitor::Monitor;
use std::path::Path;

/// A scan clip: within its set, where it lies in one.
pub fn scan(path: &Path, asked: &Asked, finder: &BodyFinder, monitor: &dyn Monitor) -> Result<Shown> {
    let file = ClipFile::scan(path)?;
    let folders = std::path::absolute(path)?;
    if let Some(root) = folders.parent().and_then(Path::parent)
        && let Ok(set) = ScanSet::open(root)
        && set.ids().contains(&file.id)
    {
        return scans(root, &asked.or_only(&file.id), finder, monitor);
    }
    let body = finder.of_vertices(file.points, None).ok_or_else(|| no_body(path, file.points))?;
    let entry = ClipEntry { id: file.id.clone(), frames: file.frames, fps: file.fps };
    let (pick, notes) = asked.only(&entry, file.points, path)?;
    let clip = part_of_scan(&file, &pick)?;
    Ok(Shown::on(&body, path, about("Scan", &entry), vec![clip], notes))
}

/// Deltas, on the body at rest.
pub fn deltas(path: &Path, asked: &Asked, finder: &BodyFinder) -> Result<Shown> {
    let file = ClipFile::deltas(path)?;
    let body = finder.of_vertices(file.points, None).ok_or_else(|| no_body(path, file.points))?;
    let entry = ClipEntry { id: file.id.clone(), frames: file.frames, fps: file.fps };
    let (pick, notes) = asked.only(&entry, 2 * file.points, path)?;
    let (mut still, mut moved) = (Frames::new(file.points), Frames::new(file.points));
    for t in pick.frames() {
        still.push(&body.template);
        moved.push(file.read(t..t + 1)?.frame(0));
    }
    let layers = vec![
        Layer { key: "deltas", label: "Deltas".into(), over: Some("alone"), frames: moved },
        Layer { key: "alone", label: "Body at rest".into(), over: None, frames: still },
    ];
    let clip = ViewClip {
        name: file.id.to_string(),
        fps: file.fps / pick.every as f32,
        start_s: pick.start as f32 / file.fps,
        layers,
    };
    let about = about("Deltas, on the mean body at rest", &entry);
    Ok(Shown::on(&body, path, about, vec![clip], notes))
}

/// A motion, on the mean body.
pub fn motion(path: &Path, asked: &Asked, finder: &BodyFinder) -> Result<Shown> {
    let clip = MotionClip::read(path)?;
    let joints = clip.rotations.points_per_frame();
    let body = finder.of_joints(joints).ok_or_else(|| {
        InputError(format!(
            "{} moves {joints} joints, and no body with so many was found near it: name it with --body FILE",
            path.display()
        ))
    })?;
    posed(path, "Motion, on the mean body", &clip, &body, asked)
}

/// A motion on the mean shape of a body.
pub fn posed(path: &Path, what: &str, clip: &MotionClip, body: &BodyModel, asked: &Asked) -> Result<Shown> {
    let entry = ClipEntry { id: clip.id.clone(), frames: clip.len(), fps: clip.fps };
    let (pick, notes) = asked.only(&entry, body.vertex_count(), path)?;
    let (mut rotations, mut translations) = (Frames::new(body.joint_count()), Vec::new());
    for t in pick.frames() {
        rotations.push(clip.rotations.frame(t));
        translations.push(clip.translations[t]);
    }
    let frames = body.posed_frames(&body.shaped(&[]), &rotations, &translations, None);
    let shown = ViewClip {
        name: clip.id.to_string(),
        fps: clip.fps / pick.every as f32,
        start_s: pick.start as f32 / clip.fps,
        layers: vec![Layer { key: "alone", label: "Body alone".into(), over: None, frames }],
    };
    Ok(Shown::on(body, path, about(what, &entry), vec![shown], notes))
}

/// A clip in a line.
pub fn about(what: &str, clip: &ClipEntry) -> String {
    let seconds = clip.frames as f32 / clip.fps;
    format!("{what}: {}, {} frames at {} a second, {seconds:.1} s.", clip.id, clip.frames, clip.fps)
}
