//! A motion that ends in standing still, simulated for evaluation alone: rest and free decay.

use super::context::Context;
use super::judge::heaviest;
use anyhow::Result;
use rayon::prelude::*;
use softtissue_clips::{ClipId, DeltaClip, FitSet, MotionClip, Split};
use softtissue_eval::StopProbe;
use softtissue_monitor::Monitor;
use softtissue_synth::SynthError;
use softtissue_synth::dataset::{Bodies, SynthConfig, true_clip};
use std::path::{Path, PathBuf};

/// Name of the motion in the generator.
const MOTION: &str = "hop_then_stand";
/// Seconds of a probe, of which the last ones are still.
const SECONDS: f32 = 4.5;
/// Seconds of stillness.
const STILL: f32 = 2.0;

/// The probes of the heaviest subjects, for generated scans; none for scans of real people, whose flesh cannot be
/// asked.
pub fn stop_probes(context: &Context, fit: &FitSet, split: &Split, generated: bool) -> Result<Vec<StopProbe>> {
    let wanted = context.config.eval.decay_subjects;
    if !generated || wanted == 0 {
        return Ok(vec![]);
    }
    let synth = context.config.synth.clone();
    let config =
        SynthConfig { motions: vec![MOTION.into()], frames: (SECONDS * synth.fps) as usize, takes: 1, ..synth };
    let folder = context.data_dir.join("cache").join(format!("stop-{}", &config.fingerprint()?[..16]));
    let subjects = heaviest_subjects(fit, &split.train, wanted)?;
    simulate(&config, &subjects, &folder, context.monitor)?;
    let probe = |subject: &String| {
        let (motion, deltas) = kept(&folder, subject);
        let motion = MotionClip::read(&motion)?;
        let stop_frame = motion.len().saturating_sub((STILL * motion.fps) as usize);
        let truth = Some(DeltaClip::read(&deltas)?.deltas);
        Ok(StopProbe { beta: fit.subject(subject)?.beta, motion, stop_frame, truth })
    };
    subjects.iter().map(probe).collect()
}

/// Names of the `count` heaviest subjects of the clips, the heaviest first.
fn heaviest_subjects(fit: &FitSet, clips: &[ClipId], count: usize) -> Result<Vec<String>> {
    let mut left = clips.to_vec();
    let mut subjects = Vec::new();
    while subjects.len() < count {
        let Some(next) = heaviest(fit, &left)? else { break };
        left.retain(|id| id.subject != next.subject);
        subjects.push(next.subject);
    }
    Ok(subjects)
}

/// Where a subject's motion and deltas are kept.
fn kept(folder: &Path, subject: &str) -> (PathBuf, PathBuf) {
    (folder.join(format!("{subject}-motion.safetensors")), folder.join(format!("{subject}-deltas.safetensors")))
}

/// Simulates the subjects that are not kept yet. The deltas are written last.
fn simulate(config: &SynthConfig, subjects: &[String], folder: &Path, monitor: &dyn Monitor) -> Result<()> {
    let missing: Vec<&String> = subjects.iter().filter(|s| !kept(folder, s).1.exists()).collect();
    if missing.is_empty() {
        return Ok(());
    }
    let bodies = Bodies::generate(config)?;
    monitor.begin("simulate stops", missing.len() as u64, "clips");
    let done = missing.par_iter().try_for_each(|subject| {
        if monitor.should_stop() {
            return Err(SynthError::Stopped.into());
        }
        let (motion, deltas) = true_clip(config, &bodies, subject, MOTION)?;
        let (motion_path, deltas_path) = kept(folder, subject);
        motion.write(&motion_path)?;
        deltas.write(&deltas_path)?;
        monitor.advance(1, subject);
        Ok(())
    });
    monitor.end();
    done
}
