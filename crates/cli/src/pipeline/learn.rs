//! Everything that is learned from one split: basis, ladder of baselines, the method's model, bundle.

use super::basis::learn_basis;
use super::bundle::{BundleMethod, LadderMethod, LearnedCodec};
use super::casas_otaduy::learn_casas_otaduy;
use super::context::{Context, Place};
use super::dyna::learn_dyna;
use super::ladder::learn_ladder;
use super::motions::{descriptor, training_clips};
use super::softsmpl::learn_softsmpl;
use super::softtissue::learn_softtissue;
use crate::config::Method;
use crate::exit::{InputError, UsageError};
use anyhow::{Context as _, Result};
use rayon::prelude::*;
use serde_json::json;
use softtissue_body::BodyModel;
use softtissue_bundle::descriptor::{Descriptor, DescriptorConfig};
use softtissue_bundle::{Bundle, BundleInfo, Model, SeenClip, SelfCheck, Trust};
use softtissue_clips::{ClipError, ClipId, FitSet, Split};
use softtissue_model::{Pca, TrainingClip};
use softtissue_train::Clips;
use std::collections::BTreeSet;
use std::path::Path;
use std::sync::Arc;

/// What one split taught.
pub struct Learned {
    /// Principal components.
    pub pca: Pca,
    /// The closed-form baselines.
    pub ladder: Vec<LadderMethod>,
    /// The whole as it ships.
    pub bundle: Arc<Bundle>,
    /// Variants of the bundle with a part switched off, for the ablation.
    pub ablations: Vec<BundleMethod>,
    /// Subspaces beside principal components of the same size.
    pub codecs: Vec<LearnedCodec>,
    /// What a reader of the report wants to know of the training.
    pub facts: Vec<(String, String)>,
}

/// What every method learns from.
#[derive(Clone, Copy)]
pub struct Material<'a> {
    /// The body.
    pub body: &'a Arc<BodyModel>,
    /// Shapes, motions and deltas.
    pub fit: &'a FitSet,
    /// Who is left out.
    pub split: &'a Split,
    /// Principal components of the training clips' deltas.
    pub pca: &'a Pca,
    /// `descriptor` of the settings.
    pub descriptor: &'a Descriptor,
    /// Clips described by it; targets as coefficients of `pca`.
    pub clips: &'a Clips<Vec<TrainingClip>>,
    /// Ridge strength that validation chose for the ladder's readout that is the regressor's shortcut.
    pub strength: f64,
}

