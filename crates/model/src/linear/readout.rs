use super::own::{BankLayout, OwnResponse};
use super::score::{Score, SoftScore};
use super::solve::{Equations, Readout, Ridge};
use crate::{ModelError, TrainingClip, plain};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use softtissue_bundle::descriptor::{FeatureBlock, FeatureScaling};
use softtissue_bundle::{Hardening, MassLaw, Matrix, Resonator, ResonatorBank};
use std::collections::BTreeMap;

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
    /// Default 1, `beta[1]`: one readout for all subjects that bends with body mass.
    pub shape_terms: Vec<Vec<u8>>,
    /// How large the weights of a shape term of degree one are expected beside the constant's, of degree two by the square
    /// of it: the smaller, the more alike people are taken to be. Default 0.25. A bank's readout only.
    pub shape_share: f32,
    /// Logarithm of the bank's frequencies for one unit of `beta[1]`: flesh of heavy people (negative) swings slower.
    /// Default 0.25.
    pub frequency_by_mass: f32,
    /// How flesh that is driven harder swings faster and yields less than in proportion: the power of the forces' root
    /// mean square that the bank's frequencies follow. Default 0.3; 0: linear springs.
    pub hardening: f32,
    /// Time constant of these forces' mean square, seconds. Default 0.04.
    pub hardening_seconds: f32,
    /// Whether deltas grow exponentially with body mass, by a rate that is learned. Default true. A bank's readout only.
    pub amplitude_by_mass: bool,
    /// Ridge strength of a first fit in which each component answers to its own force alone, as a part of all
    /// inputs' variance; the readout of all forces learns what that leaves. Zero: no first fit. Default 3e-4.
    pub own_strength: f64,
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
            shape_terms: vec![vec![], vec![0, 1]],
            shape_share: 0.25,
            frequency_by_mass: 0.25,
            hardening: 0.3,
            hardening_seconds: 0.04,
            amplitude_by_mass: true,
            own_strength: 3e-4,
            strengths: vec![1e-4, 3e-4, 1e-3, 3e-3, 1e-2],
            frame_stride: 1,
            whitening: 0.8,
        }
    }
}

impl ReadoutConfig {
    /// The same as a readout of the features of the frame alone.
    pub fn without_memory(&self) -> Self {
        Self { frequencies_hz: vec![], ..self.clone() }
    }

    /// Expected size of a shape term's weights beside the constant's.
    fn share_of(&self, powers: &[u8]) -> f32 {
        let degree: i32 = powers.iter().map(|p| i32::from(*p)).sum();
        if self.frequencies_hz.is_empty() { 1.0 } else { self.shape_share.powi(degree) }
    }

    /// Whether a readout can be fitted with these settings to motion of `fps` frames a second.
    ///
    /// # Errors
    /// Names the setting that is out of range.
    pub fn check(&self, fps: f32) -> Result<(), ModelError> {
        let good = |what: &str, value: f64, right: bool, remedy: &str| match right {
            true => Ok(()),
            false => Err(ModelError::Config(format!("{what} is {value}; write {remedy}"))),
        };
        let (whitening, share, rate) = (self.whitening, self.shape_share, self.frequency_by_mass);
        good("whitening", whitening.into(), (0.0..1.0).contains(&whitening), "0 or more and less than 1")?;
        good("shape_share", share.into(), share > 0.0 && share <= 10.0, "more than 0 and at most 10")?;
        good("frequency_by_mass", rate.into(), rate.abs() <= 2.0, "a number between -2 and 2")?;
        let (exponent, seconds) = (self.hardening, self.hardening_seconds);
        good("hardening", exponent.into(), (0.0..=1.0).contains(&exponent), "a number between 0 and 1")?;
        good("hardening_seconds", seconds.into(), (0.0..=1.0).contains(&seconds), "a number between 0 and 1")?;
        let own = self.own_strength;
        good("own_strength", own, own >= 0.0 && own.is_finite(), "0 or more")?;
        match self.resonators().find(|r| r.pole(fps).is_none()) {
            None => Ok(()),
            Some(Resonator { frequency, damping }) => Err(ModelError::Config(format!(
                "a resonator of {frequency} Hz and damping ratio {damping} is not stable at {fps} frames a second; \
                 frequencies lie between 0 and half the rate, ratios between 0 and 1"
            ))),
        }
    }

