//! Scan and delta clips and fitted subjects of ours.

use super::facts::Facts;
use crate::verbs::contact_sheet::{FULL_SCALE_M, Tile};
use crate::verbs::near::BodyFinder;
use anyhow::Result;
use glam::Vec3;
use serde_json::json;
use softtissue_body::BodyModel;
use softtissue_clips::inspection::{ClipExam, ClipFindings, ExamConfig, WatchConfig};
use softtissue_clips::{ClipFile, FittedSubject};
use std::path::Path;

/// Facts of a scan clip.
pub fn scan(path: &Path, finder: &BodyFinder) -> Result<Facts> {
    let file = ClipFile::scan(path)?;
    let body = finder.of_vertices(file.points, None);
    let found = examine_scan(&file, body.as_deref())?;
    Ok(clip("scan clip", &file).with("triangles_from", triangles_from(body.is_some())).findings(found))
}

/// Whose triangles are shown and tested.
pub fn triangles_from(found: bool) -> &'static str {
    if found {
        "a body beside it"
    } else {
        "nowhere: no body with its vertices was found beside it, so that its surface was not tested (--body names one)"
    }
}

fn clip(what: &str, file: &ClipFile) -> Facts {
    Facts::new(what)
        .with("clip", file.id.to_string())
        .with("frames", file.frames)
        .with("frames_per_second", file.fps)
        .with("seconds", file.frames as f32 / file.fps)
        .with("points", file.points)
        .with("units", "metres")
        .with("up", "Y")
}

/// Examines all frames of a scan clip, some at a time.
pub fn examine_scan(file: &ClipFile, body: Option<&BodyModel>) -> Result<ClipFindings> {
    let mut exam = ClipExam::new(file.frames, file.fps, ExamConfig::default());
    if let Some(body) = body {
        exam = exam.body(body.topology.faces.clone(), body.template.clone());
    }
    each_frame(file, |t, frame| exam.frame(t, frame))?;
    Ok(exam.finish())
}

/// Sizes of deltas.
#[derive(Clone, Copy, Debug, Default)]
pub struct DeltaSizes {
    sum: f64,
    count: usize,
    largest: f32,
}

impl DeltaSizes {
    /// Mean length, millimetres.
    pub fn mean_mm(&self) -> f64 {
        1e3 * self.sum / self.count.max(1) as f64
    }
}

/// Examines all frames of a delta clip, some at a time. Deltas have no floor.
pub fn examine_deltas(file: &ClipFile) -> Result<(ClipFindings, DeltaSizes)> {
    let config = ExamConfig { watch: WatchConfig::deltas(), sampled: 1, ..ExamConfig::default() };
    let mut exam = ClipExam::new(file.frames, file.fps, config);
    let mut sizes = DeltaSizes::default();
    each_frame(file, |t, frame| {
        exam.frame(t, frame);
        sizes.count += frame.len();
        for length in frame.iter().map(|d| d.length()) {
            sizes.sum += f64::from(length);
            sizes.largest = sizes.largest.max(length);
        }
    })?;
    Ok((exam.finish(), sizes))
}

fn each_frame(file: &ClipFile, mut see: impl FnMut(usize, &[Vec3])) -> Result<()> {
    let step = file.frames_a_read();
    for start in (0..file.frames).step_by(step) {
        let frames = file.read(start..(start + step).min(file.frames))?;
        frames.iter().enumerate().for_each(|(i, frame)| see(start + i, frame));
    }
    Ok(())
}

/// Facts of a delta clip. Where the body is known its mesh is drawn at rest, moved by some frames.
pub fn deltas(path: &Path, finder: &BodyFinder) -> Result<Facts> {
    let file = ClipFile::deltas(path)?;
    let (mut found, sizes) = examine_deltas(&file)?;
    found.samples.clear();
    let mut facts = clip("delta clip (scan minus model, rest frame)", &file)
        .with("mean_mm", sizes.mean_mm())
        .with("largest_mm", 1e3 * f64::from(sizes.largest))
        .findings(found);
    if let Some(body) = finder.of_vertices(file.points, None) {
        facts.rows.push(delta_tiles(&file, &body)?);
    }
    Ok(facts)
}

fn delta_tiles(file: &ClipFile, body: &BodyModel) -> Result<Vec<Tile>> {
    let shown = ExamConfig::default().sampled.min(file.frames);
    let tile = |i: usize| {
        let t = i * file.frames / shown;
        let deltas = file.read(t..t + 1)?;
        let moved: Vec<Vec3> = body.template.iter().zip(deltas.frame(0)).map(|(p, d)| *p + *d).collect();
        Ok(Tile::displaced(&moved, &body.topology.faces, &body.template, FULL_SCALE_M))
    };
    (0..shown).map(tile).collect()
}

/// Facts of a fitted subject.
pub fn subject(path: &Path, finder: &BodyFinder) -> Result<Facts> {
    let s = FittedSubject::read(path)?;
    let spread = |w: &[f32]| json!({"least": w.iter().copied().fold(f32::MAX, f32::min), "most": w.iter().copied().fold(0.0, f32::max)});
    let detail = s.template.iter().map(|d| f64::from(d.length())).sum::<f64>() / s.template.len().max(1) as f64;
    let mut facts = Facts::new("fitted subject")
        .with("subject", &s.subject)
        .with("vertices", s.template.len())
        .with("beta", &s.beta)
        .with("static_detail_mean_mm", detail * 1e3)
        .with("fit_weight (high on rigid parts)", spread(&s.fit_weight))
        .with("rigidity_weight (Casas-Otaduy eq. 7: high on flesh)", spread(&s.rigidity_weight));
    if let Some(body) = finder.of_vertices(s.template.len(), None) {
        let shaped = body.shaped(&s.beta).vertices;
        let detailed: Vec<Vec3> = shaped.iter().zip(&s.template).map(|(p, d)| *p + *d).collect();
        let faces = &body.topology.faces;
        facts.rows.push(vec![Tile::new(&shaped, faces), Tile::displaced(&detailed, faces, &shaped, FULL_SCALE_M)]);
    }
    Ok(facts)
}
