//! Bundles of other runs, to be judged beside a run's own.

use super::bundle::BundleMethod;
use super::job::Prepared;
use crate::exit::InputError;
use anyhow::Result;
use softtissue_bundle::Bundle;
use softtissue_eval::report::is_channel;
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
        check_rate(&dir, &bundle, job)?;
        check_unseen(&dir, &bundle, &judged)?;
        let name = free_name(&bundle.info.method, path, &names);
        names.insert(name.clone());
        methods.push(BundleMethod { name, ..BundleMethod::as_learned(&Arc::new(bundle)) });
    }
    Ok(methods)
}

/// A model plays a frame for a frame.
fn check_rate(dir: &Path, bundle: &Bundle, job: &Prepared) -> Result<()> {
    let fps = bundle.descriptor.fps;
    let judged = job.scans.set.clips().iter().filter(|clip| job.split.test.contains(&clip.id));
    match judged.into_iter().find(|clip| clip.fps != fps) {
        None => Ok(()),
        Some(clip) => Err(InputError(format!(
            "{} is for {fps} frames a second, but {}, which is judged here, has {}; leave it out",
            dir.display(),
            clip.id,
            clip.fps
        ))
        .into()),
    }
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

/// The method's name, and the folder's after a slash where another has it already. No name is that of a method on another
/// source of pose.
fn free_name(method: &str, path: &Path, taken: &BTreeSet<String>) -> String {
    if !taken.contains(method) {
        return method.to_owned();
    }
    let folder = path.file_name().map_or_else(|| "other".into(), |n| n.to_string_lossy().into_owned());
    let numbered = (2..).map(|i| format!("{method}/{folder}-{i}"));
    std::iter::once(format!("{method}/{folder}"))
        .chain(numbered)
        .find(|n| !taken.contains(n) && !is_channel(n))
        .unwrap_or(folder)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_two_methods_share_a_name_and_none_takes_that_of_a_source_of_pose() {
        let taken: BTreeSet<String> = ["softtissue", "softtissue/b"].map(str::to_owned).into();
        let name = |folder: &str| free_name("softtissue", Path::new(folder), &taken);
        assert_eq!(free_name("dyna", Path::new("runs/b"), &taken), "dyna");
        assert_eq!([name("runs/a"), name("runs/b")], ["softtissue/a", "softtissue/b-2"]);
        assert_eq!([name("runs/rough"), name("fitted")], ["softtissue/rough-2", "softtissue/fitted-2"]);
    }
}
