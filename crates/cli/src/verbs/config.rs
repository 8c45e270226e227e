//! `config`: print, check or explain the settings.

use crate::args::{ConfigAction, ConfigArgs};
use crate::settings::{EMBEDDED, resolve};
use anyhow::Result;

/// Runs the verb.
pub fn run(args: &ConfigArgs) -> Result<()> {
    let config = resolve(&args.settings)?.config;
    match args.action {
        ConfigAction::Print => crate::print_line(toml::to_string(&config)?.trim_end()),
        ConfigAction::Check => {}
        // The default configuration states every setting with its meaning; a test keeps it whole.
        ConfigAction::Explain => crate::print_line(EMBEDDED[0].1.trim_end()),
    }
    Ok(())
}
