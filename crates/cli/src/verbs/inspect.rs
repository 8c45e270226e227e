//! `inspect`: what a file or folder is, its counts, rate and range, and what is wrong with it.

mod foreign_scans;

use crate::args::InspectArgs;
use crate::exit::{InputError, UsageError};
use crate::verbs::{body_facts, inspect_motion};
use anyhow::Result;
use glam::Vec3;
use serde_json::{Map, Value, json};
use softtissue_body::BodyModel;
use softtissue_clips::{DeltaClip, FitSet, FittedSubject, MotionClip, ScanClip, ScanSet, TruthSet};
use softtissue_geometry::Frames;
use softtissue_import::motion::is_motion_file;
use softtissue_import::{ImportLimits, read_mesh};
use softtissue_store::{StoreError, TensorFile};
use std::path::Path;

/// Speeds above this look like a teleport, m/s.
const TELEPORT: f32 = 30.0;

/// Runs the verb.
pub fn run(args: &InspectArgs) -> Result<()> {
    let of_points = foreign_scans::is_npz_of_vertices(&args.path) || body_facts::is_foreign(&args.path);
    let facts = if is_motion_file(&args.path) && !of_points {
        inspect_motion::inspect(&args.path, args.picture.as_deref())?
    } else if args.picture.is_some() {
        return Err(UsageError("--picture draws foreign motions alone (.bvh, .amc, .npz)".into()).into());
    } else {
        inspect(&args.path)?
    };
    if args.json {
        crate::print_line(&serde_json::to_string_pretty(&facts)?);
    } else {
        let Value::Object(facts) = facts else { return Ok(()) };
        print_facts(&facts, "");
    }
    Ok(())
}

fn print_facts(facts: &Map<String, Value>, indent: &str) {
    for (key, value) in facts {
        match value {
            Value::Object(inner) => {
                crate::print_line(&format!("{indent}{key}:"));
                print_facts(inner, &format!("{indent}  "));
            }
            Value::Array(items) if !items.is_empty() && items.iter().all(Value::is_string) => {
                crate::print_line(&format!("{indent}{key}:"));
                items.iter().filter_map(Value::as_str).for_each(|item| crate::print_line(&format!("{indent}  {item}")));
            }
            Value::String(text) => crate::print_line(&format!("{indent}{key}: {text}")),
            other => crate::print_line(&format!("{indent}{key}: {other}")),
        }
    }
}

fn inspect(path: &Path) -> Result<Value> {
    if path.is_dir() {
        return folder(path);
    }
    match path.extension().and_then(|e| e.to_str()) {
        Some("safetensors") => tensors(path),
        Some("obj" | "OBJ") => mesh(path),
        Some("ply" | "PLY") => foreign_scans::ply(path),
        _ if body_facts::is_foreign(path) => body_facts::foreign(path),
        Some("hdf5" | "h5" | "npz") => foreign_scans::source(path),
        _ if !path.exists() => Err(InputError(format!("{} does not exist: check the path", path.display())).into()),
        _ => Err(InputError(format!(
            "{}: no file that softtissue knows (clips and bodies are .safetensors, meshes .obj and .ply, scans .hdf5, .h5 and \
             .npz, motions .bvh, .amc and .npz, foreign bodies .pkl and .npz)",
            path.display()
        ))
        .into()),
    }
}

