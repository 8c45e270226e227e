//! What a run is worth: opened truth, measures, report.

use super::basis::count_components;
use super::bundle::{BundleMethod, LearnedCodec};
use super::context::Context;
use super::job::Prepared;
use super::leak::judge_leak;
use super::learn::Learned;
use super::oracle::Oracle;
use super::probes::stop_probes;
use super::scans::Scans;
use crate::config::Method as Learns;
use crate::memory::peak_memory_bytes;
use anyhow::Result;
use softtissue_clips::{ClipId, FitSet, Split};
use softtissue_eval::{
    CodecPair, DecayTrace, LongRollout, Method, Metrics, Scene, Tally, acceptance, judge, judge_bounded, judge_fit,
    judge_shapes, judge_stops, judge_subspace, training_peaks, without_gru,
};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// What was found.
pub struct Judgement {
    /// All figures.
    pub metrics: Metrics,
    /// Curves behind them.
    pub tally: Tally,
    /// Free decays.
    pub decays: Vec<DecayTrace>,
}

/// Judges a learned model, and `others` beside it, on clips that training has not seen. Truth is opened here and
/// nowhere before.
pub fn judge_run(context: &Context, job: &Prepared, learned: &Learned, others: &[BundleMethod]) -> Result<Judgement> {
    let Prepared { scans, body, fit, split, .. } = job;
    let truth = scans.open_truth()?;
    let oracle = oracle(context, scans)?;
    let scene = Scene { body, fit, scans: Some(&scans.set), truth: truth.as_ref() };
    let ours = BundleMethod { name: learned.bundle.info.method.clone(), bundle: Arc::clone(&learned.bundle) };
    let mut rivals: Vec<&dyn Method> = vec![&ours];
    rivals.extend(others.iter().map(|m| m as &dyn Method));
    let mut methods = rivals.clone();
    methods.extend(learned.ablations.iter().map(|m| m as &dyn Method));
    methods.extend(learned.ladder.iter().map(|m| m as &dyn Method));
    methods.extend(oracle.iter().map(|m| m as &dyn Method));
    let clips = &split.test;

    let mut tally = Tally::default();
    context.timed("judge: test clips", || Ok(judge(&mut tally, &scene, &methods, clips, None, context.monitor)?))?;
    let mut metrics = tally.metrics("held-out", context.config.seed);
    metrics.validation_soft_ratio =
        context.timed("judge: validation clips", || on_validation(&scene, split, &ours, learned, context))?;
    context.timed("judge: subspaces", || judge_codecs(&mut metrics, &scene, learned, clips, context))?;
    let components = || count_components(context, body, &learned.pca, truth.as_ref(), split);
    metrics.components_95 = Some(context.timed("judge: components", components)?);
    metrics.fit = context.timed("judge: fit", || Ok(judge_fit(&scene, &all(split), context.monitor)?))?;
    if context.config.eval.compare_objectives {
        metrics.fit_objectives =
            context.timed("judge: fit objectives", || scans.compare_objectives(context, body, split, &scene))?;
    }
    if context.config.eval.bounded_seconds > 0.0 {
        context.timed("judge: long rollout", || bounded(&mut metrics, &scene, split, &rivals, context))?;
    }
    context.timed("judge: shapes", || {
        let mut asked = rivals.clone();
        asked.extend(oracle.iter().map(|m| m as &dyn Method));
        shapes(&mut metrics, &scene, clips, &asked, context)
    })?;
    if context.config.method == Learns::Softsmpl {
        metrics.leak = context.timed("judge: leak", || judge_leak(context, body, fit, &all(split), &learned.bundle))?;
    }
    let decays = context.timed("judge: rest and decay", || {
        let probes = stop_probes(context, fit, split, truth.is_some() && scans.generated)?;
        let ladder = learned.ladder.iter().filter(|m| m.name.starts_with("ar2-subject") || m.name == "resonators");
        let mut heard = rivals.clone();
        heard.extend(ladder.map(|m| m as &dyn Method));
        Ok(judge_stops(&mut metrics, body, &heard, &probes, context.monitor)?)
    })?;
    metrics.peak_memory_bytes = peak_memory_bytes();
    metrics.method = Some(ours.name.clone());
    metrics.gates = acceptance(&metrics);
    Ok(Judgement { metrics, tally, decays })
}

