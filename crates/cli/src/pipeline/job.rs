//! From a configuration to fitted clips: what every learning begins with.

use super::body::load_body;
use super::context::{Context, Place, fingerprint};
use super::scans::{Scans, fit_scans, import_or_open, make_scans};
use anyhow::Result;
use softtissue_body::BodyModel;
use softtissue_clips::{FitSet, Split};
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

/// Makes or opens the scans (`data`) and fits them.
pub fn prepare(context: &Context, data: Option<&Path>) -> Result<Prepared> {
    let (config, dir, monitor) = (context.config, &context.data_dir, context.monitor);
    let body = context.timed("body", || load_body(config, dir, monitor))?;
    let scans = context.timed("scans", || match data {
        Some(source) => import_or_open(source, config, &body.topology, dir, monitor),
        None => make_scans(config, dir, monitor),
    })?;
    let split = config.split.split(&scans.set.ids())?;
    fold(context, Arc::new(body), scans, split, String::new())
}

/// The same scans with another split; `prefix` names the fold's stages.
pub fn fold(context: &Context, body: Arc<BodyModel>, scans: Scans, split: Split, prefix: String) -> Result<Prepared> {
    let config = context.config;
    let mut place = Place { prefix, fingerprint: String::new() };
    let fit = context.timed(&place.stage("fit"), || {
        fit_scans(config, &scans, &body, &split, &context.data_dir, context.monitor)
    })?;
    place.fingerprint = fingerprint(&(
        &scans.fingerprint,
        body.topology.hash(),
        &split.train,
        &split.validation,
        (config.seed, &config.device, &config.fit),
        (&config.subspace, &config.descriptor, &config.ladder, &config.regressor),
    ))?;
    Ok(Prepared { body, scans, split, fit, place })
}
