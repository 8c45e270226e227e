//! Both stages of every network, and the avatar that comes of them.

use super::scene::{AvatarScene, Part};
use crate::pipeline::context::{Context, Place, fingerprint};
use crate::pipeline::job::Prepared;
use anyhow::Result;
use burn::module::Module;
use serde_json::json;
use softtissue_avatar::{AvatarBody, AvatarClip, AvatarInfo, AvatarModel, AvatarTrainee, Conditioning, LearnedNetwork};
use softtissue_clips::{ClipId, RawScans};
use softtissue_train::{Clips, Stage};
use std::sync::Arc;

/// Raised whenever the same settings and scans would give another avatar, so that a kept stage is not mistaken.
const AVATAR: u32 = 2;

/// Learns every network of the settings and writes the avatar.
pub fn train_avatar(context: &Context, job: &Prepared, raw: &dyn RawScans) -> Result<AvatarModel> {
    let config = &context.config.autoavatar;
    let scene = AvatarScene::of(context, job, raw);
    let subject = scene.subject()?;
    scene.interpolation(&subject)?;
    let avatar = Arc::new(AvatarBody::new(&config.network, &job.body, &context.device)?);
    let parts = |ids: &[ClipId]| -> Vec<(ClipId, Part)> {
        let part = |id: &ClipId| if config.interpolation.contains(&id.motion) { Part::FirstHalf } else { Part::Whole };
        scene.own(&subject, ids, Part::Whole).into_iter().map(|(id, _)| (id.clone(), part(&id))).collect()
    };
    let (train_parts, validation_parts) = (parts(&job.split.train), parts(&job.split.validation));
    let clips = context.timed("scans of the avatar", || {
        let train = scene.clips(&avatar, config.poses, &train_parts)?;
        let validation = scene.clips(&avatar, config.poses, &validation_parts)?;
        let validation = if validation.is_empty() { train.clone() } else { validation };
        Ok(Arc::new(Clips { train, validation }))
    })?;
    let place = Place {
        fingerprint: fingerprint(&(AVATAR, &job.place.fingerprint, config, raw.provenance()))?,
        ..job.place.clone()
    };
    let mut networks = Vec::new();
    for &conditioning in &config.networks {
        networks.push(learn_network(context, &place, &avatar, conditioning, &clips)?);
    }
    let names = |parts: &[(ClipId, Part)]| parts.iter().map(|(id, _)| id.to_string()).collect::<Vec<String>>();
    let halves: Vec<(ClipId, Part)> = [&train_parts[..], &validation_parts].concat();
    let halves: Vec<(ClipId, Part)> = halves.into_iter().filter(|(_, part)| *part == Part::FirstHalf).collect();
    let model = AvatarModel {
        info: AvatarInfo {
            beta: job.fit.subject(&subject)?.beta,
            subject,
            fps: context.config.descriptor.fps,
            poses: config.poses,
            grid: config.grid,
            licence: context.config.licence.clone(),
            provenance: json!({
                "program": format!("softtissue {}", env!("CARGO_PKG_VERSION")),
                "fingerprint": place.fingerprint, "seed": context.config.seed, "scans": place.scans,
                "raw_scans": raw.provenance(), "trained_on": names(&train_parts),
                "selected_on": names(&validation_parts), "first_half_of": names(&halves),
            }),
        },
        config: config.network.clone(),
        body: (*job.body).clone(),
        networks,
    };
    context.timed("avatar", || Ok(model.write(&context.run.avatar())?))?;
    Ok(model)
}

/// Both stages of one network.
fn learn_network(
    context: &Context,
    place: &Place,
    avatar: &Arc<AvatarBody>,
    conditioning: Conditioning,
    clips: &Arc<Clips<Vec<AvatarClip>>>,
) -> Result<LearnedNetwork> {
    let config = &context.config.autoavatar;
    let mut learned = None;
    for stage in config.stages() {
        let name = format!("autoavatar/{}/{}", conditioning.name(), stage.name);
        let place_of = Stage { name: name.clone(), seed: context.config.seed, device: context.device.clone() };
        let network = match learned.take() {
            Some((network, _)) => network,
            None => AvatarTrainee::untrained(avatar, conditioning, &place_of),
        };
        let (avatar, clips) = (Arc::clone(avatar), Arc::clone(clips));
        let mut trainee = AvatarTrainee::new(&stage, &config.loss, conditioning, place_of, avatar, network, clips)?;
        let (_, mm) = context.timed(&name, || context.train(place, &name, &mut trainee, stage.steps))?;
        learned = Some((trainee.into_network(), mm));
    }
    let (network, validation_mm) = learned.expect("there are two stages");
    context.monitor.say(&format!("  {}: {validation_mm:.2} mm on validation", conditioning.name()));
    Ok(LearnedNetwork { conditioning, network: network.valid(), validation_mm })
}
