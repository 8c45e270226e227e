//! Our own method: autoencoders of the deltas, and a regressor of resonators and a recurrent network.

use super::bundle::{LearnedCodec, SubspaceCodec};
use super::context::{Context, Place};
use super::learn::{LearnedModel, Material};
use super::recurrent::{LearnedRegressor, RegressorInputs, learn_regressor};
use super::subspaces::{LearnedSubspace, learn_subspaces};
use crate::exit::UsageError;
use anyhow::Result;
use softtissue_bundle::{Decoder, DeltaBasis, Encoder, Linear, Matrix, Model, RecurrentModel, Regressor, Subspace};
use softtissue_model::truncated;
use std::collections::BTreeMap;

/// Learns the subspaces of all configured sizes and a regressor of the chosen one.
pub fn learn_softtissue(context: &Context, place: &Place, material: &Material) -> Result<LearnedModel> {
    let config = context.config;
    let Material { body, split, pca, descriptor, clips, strength, .. } = *material;
    let (subspaces, chosen) = subspaces_and_choice(context, place, material)?;
    let subspace = chosen.to_plain(&pca.basis);
    let regressor = context.timed(&place.stage("regressor"), || {
        let inputs = RegressorInputs {
            body,
            blocks: descriptor.blocks(),
            subspace: &subspace,
            network: &chosen.network,
            clips: clips.clone(),
            validated: !split.validation.is_empty(),
            strength,
            shortcut: config.regressor.shortcut,
        };
        learn_regressor(context, place, "regressor", &config.regressor.training, inputs)
    })?;
    let facts = facts(context, material, &regressor);
    let model = |regressor: Regressor| {
        Model::Recurrent(RecurrentModel { regressor, subspace: subspace.clone(), pose_encoder: None })
    };
    Ok(LearnedModel {
        descriptor: descriptor.config().clone(),
        model: model(regressor.regressor),
        ablations: vec![
            ("without-gru", model(regressor.without_gru)),
            ("without-shortcut", model(regressor.without_shortcut)),
        ],
        soft_ratio: regressor.soft_ratio,
        codecs: subspaces.values().map(|s| codec(s, &pca.basis)).collect(),
        facts,
    })
}

/// Subspaces of all configured sizes, and the one that is regressed.
pub fn subspaces_and_choice(
    context: &Context,
    place: &Place,
    material: &Material,
) -> Result<(BTreeMap<usize, LearnedSubspace>, LearnedSubspace)> {
    let Material { body, fit, split, pca, .. } = *material;
    let wanted = context.config.regressor.latents;
    let subspaces = learn_subspaces(context, place, body, fit, split, pca)?;
    let chosen = subspaces.get(&wanted).cloned().ok_or_else(|| {
        let sizes: Vec<String> = subspaces.keys().map(ToString::to_string).collect();
        UsageError(format!(
            "regressor.latents is {wanted}, but the subspaces have {} numbers; choose one of these (a size must be under \
             the {} components that the clips have)",
            sizes.join(", "),
            pca.components()
        ))
    })?;
    Ok((subspaces, chosen))
}

fn facts(context: &Context, material: &Material, regressor: &LearnedRegressor) -> Vec<(String, String)> {
    let config = context.config;
    let features = material.descriptor.len();
    let selected = if material.split.validation.is_empty() { "training" } else { "validation" };
    let LearnedRegressor { best_step, best_mm, share, gain, .. } = regressor;
    [
        ("motion descriptor", format!("{:?}, {features} features", config.descriptor.features)),
        ("subspace steps", config.subspace.training.steps.to_string()),
        (
            "regressor",
            format!(
                "network: {} steps, best at {best_step}, {best_mm:.3} mm on {selected} clips; {:.0} % of the mixture with \
                 the shortcut, gain {gain:.2}",
                config.regressor.training.steps,
                100.0 * share,
            ),
        ),
    ]
    .map(|(term, value)| (term.to_owned(), value))
    .to_vec()
}

/// An autoencoder beside principal components of its size.
pub fn codec(learned: &LearnedSubspace, basis: &DeltaBasis) -> LearnedCodec {
    LearnedCodec {
        latents: learned.latents as u32,
        pca: Box::new(SubspaceCodec(linear(basis, learned.latents))),
        autoencoder: Box::new(SubspaceCodec(learned.to_plain(basis))),
        residual_kept: learned.best_step > 0,
        subjects: None,
    }
}

/// Principal components alone, as a subspace without residual units.
pub fn linear(basis: &DeltaBasis, latents: usize) -> Subspace {
    let identity = || {
        let mut m = Matrix::zeros(latents, latents);
        (0..latents).for_each(|i| m.row_mut(i)[i] = 1.0);
        Linear { weight: m, bias: vec![0.0; latents] }
    };
    Subspace {
        basis: truncated(basis, latents),
        encoder: Encoder { units: vec![], project: identity() },
        decoder: Decoder { lift: identity(), units: vec![] },
    }
}
