//! Sets: scans, with their truth where it lies beside them, and fits.

use super::choice::Asked;
use super::shown::{Shown, no_body};
use crate::verbs::near::BodyFinder;
use anyhow::Result;
use softtissue_body::BodyModel;
use softtissue_clips::{ClipFile, ClipId, FitSet, ScanSet, TruthSet};
use softtissue_eval::EvalError;
use softtissue_eval::viewer::{Layer, Pick, ViewClip, fitted, true_clip};
use softtissue_geometry::Frames;
use softtissue_monitor::Monitor;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A folder's neighbour; without a name the folder that holds both.
pub fn beside(path: &Path, name: &str) -> PathBuf {
    let whole = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    whole.parent().unwrap_or(&whole).join(name)
}

/// Layers of a scan with its truth, and of a fit.
const LAYERS: (usize, usize) = (3, 2);

/// A scan set; `truth` beside it is opened too.
pub fn scans(path: &Path, asked: &Asked, finder: &BodyFinder, monitor: &dyn Monitor) -> Result<Shown> {
    let set = ScanSet::open(path)?;
    let body = body_of(path, set.vertex_count(), set.topology(), finder)?;
    let truth = Some(beside(path, "truth")).filter(|p| p.join("subjects.json").exists());
    let truth = truth.map(|p| TruthSet::open(&p)).transpose()?;
    let points = set.vertex_count() * if truth.is_some() { LAYERS.0 } else { 1 };
    let chosen = asked.choose(set.clips(), &set.ids(), points, path)?;
    let mut clips = Vec::new();
    for (id, pick) in &chosen.clips {
        if monitor.should_stop() {
            return Err(EvalError::Stopped.into());
        }
        clips.push(match &truth {
            Some(truth) => true_clip(&body, truth, &set.scan(id)?)?.picked(pick),
            None => part_of_scan(&ClipFile::scan(&ScanSet::scan_path(path, id))?, pick)?,
        });
    }
    let what = if truth.is_some() { "Scans and their truth" } else { "Scans" };
    let about = format!("{what}: {} clips, {} vertices.", set.clips().len(), set.vertex_count());
    let reference = truth.is_some().then_some("reference");
    // A generated set is called by the folder that holds both.
    let named = if truth.is_some() { beside(path, "") } else { path.to_owned() };
    Ok(Shown { reference, ..Shown::on(&body, &named, about, clips, chosen.notes) })
}

/// Some frames of a scan clip, the others unread.
pub fn part_of_scan(file: &ClipFile, pick: &Pick) -> Result<ViewClip> {
    let mut frames = Frames::new(file.points);
    for t in pick.frames() {
        frames.push(file.read(t..t + 1)?.frame(0));
    }
    Ok(ViewClip {
        name: file.id.to_string(),
        fps: file.fps / pick.every as f32,
        start_s: pick.start as f32 / file.fps,
        layers: vec![Layer { key: "scan", label: "Scan".into(), over: None, frames }],
    })
}

/// A fit set.
pub fn fits(path: &Path, asked: &Asked, finder: &BodyFinder, monitor: &dyn Monitor) -> Result<Shown> {
    let set = FitSet::open(path)?;
    let body = body_of(path, set.vertex_count(), set.topology(), finder)?;
    let ids: Vec<ClipId> = set.clips().iter().map(|c| c.id.clone()).collect();
    let chosen = asked.choose(set.clips(), &ids, set.vertex_count() * LAYERS.1, path)?;
    let mut clips = Vec::new();
    for (id, pick) in &chosen.clips {
        if monitor.should_stop() {
            return Err(EvalError::Stopped.into());
        }
        clips.push(fitted(&body, &set, None, id)?.picked(pick));
    }
    let about = format!("Fit: {} clips, {} vertices.", set.clips().len(), set.vertex_count());
    Ok(Shown::on(&body, path, about, clips, chosen.notes))
}

fn body_of(path: &Path, vertices: usize, topology: &str, finder: &BodyFinder) -> Result<Arc<BodyModel>> {
    Ok(finder.of_vertices(vertices, Some(topology)).ok_or_else(|| no_body(path, vertices))?)
}
