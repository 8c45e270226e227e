//! Motions that end in standing still, simulated for evaluation alone: rest and free decay.

use super::context::Context;
use super::judge::heaviest;
use anyhow::Result;
use softtissue_body::BodyModel;
use softtissue_clips::{ClipId, FitSet, Split, TruthSet};
use softtissue_eval::StopProbe;
use softtissue_synth::dataset;

/// Name of the motion in the generator.
const MOTION: &str = "hop_then_stand";
/// Seconds of a probe, of which the last ones are still.
const SECONDS: f32 = 4.5;
/// Seconds of stillness.
const STILL: f32 = 2.0;

/// The probes of the heaviest subjects, for generated scans; none for scans of real people, whose flesh cannot be
/// asked.
pub fn stop_probes(
    context: &Context,
    body: &BodyModel,
    fit: &FitSet,
    split: &Split,
    generated: bool,
) -> Result<Vec<StopProbe>> {
    let wanted = context.config.eval.decay_subjects;
    if !generated || wanted == 0 {
        return Ok(vec![]);
    }
    let mut config = context.config.synth.clone();
    config.motions = vec![MOTION.into()];
    config.takes = 1;
    config.frames = (SECONDS * config.fps) as usize;
    let out = context.data_dir.join("cache").join(format!("probe-{}", &config.fingerprint()[..16]));
    let set = dataset::write(&config, &out, context.monitor)?;
    let truth = TruthSet::open(&dataset::truth_path(&out))?;
    let mut left: Vec<ClipId> = split.train.clone();
    let mut probes = Vec::new();
    while let Some(next) = heaviest(fit, &left)?.filter(|_| probes.len() < wanted) {
        left.retain(|id| id.subject != next.subject);
        let id = ClipId::new(&next.subject, MOTION, 0);
        if !set.ids().contains(&id) {
            continue;
        }
        let motion = truth.motion(&id)?;
        let deltas = truth.deltas(&id)?.deltas;
        debug_assert_eq!(deltas.points_per_frame(), body.vertex_count());
        let stop_frame = motion.len().saturating_sub((STILL * motion.fps) as usize);
        probes.push(StopProbe { beta: fit.subject(&next.subject)?.beta, motion, stop_frame, truth: Some(deltas) });
    }
    Ok(probes)
}
