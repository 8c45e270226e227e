//! The procedural body of a configuration, made once and kept.

use super::context::fingerprint;
use crate::config::Config;
use anyhow::Result;
use softtissue_body::BodyModel;
use softtissue_body::procedural::{ProceduralConfig, generate};
use softtissue_monitor::Monitor;
use std::path::Path;

/// Reads the body from the cache, or makes it and keeps it there.
pub fn load_body(config: &Config, data_dir: &Path, monitor: &dyn Monitor) -> Result<BodyModel> {
    let settings = ProceduralConfig { level: config.synth.level, ..Default::default() };
    let name = fingerprint(&(env!("CARGO_PKG_VERSION"), &settings))?;
    let path = data_dir.join("cache").join(format!("body-{name}.safetensors"));
    if path.exists() {
        return Ok(BodyModel::read(&path)?);
    }
    monitor.say("  making the parametric body");
    let body = generate(&settings)?.model;
    body.write(&path)?;
    Ok(body)
}
