//! The closed-form baselines.

use super::bundle::LadderMethod;
use super::context::{Context, Place, damaged};
use super::motions::training_clips;
use crate::config::ShortcutKind;
use anyhow::Result;
use serde::{Deserialize, Serialize};
use serde_json::json;
use softtissue_body::BodyModel;
use softtissue_bundle::DeltaBasis;
use softtissue_bundle::descriptor::Descriptor;
use softtissue_clips::{FitSet, Split};
use softtissue_model::TrainingClip;
use softtissue_model::linear::{FeatureSet, Ladder, dyna_descriptor};
use softtissue_store::{read_json, sha256_file, write_json_atomic};
use softtissue_train::Clips;
use std::sync::Arc;

/// What stands beside the ladder's arrays, written after them.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Fitted {
    /// Names configuration, data and split.
    fingerprint: String,
    /// SHA-256 of the arrays.
    sha256: String,
    /// Ridge strength of the rung that is the regressor's shortcut.
    shortcut_strength: f64,
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
    let fitted_path = path.with_extension("json");
    let (ladder, strength) = if context.has(&fitted_path)? {
        let fitted: Fitted = read_json(&fitted_path)?;
        place.check(&fitted_path, &fitted.fingerprint)?;
        if sha256_file(&path)? != fitted.sha256 {
            return Err(damaged(&fitted_path, "its arrays have another hash".into()));
        }
        (Ladder::read(&path)?, fitted.shortcut_strength)
    } else {
        let dyna = Descriptor::new(&dyna_descriptor(descriptor.config()), body, None)?;
        let dyna_clips = |ids, mirrored| training_clips(ids, body, fit, basis, &dyna, mirrored);
        let mut train = dyna_clips(&split.train, false)?;
        if context.config.regressor.mirror {
            train.extend(dyna_clips(&split.train, true)?);
        }
        let validation = dyna_clips(split.selection(), false)?;
        let own = FeatureSet {
            descriptor: descriptor.config(),
            blocks: descriptor.blocks(),
            train: &clips.train,
            validation: &clips.validation,
        };
        let other =
            FeatureSet { descriptor: dyna.config(), blocks: dyna.blocks(), train: &train, validation: &validation };
        let (ladder, scores) = Ladder::fit(&context.config.ladder, basis, body, own, other)?;
        for s in &scores {
            let (ratio, energy) = (s.score.ratio(), s.score.energy());
            let event = json!({"event": "ladder", "name": s.name, "strength": s.strength, "soft_ratio": ratio, "energy": energy});
            context.log.event(event)?;
        }
        let shortcut = match context.config.regressor.shortcut {
            ShortcutKind::Resonators => "resonators",
            ShortcutKind::Linear => "ridge",
        };
        let strength = scores.iter().find(|s| s.name == shortcut).and_then(|s| s.strength);
        let shortcut_strength = strength.expect("the ladder has both readouts, each with a strength");
        ladder.write(&path)?;
        let fitted = Fitted { fingerprint: place.fingerprint.clone(), sha256: sha256_file(&path)?, shortcut_strength };
        write_json_atomic(&fitted_path, &fitted)?;
        (ladder, shortcut_strength)
    };
    let ladder = Arc::new(ladder);
    let methods = ladder
        .models
        .iter()
        .map(|m| LadderMethod { name: m.name.clone(), ladder: Arc::clone(&ladder), body: Arc::clone(body) })
        .collect();
    Ok((methods, strength))
}
