//! `eval`: judges a run, or a protocol that trains again without what it judges.

use crate::args::{EvalArgs, Protocol};
use crate::config;
use crate::exit::{InputError, UsageError};
use crate::pipeline::{
    BundleMethod, Context, Learned, Opened, Prepared, fold, heaviest, import_or_open, learn, load_body,
    needs_test_clips, open, open_others, oracle, over_time, prepare, write_protocol_report,
};
use crate::run_folder::RunFolder;
use crate::settings::stored;
use crate::signals::Signals;
use crate::terminal::Terminal;
use crate::verbs::avatar;
use crate::verbs::train::{Provenance, finish};
use anyhow::Result;
use softtissue_bundle::Control;
use softtissue_clips::ClipId;
use softtissue_eval::protocol::{Fold, FoldChoice, dyna_cases, leave_one_sequence_out, leave_one_subject_out};
use softtissue_eval::report::plain;
use softtissue_eval::{Method, Metrics, Scene, SubspaceTable, Tally, judge};
use softtissue_model::tune_flesh;
use softtissue_store::read_json;
use std::path::Path;
use std::sync::Arc;

/// Runs the verb.
pub fn run(args: &EvalArgs, signals: &Signals) -> Result<()> {
    let path = args.run.join("config.toml");
    if !path.exists() {
        return Err(InputError(format!("{} holds no run: train first", args.run.display())).into());
    }
    let mut config = stored(&path)?;
    if config.method == config::Method::Autoavatar {
        return avatar::eval(args, &config, signals);
    }
    let bundle = args.run.join("bundle").join("manifest.json");
    if !bundle.exists() {
        let message =
            format!("{} has no finished bundle: go on with `softtissue train --resume` first", args.run.display());
        return Err(InputError(message).into());
    }
    if (!args.against.is_empty() || args.on.is_some()) && args.protocol != Protocol::HeldOut {
        let message =
            "--against and --on judge finished bundles, which saw what a fold leaves out; leave --protocol out";
        return Err(UsageError(message.into()).into());
    }
    if args.protocol != Protocol::HeldOut {
        // a fold is judged by its deltas alone, so it needs the one subspace that they come from
        config.subspace.sizes = vec![config.regressor.latents];
    }
    let provenance: Provenance = read_json(&args.run.join("provenance.json"))?;
    let terminal = Terminal::new(signals.clone(), args.quiet);
    let folder = RunFolder::take(&args.run, true)?;
    let mut context = Context::new(&config, &terminal, &folder, provenance.data_dir.clone())?;
    let opened = open(&context, provenance.data.as_deref())?;
    let metrics = if args.protocol == Protocol::HeldOut {
        if opened.split.test.is_empty() {
            let message = "left no clip out to judge by: train again with --set 'split.test_motions=[...]'";
            return Err(InputError(format!("{} {message}", args.run.display())).into());
        }
        context.learns = false;
        let job = prepare(&context, opened)?;
        let learned = learn(&context, &job.place, &job.body, &job.fit, &job.split, &folder.bundle())?;
        let mut taken: Vec<String> = methods_of(&learned).map(|m| m.name().to_owned()).collect();
        taken.push(learned.bundle.info.method.clone());
        let job = match &args.on {
            Some(scans) => on_other_scans(&context, job, scans)?,
            None => job,
        };
        // What others may not have seen is what is judged, so it has to be known before.
        let others = open_others(&args.against, &job, &taken)?;
        let own = args.on.is_none() && others.is_empty();
        let out = if own { folder.root().to_owned() } else { folder.comparison(args.on.as_deref()) };
        let metrics = finish(&context, &provenance.configuration, &job, &learned, &others, &out)?.metrics;
        if !own {
            context.monitor.say(&format!("measures and report: {}", out.display()));
        }
        metrics
    } else {
        protocol(args, &context, &opened, &provenance.configuration)?
    };
    if args.json {
        crate::print_line(&serde_json::to_string(&metrics)?);
        return Ok(());
    }
    crate::print_line(plain::tables(&metrics).trim_end());
    Ok(())
}

fn protocol(args: &EvalArgs, context: &Context, base: &Opened, title: &str) -> Result<Metrics> {
    let (name, folds) = folds(args, context, base)?;
    let mut tally = Tally::default();
    let oracle = oracle(context, &base.scans)?;
    for Fold { name: left_out, split } in folds {
        let prefix = format!("{name}/{}", left_out.replace('/', "."));
        let bundle_dir = context.run.root().join("folds").join(&prefix);
        let job = fold(context, Arc::clone(&base.body), base.scans.clone(), split, prefix)?;
        let learned = learn(context, &job.place, &job.body, &job.fit, &job.split, &bundle_dir)?;
        // Truth is opened only now that the fold's model is chosen.
        let truth = job.scans.open_truth()?;
        let scene = Scene { body: &job.body, fit: &job.fit, scans: Some(&job.scans.set), truth: truth.as_ref() };
        let ours = BundleMethod::as_learned(&learned.bundle);
        let by = tuning_clip(args.protocol, context, &job);
        let tuned = by.map(|clip| tuned(context, &job, &ours, clip)).transpose()?.flatten();
        let mut methods: Vec<&dyn Method> = vec![&ours];
        methods.extend(tuned.iter().map(|m| m as &dyn Method));
        methods.extend(methods_of(&learned));
        methods.extend(oracle.iter().map(|m| m as &dyn Method));
        let mut one = Tally::default();
        // Nobody is judged by a motion that a new person's flesh may be fitted to.
        let held = |id: &&ClipId| by.is_none_or(|clip| clip.motion != id.motion);
        let judged: Vec<ClipId> = job.split.test.iter().filter(held).cloned().collect();
        judge(&mut one, &scene, &methods, &judged, Some(&left_out), context.monitor)?;
        if let Some(ratio) = one.metrics(name, 0).methods.get(ours.name()).and_then(|m| m.soft_ratio) {
            context.monitor.say(&format!("  {left_out}: soft ratio {ratio:.3}"));
        }
        tally.merge(one);
    }
    let mut metrics = tally.metrics(name, context.config.seed);
    let method = context.config.method_name();
    metrics.over_time = over_time(&tally, &SubspaceTable::default(), &[method.as_str()]);
    metrics.method = Some(method);
    let path = context.run.root().join(format!("metrics-{name}.json"));
    metrics.write(&path)?;
    let report = context.run.root().join(format!("report-{name}")).join("index.html");
    write_protocol_report(context, title, &base.body.model, &metrics, &tally, &report)?;
    context.monitor.say(&format!("measures: {}\nreport: {}", path.display(), report.display()));
    Ok(metrics)
}

