//! Rollouts of avatars as clips to look at.

use super::scene::AvatarScene;
use anyhow::Result;
use softtissue_avatar::{AvatarBody, AvatarClip, Conditioning, PoseSource};
use softtissue_eval::surfaces::{HeightLayer, HeightView};
use softtissue_eval::viewer::ViewClip;
use softtissue_geometry::Mesh;
use softtissue_implicit::{FreeRollout, MeshField};
use std::ops::Range;

/// What turns heights into layers.
pub struct AvatarShow<'a> {
    /// The run.
    pub scene: &'a AvatarScene<'a>,
    /// What observers stand on.
    pub avatar: &'a AvatarBody,
    /// Which poses drive the body.
    pub poses: PoseSource,
}

impl AvatarShow<'_> {
    /// A clip from the first frame that has a history of `history`; nothing where it has none. `rollout` gives a network's
    /// heights from there on. Layers: the scans' heights (`reference`), AutoAvatar (`predicted`), pose alone (`pose`), and
    /// the true surface (`surface`) where it is known.
    pub fn clip(
        &self,
        clip: &AvatarClip,
        history: usize,
        rollout: &dyn Fn(Conditioning) -> Option<FreeRollout>,
    ) -> Result<Option<ViewClip>> {
        let start = clip.frames.start.max(history).max(1);
        if start >= clip.frames.end {
            return Ok(None);
        }
        let frames = start..clip.frames.end;
        let scene = self.scene;
        let whole = scene.posed(self.poses, &clip.id)?;
        let posed = whole.slice(frames.clone());
        let spread = self.avatar.observers.vertices_from_observers(&scene.body.template, &scene.body.topology);
        let view = HeightView {
            topology: &scene.body.topology,
            spread: &spread,
            heights: &self.avatar.heights,
            posed: &posed,
        };
        let named = [
            ("predicted", "AutoAvatar", rollout(Conditioning::Autoregressive)),
            ("pose", "Pose", rollout(Conditioning::Pose)),
        ];
        let truth = self.true_heights(clip, frames.clone())?;
        let mut layers = vec![HeightLayer { key: "reference", label: "Scan", heights: &clip.heights[frames.clone()] }];
        layers.extend(named.iter().filter_map(|(key, label, free)| {
            Some(HeightLayer { key, label, heights: &free.as_ref().filter(|f| f.start == start)?.heights })
        }));
        layers.extend(truth.iter().map(|heights| HeightLayer { key: "surface", label: "True surface", heights }));
        let fps = scene.config.descriptor.fps;
        Ok(Some(view.clip(clip.id.to_string(), fps, start as f32 / fps, &layers)))
    }

    /// The heights of the true surface, of generated scans. Its own vertices also hold how the skin slides, which no height
    /// does, and would seem farther from the scan than any prediction.
    fn true_heights(&self, clip: &AvatarClip, frames: Range<usize>) -> Result<Option<Vec<Vec<f32>>>> {
        let Some(truth) = self.scene.scans.open_truth()? else { return Ok(None) };
        let clean = truth.clean(&clip.id)?.vertices;
        let heights = |t: usize| {
            let mesh = Mesh::new(clean.frame(t).to_vec(), self.scene.body.topology.clone());
            self.avatar.heights_of(&MeshField::new(&mesh), &clip.observers[t])
        };
        Ok(Some(frames.map(heights).collect()))
    }
}
