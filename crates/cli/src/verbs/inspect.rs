//! `inspect`: what a file or folder is, its counts, units, rate and range, what is wrong with it, and a picture of it.

mod bodies;
mod bundles;
mod clips;
mod facts;
mod folders;
mod motions;
mod near;
mod scans;

use crate::args::InspectArgs;
use crate::exit::{InputError, UsageError};
use anyhow::Result;
use facts::Facts;
use near::BodyFinder;
use softtissue_eval::Metrics;
use softtissue_eval::report::plain;
use softtissue_import::motion::is_motion_file;
use softtissue_store::TensorFile;
use std::path::Path;

/// Runs the verb.
pub fn run(args: &InspectArgs) -> Result<()> {
    if args.path.is_file() && args.path.extension().is_some_and(|e| e.eq_ignore_ascii_case("json")) {
        return measures(args);
    }
    let finder = BodyFinder::new(&args.path, args.body.as_deref())?;
    let facts = facts_of(&args.path, &finder)?;
    if let Some(picture) = &args.picture {
        let Some(sheet) = facts.sheet() else {
            let what = &facts.what;
            return Err(
                UsageError(format!("--picture: there is nothing to draw of a {what}; name a file of it")).into()
            );
        };
        sheet.write(picture)?;
    }
    if args.json {
        crate::print_line(&serde_json::to_string_pretty(&facts.to_json())?);
    } else {
        facts.print();
    }
    Ok(())
}

/// The tables of a `metrics.json`, as `eval` prints them.
fn measures(args: &InspectArgs) -> Result<()> {
    let metrics = Metrics::read(&args.path)?;
    if args.picture.is_some() {
        return Err(UsageError("--picture: there is nothing to draw of measures; the report has charts".into()).into());
    }
    let text = if args.json { serde_json::to_string_pretty(&metrics)? } else { plain::tables(&metrics) };
    crate::print_line(text.trim_end());
    Ok(())
}

fn facts_of(path: &Path, finder: &BodyFinder) -> Result<Facts> {
    if path.is_dir() {
        return folders::facts(path, finder);
    }
    let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
    match extension.as_deref() {
        Some("safetensors") => tensors(path, finder),
        Some("obj") => scans::obj(path),
        Some("ply") => scans::ply(path),
        _ if bodies::is_foreign(path) => bodies::foreign(path),
        Some("hdf5" | "h5") => scans::source(path),
        Some("npz") if scans::is_npz_of_vertices(path) => scans::source(path),
        _ if is_motion_file(path) => motions::foreign(path),
        _ if !path.exists() => Err(InputError(format!("{} does not exist: check the path", path.display())).into()),
        _ => Err(InputError(format!(
            "{}: no file that softtissue knows (clips and bodies are .safetensors, meshes .obj and .ply, scans .hdf5, .h5 and \
             .npz, motions .bvh, .amc and .npz, foreign bodies .pkl, .npz and .whl, measures .json)",
            path.display()
        ))
        .into()),
    }
}

/// A tensor file of ours.
fn tensors(path: &Path, finder: &BodyFinder) -> Result<Facts> {
    let file = TensorFile::open(path)?;
    match file.meta("kind") {
        Some("scan") => clips::scan(path, finder),
        Some("delta") => clips::deltas(path, finder),
        Some("motion") => motions::ours(path, &file, finder),
        Some("body") => bodies::of_file(path),
        Some("fitted-subject") => clips::subject(path, finder),
        _ => {
            let arrays: Vec<String> =
                file.names().filter_map(|n| file.shape(n).map(|(t, s)| format!("{n}: {t:?} {s:?}"))).collect();
            Ok(Facts::new("tensor file").with("arrays", arrays))
        }
    }
}
