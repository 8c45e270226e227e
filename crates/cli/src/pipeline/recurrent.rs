//! The recurrent network and the linear memory beside it.

use super::context::{Context, Place};
use super::learn::Material;
use crate::config::ShortcutKind;
use anyhow::Result;
use rayon::prelude::*;
use softtissue_body::BodyModel;
use softtissue_bundle::descriptor::FeatureBlock;
use softtissue_bundle::{Acquaintance, Linear, Matrix, Regressor, ResonatorBank, Subspace};
use softtissue_model::linear::{ReadoutConfig, Score, SoftScore, fit_readout};
use softtissue_model::{Autoencoder, ShortcutStart, TrainingClip, truncated};
use softtissue_train::{Clips, MotionSequence, RegressorTrainee, RegressorTraining, Stage};

/// What the regressor learns from.
pub struct RegressorInputs<'a> {
    /// The body.
    pub body: &'a BodyModel,
    /// What the features are.
    pub blocks: &'a [FeatureBlock],
    /// The chosen subspace as plain arrays.
    pub subspace: &'a Subspace,
    /// The same as a network.
    pub network: &'a Autoencoder,
    /// Clips to train on (mirrored ones included) and to select by, targets as PCA coefficients.
    pub clips: Clips<Vec<TrainingClip>>,
    /// Whether the clips to select by are others than those to train on.
    pub validated: bool,
    /// Ridge strength of the shortcut, chosen on validation clips.
    pub strength: f64,
    /// What stands round the recurrent unit.
    pub shortcut: ShortcutKind,
}

/// A learned regressor, what it is without either of its parts, and how it was selected.
#[derive(Clone, Debug)]
pub struct LearnedRegressor {
    /// The regressor as the bundle holds it.
    pub regressor: Regressor,
    /// The shortcut alone, with a gain of its own.
    pub without_gru: Regressor,
    /// The network alone, with a gain of its own.
    pub without_shortcut: Regressor,
    /// Part of the prediction that is the network's; the rest is the resonators'. 1 where the shortcut is linear.
    pub share: f32,
    /// What the mixture is multiplied by, to give back motion that least squares takes.
    pub gain: f32,
    /// Soft ratio on validation, inside the subspace's basis.
    pub soft_ratio: f64,
    /// Step after which the network alone was best on validation.
    pub best_step: u64,
    /// Validation error of the network alone, mm over all vertices.
    pub best_mm: f64,
}

/// Fits the shortcut in closed form and trains the network; with resonators the two are learned apart and mixed as
/// validation has it. `name` is the stage's.
pub fn learn_regressor(
    context: &Context,
    place: &Place,
    name: &str,
    training: &RegressorTraining,
    inputs: RegressorInputs,
) -> Result<LearnedRegressor> {
    let readout = fit_shortcut(context, &inputs, &in_latents(inputs.subspace, &inputs.clips.train))?;
    let (network, best_step, best_mm) = train_network(context, place, name, training, &inputs, &readout)?;
    let score = SoftScore::new(&inputs.subspace.basis, inputs.body);
    let validation = &inputs.clips.validation;
    let judged = |latents: &[Vec<f32>]| judged(inputs.subspace, &score, validation, latents);
    Ok(match inputs.shortcut {
        ShortcutKind::Linear => {
            let mut without_gru = network.clone();
            without_gru.recurrent = None;
            let mut without_shortcut = network.clone();
            without_shortcut.shortcut.weight.data_mut().fill(0.0);
            let soft_ratio = judged(&rollouts(&network, validation)).ratio();
            let regressor = network;
            let (share, gain) = (1.0, 1.0);
            LearnedRegressor { regressor, without_gru, without_shortcut, share, gain, soft_ratio, best_step, best_mm }
        }
        ShortcutKind::Resonators => {
            let latents = [rollouts(&readout, validation), rollouts(&network, validation)];
            let people = people(&inputs.clips.train);
            let stranger = context.config.regressor.stranger;
            // a body that the network has not learned has less of it, here as in the bundle
            let known = acquaintances(&people, stranger, validation);
            let judge = |mix: Mix| judged(&mix.latents(&latents, &known));
            // without either part there is nothing to be cautious with
            let whole = vec![1.0; validation.len()];
            let judge_alone = |mix: Mix| judged(&mix.latents(&latents, &whole));
            let given = context.config.regressor.given_for_motion;
            let tuned =
                |share: f32| if inputs.validated { livelier(&judge_alone, share, given).0 } else { Mix::plain(share) };
            let (mix, soft_ratio) = match inputs.validated {
                true => best_mix(&judge, given),
                false => (Mix::plain(UNTRIED_SHARE), judge(Mix::plain(UNTRIED_SHARE)).ratio()),
            };
            let mixed = |mix: Mix, stranger: f32| mixed(&readout, &network, mix, people.clone(), stranger);
            let alone = |share: f32| mixed(tuned(share), 1.0);
            LearnedRegressor {
                regressor: mixed(mix, stranger),
                without_gru: alone(0.0),
                without_shortcut: alone(1.0),
                share: mix.share,
                gain: mix.gain,
                soft_ratio,
                best_step,
                best_mm,
            }
        }
    })
}

