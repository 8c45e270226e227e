//! What a finished run was made from, as far as it is still there: opened, never made.

use super::body::{body_place, load_body};
use super::fits::fit_place;
use super::scans::{Scans, find_scans, import_or_open, set_place};
use crate::config::Config;
use crate::exit::InputError;
use anyhow::Result;
use softtissue_body::BodyModel;
use softtissue_clips::{FitSet, Split};
use softtissue_monitor::Monitor;
use std::path::Path;
use std::sync::Arc;

/// Body, scans, split and fit of a run.
pub struct Kept {
    /// The body.
    pub body: Arc<BodyModel>,
    /// The scans.
    pub scans: Scans,
    /// Who was left out.
    pub split: Split,
    /// Shapes, motions and deltas.
    pub fit: FitSet,
}

/// Opens what the run at `run` was made from; `data` are the scans that were given.
///
/// # Errors
/// A part of it that is no longer in `data_dir`, or not yet.
pub fn kept(run: &Path, config: &Config, data: Option<&Path>, data_dir: &Path, monitor: &dyn Monitor) -> Result<Kept> {
    let gone = |what: &str| {
        let (run, data_dir) = (run.display(), data_dir.display());
        InputError(format!(
            "{what} of {run} are not in {data_dir}: name their place with --data-dir, or make them again with `softtissue \
             train --resume --out {run}` (what another version of softtissue made is not taken)"
        ))
    };
    if !body_place(config, data_dir)?.exists() {
        return Err(gone("body and scans").into());
    }
    let body = load_body(config, data_dir, monitor)?;
    let scans = match data {
        Some(source) if set_place(source, config, &body.model, data_dir)?.join("index.json").exists() => {
            Some(import_or_open(source, config, &body.model, data_dir, monitor)?)
        }
        Some(_) => None,
        None => find_scans(config, data_dir)?,
    };
    let scans = scans.ok_or_else(|| gone("the scans"))?;
    let split = config.split.split(&scans.set.ids())?;
    let fit = fit_place(config, &scans, &body, &split, data_dir)?;
    if !fit.join("index.json").exists() {
        return Err(gone("the fitted clips").into());
    }
    Ok(Kept { body: body.model, fit: FitSet::open(&fit)?, scans, split })
}
