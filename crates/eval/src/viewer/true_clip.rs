use super::fitted::difference;
use super::{Layer, ViewClip};
use crate::Result;
use crate::judge::check_size;
use softtissue_body::{BodyModel, Pose};
use softtissue_clips::{ClipId, ScanClip, TruthSet};

/// A generated clip: `scan`, added to `reference` (the true surface), which is added to `alone`, the true body without its
/// soft tissue.
pub fn true_clip(body: &BodyModel, truth: &TruthSet, scan: &ScanClip) -> Result<ViewClip> {
    let id: &ClipId = &scan.id;
    let (motion, clean) = (truth.motion(id)?, truth.clean(id)?.vertices);
    let mut soft = truth.deltas(id)?.deltas;
    let (frames, v) = (scan.vertices.len(), body.vertex_count());
    check_size(id, "the true motion's joints", &motion.rotations, frames, body.joint_count())?;
    for (what, points) in [("the scan", &scan.vertices), ("the clean scan", &clean), ("the true deltas", &soft)] {
        check_size(id, what, points, frames, v)?;
    }
    let joints = body.shaped(&[]).joints;
    for t in 0..frames {
        // Only the turning of a joint transform acts on a displacement, so that nobody's shape is needed.
        let pose = Pose { rotations: motion.rotations.frame(t), translation: motion.translations[t] };
        let posed_from_rest = body.vertex_transforms(&body.joint_transforms(&joints, pose));
        soft.frame_mut(t).iter_mut().zip(&posed_from_rest).for_each(|(d, m)| *d = m.transform_vector3(*d));
    }
    let alone = difference(&clean, &soft);
    let scanned = difference(&scan.vertices, &clean);
    let layer = |key, label: &str, over, frames| Layer { key, label: label.into(), over, frames };
    let layers = vec![
        layer("scan", "Scan", Some("reference"), scanned),
        layer("reference", "Truth", Some("alone"), soft),
        layer("alone", "Body alone", None, alone),
    ];
    Ok(ViewClip { name: id.to_string(), fps: scan.fps, start_s: 0.0, layers })
}
