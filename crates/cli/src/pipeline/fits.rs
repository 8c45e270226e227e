//! Fits of scans, kept in the cache.

use super::body::KeptBody;
use super::context::fingerprint;
use super::scans::Scans;
use crate::config::Config;
use anyhow::Result;
use softtissue_body::BodyModel;
use softtissue_clips::{ClipId, FitSet, ScanSet, Split};
use softtissue_fit::{FitConfig, FittedPeople, LevenbergMarquardt, Solver, fit_set_with};
use softtissue_monitor::Monitor;
use softtissue_train::AdamSolver;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Raised whenever the same scans, body and settings would give another fit, so that a kept one is not mistaken.
pub const FIT: u32 = 4;

/// Beside a fit in the cache: what each of its people who train was fitted from.
const PEOPLE: &str = "people.json";

/// Where the fit of a split is kept.
pub fn fit_place(config: &Config, scans: &Scans, body: &KeptBody, split: &Split, data_dir: &Path) -> Result<PathBuf> {
    let ids: Vec<&ClipId> = split.train.iter().chain(&split.validation).chain(&split.test).collect();
    let made_of = made_of(scans, body);
    let name = match config.fit.solver {
        Solver::LevenbergMarquardt => fingerprint(&(made_of, &config.fit, &split.train, ids))?,
        // Its tensors' device has a part in the last digits.
        Solver::Adam => fingerprint(&(made_of, &config.fit, &config.device, &split.train, ids))?,
    };
    Ok(data_dir.join("cache").join(format!("fit-{name}")))
}

fn made_of<'a>(scans: &'a Scans, body: &'a KeptBody) -> (&'static str, u32, &'a str, &'a str) {
    (env!("CARGO_PKG_VERSION"), FIT, &scans.fingerprint, &body.sha256)
}

/// Fits all clips of a split, or finds the fit in the cache. People who train with the same clips in a fit of another split
/// are taken from there, so that leaving out one person, or one clip of one, does not fit everybody again.
pub fn fit_scans(
    config: &Config,
    scans: &Scans,
    body: &KeptBody,
    split: &Split,
    data_dir: &Path,
    monitor: &dyn Monitor,
) -> Result<FitSet> {
    let out = fit_place(config, scans, body, split, data_dir)?;
    if out.join("index.json").exists() {
        monitor.say(&format!("  fit: found in {}", out.display()));
        return Ok(FitSet::open(&out)?);
    }
    let names: BTreeSet<&str> = split.train.iter().map(|id| id.subject.as_str()).collect();
    let fitted_from = |name: &str| {
        let clips: Vec<&ClipId> = split.train.iter().filter(|id| id.subject == name).collect();
        fingerprint(&(made_of(scans, body), &config.fit, &config.device, clips))
    };
    let wanted: BTreeMap<String, String> =
        names.into_iter().map(|name| Ok((name.to_owned(), fitted_from(name)?))).collect::<Result<_>>()?;
    let fitted = fitted_people(&data_dir.join("cache"), &wanted);
    let fit = fit_clips(&scans.set, split, &body.model, &config.fit, &config.device, &fitted, &out, monitor)?;
    softtissue_store::write_json_atomic(&out.join(PEOPLE), &wanted)?;
    Ok(fit)
}

/// Those of the `wanted` people (what each is fitted from, by name) whom a finished fit in the cache holds.
fn fitted_people(cache: &Path, wanted: &BTreeMap<String, String>) -> FittedPeople {
    let mut kept: Vec<_> = std::fs::read_dir(cache).into_iter().flatten().flatten().map(|e| e.path()).collect();
    kept.retain(|path| path.join("index.json").exists());
    kept.sort();
    let mut found = FittedPeople::new();
    for root in kept {
        // A folder without the list, or with one that cannot be read, has nobody to offer.
        let people: BTreeMap<String, String> = softtissue_store::read_json(&root.join(PEOPLE)).unwrap_or_default();
        let same = people.into_iter().filter(|(name, made_of)| wanted.get(name) == Some(made_of));
        found.extend(same.map(|(name, _)| (name, root.clone())));
    }
    found
}

/// Fits with the solver that the settings name; `device` is where the one of tensors works.
#[expect(clippy::too_many_arguments, reason = "a fit's whole context, passed on to the solver's crate")]
pub fn fit_clips(
    scans: &ScanSet,
    split: &Split,
    body: &BodyModel,
    config: &FitConfig,
    device: &str,
    fitted: &FittedPeople,
    out: &Path,
    monitor: &dyn Monitor,
) -> Result<FitSet> {
    Ok(match config.solver {
        Solver::LevenbergMarquardt => {
            fit_set_with(&LevenbergMarquardt(config), scans, split, body, config, fitted, out, monitor)?
        }
        Solver::Adam => {
            let solver = AdamSolver::new(config.adam.clone(), softtissue_train::device::parse(device)?);
            fit_set_with(&solver, scans, split, body, config, fitted, out, monitor)?
        }
    })
}
