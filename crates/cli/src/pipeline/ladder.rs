//! The closed-form baselines.

use super::bundle::LadderMethod;
use super::context::{Context, Place};
use super::motions::training_clips;
use anyhow::Result;
use serde::{Deserialize, Serialize};
use softtissue_body::BodyModel;
use softtissue_bundle::DeltaBasis;
use softtissue_bundle::descriptor::Descriptor;
use softtissue_clips::{FitSet, Split};
use softtissue_model::TrainingClip;
use softtissue_model::linear::{FeatureSet, Ladder, dyna_descriptor};
use softtissue_store::{read_json, write_json_atomic};
use softtissue_train::Clips;
use std::collections::BTreeMap;
use std::sync::Arc;

/// What validation said of each rung.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct Scores {
    /// Ridge strength of the resonators, which the regressor's shortcut takes over.
    shortcut_strength: f64,
    /// Soft ratio and energy ratio on validation clips by rung.
    validation: BTreeMap<String, [f64; 2]>,
}

/// Fits the ladder, or takes it from where an earlier attempt left it. Also returns the ridge strength that
/// validation chose for the resonators.
#[expect(clippy::too_many_arguments, reason = "each is a product of another stage; a struct would only rename them")]
pub fn learn_ladder(
    context: &Context,
    place: &Place,
    body: &Arc<BodyModel>,
    fit: &FitSet,
    split: &Split,
    basis: &DeltaBasis,
    descriptor: &Descriptor,
    clips: &Clips<Vec<TrainingClip>>,
) -> Result<(Vec<LadderMethod>, f64)> {
    let path = context.run.stage(&place.stage("ladder"));
    let scores_path = path.with_extension("json");
    let (ladder, scores) = if path.exists() && scores_path.exists() {
        (Ladder::read(&path)?, read_json(&scores_path)?)
    } else {
        let dyna = Descriptor::new(&dyna_descriptor(descriptor.config()), body, None)?;
        let dyna_clips = |ids, mirrored| training_clips(ids, body, fit, basis, &dyna, mirrored);
        let mut train = dyna_clips(&split.train, false)?;
        if context.config.regressor.mirror {
            train.extend(dyna_clips(&split.train, true)?);
        }
        let selection = if split.validation.is_empty() { &split.train } else { &split.validation };
        let validation = dyna_clips(selection, false)?;
        let own = FeatureSet {
            descriptor: descriptor.config(),
            blocks: descriptor.blocks(),
            train: &clips.train,
            validation: &clips.validation,
        };
        let other =
            FeatureSet { descriptor: dyna.config(), blocks: dyna.blocks(), train: &train, validation: &validation };
        let (ladder, fitted) = Ladder::fit(&context.config.ladder, basis, body, own, other)?;
        let mut scores = Scores::default();
        for rung in fitted {
            if rung.name == "resonators" {
                scores.shortcut_strength = rung.strength.unwrap_or_default();
            }
            scores.validation.insert(rung.name, [rung.score.ratio(), rung.score.energy()]);
        }
        ladder.write(&path)?;
        write_json_atomic(&scores_path, &scores)?;
        (ladder, scores)
    };
    let ladder = Arc::new(ladder);
    let methods = ladder
        .models
        .iter()
        .map(|m| LadderMethod { name: m.name.clone(), ladder: Arc::clone(&ladder), body: Arc::clone(body) })
        .collect();
    Ok((methods, scores.shortcut_strength))
}
