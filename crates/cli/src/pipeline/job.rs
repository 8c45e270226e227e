//! From a configuration to fitted clips: what every learning begins with.

use super::body::{KeptBody, load_body};
use super::context::{Context, Place, fingerprint};
use super::fits::{FIT, fit_scans};
use super::scans::{Scans, import_or_open, make_scans};
use crate::exit::UsageError;
use anyhow::Result;
use serde_json::json;
use softtissue_body::BodyModel;
use softtissue_clips::{FitSet, Split};
use softtissue_store::sha256_file;
use std::collections::BTreeSet;
use std::path::Path;
use std::sync::Arc;

/// Scans, their body, their fit and who is left out.
pub struct Prepared {
    /// The body.
    pub body: Arc<BodyModel>,
    /// The scans.
    pub scans: Scans,
    /// Who is left out.
    pub split: Split,
    /// Shapes, motions and deltas.
    pub fit: FitSet,
    /// Where learned stages are kept.
    pub place: Place,
}

/// Scans and who is left out, before anything is fitted.
#[derive(Clone)]
pub struct Opened {
    /// The body.
    pub body: Arc<KeptBody>,
    /// The scans.
    pub scans: Scans,
    /// Who is left out.
    pub split: Split,
}

/// Makes the scans, or opens those of `data`.
pub fn open(context: &Context, data: Option<&Path>) -> Result<Opened> {
    let (config, dir, monitor) = (context.config, &context.data_dir, context.monitor);
    let body = context.timed("body", || load_body(config, dir, monitor))?;
    let scans = context.timed("scans", || match data {
        Some(source) => import_or_open(source, config, &body.model, dir, monitor),
        None => make_scans(config, dir, monitor),
    })?;
    let split = config.split.split(&scans.set.ids())?;
    Ok(Opened { body: Arc::new(body), scans, split })
}

/// Refuses a split without test clips: errors on clips that training has seen would say nothing.
pub fn needs_test_clips(split: &Split) -> Result<()> {
    if !split.test.is_empty() {
        return Ok(());
    }
    let all = split.train.iter().chain(&split.validation);
    let motions: BTreeSet<&str> = all.map(|id| id.motion.as_str()).collect();
    let motions: Vec<&str> = motions.into_iter().collect();
    Err(UsageError(format!(
        "no clip is left out to judge by: name some of the motions {} by --set 'split.test_motions=[\"{}\"]', or pass \
         --no-eval",
        motions.join(", "),
        motions.last().unwrap_or(&"...")
    ))
    .into())
}

/// Fits what was opened.
pub fn prepare(context: &Context, opened: Opened) -> Result<Prepared> {
    let Opened { body, scans, split } = opened;
    fold(context, body, scans, split, String::new())
}

/// Raised whenever the same fit and settings would give another model, so that a kept stage is not mistaken.
const LEARNED: u32 = 9;

/// The same scans with another split; `prefix` names the fold's stages.
pub fn fold(context: &Context, kept: Arc<KeptBody>, scans: Scans, split: Split, prefix: String) -> Result<Prepared> {
    let config = context.config;
    let origin = json!({"fingerprint": scans.fingerprint, "provenance": scans.set.provenance()});
    let mut place = Place { prefix, fingerprint: String::new(), scans: origin };
    let fit = context
        .timed(&place.stage("fit"), || fit_scans(config, &scans, &kept, &split, &context.data_dir, context.monitor))?;
    let imported = config.softsmpl.poses.motions.iter().map(|path| sha256_file(path));
    place.fingerprint = fingerprint(&(
        (env!("CARGO_PKG_VERSION"), FIT, LEARNED),
        (&scans.fingerprint, &kept.sha256),
        &split.train,
        &split.validation,
        (config.method, config.seed, &config.device, &config.fit),
        (&config.subspace, &config.descriptor, &config.ladder, &config.regressor, &config.softsmpl),
        (&config.casas_otaduy, &config.dyna),
        imported.collect::<Result<Vec<String>, _>>()?,
    ))?;
    let body = Arc::clone(&kept.model);
    Ok(Prepared { body, scans, split, fit, place })
}