/// What a method's own stages leave behind.
pub struct LearnedModel {
    /// How a motion is described to it.
    pub descriptor: DescriptorConfig,
    /// From features to deltas.
    pub model: Model,
    /// The same with a part switched off, by name.
    pub ablations: Vec<(&'static str, Model)>,
    /// Soft ratio on the clips that selected it.
    pub soft_ratio: f64,
    /// Subspaces beside principal components.
    pub codecs: Vec<LearnedCodec>,
    /// Terms and values for the report.
    pub facts: Vec<(String, String)>,
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
    let (descriptor, clips) = context.timed(&place.stage("motion descriptors"), || {
        let descriptor = descriptor(context, body, &pca.basis)?;
        let mut train = training_clips(&split.train, body, fit, &pca.basis, &descriptor, false)?;
        if config.regressor.mirror {
            train.extend(training_clips(&split.train, body, fit, &pca.basis, &descriptor, true)?);
        }
        let validation = training_clips(split.selection(), body, fit, &pca.basis, &descriptor, false)?;
        Ok((descriptor, Clips { train, validation }))
    })?;
    let (ladder, strength) = context.timed(&place.stage("ladder of baselines"), || {
        learn_ladder(context, place, body, fit, split, &pca.basis, &descriptor, &clips)
    })?;
    let material = Material { body, fit, split, pca: &pca, descriptor: &descriptor, clips: &clips, strength };
    let learned = match config.method {
        Method::Softtissue => learn_softtissue(context, place, &material)?,
        Method::Softsmpl => learn_softsmpl(context, place, &material)?,
        Method::CasasOtaduy => learn_casas_otaduy(context, place, &material)?,
        Method::Dyna => learn_dyna(context, place, &material)?,
        Method::Autoavatar => {
            let message = "autoavatar learns no deltas and has no bundle; judge its run by itself, without a protocol";
            return Err(UsageError(message.into()).into());
        }
    };
    let bundle = context.timed(&place.stage("bundle"), || ship(context, place, &material, &learned, bundle_dir))?;
    let ablation = |(part, model): (&str, Model)| BundleMethod {
        name: format!("{}/{part}", bundle.info.method),
        ..BundleMethod::as_learned(&Arc::new(Bundle { model, ..bundle.clone() }))
    };
    let ablations = learned.ablations.into_iter().map(ablation).collect();
    let LearnedModel { codecs, facts, .. } = learned;
    Ok(Learned { pca, ladder, bundle: Arc::new(bundle), ablations, codecs, facts })
}

/// Writes the bundle, or reads the one that was shipped where nothing may be learned: that is what is judged.
fn ship(
    context: &Context,
    place: &Place,
    material: &Material,
    learned: &LearnedModel,
    bundle_dir: &Path,
) -> Result<Bundle> {
    let Material { body, fit, split, .. } = *material;
    let config = context.config;
    if !context.learns {
        let bundle = Bundle::read(bundle_dir)?;
        bundle.require_topology(bundle_dir, &body.topology.hash())?;
        let (found, wanted) = (&bundle.info.method, config.method_name());
        if *found != wanted {
            let message = format!(
                "{} holds a bundle of {found}, but the run is one of {wanted}; judge it with --against, or train again",
                bundle_dir.display()
            );
            return Err(InputError(message).into());
        }
        return Ok(bundle);
    }
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
                json!({"validation_soft_ratio": learned.soft_ratio})
            },
            largest_delta_m: largest_delta(fit, split)?,
        },
        body: (**body).clone(),
        descriptor: learned.descriptor.clone(),
        model: learned.model.clone(),
        trust: trust(material, learned)?,
        self_check: SelfCheck::default(),
    };
    let first = &split.train[0];
    let motion = fit.motion(first)?;
    let motion = motion.slice(0..motion.len().min(SELF_CHECK_FRAMES));
    let beta = fit.subject(&first.subject)?.beta;
    bundle.self_check =
        SelfCheck::record(&bundle, &beta, &motion.rotations, &motion.translations, SELF_CHECK_VERTICES)?;
    bundle.write(bundle_dir).context("the bundle cannot be written")?;
    Ok(bundle)
}

/// What the training clips, mirrored ones among them, show of motions, as the bundle describes them, and of bodies.
fn trust(material: &Material, learned: &LearnedModel) -> Result<Trust> {
    let Material { body, fit, split, .. } = *material;
    let descriptor =
        Descriptor::with_parts(&learned.descriptor, body, learned.model.descriptor_parts(&learned.descriptor))?;
    let seen = |(id, mirrored): (&ClipId, bool)| -> Result<(String, Vec<f32>)> {
        let shaped = body.shaped(&fit.subject(&id.subject)?.beta);
        let motion = fit.motion(id)?;
        let (rotations, translations) = match mirrored {
            true => body.mirror.motion(&motion.rotations, &motion.translations),
            false => (motion.rotations, motion.translations),
        };
        Ok((id.motion.clone(), descriptor.run(body, &shaped, &rotations, &translations)))
    };
    let both = [false, true].into_par_iter().flat_map(|m| split.train.par_iter().map(move |id| (id, m)));
    let clips: Vec<(String, Vec<f32>)> = both.map(seen).collect::<Result<_>>()?;
    let clips: Vec<SeenClip> = clips.iter().map(|(motion, features)| SeenClip { motion, features }).collect();
    let names: BTreeSet<&str> = split.train.iter().map(|id| id.subject.as_str()).collect();
    let people: Vec<Vec<f32>> =
        names.into_iter().map(|name| Ok(fit.subject(name)?.beta)).collect::<Result<_, ClipError>>()?;
    let people: Vec<&[f32]> = people.iter().map(Vec::as_slice).collect();
    Ok(Trust::fit(descriptor.blocks(), &clips, &people))
}

fn largest_delta(fit: &FitSet, split: &Split) -> Result<f32> {
    let mut largest = 0.0f32;
    for id in &split.train {
        let deltas = fit.deltas(id)?.deltas;
        largest = deltas.points().iter().fold(largest, |m, d| m.max(d.length()));
    }
    Ok(largest)
}
