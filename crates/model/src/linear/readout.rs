use super::score::{Score, SoftScore};
use super::solve::{Equations, Readout, Ridge};
use crate::{ModelError, TrainingClip, plain};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use softtissue_bundle::descriptor::{FeatureBlock, FeatureScaling};
use softtissue_bundle::{Matrix, Resonator, ResonatorBank};

/// A linear readout in the vertex metric, with or without a bank of damped resonators between it and the features.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ReadoutConfig {
    /// Undamped frequencies of the bank, Hz. Default eleven from 1.2 to 20, evenly in the logarithm. Empty: no bank, the
    /// readout sees the features of the frame alone (static ridge).
    pub frequencies_hz: Vec<f32>,
    /// Damping ratios, each with every frequency. Default 0.15, 0.5.
    pub damping_ratios: Vec<f32>,
    /// Whether the readout also sees the features themselves. Default true.
    pub direct: bool,
    /// Shape terms that multiply the readout, as exponents of `beta[0], beta[1], ...`; the first, `[]`, is the constant.
    /// Default 1, `beta[1]`, its square: one readout for all subjects that bends with body mass.
    pub shape_terms: Vec<Vec<u8>>,
    /// Ridge strengths tried on validation, as parts of the features' total variance. Default five from 1e-4 to 1e-2.
    pub strengths: Vec<f64>,
    /// Every how many-th frame is an equation. Default 1; more is faster and knows less.
    pub frame_stride: usize,
    /// Part of the frame before that is taken off each equation, 0 to below 1: what a scanner and a fit add drifts
    /// slowly, and generalised least squares with an AR(1) error gives slow parts less weight. Default 0.8.
    pub whitening: f32,
}

impl Default for ReadoutConfig {
    fn default() -> Self {
        Self {
            frequencies_hz: logarithmic(1.2, 20.0, 11),
            damping_ratios: vec![0.15, 0.5],
            direct: true,
            shape_terms: vec![vec![], vec![0, 1], vec![0, 2]],
            strengths: vec![1e-4, 3e-4, 1e-3, 3e-3, 1e-2],
            frame_stride: 1,
            whitening: 0.8,
        }
    }
}

impl ReadoutConfig {
    /// A readout of the features of the frame alone.
    pub fn static_ridge() -> Self {
        Self { frequencies_hz: vec![], ..Self::default() }
    }
}

/// `count` numbers from `first` to `last` with equal ratios.
fn logarithmic(first: f32, last: f32, count: usize) -> Vec<f32> {
    let step = (last / first).ln() / (count.max(2) - 1) as f32;
    (0..count).map(|i| first * (step * i as f32).exp()).collect()
}

/// A fitted model, the ridge strength that validation chose, and every strength's score.
#[derive(Clone, Debug)]
pub struct Selected<M> {
    /// The model at the chosen strength.
    pub model: M,
    /// The chosen strength.
    pub strength: f64,
    /// Its score on the validation clips.
    pub score: Score,
    /// Strengths tried, with their scores.
    pub tried: Vec<(f64, Score)>,
}

/// Fits a readout on `train` and chooses its ridge strength by the soft ratio of free rollouts on `validation`
/// (the first strength where there is no validation clip). The result is a regressor without recurrent part
/// whose latent is the coefficients, so that the player can run it.
pub fn fit_readout(
    config: &ReadoutConfig,
    blocks: &[FeatureBlock],
    fps: f32,
    train: &[TrainingClip],
    validation: &[TrainingClip],
    score: &SoftScore,
) -> Result<Selected<plain::Regressor>, ModelError> {
    if !(0.0..1.0).contains(&config.whitening) {
        let message = format!("whitening is {}; write 0 or more and less than 1", config.whitening);
        return Err(ModelError::Config(message));
    }
    let mut regressor = untrained(config, blocks, fps, train)?;
    let stride = config.frame_stride.max(1);
    let rows: Vec<Equations> =
        train.par_iter().map(|clip| whitened(&regressor, clip, stride, config.whitening)).collect();
    let ridge = Ridge::new(&rows)?;
    let held: Vec<Equations> = validation.par_iter().map(|clip| equations(&regressor, clip, 1)).collect();
    let (readout, strength, score, tried) = select(&config.strengths, |strength| {
        let mut readout = ridge.solve(strength)?;
        readout.bias.iter_mut().for_each(|b| *b /= 1.0 - config.whitening);
        let clips: Vec<Score> =
            held.par_iter().map(|clip| score.clip(&predict(&readout, clip), &clip.targets)).collect();
        Ok((readout, clips))
    })?;
    let inputs = readout.weight.len() / readout.bias.len().max(1);
    regressor.shortcut =
        plain::Linear { weight: Matrix::new(readout.bias.len(), inputs, readout.weight), bias: readout.bias };
    Ok(Selected { model: regressor, strength, score, tried })
}

