//! `fit`: shape, pose and deltas of a scan set.

use crate::args::FitArgs;
use crate::exit::UsageError;
use crate::pipeline::{fit_clips, import_or_open, load_body};
use crate::settings::resolve;
use crate::signals::Signals;
use crate::terminal::Terminal;
use crate::verbs::data_dir;
use anyhow::Result;
use softtissue_clips::FitSet;
use softtissue_fit::FittedPeople;
use std::path::Path;

/// Runs the verb.
pub fn run(args: &FitArgs, signals: &Signals) -> Result<()> {
    let config = resolve(&args.settings)?.config;
    let terminal = Terminal::new(signals.clone(), args.settings.quiet);
    let data = data_dir(&args.settings);
    let body = load_body(&config, &data, &terminal)?.model;
    let scans = import_or_open(&args.scans, &config, &body, &data, &terminal)?;
    let split = config.split.split(&scans.set.ids())?;
    if same_folder(&args.out, scans.set.root()) {
        return Err(
            UsageError(format!("--out {} is the folder of the scans; choose another", args.out.display())).into()
        );
    }
    FitSet::begin(&args.out)?;
    let nobody = FittedPeople::new();
    let fit = fit_clips(&scans.set, &split, &body, &config.fit, &config.device, &nobody, &args.out, &terminal)?;
    crate::print_line(&format!("{} clips fitted: {}", fit.clips().len(), args.out.display()));
    Ok(())
}

fn same_folder(a: &Path, b: &Path) -> bool {
    matches!((a.canonicalize(), b.canonicalize()), (Ok(a), Ok(b)) if a == b)
}
