//! `train`: the whole job.

use crate::args::TrainArgs;
use crate::config::Config;
use crate::exit::UsageError;
use crate::pipeline::{Context, Judgement, Learned, Prepared, heaviest, judge_run, learn, prepare, write_report};
use crate::run_folder::RunFolder;
use crate::settings::{resolve, stored};
use crate::signals::Signals;
use crate::terminal::Terminal;
use crate::verbs::data_dir;
use anyhow::Result;
use serde::{Deserialize, Serialize};
use serde_json::json;
use softtissue_bundle::Player;
use softtissue_export::{Animation, GltfConfig, write_gltf};
use softtissue_monitor::Monitor;
use softtissue_store::{read_json, write_json_atomic};
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
    let (name, config) = resolve(&args.settings)?;
    let out = args.out.clone().unwrap_or_else(|| Path::new("runs").join(&name));
    let provenance = Provenance {
        program: format!("softtissue {}", env!("CARGO_PKG_VERSION")),
        configuration: name.clone(),
        seed: config.seed,
        data: args.data.clone(),
        data_dir: data_dir(&args.settings),
        threads: rayon::current_num_threads(),
    };
    if args.dry_run {
        return plan(&config, &provenance, &out);
    }
    let terminal = Terminal::new(signals.clone(), args.settings.quiet);
    let folder = RunFolder::take(&out, args.resume)?;
    let (config, provenance) = begin(args, config, provenance, &folder)?;
    let context = Context::new(&config, &terminal, &folder, provenance.data_dir.clone())?;
    terminal.say(&format!("{} into {}", provenance.configuration, out.display()));

    let job = prepare(&context, provenance.data.as_deref())?;
    let learned = learn(&context, &job.place, &job.body, &job.fit, &job.split, &folder.bundle())?;
    if args.no_eval {
        crate::print_line(&format!("bundle: {}", folder.bundle().display()));
        return Ok(());
    }
    let judgement = finish(&context, &provenance.configuration, &job, &learned)?;
    context.timed("animation", || animate(&job, &learned, &folder, &terminal))?;
    context.log.event(json!({"event": "done", "seconds": begun.elapsed().as_secs_f64()}))?;
    if args.json {
        crate::print_line(&serde_json::to_string(&judgement.metrics)?);
    } else {
        summary(&judgement, &folder, begun.elapsed().as_secs_f64());
    }
    Ok(())
}

/// Judges, writes `metrics.json` and the report.
pub fn finish(context: &Context, title: &str, job: &Prepared, learned: &Learned) -> Result<Judgement> {
    let judgement = judge_run(context, &job.scans, &job.body, &job.fit, &job.split, learned)?;
    judgement.metrics.write(&context.run.metrics())?;
    context.timed("report", || write_report(context, title, job, learned, &judgement))?;
    Ok(judgement)
}

/// Writes what the run is, or, on a resume, takes it from the folder and refuses other settings.
fn begin(args: &TrainArgs, config: Config, provenance: Provenance, folder: &RunFolder) -> Result<(Config, Provenance)> {
    let path = folder.root().join("config.toml");
    if !args.resume {
        write_json_atomic(&folder.root().join("provenance.json"), &provenance)?;
        folder.write_text("config.toml", &toml::to_string(&config)?)?;
        return Ok((config, provenance));
    }
    let kept = stored(&path)?;
    let settings = &args.settings;
    let given = settings.config.is_some() || !settings.set.is_empty() || settings.seed.is_some() || settings.device.is_some();
    if given && config != kept {
        let reason = "the settings given are not those that the run was started with; leave them out, or choose another --out";
        return Err(TrainError::Checkpoint { path, reason: reason.into() }.into());
    }
    let kept_provenance: Provenance = read_json(&folder.root().join("provenance.json"))?;
    if args.data.is_some() && args.data != kept_provenance.data {
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
            s.bmi.len(), s.motions.len(), s.takes, s.frames, s.level
        )),
    }
    crate::print_line(&format!("  fit: {:?}, {:?}", config.fit.solver, config.fit.objective));
    crate::print_line(&format!("  subspaces: {:?}, {} steps each", config.subspace.sizes, config.subspace.training.steps));
    crate::print_line(&format!("  regressor: {} steps on {} latent numbers", config.regressor.training.steps, config.regressor.latents));
    if out.join("config.toml").exists() {
        return Err(UsageError(format!("{} holds a run already: pass --resume or another --out", out.display())).into());
    }
    Ok(())
}

/// An animation of the heaviest subject in a motion that training has not seen.
fn animate(job: &Prepared, learned: &Learned, folder: &RunFolder, monitor: &dyn Monitor) -> Result<()> {
    let clips = if job.split.test.is_empty() { &job.split.train } else { &job.split.test };
    let Some(id) = heaviest(&job.fit, clips)? else { return Ok(()) };
    let motion = job.fit.motion(&id)?;
    let mut player = Player::new(&*learned.bundle, &job.fit.subject(&id.subject)?.beta)?;
    let frames = player.rollout_vertices(&motion.rotations, &motion.translations)?;
    let extras = json!({"clip": id.to_string(), "licence": learned.bundle.info.licence});
    let topology = &job.body.topology;
    let animation = Animation { name: "softtissue", topology, fps: motion.fps, vertices: &frames, extras: &extras };
    write_gltf(&folder.root().join("animation.glb"), &animation, &GltfConfig::default(), monitor)?;
    Ok(())
}

fn summary(judgement: &Judgement, folder: &RunFolder, seconds: f64) {
    let metrics = &judgement.metrics;
    crate::print_line("");
    crate::print_line("method                         mean mm   soft ratio   energy");
    for (name, m) in &metrics.methods {
        let number = |x: Option<f64>, digits: usize| x.map_or_else(|| "-".into(), |x| format!("{x:.digits$}"));
        let all = m.regions.get("all").and_then(|r| r.mean_mm);
        let energy = m.regions.get("soft").and_then(|r| r.energy_ratio);
        if all.is_some() {
            crate::print_line(&format!("{name:<30} {:>7}   {:>10}   {:>6}", number(all, 3), number(m.soft_ratio, 3), number(energy, 2)));
        }
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
