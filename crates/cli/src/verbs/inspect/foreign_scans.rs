//! Scans of foreign formats: what they are, and what is wrong with each clip.

use super::{floor_problems, jump_problems, range};
use anyhow::Result;
use serde_json::{Value, json};
use softtissue_geometry::Topology;
use softtissue_import::ImportLimits;
use softtissue_import::scans::{ClipSurvey, ScanImportConfig, ScanSource, read_ply};
use std::path::Path;

/// Whether a path is an npz of vertices and not one of a motion.
pub fn is_npz_of_vertices(path: &Path) -> bool {
    let is_npz = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("npz"));
    is_npz && ScanSource::open(path, &ScanImportConfig::default()).is_ok()
}

/// Files and folders that `import scans` takes.
pub fn source(path: &Path) -> Result<Value> {
    let source = ScanSource::open(path, &ScanImportConfig { fill_gaps: true, ..ScanImportConfig::default() })?;
    let conventions = source.conventions()?;
    let (fps, assumed) = source.fps()?;
    let mut problems = Vec::new();
    let clips: Vec<Value> = source
        .survey(&conventions)
        .map(|(id, found)| match found {
            Ok(clip) => {
                problems.extend(clip_problems(&clip, fps).into_iter().map(|problem| format!("{id}: {problem}")));
                json!({
                    "clip": id.to_string(), "frames": clip.frames, "vertices": clip.vertices,
                    "same_vertices_in_every_frame": clip.points.is_some(), "faces": clip.has_faces,
                    "range_m": clip.points.as_ref().map(|points| range(points.points())),
                })
            }
            Err(error) => {
                problems.push(format!("{id}: {error}"));
                json!({"clip": id.to_string()})
            }
        })
        .collect();
    Ok(json!({
        "what": source.format(), "units": conventions.units, "up": conventions.up, "guessed": conventions.guessed,
        "frames_per_second": fps, "rate_assumed": assumed, "clips": clips, "problems": problems,
    }))
}

fn clip_problems(clip: &ClipSurvey, fps: f32) -> Vec<String> {
    let mut problems = Vec::new();
    if !clip.missing.is_empty() {
        problems.push(format!("{} frames are missing, first number {}", clip.missing.len(), clip.missing[0]));
    }
    match &clip.points {
        Some(points) => {
            problems.extend(floor_problems(points));
            problems.extend(jump_problems(points, fps));
        }
        None => problems.push("the vertex count changes: raw scans, which `softtissue import scans` registers".into()),
    }
    problems
}

/// A single PLY frame.
pub fn ply(path: &Path) -> Result<Value> {
    let mesh = read_ply(path, &ImportLimits::default())?;
    let fan = |c: &Vec<u32>| (1..c.len() - 1).map(|k| [c[0], c[k], c[k + 1]]).collect::<Vec<_>>();
    let faces: Vec<[u32; 3]> = mesh.faces.iter().flat_map(fan).collect();
    let mut problems = Vec::new();
    if !faces.is_empty() {
        let topology = Topology { vertex_count: mesh.positions.len(), faces, quads: vec![] };
        match topology.check_closed_manifold() {
            Ok(0) => {}
            Ok(genus) => problems.push(format!("genus {genus}")),
            Err(e) => problems.push(e.to_string()),
        }
    }
    Ok(json!({
        "what": if mesh.faces.is_empty() { "point cloud" } else { "mesh" }, "vertices": mesh.positions.len(),
        "polygons": mesh.faces.len(), "normals": !mesh.normals.is_empty(), "range": range(&mesh.positions),
        "problems": problems,
    }))
}
