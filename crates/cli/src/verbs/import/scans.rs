//! `import scans`: HDF5, OBJ and PLY sequences and arrays of vertices into a scan set.

use crate::args::{ImportScansArgs, LengthUnit, ScanUp};
use crate::pipeline::{bring_in, load_body};
use crate::settings::resolve;
use crate::signals::Signals;
use crate::terminal::Terminal;
use crate::verbs::data_dir;
use anyhow::Result;
use softtissue_import::scans::{ScanImportConfig, Units, UpAxis};

/// Runs the verb.
pub fn run(args: &ImportScansArgs, signals: &Signals) -> Result<()> {
    let config = resolve(&args.settings)?.config;
    let terminal = Terminal::new(signals.clone(), args.settings.quiet);
    let body = load_body(&config, &data_dir(&args.settings), &terminal)?.model;
    let import = ScanImportConfig {
        fps: args.fps,
        units: args.units.map(|units| match units {
            LengthUnit::Metres => Units::Metres,
            LengthUnit::Centimetres => Units::Centimetres,
            LengthUnit::Millimetres => Units::Millimetres,
        }),
        up: args.up.map(|up| match up {
            ScanUp::Y => UpAxis::Y,
            ScanUp::Z => UpAxis::Z,
            ScanUp::X => UpAxis::X,
            ScanUp::MinusY => UpAxis::MinusY,
        }),
        fill_gaps: args.fill_gaps,
        ..ScanImportConfig::default()
    };
    let set = bring_in(&args.source, &import, args.register, &body, &config.registration, &args.out, &terminal)?;
    crate::print_line(&format!("{} clips: {}", set.clips().len(), args.out.display()));
    Ok(())
}
