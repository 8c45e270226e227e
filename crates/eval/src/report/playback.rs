use crate::judge::rollout;
use crate::{Method, Result, Scene};
use softtissue_body::Pose;
use softtissue_clips::ClipId;
use softtissue_geometry::Frames;

/// A clip to play: the posed body alone, and what truth and prediction add to it.
#[derive(Clone, Debug, PartialEq)]
pub struct PlaybackClip {
    /// Which clip.
    pub id: ClipId,
    /// Frames a second.
    pub fps: f32,
    /// Name of the predicting method.
    pub method: String,
    /// Whether the reference is truth; if not, it is what the scans gave.
    pub truth: bool,
    /// Posed vertices without soft tissue `[T, V, 3]`, metres.
    pub body_alone: Frames,
    /// Displacement of the reference in the posed frame `[T, V, 3]`, metres.
    pub reference: Frames,
    /// Displacement of the prediction in the posed frame `[T, V, 3]`, metres.
    pub predicted: Frames,
}

/// Poses a judged clip for the report: fitted shape, the main channel's motion.
pub fn playback(scene: &Scene, method: &dyn Method, id: &ClipId) -> Result<PlaybackClip> {
    let (reference, _, fps) = scene.deltas(id)?;
    let beta = scene.beta(id)?;
    let motion = scene.motion(id, scene.main_channel())?.map_or_else(|| scene.fit.motion(id), Ok)?;
    let v = scene.body.vertex_count();
    crate::judge::check_size(id, "the motion's joints", &motion.rotations, reference.len(), scene.body.joint_count())?;
    let predicted = rollout(method, id, &beta, &motion, reference.len(), v)?;
    let shaped = scene.body.shaped(&beta);
    let mut clip = PlaybackClip {
        id: id.clone(),
        fps,
        method: method.name().to_owned(),
        truth: scene.truth.is_some(),
        body_alone: Frames::new(v),
        reference: Frames::new(v),
        predicted: Frames::new(v),
    };
    for t in 0..motion.len() {
        let pose = Pose { rotations: motion.rotations.frame(t), translation: motion.translations[t] };
        clip.body_alone.push(&scene.body.posed(&shaped, pose, None));
        let posed_from_rest = scene.body.vertex_transforms(&scene.body.joint_transforms(&shaped.joints, pose));
        let turn = |deltas: &[glam::Vec3]| -> Vec<glam::Vec3> {
            posed_from_rest.iter().zip(deltas).map(|(m, d)| m.transform_vector3(*d)).collect()
        };
        clip.reference.push(&turn(reference.frame(t)));
        clip.predicted.push(&turn(predicted.frame(t)));
    }
    Ok(clip)
}
