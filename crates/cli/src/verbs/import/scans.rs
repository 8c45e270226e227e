//! `import scans`: OBJ sequences into a scan set.

use crate::args::{ImportScansArgs, LengthUnit};
use crate::pipeline::load_body;
use crate::settings::resolve;
use crate::signals::Signals;
use crate::terminal::Terminal;
use crate::verbs::data_dir;
use anyhow::Result;
use softtissue_import::{ImportLimits, SequenceConfig, Units, import_obj_sequences};

/// Runs the verb.
pub fn run(args: &ImportScansArgs, signals: &Signals) -> Result<()> {
    let config = resolve(&args.settings)?.config;
    let terminal = Terminal::new(signals.clone(), args.settings.quiet);
    let body = load_body(&config, &data_dir(&args.settings), &terminal)?.model;
    let units = match args.units {
        LengthUnit::Metres => Units::Metres,
        LengthUnit::Centimetres => Units::Centimetres,
        LengthUnit::Millimetres => Units::Millimetres,
    };
    let sequence = SequenceConfig { fps: args.fps, units, limits: ImportLimits::default() };
    let set = import_obj_sequences(&args.source, &body.topology, &sequence, &args.out, &terminal)?;
    crate::print_line(&format!("{} clips: {}", set.clips().len(), args.out.display()));
    Ok(())
}
