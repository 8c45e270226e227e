//! Runs of AutoAvatar: scan, prediction, pose alone and truth on one mesh.

use super::choice::Asked;
use super::shown::{Shown, title};
use crate::config::Config;
use crate::exit::InputError;
use crate::pipeline::{AvatarScene, AvatarShow, Kept, Part, open_raw};
use anyhow::Result;
use burn::tensor::Device;
use softtissue_avatar::{AvatarBody, AvatarClip, AvatarModel, Candidate, Conditioning};
use softtissue_clips::{ClipEntry, ClipId};
use softtissue_eval::viewer::{Pick, ViewClip};
use softtissue_implicit::FreeRollout;
use softtissue_monitor::Monitor;
use std::path::Path;

/// Layers of a clip at most.
const LAYERS: usize = 4;
/// Why no triangle of the field is seen.
const NOTE: &str = "Surfaces are drawn as the body's mesh moved along its normals by their heights, up to 8 cm: their own \
                    triangles change in every frame. Rollouts begin once, from the scans before the first frame.";

/// Clips of the avatar's person, those left out for testing first.
pub fn run(
    path: &Path,
    config: &Config,
    data: Option<&Path>,
    kept: &Kept,
    asked: &Asked,
    monitor: &dyn Monitor,
) -> Result<Shown> {
    let folder = path.join("avatar");
    if !AvatarModel::is_at(&folder) {
        let message = format!("{} has no avatar yet: go on with `softtissue train --resume` first", path.display());
        return Err(InputError(message).into());
    }
    let device = Device::flex();
    let model = AvatarModel::read(&folder, &device)?;
    let raw = open_raw(config, &kept.scans, data)?;
    let scene = AvatarScene::kept(config, kept, &raw, monitor);
    let avatar = AvatarBody::new(&model.config, &kept.body, &device)?;
    let show = AvatarShow { scene: &scene, avatar: &avatar, poses: model.info.poses };
    let person = &model.info.subject;
    let listed: Vec<ClipEntry> = kept.fit.clips().iter().filter(|c| c.id.subject == *person).cloned().collect();
    let split = &kept.split;
    let own = |ids: &[ClipId]| ids.iter().filter(|id| id.subject == *person).cloned().collect::<Vec<_>>();
    let parts = [own(&split.test), own(&split.validation), own(&split.train)];
    let likely = parts.into_iter().find(|p| !p.is_empty()).unwrap_or_default();
    let chosen = asked.choose(&listed, &likely, kept.body.vertex_count() * LAYERS, path)?;
    let mut clips = Vec::new();
    for (id, pick) in &chosen.clips {
        let read = scene.clips(&avatar, model.info.poses, &[(id.clone(), Part::Whole)])?;
        for clip in &read {
            clips.extend(rolled_out(&show, &model, clip, pick, monitor)?);
        }
    }
    let mut notes = chosen.notes;
    notes.push(NOTE.into());
    let about = format!("Run of method autoavatar: {person}, {} observers.", avatar.observers.len());
    Ok(Shown { reference: Some("reference"), title: title(path), ..Shown::on(&kept.body, path, about, clips, notes) })
}

/// A clip with its rollouts, and what is picked of it.
fn rolled_out(
    show: &AvatarShow,
    model: &AvatarModel,
    clip: &AvatarClip,
    pick: &Pick,
    monitor: &dyn Monitor,
) -> Result<Option<ViewClip>> {
    let (avatar, history) = (show.avatar, model.config.history);
    let mut rollouts = Vec::new();
    for conditioning in [Conditioning::Autoregressive, Conditioning::Pose] {
        if let Some(network) = model.network(conditioning) {
            let candidate = Candidate { body: avatar, conditioning, network, grid: model.info.grid };
            let truth = clip.truth(history, &[]);
            let free = FreeRollout::of(&mut candidate.on(clip, monitor), &truth, false)?;
            rollouts.push((conditioning, free));
        }
    }
    let of = |c: Conditioning| rollouts.iter().find(|(own, _)| *own == c).map(|(_, free)| free.clone());
    let Some(shown) = show.clip(clip, history, &of)? else { return Ok(None) };
    let first = history.max(1);
    let start = pick.start.max(first) - first;
    let frames = shown.layers.first().map_or(0, |l| l.frames.len());
    let wanted = (pick.start + pick.every * pick.count).saturating_sub(first).min(frames);
    let count = wanted.saturating_sub(start).div_ceil(pick.every);
    Ok((count > 0).then(|| shown.picked(&Pick { start, every: pick.every, count })))
}
