//! `import motion`: a foreign motion into a motion clip on our skeleton.

use crate::args::ImportMotionArgs;
use crate::exit::UsageError;
use crate::pipeline::load_body;
use crate::settings::resolve;
use crate::signals::Signals;
use crate::terminal::Terminal;
use crate::verbs::data_dir;
use crate::verbs::foreign_motion::{Moved, moved};
use anyhow::Result;
use softtissue_import::motion::RATES;

/// Runs the verb.
pub fn run(args: &ImportMotionArgs, signals: &Signals) -> Result<()> {
    if let Some(fps) = args.fps.filter(|fps| !RATES.contains(&f64::from(*fps))) {
        return Err(UsageError(format!("--fps is {fps}; write {} to {}", RATES.start(), RATES.end())).into());
    }
    let config = resolve(&args.settings)?.config;
    let terminal = Terminal::new(signals.clone(), args.settings.quiet);
    // what cannot be read is said before a body is made
    let read = args.foreign.read(&args.source)?;
    let body = load_body(&config, &data_dir(&args.settings), &terminal)?.model;
    let Moved { clip, provenance, line } = moved(&args.source, &read, &body, &body.shaped(&[]), args.fps)?;
    clip.write_with_provenance(&args.out, &provenance)?;
    crate::print_line(&line);
    crate::print_line(&format!("{} frames at {} a second: {}", clip.len(), clip.fps, args.out.display()));
    Ok(())
}