/// A regressor with a linear shortcut and nothing else; `name` is the stage's.
pub fn train_linear(
    context: &Context,
    place: &Place,
    name: &str,
    training: &RegressorTraining,
    inputs: &RegressorInputs,
) -> Result<Regressor> {
    let readout = fit_shortcut(context, inputs, &in_latents(inputs.subspace, &inputs.clips.train))?;
    Ok(train_network(context, place, name, training, inputs, &readout)?.0)
}

/// The strength that validation chooses for a ridge readout of single frames: the start of a linear shortcut.
pub fn ridge_strength(
    context: &Context,
    material: &Material,
    blocks: &[FeatureBlock],
    clips: &Clips<Vec<TrainingClip>>,
) -> Result<f64> {
    let config = linear_readout(&context.config.ladder.resonators);
    let score = SoftScore::new(&material.pca.basis, material.body);
    let fps = context.config.descriptor.fps;
    Ok(fit_readout(&config, blocks, fps, &clips.train, &clips.validation, &score)?.strength)
}

/// A readout without memory or shape terms, from the ladder's settings.
fn linear_readout(ladder: &ReadoutConfig) -> ReadoutConfig {
    ReadoutConfig { frequencies_hz: vec![], shape_terms: vec![vec![]], ..ladder.clone() }
}

/// The recurrent unit with a linear layer around it (SoftSMPL sec. 5), as a regressor of its own. Beside resonators it
/// sees what drives them and starts from nothing; otherwise all features, and its linear layer starts as the readout.
fn train_network(
    context: &Context,
    place: &Place,
    name: &str,
    training: &RegressorTraining,
    inputs: &RegressorInputs,
    readout: &Regressor,
) -> Result<(Regressor, u64, f64)> {
    let all = readout.feature_count();
    let seen = readout.bank.as_ref().map_or(all, ResonatorBank::channels);
    let (columns, latents) = (seen + readout.shape_count(), readout.latent_count());
    let start = match inputs.shortcut {
        ShortcutKind::Linear => start_of(readout),
        ShortcutKind::Resonators => ShortcutStart { weight: vec![0.0; columns * latents], bias: vec![0.0; latents] },
    };
    let sequences = |clips: &[TrainingClip]| clips.iter().map(|clip| sequence(readout, clip, seen)).collect();
    let clips = Clips { train: sequences(&inputs.clips.train), validation: sequences(&inputs.clips.validation) };
    let stage = Stage { name: name.to_owned(), seed: context.config.seed, device: context.device.clone() };
    let directions = inputs.subspace.basis.directions.data();
    let mut trainee = RegressorTrainee::new(training.clone(), &stage, inputs.network, directions, start, clips)?;
    let (best_step, best_mm) = context.train(place, name, &mut trainee, training.steps)?;
    let (network, scale) = (trainee.into_network(), inputs.network.scale);
    let linear = network.to_shortcut(scale);
    let mut recurrent = network.to_recurrent(scale);
    recurrent.gru.w_ih = widened(&recurrent.gru.w_ih, seen, all);
    let regressor = Regressor {
        input: readout.input.clone(),
        shape: readout.shape.clone(),
        shape_terms: vec![vec![]],
        mass: readout.mass,
        bank: None,
        direct: true,
        shortcut: Linear { weight: widened(&linear.weight, seen, all), bias: linear.bias },
        recurrent: Some(recurrent),
        acquaintance: None,
    };
    Ok((regressor, best_step, best_mm))
}

