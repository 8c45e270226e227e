//! What a run is worth: opened truth, measures, report.

use super::basis::count_components;
use super::bundle::{BundleMethod, LearnedCodec};
use super::context::Context;
use super::job::Prepared;
use super::leak::judge_leak;
use super::learn::Learned;
use super::oracle::{ORACLE, Oracle};
use super::probes::stop_probes;
use super::scans::Scans;
use crate::config::Method as Learns;
use crate::memory::peak_memory_bytes;
use anyhow::Result;
use softtissue_clips::{ClipId, FitSet, MotionClip, Split};
use softtissue_eval::{
    ClipCurves, CodecPair, DecayTrace, LongRollout, Method, Metrics, Scene, SubspaceTable, Tally, acceptance, curves,
    judge, judge_bmi, judge_bounded, judge_fit, judge_shapes, judge_stops, judge_subspace, judge_timing,
    training_peaks, without_gru,
};
use std::collections::{BTreeMap, BTreeSet};

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
    let ours = BundleMethod::as_learned(&learned.bundle);
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
    let subspace = context.timed("judge: subspaces", || judge_codecs(&scene, learned, clips, context))?;
    let names: Vec<&str> = rivals.iter().map(|m| m.name()).collect();
    metrics.over_time = over_time(&tally, &subspace, &names);
    (metrics.subspace, metrics.subspace_by_subject) = (subspace.pooled, subspace.by_subject);
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
        let weighs = |m: &BundleMethod| m.bundle.model.autoregressive().is_some();
        let by_index = weighs(&ours) || others.iter().any(weighs);
        shapes(&mut metrics, &scene, clips, &asked, by_index, context)
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
    context.timed("judge: time a frame", || timing(&mut metrics, &scene, clips, &rivals, context))?;
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

/// Body mass indices of the sweep at one height (Dyna sec. 6.3), kg/m^2.
const INDICES: [f32; 9] = [18.0, 20.0, 22.0, 24.0, 26.0, 28.0, 30.0, 32.0, 34.0];

/// The heaviest subject's first test clip on bodies of other mass; `by_index` also by body mass index, which is a
/// question to those who know of it and to whoever stands beside them.
fn shapes(
    metrics: &mut Metrics,
    scene: &Scene,
    clips: &[ClipId],
    methods: &[&dyn Method],
    by_index: bool,
    context: &Context,
) -> Result<()> {
    let Some((beta, motion)) = heaviest_motion(scene, clips)? else { return Ok(()) };
    judge_shapes(metrics, scene.body, methods, &beta, &motion, &SHAPES, context.monitor)?;
    if by_index {
        judge_bmi(metrics, scene.body, methods, &beta, &motion, &INDICES, context.monitor)?;
    }
    Ok(())
}

/// Shape of the heaviest subject, and the motion of their first clip.
fn heaviest_motion(scene: &Scene, clips: &[ClipId]) -> Result<Option<(Vec<f32>, MotionClip)>> {
    let Some(id) = heaviest(scene.fit, clips)? else { return Ok(None) };
    let Some(motion) = scene.motion(&id, scene.main_channel())? else { return Ok(None) };
    Ok(Some((scene.beta(&id)?, motion)))
}

fn timing(
    metrics: &mut Metrics,
    scene: &Scene,
    clips: &[ClipId],
    methods: &[&dyn Method],
    context: &Context,
) -> Result<()> {
    let Some((beta, motion)) = heaviest_motion(scene, clips)? else { return Ok(()) };
    Ok(judge_timing(metrics, methods, &beta, &motion, context.monitor)?)
}

/// Error frame by frame of the heaviest subject's first takes: of the methods, the body alone and the simulator.
pub fn over_time(tally: &Tally, subspace: &SubspaceTable, methods: &[&str]) -> Vec<ClipCurves> {
    let names = [&["body"], methods, &[ORACLE]].concat();
    let heaviest = tally.heaviest().map(ToOwned::to_owned);
    curves(tally, subspace, &names, |id| id.take == 0 && heaviest.as_deref() == Some(&id.subject))
}

fn all(split: &Split) -> Vec<ClipId> {
    split.train.iter().chain(&split.validation).chain(&split.test).cloned().collect()
}

/// The subspaces on the clips of those whom they know.
fn judge_codecs(scene: &Scene, learned: &Learned, clips: &[ClipId], context: &Context) -> Result<SubspaceTable> {
    let known = learned.codecs.iter().filter_map(|c| c.subjects.as_ref()).flatten();
    let known: BTreeSet<&str> = known.map(String::as_str).collect();
    let clips: Vec<ClipId> =
        clips.iter().filter(|id| known.is_empty() || known.contains(id.subject.as_str())).cloned().collect();
    let pairs: Vec<CodecPair> = learned.codecs.iter().map(LearnedCodec::pair).collect();
    Ok(judge_subspace(scene, &pairs, &clips, context.monitor)?)
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
