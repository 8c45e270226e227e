//! The body of a configuration: a file of its own, or the procedural body, made once and kept.

use super::context::fingerprint;
use crate::config::Config;
use anyhow::Result;
use softtissue_body::BodyModel;
use softtissue_body::procedural::{ProceduralConfig, generate};
use softtissue_monitor::Monitor;
use softtissue_store::sha256_file;
use std::path::Path;
use std::sync::Arc;

/// Raised whenever the same settings would give another body, so that a kept one is not mistaken.
const GENERATOR: u32 = 3;

/// A body and the SHA-256 of its file, which names what is fitted with it.
pub struct KeptBody {
    /// The body.
    pub model: Arc<BodyModel>,
    /// SHA-256 of its file.
    pub sha256: String,
}

/// Reads the body that the settings name, or the procedural one from the cache, or makes it and keeps it there.
pub fn load_body(config: &Config, data_dir: &Path, monitor: &dyn Monitor) -> Result<KeptBody> {
    if config.synth.has_body_file() {
        let path = &config.synth.body;
        return Ok(KeptBody { model: Arc::new(BodyModel::read(path)?), sha256: sha256_file(path)? });
    }
    let settings = ProceduralConfig { level: config.synth.level, ..Default::default() };
    let name = fingerprint(&(env!("CARGO_PKG_VERSION"), GENERATOR, &settings))?;
    let path = data_dir.join("cache").join(format!("body-{name}.safetensors"));
    if !path.exists() {
        monitor.say("  making the parametric body");
        generate(&settings)?.model.write(&path)?;
    }
    // Made or kept, it is read: both give the same numbers.
    Ok(KeptBody { model: Arc::new(BodyModel::read(&path)?), sha256: sha256_file(&path)? })
}