/// `gain ((1 - share) readout + share network)`.
#[derive(Clone, Copy, Debug)]
struct Mix {
    share: f32,
    gain: f32,
}

impl Mix {
    /// Without a gain.
    fn plain(share: f32) -> Self {
        Self { share, gain: 1.0 }
    }

    /// Latents of the mixture of those of the readout and of the network, clip by clip; of the share each has the part that
    /// `known` says.
    fn latents(self, [readout, network]: &[Vec<Vec<f32>>; 2], known: &[f32]) -> Vec<Vec<f32>> {
        let clip = |((readout, network), known): ((&Vec<f32>, &Vec<f32>), &f32)| {
            let share = self.share * known;
            readout.iter().zip(network).map(|(a, b)| self.gain * ((1.0 - share) * a + share * b)).collect()
        };
        readout.iter().zip(network).zip(known).map(clip).collect()
    }
}

/// The network's share where no clip is left to choose it by: on clips that it has seen it would seem to deserve all.
const UNTRIED_SHARE: f32 = 0.3;
/// Steps in which shares from 0 to 1 are tried, ...
const SHARES: u8 = 10;
/// ... and gains from 1 to `MOST_GAIN`.
const GAINS: u8 = 20;
const MOST_GAIN: f32 = 1.5;

/// Part by which a smaller share's soft ratio may lie above the lowest and still be chosen.
const PARSIMONY: f64 = 0.015;

/// The smallest share whose soft ratio is as good as the lowest, and its gain.
fn best_mix(judge: &impl Fn(Mix) -> Score, given: f64) -> (Mix, f64) {
    let share = |i: u8| f32::from(i) / f32::from(SHARES);
    let tried: Vec<(f32, f64)> =
        (0..=SHARES).map(|i| (share(i), judge(Mix { share: share(i), gain: 1.0 }).ratio())).collect();
    let lowest = tried.iter().map(|t| t.1).fold(f64::INFINITY, f64::min);
    let good = tried.iter().find(|t| t.1 <= lowest * (1.0 + PARSIMONY)).expect("the lowest is as good as itself");
    livelier(judge, good.0, given)
}

/// The largest gain that raises the soft ratio of a share by no more than a part `given` and does not move more than
/// the scans do, and the soft ratio there. Least squares predicts less motion than there is, wherever it is unsure.
fn livelier(judge: &impl Fn(Mix) -> Score, share: f32, given: f64) -> (Mix, f64) {
    let lowest = judge(Mix { share, gain: 1.0 }).ratio();
    let gains = (1..=GAINS).map(|i| 1.0 + (MOST_GAIN - 1.0) * f32::from(i) / f32::from(GAINS));
    gains
        .map(|gain| (Mix { share, gain }, judge(Mix { share, gain })))
        .take_while(|(_, score)| score.ratio() <= lowest * (1.0 + given) && score.energy() <= 1.0)
        .last()
        .map_or((Mix { share, gain: 1.0 }, lowest), |(mix, score)| (mix, score.ratio()))
}

/// Predicted latents, clip by clip `[T, L]`, against the scans' coefficients.
fn judged(subspace: &Subspace, score: &SoftScore, clips: &[TrainingClip], latents: &[Vec<f32>]) -> Score {
    let (k, l) = (subspace.components(), subspace.latent_count());
    let mut sum = Score::default();
    let judged: Vec<Score> = clips
        .par_iter()
        .zip(latents)
        .map(|(clip, latents)| {
            let mut scratch = subspace.scratch();
            let mut found = vec![0.0; clip.frames * k];
            for (z, c) in latents.chunks_exact(l).zip(found.chunks_exact_mut(k)) {
                subspace.decode_coefficients(z, c, &mut scratch);
            }
            score.clip(&found, &clip.coefficients)
        })
        .collect();
    judged.into_iter().for_each(|s| sum.add(s));
    sum
}