/// Soft ratio of the method and of the same without its recurrent unit on the clips that selected it.
fn on_validation(
    scene: &Scene,
    split: &Split,
    ours: &BundleMethod,
    learned: &Learned,
    context: &Context,
) -> Result<BTreeMap<String, f64>> {
    let mut methods: Vec<&dyn Method> = vec![ours];
    let bare = without_gru(&ours.name);
    methods.extend(learned.ablations.iter().filter(|m| m.name == bare).map(|m| m as &dyn Method));
    let mut tally = Tally::default();
    judge(&mut tally, &Scene { scans: None, ..*scene }, &methods, &split.validation, None, context.monitor)?;
    let figures = tally.metrics("validation", context.config.seed).methods;
    let ratio = |m: &&dyn Method| Some((m.name().to_owned(), figures.get(m.name())?.soft_ratio?));
    Ok(methods.iter().filter_map(ratio).collect())
}

/// The simulator, where the scans are its own.
pub fn oracle(context: &Context, scans: &Scans) -> Result<Option<Oracle>> {
    let asked = context.config.eval.oracle && scans.generated;
    Ok(if asked { Some(Oracle::new(&context.config.synth)?) } else { None })
}

/// Values of `beta[1]` at which the answer to body mass is measured (SoftSMPL fig. 8); the lowest is the heaviest.
const SHAPES: [f32; 7] = [-2.5, -2.0, -1.5, -1.0, -0.5, 0.0, 0.5];

/// The heaviest subject's first test clip on bodies of other mass.
fn shapes(
    metrics: &mut Metrics,
    scene: &Scene,
    clips: &[ClipId],
    methods: &[&dyn Method],
    context: &Context,
) -> Result<()> {
    let Some(id) = heaviest(scene.fit, clips)? else { return Ok(()) };
    let Some(motion) = scene.motion(&id, scene.main_channel())? else { return Ok(()) };
    Ok(judge_shapes(metrics, scene.body, methods, &scene.beta(&id)?, &motion, &SHAPES, context.monitor)?)
}

fn all(split: &Split) -> Vec<ClipId> {
    split.train.iter().chain(&split.validation).chain(&split.test).cloned().collect()
}

/// The subspaces on the clips of those whom they know; where everyone has their own, person by person too.
fn judge_codecs(
    metrics: &mut Metrics,
    scene: &Scene,
    learned: &Learned,
    clips: &[ClipId],
    context: &Context,
) -> Result<()> {
    let known = learned.codecs.iter().filter_map(|c| c.subjects.as_ref()).flatten();
    let known: BTreeSet<&str> = known.map(String::as_str).collect();
    let clips: Vec<ClipId> =
        clips.iter().filter(|id| known.is_empty() || known.contains(id.subject.as_str())).cloned().collect();
    let pairs: Vec<CodecPair> = learned.codecs.iter().map(LearnedCodec::pair).collect();
    metrics.subspace = judge_subspace(scene, &pairs, &clips, context.monitor)?;
    for subject in known {
        let own: Vec<ClipId> = clips.iter().filter(|id| id.subject == subject).cloned().collect();
        if !own.is_empty() {
            let table = judge_subspace(scene, &pairs, &own, context.monitor)?;
            metrics.subspace_by_subject.insert(subject.to_owned(), table);
        }
    }
    Ok(())
}

fn bounded(
    metrics: &mut Metrics,
    scene: &Scene,
    split: &Split,
    methods: &[&dyn Method],
    context: &Context,
) -> Result<()> {
    let Some(heaviest) = heaviest(scene.fit, &split.train)? else { return Ok(()) };
    let motions = split
        .train
        .iter()
        .filter(|id| id.subject == heaviest.subject)
        .map(|id| Ok(scene.fit.motion(id)?))
        .collect::<Result<Vec<_>>>()?;
    let training = training_peaks(scene, &split.train)?;
    let seconds = context.config.eval.bounded_seconds;
    let long = LongRollout { subject: &heaviest, motions: &motions, seconds, training: &training };
    Ok(judge_bounded(metrics, scene, methods, &long, context.monitor)?)
}

/// A clip of the subject with the least `beta[1]`: the heaviest.
pub fn heaviest(fit: &FitSet, clips: &[ClipId]) -> Result<Option<ClipId>> {
    let mut best: Option<(f32, ClipId)> = None;
    for id in clips {
        let mass = fit.subject(&id.subject)?.beta.get(1).copied().unwrap_or(0.0);
        if best.as_ref().is_none_or(|(m, _)| mass < *m) {
            best = Some((mass, id.clone()));
        }
    }
    Ok(best.map(|(_, id)| id))
}
