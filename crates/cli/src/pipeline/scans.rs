//! Scans and their fit: made, opened or brought in.

use super::context::{Context, fingerprint};
use super::fits::fit_clips;
use super::foreign::bring_in;
use crate::config::Config;
use crate::exit::InputError;
use anyhow::Result;
use softtissue_body::BodyModel;
use softtissue_clips::{ScanSet, Split, TruthSet};
use softtissue_eval::{FitMetrics, Scene, judge_fit};
use softtissue_fit::{FitConfig, FittedPeople, ObjectiveKind};
use softtissue_geometry::Topology;
use softtissue_import::scans::ScanImportConfig;
use softtissue_monitor::Monitor;
use softtissue_store::{Sha256, sha256_file};
use softtissue_synth::dataset;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Scans and where their truth would be.
#[derive(Clone, Debug)]
pub struct Scans {
    /// The scans.
    pub set: ScanSet,
    /// Truth, for generated scans. Opened by [`Scans::open_truth`] alone.
    truth: Option<PathBuf>,
    /// Names the scans' content.
    pub fingerprint: String,
    /// Whether they came from this configuration's generator, so that more can be asked of it.
    pub generated: bool,
}

impl Scans {
    /// Opens the truth, if there is any.
    pub fn open_truth(&self) -> Result<Option<TruthSet>> {
        match &self.truth {
            Some(path) if path.join("subjects.json").exists() => Ok(Some(TruthSet::open(path)?)),
            _ => Ok(None),
        }
    }

    /// The fit against truth with each objective, on the test clips (or the validation clips): Casas-Otaduy fig. 3.
    pub fn compare_objectives(
        &self,
        context: &Context,
        body: &BodyModel,
        split: &Split,
        scene: &Scene,
    ) -> Result<BTreeMap<String, FitMetrics>> {
        let judged = if split.test.is_empty() { &split.validation } else { &split.test };
        let mut found = BTreeMap::new();
        if scene.truth.is_none() || judged.is_empty() {
            return Ok(found);
        }
        let folder = context.run.objectives();
        for (name, objective) in [("unposed", ObjectiveKind::Unposed), ("posed", ObjectiveKind::Posed)] {
            let config = FitConfig { objective, ..context.config.fit.clone() };
            let part = Split { train: split.train.clone(), validation: vec![], test: judged.clone() };
            let fit = if config == context.config.fit {
                scene.fit.clone()
            } else {
                let device = &context.config.device;
                let nobody = FittedPeople::new();
                fit_clips(&self.set, &part, body, &config, device, &nobody, &folder.join(name), context.monitor)?
            };
            if let Some(metrics) = judge_fit(&Scene { fit: &fit, ..*scene }, judged, context.monitor)? {
                found.insert(name.to_owned(), metrics);
            }
        }
        // Deltas of a second fit are large and serve nothing else.
        let _ = std::fs::remove_dir_all(folder);
        Ok(found)
    }
}

/// Makes the configured scans in the cache, or finds them there.
pub fn make_scans(config: &Config, data_dir: &Path, monitor: &dyn Monitor) -> Result<Scans> {
    let fingerprint = config.synth.fingerprint()?;
    let out = data_dir.join("cache").join(&fingerprint[..16]);
    let set = dataset::write(&config.synth, &out, monitor)?;
    Ok(Scans { set, truth: Some(dataset::truth_path(&out)), fingerprint, generated: true })
}

/// The configured scans where they are in the cache, with or without their truth; nothing is made.
pub fn find_scans(config: &Config, data_dir: &Path) -> Result<Option<Scans>> {
    let fingerprint = config.synth.fingerprint()?;
    let out = data_dir.join("cache").join(&fingerprint[..16]);
    let root = dataset::scans_path(&out);
    if !root.join("index.json").exists() {
        return Ok(None);
    }
    let truth = Some(dataset::truth_path(&out));
    Ok(Some(Scans { set: ScanSet::open(&root)?, truth, fingerprint, generated: true }))
}