/// The part of its whole share that the network has on each clip's body.
fn acquaintances(people: &Matrix, stranger: f32, clips: &[TrainingClip]) -> Vec<f32> {
    let whole = Acquaintance { share: 1.0, stranger, people: people.clone(), ..Acquaintance::default() };
    clips.iter().map(|clip| whole.share_of(&clip.beta)).collect()
}

/// The mixture as one regressor that knows whom the network has learned.
fn mixed(readout: &Regressor, network: &Regressor, mix: Mix, people: Matrix, stranger: f32) -> Regressor {
    let mut mixture = readout.clone();
    times(&mut mixture.shortcut, mix.gain);
    if mix.share == 0.0 {
        return mixture;
    }
    assert!(readout.sees_features(), "settings ask for a readout that sees the features");
    let mut around = network.shortcut.clone();
    times(&mut around, mix.gain);
    mixture.recurrent = network.recurrent.clone();
    if let Some(recurrent) = &mut mixture.recurrent {
        times(&mut recurrent.readout, mix.gain);
    }
    mixture.acquaintance = Some(Acquaintance { around, share: mix.share, stranger, people });
    mixture
}

fn times(layer: &mut Linear, factor: f32) {
    layer.weight.data_mut().iter_mut().chain(&mut layer.bias).for_each(|w| *w *= factor);
}

/// Each person of the clips once, `[P, N]` shape coefficients.
fn people(clips: &[TrainingClip]) -> Matrix {
    let mut people: Vec<&[f32]> = vec![];
    for clip in clips {
        if !people.contains(&&clip.beta[..]) {
            people.push(&clip.beta);
        }
    }
    Matrix::new(people.len(), people.first().map_or(0, |beta| beta.len()), people.concat())
}

/// The same clips with latents in the place of coefficients.
fn in_latents(subspace: &Subspace, clips: &[TrainingClip]) -> Vec<TrainingClip> {
    let (k, l) = (subspace.components(), subspace.latent_count());
    clips
        .par_iter()
        .map(|clip| {
            let mut scratch = subspace.scratch();
            let mut latents = vec![0.0; clip.frames * l];
            for (c, z) in clip.coefficients.chunks_exact(k).zip(latents.chunks_exact_mut(l)) {
                subspace.encode_coefficients(c, z, &mut scratch);
            }
            TrainingClip { coefficients: latents, ..clip.clone() }
        })
        .collect()
}

/// The shortcut on the given clips at the one strength that validation chose.
fn fit_shortcut(context: &Context, inputs: &RegressorInputs, clips: &[TrainingClip]) -> Result<Regressor> {
    let ladder = &context.config.ladder.resonators;
    let readout = match inputs.shortcut {
        ShortcutKind::Resonators => ladder.clone(),
        ShortcutKind::Linear => linear_readout(ladder),
    };
    let readout = ReadoutConfig { strengths: vec![inputs.strength], ..readout };
    // One strength leaves nothing to select, so the score only has to have the latents' length.
    let score = SoftScore::new(&truncated(&inputs.subspace.basis, inputs.subspace.latent_count()), inputs.body);
    let fps = context.config.descriptor.fps;
    Ok(fit_readout(&readout, inputs.blocks, fps, clips, &[], &score)?.model)
}

fn rollouts(regressor: &Regressor, clips: &[TrainingClip]) -> Vec<Vec<f32>> {
    clips.par_iter().map(|clip| rollout(regressor, clip)).collect()
}

/// Latents `[T, L]` of a clip, from rest.
fn rollout(regressor: &Regressor, clip: &TrainingClip) -> Vec<f32> {
    let mut state = regressor.start(&clip.beta);
    let mut latents = Vec::with_capacity(clip.frames * regressor.latent_count());
    for features in clip.features.chunks_exact(clip.feature_count()) {
        regressor.step(features, &mut state);
        latents.extend_from_slice(state.latent());
    }
    latents
}

