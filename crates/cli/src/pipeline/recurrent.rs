//! The recurrent regressor round its shortcut.

use super::context::{Context, Place};
use crate::config::ShortcutKind;
use anyhow::Result;
use rayon::prelude::*;
use softtissue_body::BodyModel;
use softtissue_bundle::descriptor::FeatureBlock;
use softtissue_bundle::{Matrix, Regressor, ResonatorBank, Subspace};
use softtissue_model::linear::{ReadoutConfig, SoftScore, fit_readout};
use softtissue_model::{Autoencoder, ShortcutStart, TrainingClip, truncated};
use softtissue_train::{Clips, MotionSequence, RegressorTrainee, Shortcut, Stage};
use std::collections::BTreeSet;

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
    /// Ridge strength of the shortcut, chosen on validation clips.
    pub strength: f64,
}

/// A learned regressor and how it was selected.
#[derive(Clone, Debug)]
pub struct LearnedRegressor {
    /// The regressor as the bundle holds it.
    pub regressor: Regressor,
    /// Steps after which validation was best; 0: the shortcut alone.
    pub best_step: u64,
    /// Validation error of the whole, mm over all vertices.
    pub best_mm: f64,
}

/// Fits the shortcut in closed form, then trains the recurrent part round it.
pub fn learn_regressor(context: &Context, place: &Place, inputs: RegressorInputs) -> Result<LearnedRegressor> {
    let config = &context.config.regressor;
    let latent_clips = Clips {
        train: in_latents(inputs.subspace, &inputs.clips.train),
        validation: in_latents(inputs.subspace, &inputs.clips.validation),
    };
    let mut regressor = fit_shortcut(context, &inputs, &latent_clips.train)?;
    let (shortcut, outside) = match config.shortcut {
        ShortcutKind::Linear => (Shortcut::Trained(start_of(&regressor)), Outside::Inputs),
        ShortcutKind::Resonators => {
            let train = cross_fitted(context, &inputs, &latent_clips.train)?;
            let validation = rollouts(&regressor, &latent_clips.validation);
            (Shortcut::Fixed, Outside::Latents(Clips { train, validation }))
        }
    };
    let sequences = |clips: &[TrainingClip], latents: Option<&Vec<Vec<f32>>>| -> Vec<MotionSequence> {
        clips.iter().enumerate().map(|(i, clip)| sequence(&regressor, clip, latents.map(|l| l[i].clone()))).collect()
    };
    let clips = match &outside {
        Outside::Inputs => {
            Clips { train: sequences(&inputs.clips.train, None), validation: sequences(&inputs.clips.validation, None) }
        }
        Outside::Latents(l) => Clips {
            train: sequences(&inputs.clips.train, Some(&l.train)),
            validation: sequences(&inputs.clips.validation, Some(&l.validation)),
        },
    };
    let stage = Stage { name: "regressor".into(), seed: context.config.seed, device: context.device.clone() };
    let directions = inputs.subspace.basis.directions.data();
    let mut trainee =
        RegressorTrainee::new(config.training.clone(), &stage, inputs.network, directions, shortcut, clips)?;
    let (best_step, best_mm) = context.train(place, "regressor", &mut trainee, config.training.steps)?;
    let network = trainee.into_network();
    let scale = inputs.network.scale;
    if let Some(trained) = network.to_shortcut(scale) {
        regressor.shortcut = trained;
    }
    let mut recurrent = network.to_recurrent(scale);
    recurrent.gru.w_ih = widened(&recurrent.gru.w_ih, seen(&regressor), regressor.feature_count());
    regressor.recurrent = Some(recurrent);
    Ok(LearnedRegressor { regressor, best_step, best_mm })
}

enum Outside {
    /// The shortcut sees the regressor's own inputs and is trained along.
    Inputs,
    /// The shortcut's latents, clip by clip.
    Latents(Clips<Vec<Vec<f32>>>),
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
    let readout = match context.config.regressor.shortcut {
        ShortcutKind::Resonators => context.config.ladder.resonators.clone(),
        ShortcutKind::Linear => ReadoutConfig { shape_terms: vec![vec![]], ..ReadoutConfig::static_ridge() },
    };
    let readout = ReadoutConfig { strengths: vec![inputs.strength], ..readout };
    // One strength leaves nothing to select, so the score only has to have the latents' length.
    let score = SoftScore::new(&truncated(&inputs.subspace.basis, inputs.subspace.latent_count()), inputs.body);
    let fps = context.config.descriptor.fps;
    Ok(fit_readout(&readout, inputs.blocks, fps, clips, &[], &score)?.model)
}

/// Each training clip's latents from a shortcut that has not seen its motion: a network trained on the residuals
/// that a shortcut leaves on its own training clips would learn that fit's noise.
fn cross_fitted(context: &Context, inputs: &RegressorInputs, clips: &[TrainingClip]) -> Result<Vec<Vec<f32>>> {
    let motions: Vec<&str> = clips.iter().map(|c| c.id.motion.as_str()).collect::<BTreeSet<_>>().into_iter().collect();
    let folds = context.config.regressor.cross_fit_folds.clamp(2, motions.len().max(2));
    let fold_of = |clip: &TrainingClip| motions.iter().position(|m| *m == clip.id.motion).unwrap_or(0) % folds;
    let mut latents = vec![Vec::new(); clips.len()];
    if motions.len() < 2 {
        return Ok(rollouts(&fit_shortcut(context, inputs, clips)?, clips));
    }
    for fold in 0..folds {
        let seen: Vec<TrainingClip> = clips.iter().filter(|c| fold_of(c) != fold).cloned().collect();
        let regressor = fit_shortcut(context, inputs, &seen)?;
        for (i, clip) in clips.iter().enumerate().filter(|(_, c)| fold_of(c) == fold) {
            latents[i] = rollout(&regressor, clip);
        }
    }
    Ok(latents)
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

/// How many of the scaled features the recurrent unit sees: what drives the resonators (the forces). Pose entries
/// serve a linear readout, but a network learns by them which training clip it is in. Without resonators all, as
/// published.
fn seen(regressor: &Regressor) -> usize {
    regressor.bank.as_ref().map_or(regressor.feature_count(), ResonatorBank::channels)
}

/// Input weights `[3H, seen + B]` with zeros for the features that the recurrent unit does not see: `[3H, all + B]`.
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

/// Scaled features and shape beside what the shortcut gives (or, without `latents`, sees).
fn sequence(regressor: &Regressor, clip: &TrainingClip, latents: Option<Vec<f32>>) -> MotionSequence {
    let (d, shape) = (regressor.feature_count(), regressor.scaled_shape(&clip.beta));
    let scaled = regressor.input.apply_clip(&clip.features);
    let with_shape = |count: usize| -> Vec<f32> {
        scaled.chunks_exact(d.max(1)).flat_map(|x| x[..count].iter().copied().chain(shape.iter().copied())).collect()
    };
    MotionSequence {
        input: with_shape(seen(regressor)),
        input_width: seen(regressor) + shape.len(),
        shortcut: latents.unwrap_or_else(|| with_shape(d)),
        target: clip.coefficients.clone(),
    }
}

/// The ridge readout as the start of a trained layer: its weight turned to `[inputs, latents]`.
fn start_of(regressor: &Regressor) -> ShortcutStart {
    let w = &regressor.shortcut.weight;
    let weight = (0..w.cols()).flat_map(|i| (0..w.rows()).map(move |o| w.row(o)[i])).collect();
    ShortcutStart { weight, bias: regressor.shortcut.bias.clone() }
}
