//! Bundles and runs.

use super::bodies;
use super::facts::Facts;
use crate::verbs::contact_sheet::{ContactSheet, Tile};
use anyhow::Result;
use serde_json::Value;
use softtissue_bundle::{Bundle, Player};
use softtissue_clips::inspection::{ExamConfig, Problem, ProblemKind};
use softtissue_import::examine_body;
use softtissue_synth::motion::{Request, Style, generate};
use std::path::Path;

/// The generated motion that is drawn, and how much of it.
const SHOWN: &str = "jumping_jacks";
const SECONDS: f32 = 2.5;

/// Facts of a bundle. It runs its self-check when it is read.
pub fn bundle(path: &Path) -> Result<Facts> {
    let bundle = Bundle::read(path)?;
    let mut facts = Facts::new("bundle").with("manifest", bundle.manifest()?);
    let (mesh, problems) = examine_body(&bundle.body, &ExamConfig::default());
    facts.mesh(Some(&mesh));
    facts.problems = problems;
    facts.rows = played(&bundle)?;
    Ok(facts)
}

/// A generated motion, the body alone above and with soft tissue below; bodies with joints of their own do what the
/// self-check has, or stand.
fn played(bundle: &Bundle) -> Result<Vec<Vec<Tile>>> {
    let fps = bundle.descriptor.fps;
    let frames = (SECONDS * fps) as usize;
    let request = Request { subject: "anybody", motion: SHOWN, take: 0, frames, fps, seed: 0 };
    let check = &bundle.self_check;
    let (beta, rotations, translations) = match generate(&request, &bundle.body.shaped(&[]), &Style::neutral()) {
        Ok(clip) => (vec![], clip.rotations, clip.translations),
        Err(_) if check.translations.is_empty() => return Ok(vec![bodies::portraits(&bundle.body)]),
        Err(_) => (check.beta.clone(), check.rotations.clone(), check.translations.clone()),
    };
    let moved = Player::new(bundle, &beta)?.rollout_vertices(&rotations, &translations)?;
    let alone = bundle.body.posed_frames(&bundle.body.shaped(&beta), &rotations, &translations, None);
    Ok(ContactSheet::of_animation(&bundle.body.topology, &alone, &moved).rows)
}

/// Facts of a run folder, with the picture of its bundle.
pub fn run(path: &Path) -> Result<Facts> {
    let provenance: Value = softtissue_store::read_json(&path.join("provenance.json"))?;
    let exists = |name: &str| path.join(name).exists();
    let mut facts = Facts::new("run")
        .with("provenance", provenance)
        .with("bundle", exists("bundle/manifest.json"))
        .with("avatar", exists("avatar/manifest.json"))
        .with("metrics", exists("metrics.json") || exists("autoavatar.json"))
        .with("report", exists("report/index.html"));
    if exists("bundle/manifest.json") {
        let bundle = bundle(&path.join("bundle"))?;
        facts.problems = bundle.problems;
        facts.rows = bundle.rows;
    }
    if !exists("metrics.json") && !exists("autoavatar.json") {
        let says = "not evaluated: run `softtissue train --resume` or `softtissue eval`";
        facts.problems.push(Problem::new(ProblemKind::Incomplete, says));
    }
    Ok(facts)
}