/// Weights `[N, seen + B]` with zeros for the features that are not seen, `[N, all + B]`. Beside resonators a network
/// sees what drives them: pose entries serve a linear readout, but a network learns by them which clip it is in.
fn widened(weight: &Matrix, seen: usize, all: usize) -> Matrix {
    let mut data = Vec::with_capacity(weight.rows() * (weight.cols() + all - seen));
    for row in 0..weight.rows() {
        let (features, shape) = weight.row(row).split_at(seen);
        data.extend_from_slice(features);
        data.extend(std::iter::repeat_n(0.0, all - seen));
        data.extend_from_slice(shape);
    }
    Matrix::new(weight.rows(), weight.cols() + all - seen, data)
}

/// The first `seen` scaled features and the shape, for the recurrent unit and for the linear layer around it.
fn sequence(readout: &Regressor, clip: &TrainingClip, seen: usize) -> MotionSequence {
    let (d, shape) = (readout.feature_count(), readout.scaled_shape(&clip.beta));
    let scaled = readout.input.apply_clip(&clip.features);
    let amplitude = readout.mass.amplitude(&clip.beta);
    let input: Vec<f32> =
        scaled.chunks_exact(d.max(1)).flat_map(|x| x[..seen].iter().copied().chain(shape.iter().copied())).collect();
    MotionSequence {
        input_width: seen + shape.len(),
        input,
        target: clip.coefficients.iter().map(|c| c / amplitude).collect(),
        amplitude,
    }
}