/// Opens scans of ours, or brings in other people's, their units and up axis as found.
pub fn import_or_open(
    source: &Path,
    config: &Config,
    body: &BodyModel,
    data_dir: &Path,
    monitor: &dyn Monitor,
) -> Result<Scans> {
    let topology = &body.topology;
    let root = set_place(source, config, body, data_dir)?;
    let set = if root.join("index.json").exists() {
        ScanSet::open(&root)?
    } else {
        let import = ScanImportConfig { assumed_fps: config.descriptor.fps, ..ScanImportConfig::default() };
        bring_in(source, &import, false, body, &config.registration, &root, monitor)?
    };
    check_set(&set, config, topology)?;
    let truth = root.parent().map(|p| p.join("truth")).filter(|p| p.join("subjects.json").exists());
    let fingerprint = content(&set)?;
    Ok(Scans { set, truth, fingerprint, generated: false })
}

/// Where the set of a source lies: the source itself where it is one, or what was brought in from it, there or not.
pub fn set_place(source: &Path, config: &Config, body: &BodyModel, data_dir: &Path) -> Result<PathBuf> {
    let below = source.join("scans");
    if let Some(set) = [below.as_path(), source].into_iter().find(|p| p.join("index.json").exists()) {
        return Ok(set.to_owned());
    }
    let made_of = (IMPORT, listing(source), config.descriptor.fps, body.topology.hash(), &config.registration);
    Ok(data_dir.join("cache").join(format!("import-{}", fingerprint(&made_of)?)))
}

/// SHA-256 over the list and every clip of a set.
fn content(set: &ScanSet) -> Result<String> {
    let mut hash = Sha256::default();
    hash.update(sha256_file(&set.root().join("index.json"))?.as_bytes());
    for id in set.ids() {
        for path in [ScanSet::scan_path(set.root(), &id), ScanSet::rough_path(set.root(), &id)] {
            if path.exists() {
                hash.update(sha256_file(&path)?.as_bytes());
            }
        }
    }
    Ok(hash.finish())
}

/// Raised whenever the same files and settings would be brought in otherwise, so that kept scans are not mistaken.
const IMPORT: u32 = 3;

/// Folders this deep are read: SUBJECT/MOTION.
const DEPTH: usize = 3;

/// Names, sizes and times of a file or of all files below a folder, links followed: changes when they do.
fn listing(source: &Path) -> Vec<(String, u64, u128)> {
    let mut found = Vec::new();
    let mut waiting = vec![(0, source.to_owned())];
    while let Some((depth, path)) = waiting.pop() {
        let Ok(meta) = std::fs::metadata(&path) else { continue };
        if meta.is_dir() {
            let below = std::fs::read_dir(&path).into_iter().flatten().flatten();
            waiting.extend(below.filter(|_| depth < DEPTH).map(|e| (depth + 1, e.path())));
        } else {
            let changed = meta.modified().ok().and_then(|t| t.duration_since(std::time::UNIX_EPOCH).ok());
            found.push((path.display().to_string(), meta.len(), changed.map_or(0, |d| d.as_nanos())));
        }
    }
    found.sort();
    found
}

fn check_set(set: &ScanSet, config: &Config, topology: &Topology) -> Result<()> {
    let place = set.root().display();
    if set.clips().is_empty() {
        return Err(InputError(format!("{place} holds no clip")).into());
    }
    if set.vertex_count() != topology.vertex_count {
        return Err(InputError(format!(
            "{place} has {} vertices a frame, but the body has {}: set synth.level to the body's level, or register the \
             scans to it",
            set.vertex_count(),
            topology.vertex_count
        ))
        .into());
    }
    if set.topology() != topology.hash() {
        return Err(InputError(format!(
            "{place} is of another topology ({}) than the body ({}): register the scans to the body's template",
            set.topology(),
            topology.hash()
        ))
        .into());
    }
    if let Some(clip) = set.clips().iter().find(|c| c.fps != config.descriptor.fps) {
        return Err(InputError(format!(
            "{place}: clip {} has {} frames a second, but the model is for {}; resample it, or set descriptor.fps and \
             synth.fps",
            clip.id, clip.fps, config.descriptor.fps
        ))
        .into());
    }
    if let Some(clip) = set.clips().iter().find(|c| c.frames < 2) {
        return Err(
            InputError(format!("{place}: clip {} has one frame, which has no velocity; remove it", clip.id)).into()
        );
    }
    Ok(())
}