    /// How the bank's springs harden; `None` where they are linear.
    fn law_of_hardening(&self) -> Option<Hardening> {
        let law = Hardening { exponent: self.hardening, seconds: self.hardening_seconds, floor: STANDING };
        (self.hardening > 0.0).then_some(law)
    }

    fn resonators(&self) -> impl Iterator<Item = Resonator> + '_ {
        let of = |frequency: f32| self.damping_ratios.iter().map(move |&damping| Resonator { frequency, damping });
        self.frequencies_hz.iter().flat_map(move |&f| of(f))
    }
}

/// Mean square of the forces, beside one in training, below which flesh counts as standing still.
const STANDING: f32 = 0.05;

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
    config.check(fps)?;
    let mut regressor = untrained(config, blocks, fps, train)?;
    let shares = regressor.shape_terms.iter().map(|powers| config.share_of(powers)).collect::<Vec<f32>>();
    let stride = config.frame_stride.max(1);
    let mut rows: Vec<Equations> =
        train.par_iter().map(|clip| whitened(&regressor, &shares, clip, stride, config.whitening)).collect();
    let (channels, outputs) = regressor.bank.as_ref().map_or((1, 0), |b| (b.channels(), b.outputs()));
    let bank = BankLayout { channels, outputs: outputs / channels.max(1), memory: regressor.memory_count() };
    let own = OwnResponse::fit(&rows, bank, config.own_strength)?;
    rows.par_iter_mut().for_each(|clip| own.take_from(clip));
    let ridge = Ridge::new(&rows)?;
    let held: Vec<Equations> = validation.par_iter().map(|clip| equations(&regressor, &shares, clip, 1)).collect();
    let (mut readout, strength, score, tried) = select(&config.strengths, |strength| {
        let mut readout = ridge.solve(strength)?;
        readout.bias.iter_mut().for_each(|b| *b /= 1.0 - config.whitening);
        own.add_to(&mut readout);
        let clips: Vec<Score> = held
            .par_iter()
            .zip(validation)
            .map(|(clip, held)| score.clip(&predict(&readout, clip), &held.coefficients))
            .collect();
        Ok((readout, clips))
    })?;
    let (inputs, a) = (readout.weight.len() / readout.bias.len().max(1), regressor.memory_count());
    for row in readout.weight.chunks_exact_mut(inputs.max(1)) {
        let terms = row.chunks_exact_mut(a.max(1)).zip(&shares);
        terms.for_each(|(term, share)| term.iter_mut().for_each(|w| *w *= share));
    }
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
    let resonators: Vec<Resonator> = config.resonators().collect();
    // Forces drive the flesh; pose entries beside them only bias it. Without forces everything drives.
    let driving = blocks.iter().find(|b| b.name == "modal-forces").map_or(usize::MAX, |b| b.range.end);
    let channels = input.kept.iter().filter(|d| (**d as usize) < driving).count();
    let bank = (!resonators.is_empty())
        .then(|| ResonatorBank::new(resonators, channels, fps).with_hardening(config.law_of_hardening()));
    let shape_terms = config.shape_terms.iter().filter_map(|powers| kept_powers(powers, &shape)).collect();
    let mass = if bank.is_some() { mass_law(config, train) } else { MassLaw::default() };
    Ok(plain::Regressor {
        input,
        shape,
        shape_terms,
        mass,
        bank,
        direct: config.direct,
        shortcut: plain::Linear::default(),
        recurrent: None,
        acquaintance: None,
    })
}

/// How far beyond the people of the training the law of mass goes on, in units of `beta[1]`.
const MASS_MARGIN: f32 = 1.0;

