//! The body of a configuration: a file of its own, or the procedural body, made once and kept.

use super::context::fingerprint;
use crate::config::Config;
use anyhow::Result;
use softtissue_body::BodyModel;
use softtissue_body::procedural::{ProceduralConfig, generate};
use softtissue_monitor::Monitor;
use softtissue_store::sha256_file;
use std::path::{Path, PathBuf};
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

/// Where the body that the settings name lies, or where it is kept once it is made.
pub fn body_place(config: &Config, data_dir: &Path) -> Result<PathBuf> {
    if config.synth.has_body_file() {
        return Ok(config.synth.body.clone());
    }
    let name = fingerprint(&(env!("CARGO_PKG_VERSION"), GENERATOR, &procedural(config)))?;
    Ok(data_dir.join("cache").join(format!("body-{name}.safetensors")))
}

/// Reads the body that the settings name, or the procedural one from the cache, or makes it and keeps it there.
pub fn load_body(config: &Config, data_dir: &Path, monitor: &dyn Monitor) -> Result<KeptBody> {
    let path = body_place(config, data_dir)?;
    if !config.synth.has_body_file() && !path.exists() {
        monitor.say("  making the parametric body");
        generate(&procedural(config))?.model.write(&path)?;
    }
    // Made or kept, it is read: both give the same numbers.
    Ok(KeptBody { model: Arc::new(BodyModel::read(&path)?), sha256: sha256_file(&path)? })
}

fn procedural(config: &Config) -> ProceduralConfig {
    ProceduralConfig { level: config.synth.level, ..Default::default() }
}
