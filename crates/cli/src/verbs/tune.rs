//! `tune`: a bundle's flesh fitted to one clip of a person.

use crate::args::TuneArgs;
use crate::exit::{InputError, UsageError};
use crate::pipeline::{fit_clips, import_or_open};
use crate::settings::resolve;
use crate::signals::Signals;
use crate::terminal::Terminal;
use crate::verbs::{controls, data_dir};
use anyhow::Result;
use softtissue_bundle::Bundle;
use softtissue_clips::{ClipId, Split};
use softtissue_fit::FittedPeople;
use softtissue_model::{Tuning, tune_flesh};

/// Runs the verb.
pub fn run(args: &TuneArgs, signals: &Signals) -> Result<()> {
    let config = resolve(&args.settings)?.config;
    let terminal = Terminal::new(signals.clone(), args.settings.quiet);
    let bundle = Bundle::read(&args.bundle)?;
    let scans = import_or_open(&args.scans, &config, &bundle.body, &data_dir(&args.settings), &terminal)?;
    let clip = chosen(args, &scans.set.ids())?;
    let split = Split { train: vec![clip.clone()], validation: vec![], test: vec![] };
    let folder = tempfile::tempdir()?;
    let nobody = FittedPeople::new();
    let (body, device) = (&bundle.body, &config.device);
    let fit = fit_clips(&scans.set, &split, body, &config.fit, device, &nobody, folder.path(), &terminal)?;
    let beta = fit.subject(&clip.subject)?.beta;
    let tuning = tune_flesh(&bundle, &beta, &fit.motion(&clip)?, &fit.deltas(&clip)?, &config.tuning, &terminal)?;
    let shape: Vec<String> = beta.iter().map(|b| format!("{b:.3}")).collect();
    let text = text(&tuning, &format!("{clip}, shape {}", shape.join(",")));
    softtissue_store::write_atomic(&args.out, |w| w.write_all(text.as_bytes()))?;
    crate::print_line(text.trim_end());
    crate::print_line(&args.out.display().to_string());
    Ok(())
}

/// The clip that is named, or the only one.
fn chosen(args: &TuneArgs, clips: &[ClipId]) -> Result<ClipId> {
    let known = || clips.iter().take(12).map(ToString::to_string).collect::<Vec<_>>().join(", ");
    match (&args.clip, clips) {
        (None, [only]) => Ok(only.clone()),
        (None, _) => {
            Err(UsageError(format!("{} holds several clips; choose one by --clip: {}", args.scans.display(), known()))
                .into())
        }
        (Some(name), _) => clips.iter().find(|id| id.to_string() == *name).cloned().ok_or_else(|| {
            InputError(format!("{} holds no clip {name:?}; it holds {}", args.scans.display(), known())).into()
        }),
    }
}

fn text(tuning: &Tuning, what: &str) -> String {
    let mut text = format!("# flesh of {what}: error over the body's own in this clip, as learned and so\n");
    for r in &tuning.regions {
        let line = controls::line(r.region, &r.control);
        text += &format!("{line}\n# {}: {:.3} to {:.3}\n", r.region.name(), r.ratio_before, r.ratio_after);
    }
    text
}