/// The ridge readout as the start of a trained layer: its weight turned to `[inputs, latents]`.
fn start_of(regressor: &Regressor) -> ShortcutStart {
    let w = &regressor.shortcut.weight;
    let weight = (0..w.cols()).flat_map(|i| (0..w.rows()).map(move |o| w.row(o)[i])).collect();
    ShortcutStart { weight, bias: regressor.shortcut.bias.clone() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use softtissue_bundle::descriptor::FeatureScaling;
    use softtissue_bundle::{Gru, MassLaw, Recurrent, Resonator};
    use softtissue_clips::ClipId;

    const FEATURES: usize = 5;
    const LATENTS: usize = 3;

    /// Numbers between -1 and 1 that do not repeat soon.
    fn numbers(count: usize, seed: f32) -> Vec<f32> {
        (0..count).map(|i| ((i as f32 + 1.0) * (1.7 + seed)).sin()).collect()
    }

    fn scaling(size: usize) -> FeatureScaling {
        FeatureScaling {
            input_size: size,
            kept: (0..size as u32).collect(),
            lower: vec![-9.0; size],
            upper: vec![9.0; size],
            scale: vec![1.0; size],
        }
    }

    fn readout() -> Regressor {
        let bank = ResonatorBank::new(vec![Resonator { frequency: 3.0, damping: 0.2 }], 4, 60.0);
        let memory = bank.outputs() + FEATURES;
        let columns = 2 * memory + 2;
        Regressor {
            input: scaling(FEATURES),
            shape: scaling(2),
            shape_terms: vec![vec![0, 1], vec![]],
            mass: MassLaw { frequency: 0.3, amplitude: -0.5, centre: 0.1, range: [-2.0, 2.0] },
            bank: Some(bank),
            direct: true,
            shortcut: Linear {
                weight: Matrix::new(LATENTS, columns, numbers(LATENTS * columns, 0.1)),
                bias: numbers(LATENTS, 0.2),
            },
            recurrent: None,
            acquaintance: None,
        }
    }

    fn network() -> Regressor {
        let (width, inputs) = (4, FEATURES + 2);
        let matrix = |rows: usize, cols: usize, seed| Matrix::new(rows, cols, numbers(rows * cols, seed));
        let gru = Gru {
            w_ih: matrix(3 * width, inputs, 0.3),
            w_hh: matrix(3 * width, width, 0.4),
            b_ih: numbers(3 * width, 0.5),
            b_hh: numbers(3 * width, 0.6),
        };
        Regressor {
            shape_terms: vec![vec![]],
            bank: None,
            shortcut: Linear { weight: matrix(LATENTS, inputs, 0.7), bias: numbers(LATENTS, 0.8) },
            recurrent: Some(Recurrent {
                gru,
                readout: Linear { weight: matrix(LATENTS, width, 0.9), bias: numbers(LATENTS, 1.0) },
            }),
            ..readout()
        }
    }

    #[test]
    fn the_mixture_is_the_sum_of_its_parts_frame_by_frame() {
        let clip = TrainingClip {
            id: ClipId::new("a", "b", 0),
            beta: vec![0.3, -0.8],
            features: numbers(20 * FEATURES, 1.1),
            coefficients: vec![0.0; 20 * LATENTS],
            frames: 20,
        };
        let (readout, network, mix) = (readout(), network(), Mix { share: 0.35, gain: 1.2 });
        let parts = [vec![rollout(&readout, &clip)], vec![rollout(&network, &clip)]];
        let known = Matrix::new(1, 2, clip.beta.clone());
        let unknown = Matrix::new(1, 2, vec![40.0, 0.0]);
        let mixture = |people: &Matrix, stranger| mixed(&readout, &network, mix, people.clone(), stranger);
        for (people, stranger, share) in [(&known, 0.0, 0.35), (&unknown, 1.0, 0.35), (&unknown, 0.4, 0.14)] {
            let found = rollout(&mixture(people, stranger), &clip);
            let known = acquaintances(people, stranger, std::slice::from_ref(&clip));
            assert!((mix.share * known[0] - share).abs() < 1e-6);
            let wanted = &mix.latents(&parts, &known)[0];
            assert!(found.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-4), "{found:?} {wanted:?}");
            assert!(found.iter().zip(&parts[0][0]).any(|(a, b)| (a - b).abs() > 0.1), "the network has its part");
        }
        let none = mixed(&readout, &network, Mix { share: 0.0, ..mix }, known, 1.0);
        assert!(none.recurrent.is_none() && none.acquaintance.is_none());
        let wanted = &Mix { share: 0.0, ..mix }.latents(&parts, &[1.0])[0];
        assert!(rollout(&none, &clip).iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-4));
    }

    #[test]
    fn each_person_is_learned_once_whatever_the_clips() {
        let clip = |beta: &[f32]| TrainingClip {
            id: ClipId::new("a", "b", 0),
            beta: beta.to_vec(),
            features: vec![],
            coefficients: vec![],
            frames: 0,
        };
        let clips = [clip(&[1.0, -2.0]), clip(&[0.5, 3.0]), clip(&[1.0, -2.0])];
        assert_eq!(people(&clips), Matrix::new(2, 2, vec![1.0, -2.0, 0.5, 3.0]));
    }

    /// What a prediction scores that is best at a share of 0.4, too still by a fifth, and worse by the gain's square.
    fn judge(mix: Mix) -> Score {
        let off = 0.5 * f64::from(mix.share - 0.4).powi(2) + f64::from(mix.gain - 1.0).powi(2);
        Score {
            error: 0.5 + off,
            body_alone: 1.0,
            predicted_motion: (0.79 * f64::from(mix.gain)).powi(2),
            true_motion: 1.0,
        }
    }

    #[test]
    fn share_and_gain_are_those_that_validation_allows() {
        let (mix, ratio) = best_mix(&judge, 0.04);
        // 0.3 is 1 % worse than 0.4, which is best; 0.2 is 4 % worse
        assert!((mix.share - 0.3).abs() < 1e-6);
        // 0.14^2 is just within 4 % of 0.5; gains are tried in steps of 0.025
        assert!((mix.gain - 1.125).abs() < 1e-6, "{mix:?}");
        assert!((ratio - judge(mix).ratio()).abs() < 1e-12);
        assert_eq!(best_mix(&judge, 0.0).0.gain, 1.0);
        // however much may be given, it does not move more than the scans do
        assert!((best_mix(&judge, 10.0).0.gain - 1.25).abs() < 1e-6);
    }
}