fn folder(path: &Path) -> Result<Value> {
    if path.join("config.toml").exists() && path.join("provenance.json").exists() {
        return run_folder(path);
    }
    if path.join("synth.json").exists() {
        let recipe: Value = softtissue_store::read_json(&path.join("synth.json"))?;
        let mut problems = Vec::new();
        if !path.join("scans/index.json").exists() {
            problems.push("unfinished: the same `softtissue synth` or `train` goes on with it");
        }
        return Ok(
            json!({"what": "generated scans (scans/) and their truth (truth/)", "recipe": recipe, "problems": problems}),
        );
    }
    if path.join("subjects.json").exists() {
        let truth = TruthSet::open(path)?;
        let subjects: Vec<String> =
            truth.subjects().iter().map(|s| format!("{}: {:.1} kg/m^2", s.subject, s.bmi)).collect();
        return Ok(json!({"what": "truth, which only evaluation opens", "subjects": subjects, "problems": []}));
    }
    if path.join("state.safetensors").exists() {
        let manifest: Value = softtissue_store::read_json(&path.join("manifest.json"))?;
        return Ok(json!({"what": "checkpoint", "manifest": manifest, "problems": []}));
    }
    if path.join("manifest.json").exists() {
        let bundle = softtissue_bundle::Bundle::read(path)?;
        return Ok(json!({"what": "bundle", "manifest": bundle.manifest()?, "problems": []}));
    }
    if path.join("index.json").exists() {
        let index: Value = softtissue_store::read_json(&path.join("index.json"))?;
        if index["kind"] == "scan" {
            let set = ScanSet::open(path)?;
            return Ok(json!({
                "what": "scan set", "vertices": set.vertex_count(), "topology": set.topology(), "units": "metres", "up": "Y",
                "subjects": set.subjects(), "provenance": set.provenance(), "clips": entries(set.clips()), "problems": [],
            }));
        }
        let set = FitSet::open(path)?;
        return Ok(json!({
            "what": "fit set", "vertices": set.vertex_count(), "topology": set.topology(), "units": "metres", "up": "Y",
            "clips": entries(set.clips()), "problems": [],
        }));
    }
    let kept = kept_in_cache(path)?;
    if kept.is_empty() {
        // the error of a folder that is no source of scans either says what was looked for
        return foreign_scans::source(path);
    }
    Ok(json!({"what": "cache", "kept": kept, "problems": []}))
}

/// What lies in a cache folder: bodies, imports, fits and generated scans.
fn kept_in_cache(path: &Path) -> Result<Vec<String>> {
    let entries = std::fs::read_dir(path).map_err(|e| StoreError::io("read", path, e))?;
    let mut kept: Vec<String> = entries
        .flatten()
        .filter_map(|entry| {
            let name = entry.file_name().to_string_lossy().into_owned();
            let what = match name.split_once('-') {
                Some(("body", _)) => "parametric body",
                Some(("import", _)) => "imported scans",
                Some(("fit", _)) => "fitted clips",
                _ if entry.path().join("synth.json").exists() => "generated scans and their truth",
                _ => return None,
            };
            Some(format!("{name}: {what}"))
        })
        .collect();
    kept.sort();
    Ok(kept)
}

fn run_folder(path: &Path) -> Result<Value> {
    let provenance: Value = softtissue_store::read_json(&path.join("provenance.json"))?;
    let exists = |name: &str| path.join(name).exists();
    let mut problems = Vec::new();
    if !exists("metrics.json") {
        problems.push("not evaluated: run `softtissue train --resume` or `softtissue eval`".to_owned());
    }
    Ok(json!({
        "what": "run", "provenance": provenance, "bundle": exists("bundle/manifest.json"), "metrics": exists("metrics.json"),
        "report": exists("report/index.html"), "problems": problems,
    }))
}

fn entries(clips: &[softtissue_clips::ClipEntry]) -> Vec<String> {
    clips.iter().map(|c| format!("{}: {} frames at {} a second", c.id, c.frames, c.fps)).collect()
}

fn mesh(path: &Path) -> Result<Value> {
    let mesh = read_mesh(path, &ImportLimits::default())?;
    let problems: Vec<String> = match mesh.topology.check_closed_manifold() {
        Ok(0) => vec![],
        Ok(genus) => vec![format!("genus {genus}")],
        Err(e) => vec![e.to_string()],
    };
    Ok(json!({
        "what": "mesh", "vertices": mesh.positions.len(), "triangles": mesh.topology.faces.len(),
        "range_m": range(&mesh.positions), "problems": problems,
    }))
}

