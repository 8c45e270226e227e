//! SoftSMPL (Santesteban et al. 2020) whole: deformation autoencoder, disentangled motion descriptor, motion transfer,
//! recurrent regressor with a linear shortcut.
//!
//! As published but for what the settings name and: the root's velocity and acceleration are in its own frame, deltas
//! are the scans' with the subject's template taken out (`fit.subject_template`), differences are causal behind one
//! low-pass, poses come from the clips that train (`softtissue_model::PoseSetConfig`).

use super::context::{Context, Place};
use super::learn::{LearnedModel, Material};
use super::motions::training_clips;
use super::recurrent::{LearnedRegressor, RegressorInputs, learn_regressor, ridge_strength, train_linear};
use super::softtissue::{codec, subspaces_and_choice};
use crate::config::ShortcutKind;
use crate::exit::InputError;
use anyhow::Result;
use softtissue_body::BodyModel;
use softtissue_bundle::descriptor::{Descriptor, DescriptorConfig, DescriptorParts, FeatureKind, PoseEncoder};
use softtissue_bundle::{Model, RecurrentModel, Regressor};
use softtissue_clips::{ClipId, MotionClip};
use softtissue_geometry::Frames;
use softtissue_model::{PoseSet, SubjectRegressor, TrainingClip, transferred};
use softtissue_random::Draws;
use softtissue_train::{Clips, PoseTrainee, Stage};
use std::path::PathBuf;
use std::sync::Arc;

/// Name of the regressors' stage, and of the pose autoencoder's: each the section of its training.
const REGRESSOR: &str = "softsmpl";
const POSES: &str = "softsmpl.poses";

/// Learns all of it.
pub fn learn_softsmpl(context: &Context, place: &Place, material: &Material) -> Result<LearnedModel> {
    let settings = &context.config.softsmpl;
    let (subspaces, chosen) = subspaces_and_choice(context, place, material)?;
    let subspace = chosen.to_plain(&material.pca.basis);
    let (encoder, pose_mm) = match settings.static_disentangling {
        true => {
            let (encoder, mm) =
                context.timed(&place.stage("pose autoencoder"), || learn_encoder(context, place, material))?;
            (Some(Arc::new(encoder)), Some(mm))
        }
        false => (None, None),
    };
    let (descriptor, mut clips) =
        context.timed(&place.stage("softsmpl descriptors"), || describe(context, material, encoder.as_ref()))?;
    let strength = ridge_strength(context, material, descriptor.blocks(), &clips)?;
    let inputs = |clips| RegressorInputs {
        body: material.body,
        blocks: descriptor.blocks(),
        subspace: &subspace,
        network: &chosen.network,
        clips,
        validated: !material.split.validation.is_empty(),
        strength,
        shortcut: ShortcutKind::Linear,
    };
    let own = clips.train.len();
    if settings.transfer {
        let people = context
            .timed(&place.stage("regressors of each person"), || learn_people(context, place, &clips, inputs))?;
        let extra = transferred(&subspace, &people, &clips.train);
        clips.train.extend(extra);
    }
    let counts = (own, clips.train.len() - own);
    let regressor = context.timed(&place.stage("regressor"), || {
        learn_regressor(context, place, REGRESSOR, &settings.training.over(settings.training.steps), inputs(clips))
    })?;
    let facts = facts(context, &descriptor, &regressor, counts, pose_mm);
    let model = |regressor: Regressor| {
        Model::Recurrent(RecurrentModel { regressor, subspace: subspace.clone(), pose_encoder: encoder.clone() })
    };
    Ok(LearnedModel {
        descriptor: descriptor.config().clone(),
        model: model(regressor.regressor),
        ablations: vec![
            ("without-gru", model(regressor.without_gru)),
            ("without-shortcut", model(regressor.without_shortcut)),
        ],
        soft_ratio: regressor.soft_ratio,
        codecs: subspaces.values().map(|s| codec(s, &material.pca.basis)).collect(),
        facts,
    })
}

/// The descriptor that SoftSMPL has in the place of the settings'.
pub fn descriptor_config(context: &Context, features: FeatureKind) -> DescriptorConfig {
    let root_angular_velocity = context.config.softsmpl.root_angular_velocity;
    DescriptorConfig { features, root_angular_velocity, ..context.config.descriptor.clone() }
}

