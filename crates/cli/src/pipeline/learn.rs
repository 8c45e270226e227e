//! Everything that is learned from one split: basis, subspaces, ladder, regressor, bundle.

use super::basis::learn_basis;
use super::bundle::{BundleMethod, LadderMethod};
use super::context::{Context, Place};
use super::ladder::learn_ladder;
use super::motions::{descriptor, training_clips};
use super::recurrent::{LearnedRegressor, RegressorInputs, learn_regressor};
use super::subspaces::{LearnedSubspace, learn_subspaces};
use crate::exit::UsageError;
use anyhow::{Context as _, Result};
use serde_json::json;
use softtissue_body::BodyModel;
use softtissue_bundle::{Bundle, BundleInfo, Regressor, SelfCheck};
use softtissue_clips::{FitSet, Split};
use softtissue_model::Pca;
use softtissue_train::Clips;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

/// What one split taught.
pub struct Learned {
    /// Principal components.
    pub pca: Pca,
    /// Autoencoders by latent size.
    pub subspaces: BTreeMap<usize, LearnedSubspace>,
    /// The regressor.
    pub regressor: LearnedRegressor,
    /// The whole as it ships.
    pub bundle: Arc<Bundle>,
    /// The closed-form baselines.
    pub ladder: Vec<LadderMethod>,
    /// Variants of the bundle with a part switched off, for the ablation.
    pub ablations: Vec<BundleMethod>,
}

/// Frames of the bundle's self-check.
const SELF_CHECK_FRAMES: usize = 24;
/// Vertices that the self-check keeps.
const SELF_CHECK_VERTICES: usize = 64;

/// Learns all of it; stages that are finished already are taken from the run folder. Where the context may not learn,
/// everything is taken from there, the bundle too.
pub fn learn(
    context: &Context,
    place: &Place,
    body: &Arc<BodyModel>,
    fit: &FitSet,
    split: &Split,
    bundle_dir: &Path,
) -> Result<Learned> {
    let config = context.config;
    let pca = context.timed(&place.stage("principal components"), || learn_basis(context, place, body, fit, split))?;
    let subspaces = learn_subspaces(context, place, body, fit, split, &pca)?;
    let chosen = subspaces.get(&config.regressor.latents).ok_or_else(|| {
        let sizes: Vec<String> = subspaces.keys().map(ToString::to_string).collect();
        UsageError(format!(
            "regressor.latents is {}, but the subspaces have {} numbers; choose one of these (a size must be under the \
             {} components that the clips have)",
            config.regressor.latents,
            sizes.join(", "),
            pca.components()
        ))
    })?;

    let (descriptor, clips) = context.timed(&place.stage("motion descriptors"), || {
        let descriptor = descriptor(context, body, &pca.basis)?;
        let mut train = training_clips(&split.train, body, fit, &pca.basis, &descriptor, false)?;
        if config.regressor.mirror {
            train.extend(training_clips(&split.train, body, fit, &pca.basis, &descriptor, true)?);
        }
        let selection = if split.validation.is_empty() { &split.train } else { &split.validation };
        let validation = training_clips(selection, body, fit, &pca.basis, &descriptor, false)?;
        Ok((descriptor, Clips { train, validation }))
    })?;
    let (ladder, strength) = context.timed(&place.stage("ladder of baselines"), || {
        learn_ladder(context, place, body, fit, split, &pca.basis, &descriptor, &clips)
    })?;

    let plain = chosen.to_plain(&pca.basis);
    let regressor = context.timed(&place.stage("regressor"), || {
        let inputs = RegressorInputs {
            body,
            blocks: descriptor.blocks(),
            subspace: &plain,
            network: &chosen.network,
            clips: clips.clone(),
            strength,
        };
        learn_regressor(context, place, inputs)
    })?;

    let mut bundle = Bundle {
        info: BundleInfo {
            method: config.method_name(),
            licence: config.licence.clone(),
            provenance: json!({
                "program": format!("softtissue {}", env!("CARGO_PKG_VERSION")),
                "fingerprint": place.fingerprint, "seed": config.seed, "scans": place.scans,
                "trained_on": split.train.iter().map(ToString::to_string).collect::<Vec<_>>(),
                "selected_on": split.validation.iter().map(ToString::to_string).collect::<Vec<_>>(),
            }),
            // An error on clips that training has seen is none to ship.
            measured: if split.validation.is_empty() {
                json!({})
            } else {
                json!({"validation_soft_ratio": regressor.soft_ratio})
            },
            largest_delta_m: largest_delta(fit, split)?,
        },
        body: (**body).clone(),
        descriptor: descriptor.config().clone(),
        regressor: regressor.regressor.clone(),
        subspace: plain,
        self_check: SelfCheck::default(),
    };
    let first = &split.train[0];
    let motion = fit.motion(first)?;
    let motion = motion.slice(0..motion.len().min(SELF_CHECK_FRAMES));
    let beta = fit.subject(&first.subject)?.beta;
    bundle.self_check =
        SelfCheck::record(&bundle, &beta, &motion.rotations, &motion.translations, SELF_CHECK_VERTICES)?;
    context.timed(&place.stage("bundle"), || {
        if context.learns {
            bundle.write(bundle_dir).context("the bundle cannot be written")?;
        } else {
            // What is judged is what was shipped.
            bundle = Bundle::read(bundle_dir)?;
        }
        Ok(())
    })?;
    let ablations = ablations(&bundle, &regressor);
    Ok(Learned { pca, subspaces, regressor, bundle: Arc::new(bundle), ladder, ablations })
}

/// The bundle with each part of the regressor alone.
fn ablations(bundle: &Bundle, learned: &LearnedRegressor) -> Vec<BundleMethod> {
    let name = &bundle.info.method;
    let with = |part: &str, regressor: &Regressor| {
        let bundle = Bundle { regressor: regressor.clone(), ..bundle.clone() };
        BundleMethod { name: format!("{name}/{part}"), bundle: Arc::new(bundle) }
    };
    vec![with("without-gru", &learned.without_gru), with("without-shortcut", &learned.without_shortcut)]
}

fn largest_delta(fit: &FitSet, split: &Split) -> Result<f32> {
    let mut largest = 0.0f32;
    for id in &split.train {
        let deltas = fit.deltas(id)?.deltas;
        largest = deltas.points().iter().fold(largest, |m, d| m.max(d.length()));
    }
    Ok(largest)
}
