//! `train`: the whole job.

use crate::args::TrainArgs;
use crate::config::{Config, Method};
use crate::exit::UsageError;
use crate::pipeline::{
    BundleMethod, Context, Judgement, Learned, Prepared, heaviest, judge_run, learn, needs_test_clips, open, prepare,
    write_report,
};
use crate::run_folder::{METRICS_FILE, REPORT_FILE, RunFolder};
use crate::settings::{Resolved, resolve, stored};
use crate::signals::Signals;
use crate::terminal::Terminal;
use crate::verbs::{avatar, data_dir};
use anyhow::Result;
use serde::{Deserialize, Serialize};
use serde_json::json;
use softtissue_bundle::Player;
use softtissue_clips::Split;
use softtissue_eval::report::plain;
use softtissue_export::{Animation, GltfConfig, write_gltf};
use softtissue_monitor::Monitor;
use softtissue_store::{StoreError, read_json, write_json_atomic};
use softtissue_train::TrainError;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// What is kept of how a run was started.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Provenance {
    /// Program and version.
    pub program: String,
    /// Name of the configuration.
    pub configuration: String,
    /// The run's seed.
    pub seed: u64,
    /// Scans that were given, if any.
    pub data: Option<PathBuf>,
    /// Where generated and imported clips lie.
    pub data_dir: PathBuf,
    /// Threads.
    pub threads: usize,
}

/// Runs the verb.
pub fn run(args: &TrainArgs, signals: &Signals) -> Result<()> {
    let begun = Instant::now();
    let Resolved { name, config, licence_stated } = resolve(&args.settings)?;
    let out = args.out.clone().unwrap_or_else(|| Path::new("runs").join(&name));
    let given = Start {
        provenance: Provenance {
            program: format!("softtissue {}", env!("CARGO_PKG_VERSION")),
            configuration: name.clone(),
            seed: config.seed,
            data: args.data.as_deref().map(absolute).transpose()?,
            data_dir: absolute(&data_dir(&args.settings))?,
            threads: rayon::current_num_threads(),
        },
        config,
        licence_stated,
    };
    if args.data.is_none() && !args.resume {
        // The clips are known before they are made.
        check_split(args, &given.config.planned_split()?)?;
    }
    if args.dry_run {
        return plan(&given.config, &given.provenance, &out);
    }
    let terminal = Terminal::new(signals.clone(), args.settings.quiet);
    let folder = RunFolder::take(&out, args.resume)?;
    let (config, provenance) = begin(args, given, &folder)?;
    let context = Context::new(&config, &terminal, &folder, provenance.data_dir.clone())?;
    terminal.say(&format!("{} into {}", provenance.configuration, out.display()));
    // Scans that take long to make belong to a run that can be resumed; scans that cannot be read leave none behind.
    let keep = |when: bool| if when && !args.resume { keep(&folder, &config, &provenance) } else { Ok(()) };
    keep(provenance.data.is_none())?;
    let opened = open(&context, provenance.data.as_deref())?;
    check_split(args, &opened.split)?;
    keep(provenance.data.is_some())?;

    let job = prepare(&context, opened)?;
    if config.method == Method::Autoavatar {
        return avatar::train(
            &context,
            &provenance.configuration,
            &job,
            provenance.data.as_deref(),
            !args.no_eval,
            args.json,
        );
    }
    let learned = learn(&context, &job.place, &job.body, &job.fit, &job.split, &folder.bundle())?;
    if args.no_eval {
        crate::print_line(&format!("bundle: {}", folder.bundle().display()));
        return Ok(());
    }
    let judgement = finish(&context, &provenance.configuration, &job, &learned, &[], folder.root())?;
    context.timed("animation", || animate(&job, &learned, &folder, &terminal))?;
    context.log.event(json!({"event": "done", "seconds": begun.elapsed().as_secs_f64()}))?;
    if args.json {
        crate::print_line(&serde_json::to_string(&judgement.metrics)?);
    } else {
        summary(&judgement, &folder, begun.elapsed().as_secs_f64());
    }
    Ok(())
}

/// Judges, `others` beside the run's own method, and writes measures and report into `folder`.
pub fn finish(
    context: &Context,
    title: &str,
    job: &Prepared,
    learned: &Learned,
    others: &[BundleMethod],
    folder: &Path,
) -> Result<Judgement> {
    let judgement = judge_run(context, job, learned, others)?;
    judgement.metrics.write(&folder.join(METRICS_FILE))?;
    let report = folder.join(REPORT_FILE);
    context.timed("report", || write_report(context, title, job, learned, &judgement, &report))?;
    Ok(judgement)
}

/// What the command line asks for.
struct Start {
    config: Config,
    provenance: Provenance,
    licence_stated: bool,
}

fn check_split(args: &TrainArgs, split: &Split) -> Result<()> {
    if args.no_eval { Ok(()) } else { needs_test_clips(split) }
}

fn absolute(path: &Path) -> Result<PathBuf> {
    Ok(std::path::absolute(path).map_err(|e| StoreError::io("find", path, e))?)
}

/// Writes what the run is: from now on it can be resumed.
fn keep(folder: &RunFolder, config: &Config, provenance: &Provenance) -> Result<()> {
    write_json_atomic(&folder.root().join("provenance.json"), provenance)?;
    folder.write_text("config.toml", &toml::to_string(config)?)
}

