//! `inspect`: what a file or folder is, its counts, units, rate and range, what is wrong with it, and a picture of it.

mod bodies;
mod bundles;
mod clips;
mod facts;
mod folders;
mod motions;
mod scans;

use crate::args::InspectArgs;
use crate::exit::UsageError;
use crate::verbs::kind::Kind;
use crate::verbs::near::BodyFinder;
use anyhow::Result;
use facts::Facts;
use softtissue_eval::Metrics;
use softtissue_eval::report::{plain, surface_tables};
use softtissue_eval::surfaces::SurfaceMetrics;
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

/// The tables of a `metrics.json` or an `autoavatar.json`, as `eval` prints them.
fn measures(args: &InspectArgs) -> Result<()> {
    let (json, tables) = if SurfaceMetrics::is_at(&args.path) {
        let metrics = SurfaceMetrics::read(&args.path)?;
        (serde_json::to_string_pretty(&metrics)?, surface_tables(&metrics))
    } else {
        let metrics = Metrics::read(&args.path)?;
        (serde_json::to_string_pretty(&metrics)?, plain::tables(&metrics))
    };
    if args.picture.is_some() {
        return Err(UsageError("--picture: there is nothing to draw of measures; the report has charts".into()).into());
    }
    let text = if args.json { json } else { tables };
    crate::print_line(text.trim_end());
    Ok(())
}

fn facts_of(path: &Path, finder: &BodyFinder) -> Result<Facts> {
    match Kind::of(path)? {
        Kind::Run => bundles::run(path),
        Kind::Generated => folders::generated(path, finder),
        Kind::Truth => folders::truth(path, finder),
        Kind::Checkpoint => folders::checkpoint(path),
        Kind::Bundle => bundles::bundle(path),
        Kind::ScanSet => folders::scan_set(path, finder),
        Kind::FitSet => folders::fit_set(path, finder),
        Kind::Cache(kept) => Ok(Facts::new("cache").with("kept", kept)),
        Kind::Anny => bodies::anny(path),
        Kind::Tensors(file) => tensors(path, &file, finder),
        Kind::Obj => scans::obj(path),
        Kind::Ply => scans::ply(path),
        Kind::ForeignBody => bodies::foreign(path),
        Kind::ForeignScans => scans::source(path),
        Kind::ForeignMotion => motions::foreign(path),
    }
}

/// A tensor file of ours.
fn tensors(path: &Path, file: &TensorFile, finder: &BodyFinder) -> Result<Facts> {
    match file.meta("kind") {
        Some("scan") => clips::scan(path, finder),
        Some("delta") => clips::deltas(path, finder),
        Some("motion") => motions::ours(path, file, finder),
        Some("body") => bodies::of_file(path),
        Some("fitted-subject") => clips::subject(path, finder),
        _ => {
            let arrays: Vec<String> =
                file.names().filter_map(|n| file.shape(n).map(|(t, s)| format!("{n}: {t:?} {s:?}"))).collect();
            Ok(Facts::new("tensor file").with("arrays", arrays))
        }
    }
}
