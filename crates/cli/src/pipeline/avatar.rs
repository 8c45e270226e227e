//! AutoAvatar: one person's neural field, learned from raw scans and judged by the paper's table.

use super::context::{Context, Place, fingerprint};
use super::job::Prepared;
use super::judge::heaviest;
use super::scans::Scans;
use crate::exit::{InputError, UsageError};
use anyhow::Result;
use burn::module::Module;
use serde::{Deserialize, Serialize};
use serde_json::json;
use softtissue_avatar::{
    AvatarBody, AvatarClip, AvatarConfig, AvatarInfo, AvatarModel, AvatarTrainee, Candidate, ClipRequest, Conditioning,
    LearnedNetwork, PoseSource, RolloutFigures, RolloutTally,
};
use softtissue_clips::{ClipId, MotionClip, RawScans};
use softtissue_import::scans::{RawScanSource, ScanImportConfig, ScanSource, Units, UpAxis};
use softtissue_train::{Clips, Stage};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

/// Raised whenever the same settings and scans would give another avatar, so that a kept stage is not mistaken.
const AVATAR: u32 = 1;

/// The paper's table 1 of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AvatarFigures {
    /// Version of the form.
    pub schema: u64,
    /// Whose avatar.
    pub subject: String,
    /// Networks by name, for motions that training has seen the first half of.
    pub interpolation: BTreeMap<String, RolloutFigures>,
    /// The same, for motions that training has not seen.
    pub extrapolation: BTreeMap<String, RolloutFigures>,
}

/// The raw scans that a set was made with, or that it was registered from.
pub fn open_raw(context: &Context, scans: &Scans, data: Option<&Path>) -> Result<RawScanSource> {
    let beside = scans.set.root().parent().map(|p| p.join("raw")).filter(|p| p.is_dir());
    let assumed_fps = context.config.descriptor.fps;
    let found = ScanImportConfig { assumed_fps, ..ScanImportConfig::default() };
    let (path, import) = match (beside, data) {
        (Some(path), _) => (path, ScanImportConfig { units: Some(Units::Metres), up: Some(UpAxis::Y), ..found }),
        (None, Some(data)) if !data.join("index.json").exists() => (data.to_owned(), found),
        _ => {
            let place = scans.set.root().display();
            let message = format!(
                "{place} holds registered scans alone, and autoavatar learns from raw ones: pass the raw scans by --data, or \
                 make some with synth.scanner.raw_points"
            );
            return Err(InputError(message).into());
        }
    };
    Ok(RawScanSource::new(&ScanSource::open(&path, &import)?)?)
}

/// Whom to learn.
fn subject(config: &AvatarConfig, job: &Prepared) -> Result<String> {
    let train = &job.split.train;
    if config.subject.is_empty() {
        return Ok(heaviest(&job.fit, train)?.map(|id| id.subject).unwrap_or_default());
    }
    match train.iter().any(|id| id.subject == config.subject) {
        true => Ok(config.subject.clone()),
        false => {
            let message = format!("autoavatar.subject is {}, of whom no clip trains; choose another", config.subject);
            Err(UsageError(message).into())
        }
    }
}

/// The poses that drive a clip.
fn motion(job: &Prepared, poses: PoseSource, id: &ClipId) -> Result<MotionClip> {
    match poses {
        PoseSource::Fitted => Ok(job.fit.motion(id)?),
        PoseSource::Rough => job
            .scans
            .set
            .rough_motion(id)?
            .ok_or_else(|| InputError(format!("{id} has no rough poses; set autoavatar.poses = \"fitted\"")).into()),
    }
}

/// Which frames of a clip a prediction may be compared with.
#[derive(Clone, Copy)]
enum Part {
    Whole,
    FirstHalf,
    SecondHalf,
}