/// What body mass does to frequencies, as configured, and to the speed of deltas, as the clips have it: a line through the
/// logarithms of each person's rms speed.
fn mass_law(config: &ReadoutConfig, train: &[TrainingClip]) -> MassLaw {
    let mut people: BTreeMap<&str, (f64, f64, usize)> = BTreeMap::new();
    for clip in train {
        let k = clip.coefficient_count();
        let steps = clip.coefficients.iter().zip(clip.coefficients.iter().skip(k));
        let person = people.entry(&clip.id.subject).or_default();
        person.0 = f64::from(clip.beta.get(1).copied().unwrap_or(0.0));
        person.1 += steps.map(|(before, now)| f64::from(now - before).powi(2)).sum::<f64>();
        person.2 += clip.frames.saturating_sub(1);
    }
    let points: Vec<(f64, f64)> = people
        .values()
        .filter(|(_, squares, frames)| *squares > 0.0 && *frames > 0)
        .map(|(mass, squares, frames)| (*mass, 0.5 * (squares / *frames as f64).ln()))
        .collect();
    let count = points.len().max(1) as f64;
    let (mean_mass, mean_log) =
        (points.iter().map(|p| p.0).sum::<f64>() / count, points.iter().map(|p| p.1).sum::<f64>() / count);
    let spread: f64 = points.iter().map(|p| (p.0 - mean_mass).powi(2)).sum();
    let common: f64 = points.iter().map(|p| (p.0 - mean_mass) * (p.1 - mean_log)).sum();
    // People of one mass say nothing of another.
    let slope = if config.amplitude_by_mass && spread > 1e-3 { (common / spread).clamp(-2.0, 2.0) } else { 0.0 };
    let least = points.iter().map(|p| p.0).fold(mean_mass, f64::min) as f32;
    let most = points.iter().map(|p| p.0).fold(mean_mass, f64::max) as f32;
    MassLaw {
        frequency: config.frequency_by_mass,
        amplitude: slope as f32,
        centre: mean_mass as f32,
        range: [least - MASS_MARGIN, most + MASS_MARGIN],
    }
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

/// Runs the memory over a clip from rest and keeps every `stride`-th frame. Targets are those of a body whose amplitude is
/// one; `shares` are the factors on the shape terms.
fn equations(regressor: &plain::Regressor, shares: &[f32], clip: &TrainingClip, stride: usize) -> Equations {
    let scaled = regressor.input.apply_clip(&clip.features);
    let (d, k) = (regressor.feature_count(), clip.coefficient_count());
    let bank = regressor.bank_of(&clip.beta);
    let (mut state, mut drive) = (vec![0.0; bank.as_ref().map_or(0, ResonatorBank::outputs)], 0.0);
    let amplitude = regressor.mass.amplitude(&clip.beta);
    let mut memory = Vec::with_capacity(clip.frames.div_ceil(stride) * regressor.memory_count());
    let mut targets = Vec::with_capacity(clip.frames.div_ceil(stride) * k);
    let mut rows = 0;
    for t in 0..clip.frames {
        let x = &scaled[t * d..(t + 1) * d];
        if let Some(bank) = &bank {
            bank.step(x, &mut state, &mut drive);
        }
        if t % stride == 0 {
            memory.extend_from_slice(&state);
            if regressor.sees_features() {
                memory.extend_from_slice(x);
            }
            targets.extend(clip.coefficients[t * k..(t + 1) * k].iter().map(|c| c / amplitude));
            rows += 1;
        }
    }
    let statics = regressor.scaled_shape(&clip.beta);
    let factors = regressor.shape_factors(&statics).iter().zip(shares).map(|(phi, share)| phi * share).collect();
    Equations { memory, factors, amplitude, statics, targets, rows }
}

/// Every `stride`-th frame's equation less a part of the one before; the first frame has none before it and is left out.
fn whitened(regressor: &plain::Regressor, shares: &[f32], clip: &TrainingClip, stride: usize, part: f32) -> Equations {
    let all = equations(regressor, shares, clip, 1);
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
        ..all
    }
}

/// What a readout gives for a clip, `[T, L]`, metres.
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
        y.iter_mut().zip(&bias).for_each(|(y, b)| *y = clip.amplitude * (*y + b));
    }
    out
}
