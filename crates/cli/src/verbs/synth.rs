//! `synth`: scans with known truth, from code alone.

use crate::args::SynthArgs;
use crate::settings::resolve;
use crate::signals::Signals;
use crate::terminal::Terminal;
use crate::verbs::data_dir;
use anyhow::Result;
use softtissue_synth::dataset;

/// Runs the verb.
pub fn run(args: &SynthArgs, signals: &Signals) -> Result<()> {
    let config = resolve(&args.settings)?.config;
    let terminal = Terminal::new(signals.clone(), args.settings.quiet);
    let fingerprint = config.synth.fingerprint()?;
    let cache = || data_dir(&args.settings).join("cache").join(&fingerprint[..16]);
    let out = args.out.clone().unwrap_or_else(cache);
    let set = dataset::write(&config.synth, &out, &terminal)?;
    crate::print_line(&format!("{} clips: {}", set.clips().len(), dataset::scans_path(&out).display()));
    crate::print_line(&format!("their truth: {}", dataset::truth_path(&out).display()));
    Ok(())
}