/// Reads clips of one person, each in part.
fn clips(
    context: &Context,
    job: &Prepared,
    avatar: &AvatarBody,
    raw: &dyn RawScans,
    poses: PoseSource,
    wanted: &[(ClipId, Part)],
) -> Result<Vec<AvatarClip>> {
    let config = &context.config.autoavatar;
    let mut clips = Vec::with_capacity(wanted.len());
    context.monitor.begin("raw scans", wanted.len() as u64, "clips");
    for (id, part) in wanted {
        let motion = motion(job, poses, id)?;
        let (all, half) = (motion.len(), motion.len() / 2);
        let frames = match part {
            Part::Whole => 0..all,
            Part::FirstHalf => 0..half,
            Part::SecondHalf => half..all,
        };
        let request = ClipRequest {
            motion: &motion,
            frames,
            kept_points: config.kept_points,
            outlier: config.outlier,
            seed: context.config.seed,
        };
        let shaped = job.body.shaped(&job.fit.subject(&id.subject)?.beta);
        clips.push(AvatarClip::read(avatar, &job.body, &shaped, raw, &request, context.monitor)?);
        context.monitor.advance(1, &id.to_string());
    }
    context.monitor.end();
    Ok(clips)
}

/// Learns every network of the settings and writes the avatar.
pub fn train_avatar(context: &Context, job: &Prepared, raw: &dyn RawScans) -> Result<AvatarModel> {
    let config = &context.config.autoavatar;
    let subject = subject(config, job)?;
    let avatar = Arc::new(AvatarBody::new(&config.network, &job.body, &context.device)?);
    let of = |ids: &[ClipId]| -> Vec<ClipId> { ids.iter().filter(|id| id.subject == subject).cloned().collect() };
    let part = |id: &ClipId| if config.interpolation.contains(&id.motion) { Part::FirstHalf } else { Part::Whole };
    let parts = |ids: Vec<ClipId>| ids.into_iter().map(|id| (id.clone(), part(&id))).collect::<Vec<_>>();
    let clips = context.timed("scans of the avatar", || {
        let read = |ids| clips(context, job, &avatar, raw, config.poses, &parts(of(ids)));
        let train = read(&job.split.train)?;
        let validation = read(&job.split.validation)?;
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
    let trained: Vec<String> = clips.train.iter().map(|c| c.id.to_string()).collect();
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
                "raw_scans": raw.provenance(), "trained_on": trained,
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

/// The paper's table: every network of `models`, each with the words that go before its name, on the clips that this run
/// left out.
pub fn judge_avatars(
    context: &Context,
    job: &Prepared,
    raw: &dyn RawScans,
    models: &[(String, AvatarModel)],
) -> Result<AvatarFigures> {
    let config = &context.config.autoavatar;
    let subject = subject(config, job)?;
    let own = |ids: &[ClipId], part: Part| -> Vec<(ClipId, Part)> {
        ids.iter().filter(|id| id.subject == subject).map(|id| (id.clone(), part)).collect()
    };
    let extrapolation = own(&job.split.test, Part::Whole);
    let mut interpolation = own(&job.split.train, Part::SecondHalf);
    interpolation.retain(|(id, _)| config.interpolation.contains(&id.motion));
    let mut figures =
        AvatarFigures { schema: 1, subject, interpolation: BTreeMap::new(), extrapolation: BTreeMap::new() };
    for (prefix, model) in models {
        let avatar = AvatarBody::new(&model.config, &job.body, &context.device)?;
        for (wanted, table) in
            [(&interpolation, &mut figures.interpolation), (&extrapolation, &mut figures.extrapolation)]
        {
            let clips = clips(context, job, &avatar, raw, model.info.poses, wanted)?;
            for learned in &model.networks {
                let candidate = Candidate {
                    body: &avatar,
                    conditioning: learned.conditioning,
                    network: &learned.network,
                    grid: config.grid,
                };
                let name = format!("{prefix}{}", learned.conditioning.name());
                context.monitor.begin(&format!("judging {name}"), clips.len() as u64, "clips");
                let mut tally = RolloutTally::default();
                for clip in &clips {
                    tally.add(&candidate, clip, context.monitor)?;
                    context.monitor.advance(1, &clip.id.to_string());
                }
                context.monitor.end();
                if !clips.is_empty() {
                    table.insert(name, tally.figures());
                }
            }
        }
    }
    Ok(figures)
}
