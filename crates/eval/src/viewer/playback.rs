use super::{Layer, ViewClip};
use crate::judge::{check_size, rollout};
use crate::report::method_label;
use crate::{Method, Result, Scene};
use softtissue_body::Pose;
use softtissue_clips::ClipId;
use softtissue_geometry::Frames;

/// A judged clip: `reference` (truth, or the scans' deltas where there is none) and `predicted`, both added to `alone`, the
/// body of the fitted shape in the main channel's motion.
pub fn playback(scene: &Scene, method: &dyn Method, id: &ClipId) -> Result<ViewClip> {
    let (reference, _, fps) = scene.deltas(id)?;
    let beta = scene.beta(id)?;
    let motion = scene.motion(id, scene.main_channel())?.map_or_else(|| scene.fit.motion(id), Ok)?;
    let v = scene.body.vertex_count();
    check_size(id, "the motion's joints", &motion.rotations, reference.len(), scene.body.joint_count())?;
    let predicted = rollout(method, id, &beta, &motion, reference.len(), v)?;
    let shaped = scene.body.shaped(&beta);
    let alone = scene.body.posed_frames(&shaped, &motion.rotations, &motion.translations, None);
    let [mut reference, mut predicted] = [reference, predicted];
    for t in 0..motion.len() {
        let pose = Pose { rotations: motion.rotations.frame(t), translation: motion.translations[t] };
        let posed_from_rest = scene.body.vertex_transforms(&scene.body.joint_transforms(&shaped.joints, pose));
        let turn = |deltas: &mut Frames| {
            deltas.frame_mut(t).iter_mut().zip(&posed_from_rest).for_each(|(d, m)| *d = m.transform_vector3(*d));
        };
        turn(&mut reference);
        turn(&mut predicted);
    }
    let name = if scene.truth.is_some() { "Truth" } else { "Scan" };
    let layer = |key, label: &str, over, frames| Layer { key, label: label.into(), over, frames };
    let layers = vec![
        layer("reference", name, Some("alone"), reference),
        layer("alone", "Body alone", None, alone),
        layer("predicted", &method_label(method.name()), Some("alone"), predicted),
    ];
    Ok(ViewClip { name: id.to_string(), fps, start_s: 0.0, layers })
}