/// The clip by which the flesh of the person who is left out is fitted; `None` where nobody is left out or nothing would be
/// left to judge by.
fn tuning_clip<'a>(protocol: Protocol, context: &Context, job: &'a Prepared) -> Option<&'a ClipId> {
    let motion = &context.config.eval.tuning_motion;
    let others = job.split.test.iter().any(|id| id.motion != *motion);
    let clip = job.split.test.iter().find(|id| id.motion == *motion);
    clip.filter(|_| others && protocol == Protocol::Subjects)
}

/// A model of flesh with resonators or a recurrent network, fitted to a clip of a new person, as scanned and fitted: no
/// truth is seen. `None` for other models.
fn tuned(context: &Context, job: &Prepared, learned: &BundleMethod, clip: &ClipId) -> Result<Option<BundleMethod>> {
    if learned.bundle.model.recurrent().is_none() {
        return Ok(None);
    }
    let beta = job.fit.subject(&clip.subject)?.beta;
    let (poses, deltas) = (job.fit.motion(clip)?, job.fit.deltas(clip)?);
    let tuning = tune_flesh(&learned.bundle, &beta, &poses, &deltas, &context.config.tuning, context.monitor)?;
    for r in &tuning.regions {
        let Control { gain, mass, damping, .. } = r.control;
        context.monitor.say(&format!(
            "  {clip}: {} gain {gain:.2}, mass {mass:+.1}, damping {damping:.2}: error {:.3} to {:.3} of the motion",
            r.region.name(),
            r.ratio_before,
            r.ratio_after
        ));
    }
    let name = format!("{}/tuned", learned.name);
    Ok(Some(BundleMethod { name, bundle: Arc::clone(&learned.bundle), controls: tuning.controls }))
}

/// The test motions of other scans, fitted as the run's own were. Their training motions serve the fit alone.
fn on_other_scans(context: &Context, job: Prepared, scans: &Path) -> Result<Prepared> {
    let config = context.config;
    let scans = import_or_open(scans, config, &job.body, &context.data_dir, context.monitor)?;
    let split = config.split.split(&scans.set.ids())?;
    needs_test_clips(&split)?;
    let body = load_body(config, &context.data_dir, context.monitor)?;
    fold(context, Arc::new(body), scans, split, "other scans".into())
}

/// What a run is judged beside: its ablations and the ladder.
fn methods_of(learned: &Learned) -> impl Iterator<Item = &dyn Method> {
    let ladder = learned.ladder.iter().map(|m| m as &dyn Method);
    learned.ablations.iter().map(|m| m as &dyn Method).chain(ladder)
}

/// The names of `--folds`.
fn named(text: &str) -> Result<Vec<String>> {
    let names: Vec<String> = text.split(',').map(|n| n.trim().to_owned()).collect();
    match names.iter().any(String::is_empty) {
        true => {
            Err(UsageError(format!("--folds {text:?} has an empty name; write names with commas between, or all"))
                .into())
        }
        false => Ok(names),
    }
}

fn folds(args: &EvalArgs, context: &Context, base: &Opened) -> Result<(&'static str, Vec<Fold>)> {
    let clips = base.scans.set.ids();
    let choice = match args.folds.as_deref() {
        Some("all") => FoldChoice::All,
        Some(names) => FoldChoice::Named(named(names)?),
        None if args.protocol == Protocol::Sequences => match heaviest(&prepare(context, base.clone())?.fit, &clips)? {
            Some(id) => FoldChoice::Networks { subject: id.subject },
            None => FoldChoice::All,
        },
        None => FoldChoice::All,
    };
    let split = &context.config.split;
    Ok(match args.protocol {
        Protocol::DynaCases => {
            let judged = if base.split.test.is_empty() { &clips } else { &base.split.test };
            let Some(id) = heaviest(&prepare(context, base.clone())?.fit, judged)? else {
                return Err(InputError("there is no clip to judge".into()).into());
            };
            ("dyna-cases", dyna_cases(&clips, split, &id.subject, &id.motion, &choice)?)
        }
        Protocol::Subjects => ("leave-one-subject-out", leave_one_subject_out(&clips, split, &choice)?),
        _ => ("leave-one-sequence-out", leave_one_sequence_out(&clips, split, &choice)?),
    })
}