/// The chosen model, its strength and score, and every strength's score.
type Choice<M> = (M, f64, Score, Vec<(f64, Score)>);

/// Share by which a stronger ridge's soft ratio may lie above the lowest and still be chosen. Poses and deltas of a
/// validation clip come from one fit and share its error, which favours weak ridges.
const PARSIMONY: f64 = 0.02;

/// Solves at each strength and keeps the strongest whose soft ratio is as good as the lowest.
pub(super) fn select<M>(
    strengths: &[f64],
    mut solve: impl FnMut(f64) -> Result<(M, Vec<Score>), ModelError>,
) -> Result<Choice<M>, ModelError> {
    let mut found: Vec<(M, f64, Score)> = Vec::with_capacity(strengths.len());
    for &strength in strengths {
        if !(strength > 0.0 && strength.is_finite()) {
            return Err(ModelError::Config(format!("ridge strength {strength} is not above 0; correct `strengths`")));
        }
        let (model, clips) = solve(strength)?;
        let mut score = Score::default();
        clips.into_iter().for_each(|c| score.add(c));
        found.push((model, strength, score));
    }
    let tried = found.iter().map(|(_, strength, score)| (*strength, *score)).collect();
    let lowest = found.iter().map(|(_, _, score)| score.ratio()).fold(f64::INFINITY, f64::min);
    let unjudged = !lowest.is_finite();
    let good = |score: &Score| unjudged || score.ratio() <= lowest * (1.0 + PARSIMONY);
    let (model, strength, score) = found
        .into_iter()
        .filter(|(_, _, score)| good(score))
        .reduce(|a, b| if !unjudged && b.1 > a.1 { b } else { a })
        .ok_or_else(|| ModelError::Config("no ridge strength is named; name one in `strengths`".into()))?;
    Ok((model, strength, score, tried))
}

/// Everything of the regressor but its weights.
fn untrained(
    config: &ReadoutConfig,
    blocks: &[FeatureBlock],
    fps: f32,
    train: &[TrainingClip],
) -> Result<plain::Regressor, ModelError> {
    let features: Vec<&[f32]> = train.iter().map(|c| c.features.as_slice()).collect();
    let input = FeatureScaling::fit(&features, blocks);
    let shape = shape_scaling(train);
    let mut resonators = Vec::new();
    for &frequency in &config.frequencies_hz {
        for &damping in &config.damping_ratios {
            let resonator = Resonator { frequency, damping };
            if resonator.pole(fps).is_none() {
                return Err(ModelError::Config(format!(
                    "a resonator of {frequency} Hz and damping ratio {damping} is not stable at {fps} frames a second; \
                     frequencies lie between 0 and half the rate, ratios between 0 and 1"
                )));
            }
            resonators.push(resonator);
        }
    }
    // Forces drive the flesh; pose entries beside them only bias it. Without forces everything drives.
    let driving = blocks.iter().find(|b| b.name == "modal-forces").map_or(usize::MAX, |b| b.range.end);
    let channels = input.kept.iter().filter(|d| (**d as usize) < driving).count();
    let bank = (!resonators.is_empty()).then(|| ResonatorBank::new(resonators, channels, fps));
    let shape_terms = config.shape_terms.iter().filter_map(|powers| kept_powers(powers, &shape)).collect();
    Ok(plain::Regressor {
        input,
        shape,
        shape_terms,
        bank,
        direct: config.direct,
        shortcut: plain::Linear::default(),
        recurrent: None,
    })
}

/// Each shape coefficient has its own scale; what did not vary is dropped.
fn shape_scaling(train: &[TrainingClip]) -> FeatureScaling {
    let size = train.iter().map(|c| c.beta.len()).max().unwrap_or(0);
    let shapes: Vec<Vec<f32>> = train
        .iter()
        .map(|c| {
            let mut beta = c.beta.clone();
            beta.resize(size, 0.0);
            beta
        })
        .collect();
    let shapes: Vec<&[f32]> = shapes.iter().map(Vec::as_slice).collect();
    let names: Vec<String> = (0..size).map(|i| format!("beta[{i}]")).collect();
    let blocks: Vec<(&str, usize)> = names.iter().map(|n| (n.as_str(), 1)).collect();
    FeatureScaling::fit(&shapes, &FeatureBlock::in_a_row(&blocks))
}

