//! The autoencoders, one a latent size.

use super::basis::clip_coefficients;
use super::context::{Context, Place};
use anyhow::Result;
use softtissue_body::BodyModel;
use softtissue_bundle::{DeltaBasis, Subspace};
use softtissue_clips::{ClipId, FitSet, Split};
use softtissue_model::{Autoencoder, Pca};
use softtissue_train::{Clips, DeltaFrames, DeltaSurface, Stage, SubspaceTrainee};
use std::collections::BTreeMap;
use std::sync::Arc;

/// One latent size's outcome.
#[derive(Clone, Debug)]
pub struct LearnedSubspace {
    /// Latent numbers.
    pub latents: usize,
    /// The network, without autodiff.
    pub network: Autoencoder,
    /// Steps after which validation was best; 0 means that it kept PCA.
    pub best_step: u64,
}

impl LearnedSubspace {
    /// As the bundle's plain arrays.
    pub fn to_plain(&self, basis: &DeltaBasis) -> Subspace {
        Subspace { basis: basis.clone(), encoder: self.network.to_encoder(), decoder: self.network.to_decoder() }
    }
}

/// Trains every configured size.
pub fn learn_subspaces(
    context: &Context,
    place: &Place,
    body: &BodyModel,
    fit: &FitSet,
    split: &Split,
    pca: &Pca,
) -> Result<BTreeMap<usize, LearnedSubspace>> {
    let config = &context.config.subspace;
    let subjects = subjects_of(split);
    let mut train = frames(&split.train, &subjects, body, fit, &pca.basis, false)?;
    if config.mirror {
        let mirrored = frames(&split.train, &subjects, body, fit, &pca.basis, true)?;
        train.coefficients.extend(mirrored.coefficients);
        train.subjects.extend(mirrored.subjects);
    }
    let validation = frames(split.selection(), &subjects, body, fit, &pca.basis, false)?;
    let surface = surface(body, fit, &subjects, &pca.basis)?;
    let mut learned = BTreeMap::new();
    for &latents in &config.sizes {
        if latents >= pca.components() {
            let components = pca.components();
            context.monitor.say(&format!("  no subspace of {latents} numbers: the clips have {components} components"));
            continue;
        }
        let name = format!("subspace-{latents}");
        let subspace = context.timed(&place.stage(&name), || {
            let stage = Stage { name: name.clone(), seed: context.config.seed, device: context.device.clone() };
            let clips = Clips { train: train.clone(), validation: validation.clone() };
            let mut trainee = SubspaceTrainee::new(config.training.clone(), &stage, latents, surface.clone(), clips)?;
            let (best_step, _) = context.train(place, &name, &mut trainee, config.training.steps)?;
            Ok(LearnedSubspace { latents, network: trainee.into_network(), best_step })
        })?;
        learned.insert(latents, subspace);
    }
    Ok(learned)
}

/// Subjects of all parts, sorted: validation frames need their rest mesh too.
fn subjects_of(split: &Split) -> Vec<String> {
    let mut subjects: Vec<String> = split.train.iter().chain(&split.validation).map(|id| id.subject.clone()).collect();
    subjects.sort();
    subjects.dedup();
    subjects
}

fn frames(
    ids: &[ClipId],
    subjects: &[String],
    body: &BodyModel,
    fit: &FitSet,
    basis: &DeltaBasis,
    mirrored: bool,
) -> Result<DeltaFrames> {
    let mut all = DeltaFrames::default();
    for id in ids {
        let deltas = fit.deltas(id)?.deltas;
        let subject = subjects.iter().position(|s| *s == id.subject).unwrap_or(0) as u32;
        all.subjects.extend(std::iter::repeat_n(subject, deltas.len()));
        all.coefficients.extend(clip_coefficients(basis, body, &deltas, mirrored));
    }
    Ok(all)
}

fn surface(body: &BodyModel, fit: &FitSet, subjects: &[String], basis: &DeltaBasis) -> Result<DeltaSurface> {
    let mut rest = Vec::with_capacity(subjects.len());
    for subject in subjects {
        let shaped = body.shaped(&fit.subject(subject)?.beta);
        rest.push(shaped.vertices.iter().flat_map(|p| p.to_array()).collect());
    }
    Ok(DeltaSurface {
        rest,
        mean: basis.mean.clone(),
        directions: basis.directions.data().to_vec(),
        faces: Arc::new(body.topology.faces.clone()),
    })
}
