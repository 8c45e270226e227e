//! Scans and meshes of foreign formats.

use super::facts::{Facts, range, self_intersection};
use crate::verbs::contact_sheet::Tile;
use anyhow::Result;
use serde_json::{Value, json};
use softtissue_clips::inspection::{ClipExam, ExamConfig, Problem, ProblemKind};
use softtissue_import::ImportLimits;
use softtissue_import::read_obj_frame;
use softtissue_import::scans::{ClipSurvey, Conventions, FrameMesh, ScanImportConfig, ScanSource, read_ply};
use std::path::Path;

/// Clips of a source that are drawn.
const DRAWN: usize = 6;

/// Files and folders that `import scans` takes.
pub fn source(path: &Path) -> Result<Facts> {
    let source = ScanSource::open(path, &ScanImportConfig { fill_gaps: true, ..ScanImportConfig::default() })?;
    let conventions = source.conventions()?;
    let (fps, assumed) = source.fps()?;
    let (mut clips, mut problems, mut rows) = (Vec::new(), Vec::new(), Vec::new());
    for (id, found) in source.survey(&conventions, fps, ExamConfig::default()) {
        match found {
            Ok(clip) => {
                clips.push(clip_facts(&clip, fps));
                if rows.len() < DRAWN {
                    rows.push(Tile::row(&clip.findings.samples));
                }
                problems.extend(clip.findings.problems.into_iter().map(|p| named_raw(p).of_clip(&id)));
            }
            Err(error) => {
                problems.push(Problem::new(ProblemKind::Unreadable, error.to_string()).of_clip(&id));
                clips.push(json!({"clip": id.to_string()}));
            }
        }
    }
    let mut facts = Facts::new(source.format())
        .with("units", conventions.units)
        .with("up", conventions.up)
        .with("guessed", (!conventions.guessed.is_empty()).then_some(&conventions.guessed))
        .with("frames_per_second", fps)
        .with("rate_assumed", assumed)
        .with("clips", clips);
    facts.problems = problems;
    facts.rows = rows;
    Ok(facts)
}

/// What a changing vertex count means for scans.
fn named_raw(mut problem: Problem) -> Problem {
    if problem.kind == ProblemKind::TopologyChange {
        problem.says.push_str(": raw scans, which `softtissue import scans` registers");
    }
    problem
}

fn clip_facts(clip: &ClipSurvey, fps: f32) -> Value {
    let found = &clip.findings;
    json!({
        "clip": clip.id.to_string(), "frames": clip.frames, "seconds": clip.frames as f32 / fps, "vertices": clip.vertices,
        "range_m": found.range.map(range), "mesh": found.mesh, "self_intersection": self_intersection(found),
    })
}

/// A single OBJ mesh.
pub fn obj(path: &Path) -> Result<Facts> {
    Ok(mesh(&read_obj_frame(path, &ImportLimits::default())?.into()))
}

/// A single PLY mesh or point cloud.
pub fn ply(path: &Path) -> Result<Facts> {
    Ok(mesh(&read_ply(path, &ImportLimits::default())?))
}

/// One frame, with guessed units. The floor of a single mesh may be anywhere.
fn mesh(mesh: &FrameMesh) -> Facts {
    let conventions = Conventions::of(&mesh.positions, None, None);
    let points: Vec<glam::Vec3> = mesh.positions.iter().map(|p| conventions.point(*p)).collect();
    let mut config = ExamConfig::default();
    config.watch.floor_m = None;
    let mut exam = ClipExam::new(1, 1.0, config);
    exam.meshed_frame(0, &points, mesh.triangles());
    Facts::new(if mesh.faces.is_empty() { "point cloud" } else { "mesh" })
        .with("vertices", mesh.positions.len())
        .with("polygons", mesh.faces.len())
        .with("normals", !mesh.normals.is_empty())
        .with("units", conventions.units)
        .with("up", conventions.up)
        .with("guessed", &conventions.guessed)
        .findings(exam.finish())
}
