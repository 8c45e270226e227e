//! Folders: sets of clips, truth, generated scans, checkpoints.

use super::clips::{examine_deltas, examine_scan, triangles_from};
use super::facts::{Facts, range, self_intersection};
use super::motions::examine_clip;
use crate::verbs::contact_sheet::{FULL_SCALE_M, Tile};
use crate::verbs::near::BodyFinder;
use anyhow::Result;
use serde_json::{Value, json};
use softtissue_clips::inspection::{ClipFindings, Problem, ProblemKind};
use softtissue_clips::{ClipEntry, ClipFile, ClipId, FitSet, MotionClip, ScanSet, TruthSet};
use std::path::Path;

/// Points of a set whose clips are all examined; of larger sets some are, spread evenly over the list.
const EXAMINED_POINTS: usize = 40_000_000;
/// Clips of a set that are drawn.
const DRAWN: usize = 6;

/// Facts of a checkpoint.
pub fn checkpoint(path: &Path) -> Result<Facts> {
    let manifest: Value = softtissue_store::read_json(&path.join("manifest.json"))?;
    Ok(Facts::new("checkpoint").with("manifest", manifest))
}

/// Facts of generated scans.
pub fn generated(path: &Path, finder: &BodyFinder) -> Result<Facts> {
    let recipe: Value = softtissue_store::read_json(&path.join("synth.json"))?;
    let what = "generated scans (scans/) and their truth (truth/)";
    if !path.join("scans/index.json").exists() {
        let mut facts = Facts::new(what).with("recipe", recipe);
        let says = "unfinished: the same `softtissue synth` or `train` goes on with it";
        facts.problems.push(Problem::new(ProblemKind::Incomplete, says));
        return Ok(facts);
    }
    let mut facts = scan_set(&path.join("scans"), finder)?;
    facts.what = what.into();
    Ok(facts.with("recipe", recipe))
}

/// Facts of a truth folder.
pub fn truth(path: &Path, finder: &BodyFinder) -> Result<Facts> {
    let truth = TruthSet::open(path)?;
    let subjects: Vec<String> =
        truth.subjects().iter().map(|s| format!("{}: {:.1} kg/m^2", s.subject, s.bmi)).collect();
    let mut facts = Facts::new("truth, which only evaluation opens").with("subjects", subjects);
    let entries = std::fs::read_dir(path.join("clean")).into_iter().flatten().flatten();
    let mut files: Vec<_> =
        entries.map(|e| e.path()).filter(|p| p.extension().is_some_and(|e| e == "safetensors")).collect();
    files.sort();
    let mut clips = Vec::new();
    for file in files.into_iter().take(DRAWN) {
        let file = ClipFile::scan(&file)?;
        let body = finder.of_vertices(file.points, None);
        clips.push(told(&mut facts, &file.id.clone(), file.frames, file.fps, examine_scan(&file, body.as_deref())?));
    }
    Ok(facts.with("clips_examined", clips))
}

/// Which clips of a list are examined: all, or some where they have too many points.
fn examined(clips: &[ClipEntry], points: usize) -> Vec<&ClipEntry> {
    let total: usize = clips.iter().map(|c| c.frames.saturating_mul(points)).sum();
    let wanted = if total <= EXAMINED_POINTS {
        clips.len()
    } else {
        (EXAMINED_POINTS / (total / clips.len()).max(1)).clamp(1, clips.len())
    };
    (0..wanted).map(|i| &clips[i * clips.len() / wanted]).collect()
}

/// Adds a clip's problems and frames to those of its set; what is said of the clip itself.
fn told(facts: &mut Facts, id: &ClipId, frames: usize, fps: f32, found: ClipFindings) -> Value {
    let told = json!({
        "clip": id.to_string(), "frames": frames, "frames_per_second": fps, "range_m": found.range.map(range),
        "self_intersection": self_intersection(&found),
    });
    if facts.rows.len() < DRAWN && !found.samples.is_empty() {
        facts.rows.push(Tile::row(&found.samples));
    }
    facts.problems.extend(found.problems.into_iter().map(|p| p.of_clip(id)));
    told
}

fn entries(clips: &[ClipEntry]) -> Vec<String> {
    clips.iter().map(|c| format!("{}: {} frames at {} a second", c.id, c.frames, c.fps)).collect()
}

fn how_many(chosen: &[&ClipEntry], clips: &[ClipEntry]) -> String {
    format!("{} of {} clips, every frame of them", chosen.len(), clips.len())
}