fn tensors(path: &Path) -> Result<Value> {
    let file = TensorFile::open(path)?;
    match file.meta("kind") {
        Some("scan") => {
            let clip = ScanClip::read(path)?;
            Ok(clip_facts("scan clip", &clip.id, clip.fps, &clip.vertices, floor_problems(&clip.vertices)))
        }
        Some("delta") => {
            let clip = DeltaClip::read(path)?;
            let points = clip.deltas.points();
            let mean = points.iter().map(|d| f64::from(d.length())).sum::<f64>() / points.len() as f64;
            let mut facts =
                clip_facts("delta clip (scan minus model, rest frame)", &clip.id, clip.fps, &clip.deltas, vec![]);
            facts["mean_mm"] = json!(mean * 1e3);
            facts["largest_mm"] = json!(f64::from(points.iter().map(|d| d.length()).fold(0.0, f32::max)) * 1e3);
            Ok(facts)
        }
        Some("motion") => {
            let clip = MotionClip::read(path)?;
            let roots = Frames::from_points(1, clip.translations.clone());
            let mut facts = clip_facts("motion clip", &clip.id, clip.fps, &roots, vec![]);
            facts["joints"] = json!(clip.rotations.points_per_frame());
            if let Some(provenance) = file.meta("provenance") {
                facts["provenance"] = serde_json::from_str(provenance).unwrap_or_else(|_| json!(provenance));
            }
            Ok(facts)
        }
        Some("body") => Ok(body_facts::facts(&BodyModel::read(path)?)),
        Some("fitted-subject") => {
            let s = FittedSubject::read(path)?;
            let spread = |w: &[f32]| json!({"least": w.iter().copied().fold(f32::MAX, f32::min), "most": w.iter().copied().fold(0.0, f32::max)});
            let detail = s.template.iter().map(|d| f64::from(d.length())).sum::<f64>() / s.template.len().max(1) as f64;
            Ok(json!({
                "what": "fitted subject", "subject": s.subject, "vertices": s.template.len(), "beta": s.beta,
                "static_detail_mean_mm": detail * 1e3,
                "fit_weight (high on rigid parts)": spread(&s.fit_weight),
                "rigidity_weight (Casas-Otaduy eq. 7: high on flesh)": spread(&s.rigidity_weight),
                "problems": [],
            }))
        }
        _ => {
            let arrays: Vec<String> =
                file.names().filter_map(|n| file.shape(n).map(|(t, s)| format!("{n}: {t:?} {s:?}"))).collect();
            Ok(json!({"what": "tensor file", "arrays": arrays, "problems": []}))
        }
    }
}

fn clip_facts(
    what: &str,
    id: &softtissue_clips::ClipId,
    fps: f32,
    frames: &Frames,
    mut problems: Vec<String>,
) -> Value {
    problems.extend(jump_problems(frames, fps));
    json!({
        "what": what, "clip": id.to_string(), "frames": frames.len(), "points": frames.points_per_frame(),
        "frames_per_second": fps, "seconds": frames.len() as f32 / fps, "units": "metres", "up": "Y",
        "range_m": range(frames.points()), "problems": problems,
    })
}

fn range(points: &[Vec3]) -> Value {
    let (low, high) = points.iter().fold((Vec3::MAX, Vec3::MIN), |(l, h), p| (l.min(*p), h.max(*p)));
    json!({"low": low.to_array(), "high": high.to_array()})
}

fn floor_problems(vertices: &Frames) -> Vec<String> {
    let low = vertices.points().iter().map(|p| p.y).fold(f32::MAX, f32::min);
    if low < -0.1 { vec![format!("{:.2} m below the floor", -low)] } else { vec![] }
}

fn jump_problems(frames: &Frames, fps: f32) -> Vec<String> {
    let mut problems = Vec::new();
    for t in 1..frames.len() {
        let (a, b) = (frames.frame(t - 1), frames.frame(t));
        let fastest = a.iter().zip(b).map(|(a, b)| a.distance(*b)).fold(0.0, f32::max) * fps;
        if fastest > TELEPORT {
            problems.push(format!("frame {t}: a point moves at {fastest:.0} m/s"));
        } else if a == b && frames.points_per_frame() > 1 {
            problems.push(format!("frame {t} repeats the one before"));
        }
        if problems.len() == 8 {
            problems.push("... and more".into());
            break;
        }
    }
    problems
}
