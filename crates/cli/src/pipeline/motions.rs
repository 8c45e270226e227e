//! Clips as the regressors see them: descriptor features beside the coefficients of the deltas.

use super::basis::clip_coefficients;
use super::context::Context;
use anyhow::Result;
use rayon::prelude::*;
use softtissue_body::BodyModel;
use softtissue_bundle::DeltaBasis;
use softtissue_bundle::descriptor::Descriptor;
use softtissue_clips::{ClipId, FitSet};
use softtissue_model::TrainingClip;

/// The descriptor whose modes are the first directions of the basis.
pub fn descriptor(context: &Context, body: &BodyModel, basis: &DeltaBasis) -> Result<Descriptor> {
    let mut config = context.config.descriptor.clone();
    config.modes = config.modes.min(basis.directions.rows());
    Ok(Descriptor::new(&config, body, Some(basis.directions.data()))?)
}

/// Features of fitted motions and coefficients of scan deltas, in the order of `ids`.
pub fn training_clips(
    ids: &[ClipId],
    body: &BodyModel,
    fit: &FitSet,
    basis: &DeltaBasis,
    descriptor: &Descriptor,
    mirrored: bool,
) -> Result<Vec<TrainingClip>> {
    ids.par_iter()
        .map(|id| {
            let beta = fit.subject(&id.subject)?.beta;
            let motion = fit.motion(id)?;
            let deltas = fit.deltas(id)?.deltas;
            let (rotations, translations) = if mirrored {
                body.mirror.motion(&motion.rotations, &motion.translations)
            } else {
                (motion.rotations, motion.translations)
            };
            let features = descriptor.run(body, &body.shaped(&beta), &rotations, &translations);
            let coefficients = clip_coefficients(basis, body, &deltas, mirrored);
            Ok(TrainingClip { id: id.clone(), beta, features, coefficients, frames: deltas.len() })
        })
        .collect()
}