/// Facts of a scan set.
pub fn scan_set(path: &Path, finder: &BodyFinder) -> Result<Facts> {
    let set = ScanSet::open(path)?;
    let chosen = examined(set.clips(), set.vertex_count());
    let body = finder.of_vertices(set.vertex_count(), Some(set.topology()));
    let mut facts = Facts::new("scan set")
        .with("vertices", set.vertex_count())
        .with("topology", set.topology())
        .with("triangles_from", triangles_from(body.is_some()))
        .with("units", "metres")
        .with("up", "Y")
        .with("subjects", set.subjects())
        .with("provenance", set.provenance())
        .with("clips", entries(set.clips()))
        .with("examined", how_many(&chosen, set.clips()));
    let mut clips = Vec::new();
    for entry in chosen {
        let file = ScanSet::scan_path(set.root(), &entry.id);
        match ClipFile::scan(&file).map_err(anyhow::Error::from).and_then(|f| examine_scan(&f, body.as_deref())) {
            Ok(found) => clips.push(told(&mut facts, &entry.id, entry.frames, entry.fps, found)),
            Err(error) => facts.problems.push(unreadable(&entry.id, &error)),
        }
    }
    Ok(facts.with("clips_examined", clips))
}

fn unreadable(id: &ClipId, error: &anyhow::Error) -> Problem {
    Problem::new(ProblemKind::Unreadable, error.to_string()).of_clip(id)
}

/// Facts of a fit set.
pub fn fit_set(path: &Path, finder: &BodyFinder) -> Result<Facts> {
    let set = FitSet::open(path)?;
    let chosen = examined(set.clips(), set.vertex_count());
    let body = finder.of_vertices(set.vertex_count(), Some(set.topology()));
    let mut facts = Facts::new("fit set")
        .with("vertices", set.vertex_count())
        .with("topology", set.topology())
        .with("units", "metres")
        .with("up", "Y")
        .with("clips", entries(set.clips()))
        .with("examined", how_many(&chosen, set.clips()));
    let mut clips = Vec::new();
    for entry in chosen {
        let id = &entry.id;
        match fitted(&set, id) {
            Ok((motion, deltas, mean_mm)) => {
                if let Some(body) = &body {
                    facts.problems.extend(examine_clip(&motion, body).problems.into_iter().map(|p| p.of_clip(id)));
                    if facts.rows.len() < DRAWN {
                        facts.rows.push(fitted_tiles(&set, &motion, body)?);
                    }
                }
                facts.problems.extend(deltas.problems.into_iter().map(|p| p.of_clip(id)));
                clips.push(json!({"clip": id.to_string(), "frames": entry.frames, "delta_mean_mm": mean_mm}));
            }
            Err(error) => facts.problems.push(unreadable(id, &error)),
        }
    }
    Ok(facts.with("clips_examined", clips))
}

fn fitted(set: &FitSet, id: &ClipId) -> Result<(MotionClip, ClipFindings, f64)> {
    let motion = set.motion(id)?;
    let (deltas, sizes) = examine_deltas(&ClipFile::deltas(&FitSet::delta_path(set.root(), id))?)?;
    Ok((motion, deltas, sizes.mean_mm()))
}

/// A few frames of a fitted clip: the model and its deltas, coloured by their size.
fn fitted_tiles(set: &FitSet, motion: &MotionClip, body: &softtissue_body::BodyModel) -> Result<Vec<Tile>> {
    let file = ClipFile::deltas(&FitSet::delta_path(set.root(), &motion.id))?;
    let subject = set.subject(&motion.id.subject)?;
    let mut shaped = body.shaped(&subject.beta);
    shaped.vertices.iter_mut().zip(&subject.template).for_each(|(p, d)| *p += *d);
    let shown = DRAWN.min(motion.len());
    let tile = |i: usize| {
        let t = i * motion.len() / shown;
        let pose = softtissue_body::Pose { rotations: motion.rotations.frame(t), translation: motion.translations[t] };
        let alone = body.posed(&shaped, pose, None);
        let deltas = file.read(t..t + 1)?;
        let moved = body.posed(&shaped, pose, Some(deltas.frame(0)));
        Ok(Tile::displaced(&moved, &body.topology.faces, &alone, FULL_SCALE_M))
    };
    (0..shown).map(tile).collect()
}