/// Exponents of the kept coefficients; `None` where the term needs one that never varied.
fn kept_powers(powers: &[u8], shape: &FeatureScaling) -> Option<Vec<u8>> {
    let needed = powers.iter().enumerate().filter(|(_, p)| **p > 0);
    if needed.clone().any(|(i, _)| !shape.kept.contains(&(i as u32))) {
        return None;
    }
    Some(shape.kept.iter().map(|k| powers.get(*k as usize).copied().unwrap_or(0)).collect())
}

/// Runs the memory over a clip from rest and keeps every `stride`-th frame.
fn equations(regressor: &plain::Regressor, clip: &TrainingClip, stride: usize) -> Equations {
    let scaled = regressor.input.apply_clip(&clip.features);
    let (d, k) = (regressor.feature_count(), clip.coefficient_count());
    let bank_outputs = regressor.bank.as_ref().map_or(0, ResonatorBank::outputs);
    let mut state = vec![0.0; bank_outputs];
    let mut memory = Vec::with_capacity(clip.frames.div_ceil(stride) * regressor.memory_count());
    let mut targets = Vec::with_capacity(clip.frames.div_ceil(stride) * k);
    let mut rows = 0;
    for t in 0..clip.frames {
        let x = &scaled[t * d..(t + 1) * d];
        if let Some(bank) = &regressor.bank {
            bank.step(x, &mut state);
        }
        if t % stride == 0 {
            memory.extend_from_slice(&state);
            if regressor.sees_features() {
                memory.extend_from_slice(x);
            }
            targets.extend_from_slice(&clip.coefficients[t * k..(t + 1) * k]);
            rows += 1;
        }
    }
    let statics = regressor.scaled_shape(&clip.beta);
    Equations { memory, factors: regressor.shape_factors(&statics), statics, targets, rows }
}

/// Every `stride`-th frame's equation less a part of the one before; the first frame has none before it and is left out.
fn whitened(regressor: &plain::Regressor, clip: &TrainingClip, stride: usize, part: f32) -> Equations {
    let all = equations(regressor, clip, 1);
    let kept: Vec<usize> = (1..all.rows).step_by(stride).collect();
    let less = |x: &[f32]| -> Vec<f32> {
        let width = x.len() / all.rows.max(1);
        let row = |t: usize| &x[t * width..(t + 1) * width];
        kept.iter().flat_map(|&t| row(t).iter().zip(row(t - 1)).map(|(now, before)| now - part * before)).collect()
    };
    Equations {
        memory: less(&all.memory),
        targets: less(&all.targets),
        rows: kept.len(),
        statics: all.statics.iter().map(|x| (1.0 - part) * x).collect(),
        factors: all.factors,
    }
}

/// What a readout gives for a clip, `[T, L]`.
fn predict(readout: &Readout, clip: &Equations) -> Vec<f32> {
    let l = readout.bias.len();
    let a = clip.memory.len() / clip.rows.max(1);
    let inputs = readout.weight.len() / l.max(1);
    let mut weight = vec![0.0f32; l * a];
    let mut bias = readout.bias.clone();
    for o in 0..l {
        let row = &readout.weight[o * inputs..(o + 1) * inputs];
        let folded = &mut weight[o * a..(o + 1) * a];
        for (factor, part) in clip.factors.iter().zip(row.chunks_exact(a.max(1))) {
            folded.iter_mut().zip(part).for_each(|(f, w)| *f += factor * w);
        }
        let statics = &row[clip.factors.len() * a..];
        bias[o] += statics.iter().zip(&clip.statics).map(|(w, x)| w * x).sum::<f32>();
    }
    let weight = Matrix::new(l, a, weight);
    let mut out = vec![0.0; clip.rows * l];
    for (memory, y) in clip.memory.chunks_exact(a.max(1)).zip(out.chunks_exact_mut(l.max(1))) {
        weight.times(memory, y);
        y.iter_mut().zip(&bias).for_each(|(y, b)| *y += b);
    }
    out
}
