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
    /// Undamped frequencies of the bank, Hz. Default ten from 1.2 to 12, evenly in the logarithm. Empty: no bank, the
    /// readout sees the features of the frame alone (static ridge).
    pub frequencies_hz: Vec<f32>,
    /// Damping ratios, each with every frequency. Default 0.08, 0.2, 0.4.
    pub damping_ratios: Vec<f32>,
    /// Whether the readout also sees the features themselves. Default true.
    pub direct: bool,
    /// Shape terms that multiply the readout, as exponents of `beta[0], beta[1], ...`; the first, `[]`, is the constant.
    /// Default 1, `beta[1]`, its square: one readout for all subjects that bends with body mass.
    pub shape_terms: Vec<Vec<u8>>,
    /// Ridge strengths tried on validation, as parts of the features' total variance. Default six from 1e-6 to 1e-1.
    pub strengths: Vec<f64>,
    /// Every how many-th frame is an equation. Default 2: neighbours say nearly the same, and the fit costs the cube.
    pub frame_stride: usize,
}

impl Default for ReadoutConfig {
    fn default() -> Self {
        Self {
            frequencies_hz: logarithmic(1.2, 12.0, 10),
            damping_ratios: vec![0.08, 0.2, 0.4],
            direct: true,
            shape_terms: vec![vec![], vec![0, 1], vec![0, 2]],
            strengths: vec![1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1],
            frame_stride: 2,
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
    /// The chosen strength; the median where each coefficient has its own.
    pub strength: f64,
    /// Its score on the validation clips.
    pub score: Score,
    /// Strengths tried, with their scores.
    pub tried: Vec<(f64, Score)>,
}

/// Fits a readout on `train` and chooses a ridge strength for each coefficient by the squared error of free rollouts on
/// `validation` (the first strength where there is no validation clip). The result is a regressor without recurrent part
/// whose latent is the coefficients, so that the player can run it.
pub fn fit_readout(
    config: &ReadoutConfig,
    blocks: &[FeatureBlock],
    fps: f32,
    train: &[TrainingClip],
    validation: &[TrainingClip],
    score: &SoftScore,
) -> Result<Selected<plain::Regressor>, ModelError> {
    let mut regressor = untrained(config, blocks, fps, train)?;
    let stride = config.frame_stride.max(1);
    let rows: Vec<Equations> = train.par_iter().map(|clip| equations(&regressor, clip, stride)).collect();
    let ridge = Ridge::new(&rows)?;
    let held: Vec<Equations> = validation.par_iter().map(|clip| equations(&regressor, clip, 1)).collect();
    let mut fits = Vec::with_capacity(config.strengths.len());
    for &strength in &config.strengths {
        check_strength(strength)?;
        let readout = ridge.solve(strength)?;
        let clips: Vec<Vec<f32>> = held.par_iter().map(|clip| predict(&readout, clip)).collect();
        fits.push(Fit { strength, readout, clips });
    }
    let total = |clips: &dyn Fn(usize) -> Vec<f32>| {
        let mut sum = Score::default();
        held.iter().enumerate().for_each(|(i, h)| sum.add(score.clip(&clips(i), &h.targets)));
        sum
    };
    let tried = fits.iter().map(|fit| (fit.strength, total(&|i| fit.clips[i].clone()))).collect();
    let (readout, strengths, clips) = best_of_each(&fits, &held)?;
    let (strength, score) = (median(&strengths), total(&|i| clips[i].clone()));
    let inputs = readout.weight.len() / readout.bias.len().max(1);
    regressor.shortcut =
        plain::Linear { weight: Matrix::new(readout.bias.len(), inputs, readout.weight), bias: readout.bias };
    Ok(Selected { model: regressor, strength, score, tried })
}

/// One strength's solution and what it predicts for the validation clips.
struct Fit {
    strength: f64,
    readout: Readout,
    clips: Vec<Vec<f32>>,
}

/// Each coefficient's weights from the strength that predicts it with the least squared error on validation: the late
/// components hold more noise than motion and want a stronger ridge. Returns the readout, the strengths and its
/// predictions.
fn best_of_each(fits: &[Fit], held: &[Equations]) -> Result<(Readout, Vec<f64>, Vec<Vec<f32>>), ModelError> {
    let first = fits.first().ok_or_else(no_strength)?;
    let (mut readout, mut clips) = (first.readout.clone(), first.clips.clone());
    let outputs = readout.bias.len();
    let inputs = readout.weight.len() / outputs.max(1);
    let mut strengths = Vec::with_capacity(outputs);
    for o in 0..outputs {
        let error = |fit: &Fit| -> f64 {
            let pairs = fit.clips.iter().zip(held).flat_map(|(p, h)| p.iter().zip(&h.targets).skip(o).step_by(outputs));
            pairs.map(|(p, t)| f64::from(p - t).powi(2)).sum()
        };
        let errors: Vec<f64> = fits.iter().map(error).collect();
        let best = (0..fits.len()).fold(0, |b, i| if errors[i] < errors[b] { i } else { b });
        let fit = &fits[best];
        strengths.push(fit.strength);
        readout.bias[o] = fit.readout.bias[o];
        let row = o * inputs..(o + 1) * inputs;
        readout.weight[row.clone()].copy_from_slice(&fit.readout.weight[row]);
        for (to, from) in clips.iter_mut().zip(&fit.clips) {
            to.iter_mut().zip(from).skip(o).step_by(outputs).for_each(|(to, from)| *to = *from);
        }
    }
    Ok((readout, strengths, clips))
}

fn median(numbers: &[f64]) -> f64 {
    let mut sorted = numbers.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(0.0)
}

fn no_strength() -> ModelError {
    ModelError::Config("no ridge strength is named; name one in `strengths`".into())
}

fn check_strength(strength: f64) -> Result<(), ModelError> {
    if strength > 0.0 && strength.is_finite() {
        return Ok(());
    }
    Err(ModelError::Config(format!("ridge strength {strength} is not above 0; correct `strengths`")))
}

/// Solves at each strength and keeps the one with the lowest soft ratio.
pub(super) fn select<M>(
    strengths: &[f64],
    mut solve: impl FnMut(f64) -> Result<(M, Vec<Score>), ModelError>,
) -> Result<(M, f64, Score, Vec<(f64, Score)>), ModelError> {
    let mut best: Option<(M, f64, Score)> = None;
    let mut tried = Vec::with_capacity(strengths.len());
    for &strength in strengths {
        check_strength(strength)?;
        let (model, clips) = solve(strength)?;
        let mut score = Score::default();
        clips.into_iter().for_each(|c| score.add(c));
        tried.push((strength, score));
        if best.as_ref().is_none_or(|(_, _, b)| score.ratio() < b.ratio()) {
            best = Some((model, strength, score));
        }
    }
    let (model, strength, score) = best.ok_or_else(no_strength)?;
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
