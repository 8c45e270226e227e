//! Bundles of other runs, to be judged beside a run's own.

use super::bundle::BundleMethod;
use super::job::Prepared;
use crate::exit::InputError;
use anyhow::Result;
use softtissue_bundle::Bundle;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Opens runs or bundles that `eval --against` names. Refused are bundles of another body or rate, and those that have
/// learned from, or were selected on, what is judged here.
pub fn open_others(paths: &[PathBuf], job: &Prepared, taken: &[String]) -> Result<Vec<BundleMethod>> {
    let judged: BTreeSet<String> = job.split.test.iter().map(ToString::to_string).collect();
    let mut names: BTreeSet<String> = taken.iter().cloned().collect();
    let mut methods = Vec::new();
    for path in paths {
        let dir = if path.join("bundle").is_dir() { path.join("bundle") } else { path.clone() };
        let bundle = Bundle::read(&dir)?;
        bundle.require_topology(&dir, &job.body.topology.hash())?;
        check_unseen(&dir, &bundle, &judged)?;
        let name = free_name(&bundle.info.method, path, &names);
        names.insert(name.clone());
        methods.push(BundleMethod { name, ..BundleMethod::as_learned(&Arc::new(bundle)) });
    }
    Ok(methods)
}

/// An error on clips that training has seen is none to compare. A bundle that does not say what it has seen is refused.
fn check_unseen(dir: &Path, bundle: &Bundle, judged: &BTreeSet<String>) -> Result<()> {
    let provenance = &bundle.info.provenance;
    for (key, deed) in [("trained_on", "was trained on"), ("selected_on", "was selected on")] {
        let Some(clips) = provenance[key].as_array() else {
            let message = format!("{} does not say what it {deed}; train it again", dir.display());
            return Err(InputError(message).into());
        };
        if let Some(clip) = clips.iter().filter_map(|c| c.as_str()).find(|c| judged.contains(*c)) {
            let message = format!(
                "{} {deed} {clip}, which is judged here; train it with the split of this run, or leave it out",
                dir.display()
            );
            return Err(InputError(message).into());
        }
    }
    Ok(())
}

/// The method's name, and the folder's after a slash where another has it already.
fn free_name(method: &str, path: &Path, taken: &BTreeSet<String>) -> String {
    if !taken.contains(method) {
        return method.to_owned();
    }
    let folder = path.file_name().map_or_else(|| "other".into(), |n| n.to_string_lossy().into_owned());
    let numbered = (2..).map(|i| format!("{method}/{folder}-{i}"));
    std::iter::once(format!("{method}/{folder}")).chain(numbered).find(|n| !taken.contains(n)).unwrap_or(folder)
}
