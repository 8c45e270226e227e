//! Dyna (Pons-Moll et al. 2015) in vertex form: people's autoregressions on principal components, mixed by body mass
//! index. Closed forms, solved anew wherever they are needed: the same clips give the same numbers.

use super::context::{Context, Place};
use super::learn::{LearnedModel, Material};
use super::motions::training_clips;
use anyhow::Result;
use serde_json::json;
use softtissue_bundle::descriptor::Descriptor;
use softtissue_bundle::{AutoregressiveModel, Model};
use softtissue_model::linear::{DynaConfig, FeatureSet, Selected, dyna_descriptor, fit_dyna};
use softtissue_model::truncated;

/// Learns the configured order, and beside it the other one (Dyna fig. 6).
pub fn learn_dyna(context: &Context, place: &Place, material: &Material) -> Result<LearnedModel> {
    let config = &context.config.dyna;
    let Material { body, fit, split, pca, .. } = *material;
    let held = pca.components_for(config.variance).unwrap_or_else(|| pca.components());
    let basis = truncated(&pca.basis, held.min(config.components));
    let descriptor = Descriptor::new(&dyna_descriptor(material.descriptor.config()), body, None)?;
    let clips = |ids, mirrored| training_clips(ids, body, fit, &basis, &descriptor, mirrored);
    let mut train = clips(&split.train, false)?;
    if config.mirror {
        train.extend(clips(&split.train, true)?);
    }
    let validation = clips(split.selection(), false)?;
    let set = FeatureSet {
        descriptor: descriptor.config(),
        blocks: descriptor.blocks(),
        train: &train,
        validation: &validation,
    };
    let (name, order) = if config.order == 0 { ("second-order", 2) } else { ("zero-order", 0) };
    let (whole, other) = context.timed(&place.stage("autoregressions"), || {
        let other = DynaConfig { order, ..config.clone() };
        Ok((fit_dyna(config, &basis, body, set)?, fit_dyna(&other, &basis, body, set)?))
    })?;
    for (order, fitted) in [(config.order, &whole), (order, &other)] {
        let (ratio, energy) = (fitted.score.ratio(), fitted.score.energy());
        let tried: Vec<_> =
            fitted.tried.iter().map(|(s, score)| json!({"strength": s, "soft_ratio": score.ratio()})).collect();
        context.log.event(json!({"event": "dyna", "order": order, "strength": fitted.strength, "soft_ratio": ratio,
            "energy": energy, "tried": tried}))?;
    }
    Ok(LearnedModel {
        descriptor: descriptor.config().clone(),
        facts: facts(config, &whole, descriptor.len()),
        soft_ratio: whole.score.ratio(),
        model: Model::Autoregressive(whole.model),
        ablations: vec![(name, Model::Autoregressive(other.model))],
        codecs: vec![],
    })
}

fn facts(config: &DynaConfig, fitted: &Selected<AutoregressiveModel>, features: usize) -> Vec<(String, String)> {
    let model = &fitted.model;
    let (low, high) = model.bmi_range();
    [
        ("motion descriptor", format!("pose, {features} features, of which {} drive", model.input.len())),
        (
            "autoregressions",
            format!(
                "order {}, {} components, ridge strength {:e}, {} people of body mass index {low:.1} to {high:.1}, tau {}",
                config.order,
                model.components(),
                fitted.strength,
                model.people.len(),
                config.tau
            ),
        ),
    ]
    .map(|(term, value)| (term.to_owned(), value))
    .to_vec()
}