/// `Epose`, and its error on poses of the clips that select, mm.
fn learn_encoder(context: &Context, place: &Place, material: &Material) -> Result<(PoseEncoder, f64)> {
    let config = &context.config.softsmpl.poses;
    let Material { body, fit, split, .. } = *material;
    let motions =
        |ids: &[ClipId]| -> Result<Vec<Frames>> { ids.iter().map(|id| Ok(fit.motion(id)?.rotations)).collect() };
    let draws = |what: &str| Draws::new(context.config.seed, &place.stage(&format!("{POSES}/{what}")), 0, 0);
    let learned = [motions(&split.train)?, imported_poses(&config.motions, body)?].concat();
    let set = PoseSet::new(&config.set, body, &learned, &mut draws("set"));
    let basis = set.components(body, &config.set, &mut draws("components"), context.monitor)?;
    let judged = PoseSet::plain(body, &motions(split.selection())?);
    let poses = Clips {
        train: set.frames(body, &basis, context.monitor)?,
        validation: judged.frames(body, &basis, context.monitor)?,
    };
    let stage = Stage { name: POSES.into(), seed: context.config.seed, device: context.device.clone() };
    let mut trainee = PoseTrainee::new(config.training.clone(), &stage, basis.directions.data(), poses)?;
    let steps = trainee.steps();
    let (_, mm) = context.train(place, POSES, &mut trainee, steps)?;
    Ok((trainee.into_network().to_encoder(), mm))
}

/// Poses `[T, J]` of imported motion, which stand beside the fitted ones.
fn imported_poses(files: &[PathBuf], body: &BodyModel) -> Result<Vec<Frames>> {
    let read = |path: &PathBuf| {
        let rotations = MotionClip::read(path)?.rotations;
        let (found, expected) = (rotations.points_per_frame(), body.joint_count());
        match found == expected {
            true => Ok(rotations),
            false => {
                let message = format!("{}: {found} joints, but the body has {expected}; retarget it", path.display());
                Err(InputError(message).into())
            }
        }
    };
    files.iter().map(read).collect()
}

/// The clips as SoftSMPL sees them, mirrored ones after the others.
fn describe(
    context: &Context,
    material: &Material,
    encoder: Option<&Arc<PoseEncoder>>,
) -> Result<(Descriptor, Clips<Vec<TrainingClip>>)> {
    let Material { body, fit, split, pca, .. } = *material;
    let features = if encoder.is_some() { FeatureKind::DisentangledPose } else { FeatureKind::Pose };
    let config = descriptor_config(context, features);
    let descriptor = Descriptor::with_parts(&config, body, DescriptorParts { modes: None, encoder })?;
    let clips = |ids: &[ClipId], mirrored| training_clips(ids, body, fit, &pca.basis, &descriptor, mirrored);
    let mut train = clips(&split.train, false)?;
    if context.config.regressor.mirror {
        train.extend(clips(&split.train, true)?);
    }
    let validation = clips(split.selection(), false)?;
    Ok((descriptor, Clips { train, validation }))
}

/// A regressor for each person of the training clips, from that person's clips alone. It is to play the same motions as
/// others do them, so it is the clips that train that choose its state, not motions that it will never be asked for.
fn learn_people<'a>(
    context: &Context,
    place: &Place,
    clips: &Clips<Vec<TrainingClip>>,
    inputs: impl Fn(Clips<Vec<TrainingClip>>) -> RegressorInputs<'a>,
) -> Result<Vec<SubjectRegressor>> {
    let settings = &context.config.softsmpl;
    let training = settings.training.over(settings.transfer_steps);
    let mut people: Vec<&str> = clips.train.iter().map(|c| c.id.subject.as_str()).collect();
    people.sort_unstable();
    people.dedup();
    let learn = |person: &str| {
        let train: Vec<TrainingClip> = clips.train.iter().filter(|c| c.id.subject == person).cloned().collect();
        let validation = train.clone();
        let beta = train[0].beta.clone();
        let name = format!("{REGRESSOR}-of-{person}");
        let regressor = train_linear(context, place, &name, &training, &inputs(Clips { train, validation }))?;
        Ok(SubjectRegressor { subject: person.to_owned(), beta, regressor })
    };
    people.into_iter().map(learn).collect()
}

fn facts(
    context: &Context,
    descriptor: &Descriptor,
    regressor: &LearnedRegressor,
    (own, transferred): (usize, usize),
    pose_mm: Option<f64>,
) -> Vec<(String, String)> {
    let settings = &context.config.softsmpl;
    let (steps, best) = (settings.training.steps, regressor.best_step);
    let pose = pose_mm.map_or(String::new(), |mm| format!("; the learned pose is {mm:.1} mm off on validation clips"));
    [
        ("motion descriptor", format!("{:?}, {} features{pose}", descriptor.config().features, descriptor.len())),
        ("subspace steps", context.config.subspace.training.steps.to_string()),
        ("clips of the regressor", format!("{own} with mirrored ones, {transferred} transferred")),
        ("regressor", format!("{steps} steps, best at {best}, {:.3} mm on validation clips", regressor.best_mm)),
    ]
    .map(|(term, value)| (term.to_owned(), value))
    .to_vec()
}