/// What the run is: as asked for, or, on a resume, as the folder has it; then other settings are refused.
fn begin(args: &TrainArgs, start: Start, folder: &RunFolder) -> Result<(Config, Provenance)> {
    let Start { mut config, provenance, licence_stated } = start;
    let unlicensed = |config: &mut Config, data: &Option<PathBuf>| {
        if data.is_some() && !licence_stated {
            config.licence = "unspecified".into();
        }
    };
    if !args.resume {
        unlicensed(&mut config, &provenance.data);
        return Ok((config, provenance));
    }
    let path = folder.root().join("config.toml");
    let kept = stored(&path)?;
    let kept_provenance: Provenance = read_json(&folder.root().join("provenance.json"))?;
    unlicensed(&mut config, &kept_provenance.data);
    let settings = &args.settings;
    let given =
        settings.config.is_some() || !settings.set.is_empty() || settings.seed.is_some() || settings.device.is_some();
    if given && config != kept {
        let reason =
            "the settings given are not those that the run was started with; leave them out, or choose another --out";
        return Err(TrainError::Checkpoint { path, reason: reason.into() }.into());
    }
    if provenance.data.is_some() && provenance.data != kept_provenance.data {
        let reason = "--data is not what the run was started with; leave it out, or choose another --out";
        return Err(TrainError::Checkpoint { path, reason: reason.into() }.into());
    }
    Ok((kept, kept_provenance))
}

fn plan(config: &Config, provenance: &Provenance, out: &Path) -> Result<()> {
    let s = &config.synth;
    let clips = s.bmi.len() * s.motions.len() * s.takes as usize;
    crate::print_line(&format!("configuration {}: would write {}", provenance.configuration, out.display()));
    match &provenance.data {
        Some(data) => crate::print_line(&format!("  scans: from {}", data.display())),
        None => crate::print_line(&format!(
            "  scans: {} subjects x {} motions x {} takes of {} frames, {clips} clips, level {}",
            s.bmi.len(),
            s.motions.len(),
            s.takes,
            s.frames,
            s.level
        )),
    }
    crate::print_line(&format!("  fit: {:?}, {:?}", config.fit.solver, config.fit.objective));
    crate::print_line(&format!("  method: {}", config.method_name()));
    crate::print_line(&format!("  {}", method_plan(config)));
    if out.join("config.toml").exists() {
        return Err(UsageError(format!("{} holds a run already: pass --resume or another --out", out.display())).into());
    }
    Ok(())
}

/// What the method will learn, in a line.
fn method_plan(config: &Config) -> String {
    let (subspace, regressor) = (&config.subspace, &config.regressor);
    let networks = |sizes: &[usize], each: u64, latents: usize, steps: u64| {
        format!("subspaces: {sizes:?}, {each} steps each; regressor: {steps} steps on {latents} latent numbers")
    };
    let shared = |steps| networks(&subspace.sizes, subspace.training.steps, regressor.latents, steps);
    match config.method {
        Method::Softtissue => shared(regressor.training.steps),
        Method::Softsmpl => shared(config.softsmpl.training.steps),
        Method::CasasOtaduy => {
            let own = &config.casas_otaduy;
            networks(&own.sizes, own.autoencoder.steps, own.latents, own.regressor.steps)
        }
        Method::Dyna => {
            let own = &config.dyna;
            format!("order {}, at most {} components, tau {}", own.order, own.components, own.tau)
        }
        Method::Autoavatar => {
            let own = &config.autoavatar;
            let names: Vec<&str> = own.networks.iter().map(|n| n.name()).collect();
            format!("networks: {}; {} + {} steps each", names.join(", "), own.teacher.steps, own.rollout.steps)
        }
    }
}

/// An animation of the heaviest subject in a motion that training has not seen.
fn animate(job: &Prepared, learned: &Learned, folder: &RunFolder, monitor: &dyn Monitor) -> Result<()> {
    let Some(id) = heaviest(&job.fit, &job.split.test)? else { return Ok(()) };
    let motion = job.fit.motion(&id)?;
    let mut player = Player::new(&*learned.bundle, &job.fit.subject(&id.subject)?.beta)?;
    let frames = player.rollout_vertices(&motion.rotations, &motion.translations)?;
    let extras = json!({"clip": id.to_string(), "licence": learned.bundle.info.licence});
    let topology = &job.body.topology;
    let animation =
        Animation { name: "softtissue", topology, uv: None, fps: motion.fps, vertices: &frames, extras: &extras };
    write_gltf(&folder.root().join("animation.glb"), &animation, &GltfConfig::default(), monitor)?;
    Ok(())
}

fn summary(judgement: &Judgement, folder: &RunFolder, seconds: f64) {
    let metrics = &judgement.metrics;
    crate::print_line("");
    crate::print_line(&plain::methods(metrics));
    crate::print_line("acceptance                     found        asked");
    for (name, gate) in &metrics.gates {
        crate::print_line(&format!("{name:<30} {:<12} {:<18} {}", gate.found(), gate.asked(), gate.verdict()));
    }
    crate::print_line("");
    for (label, path) in [
        ("report", folder.report()),
        ("bundle", folder.bundle()),
        ("animation", folder.root().join("animation.glb")),
        ("measures", folder.metrics()),
    ] {
        crate::print_line(&format!("{label:<10} {}", path.display()));
    }
    crate::print_line(&format!("done in {:.0} min {:.0} s", (seconds / 60.0).floor(), seconds % 60.0));
}
