//! `view`: a bundle, played by a page that this machine serves; everything else that moves, as a page in one file.

mod avatars;
mod browser;
mod choice;
mod clips;
mod foreign;
mod runs;
mod served;
mod sets;
mod shown;

use crate::args::ViewArgs;
use crate::exit::{InputError, UsageError};
use crate::signals::Signals;
use crate::terminal::Terminal;
use crate::verbs::kind::Kind;
use crate::verbs::near::BodyFinder;
use anyhow::Result;
use choice::Asked;
use shown::Shown;
use softtissue_monitor::Monitor;
use std::path::PathBuf;

/// Runs the verb.
pub fn run(args: &ViewArgs, signals: &Signals) -> Result<()> {
    if args.viz.is_some() && !cfg!(feature = "rerun") {
        let message = "--viz: this softtissue was built without logs for Rerun; build it with --features rerun, or leave \
                       --viz out for a page";
        return Err(UsageError(message.into()).into());
    }
    let kind = Kind::of(&args.path)?;
    check_options(args, &kind)?;
    if matches!(kind, Kind::Bundle) {
        return served::run(args, signals);
    }
    let terminal = Terminal::new(signals.clone(), false);
    let shown = shown_of(args, &kind, &terminal)?;
    #[cfg(feature = "rerun")]
    if let Some(log) = &args.viz {
        shown.log(log)?;
        crate::print_line(&log.display().to_string());
    }
    if let Some(out) = args.out.clone().or_else(|| args.viz.is_none().then(|| temporary(&shown.title))) {
        shown.write(&out)?;
        if !args.no_browser {
            browser::open(&std::path::absolute(&out)?.display().to_string());
        }
        crate::print_line(&out.display().to_string());
    }
    Ok(())
}

fn shown_of(args: &ViewArgs, kind: &Kind, monitor: &dyn Monitor) -> Result<Shown> {
    let path = args.path.as_path();
    let finder = BodyFinder::new(path, args.body.as_deref())?;
    let asked = Asked::new(args)?;
    let nothing = |what: &str| {
        Err(InputError(format!(
            "{} is {what}, in which nothing moves: name a run, a fit or scan set, a clip, a motion, scans or a bundle",
            path.display()
        ))
        .into())
    };
    match kind {
        Kind::Run => runs::run(path, args, &asked, monitor),
        Kind::Generated => sets::scans(&path.join("scans"), &asked, &finder, monitor),
        Kind::Truth => sets::scans(&sets::beside(path, "scans"), &asked, &finder, monitor),
        Kind::ScanSet => sets::scans(path, &asked, &finder, monitor),
        Kind::FitSet => sets::fits(path, &asked, &finder, monitor),
        Kind::Tensors(file) => match file.meta("kind") {
            Some("scan") => clips::scan(path, &asked, &finder, monitor),
            Some("delta") => clips::deltas(path, &asked, &finder),
            Some("motion") => clips::motion(path, &asked, &finder),
            Some(other) => nothing(&format!("a {other} file")),
            None => nothing("a file of arrays"),
        },
        Kind::Obj | Kind::Ply => foreign::mesh(path, &asked, matches!(kind, Kind::Ply)),
        Kind::ForeignScans if path.is_dir() && !foreign::may_hold_scans(path) => nothing("a folder of other things"),
        Kind::ForeignScans => foreign::scans(path, &asked, monitor),
        Kind::ForeignMotion => foreign::motion(path, &args.motions.foreign, &asked, &finder),
        Kind::Cache(kept) => nothing(&format!("a cache of {} things", kept.len())),
        Kind::Checkpoint => nothing("a checkpoint"),
        Kind::Anny | Kind::ForeignBody => nothing("a body model"),
        Kind::Bundle => nothing("a bundle"),
    }
}

/// Options that say nothing to what is viewed are refused.
fn check_options(args: &ViewArgs, kind: &Kind) -> Result<()> {
    let refuse = |option: &str, what: &str| Err(UsageError(format!("{option} is for {what}; leave it out")).into());
    let is_bundle = matches!(kind, Kind::Bundle);
    let is_run = matches!(kind, Kind::Run);
    let of_bundles = [
        ("--motion", !args.motions.chosen.is_empty()),
        ("--frames", args.motions.frames.is_some()),
        ("--port", args.port.is_some()),
    ];
    if let Some((option, _)) = of_bundles.iter().find(|(_, given)| *given && !is_bundle) {
        return refuse(option, "the page of a bundle");
    }
    let foreign = &args.motions.foreign;
    let of_motions = [
        ("--skeleton", foreign.skeleton.is_some()),
        ("--units", foreign.units.is_some()),
        ("--up", foreign.up.is_some()),
        ("--source-fps", foreign.source_fps.is_some()),
    ];
    let takes_motions = is_bundle || matches!(kind, Kind::ForeignMotion);
    if let Some((option, _)) = of_motions.iter().find(|(_, given)| *given && !takes_motions) {
        return refuse(option, "foreign motions");
    }
    let of_clips = [
        ("--clip", !args.clips.is_empty()),
        ("--range", args.range.is_some()),
        ("--out", args.out.is_some()),
        ("--viz", args.viz.is_some()),
        ("--body", args.body.is_some()),
    ];
    if let Some((option, _)) = of_clips.iter().find(|(_, given)| *given && is_bundle) {
        return refuse(option, "clips, fits, scans and runs");
    }
    let of_runs = [("--fit", args.fit), ("--data-dir", args.data_dir.is_some())];
    if let Some((option, _)) = of_runs.iter().find(|(_, given)| *given && !is_run) {
        return refuse(option, "runs");
    }
    if is_run && args.body.is_some() {
        return refuse("--body", "clips that do not say which body they are of");
    }
    Ok(())
}

/// A file for a page that nobody gave a name. The system removes it some day.
fn temporary(title: &str) -> PathBuf {
    let plain = |c: char| if c.is_ascii_alphanumeric() || c == '-' { c } else { '_' };
    let name: String = title.chars().take(64).map(plain).collect();
    std::env::temp_dir().join(format!("softtissue-{name}-{}.html", std::process::id()))
}
