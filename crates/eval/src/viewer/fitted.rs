use super::{Layer, ViewClip};
use crate::Result;
use crate::judge::check_size;
use softtissue_body::BodyModel;
use softtissue_clips::{ClipId, FitSet, ScanClip};
use softtissue_geometry::Frames;

/// A fitted clip: `fit`, the person's shape and static detail in the fitted pose; `deltas`, what the scan adds to it; and
/// `scan`, the scan itself, where it is given: what of it neither holds.
pub fn fitted(body: &BodyModel, fit: &FitSet, scan: Option<&ScanClip>, id: &ClipId) -> Result<ViewClip> {
    let (motion, deltas) = (fit.motion(id)?, fit.deltas(id)?);
    let subject = fit.subject(&id.subject)?;
    let (frames, v) = (motion.len(), body.vertex_count());
    check_size(id, "the motion's joints", &motion.rotations, frames, body.joint_count())?;
    check_size(id, "the deltas", &deltas.deltas, frames, v)?;
    check_size(id, "the subject's detail", &Frames::from_points(1, subject.template.clone()), v, 1)?;
    let mut shaped = body.shaped(&subject.beta);
    shaped.vertices.iter_mut().zip(&subject.template).for_each(|(p, d)| *p += *d);
    let posed = |deltas| body.posed_frames(&shaped, &motion.rotations, &motion.translations, deltas);
    let alone = posed(None);
    let whole = posed(Some(&deltas.deltas));
    let mut layers = Vec::new();
    if let Some(scan) = scan {
        check_size(id, "the scan", &scan.vertices, frames, v)?;
        let frames = difference(&scan.vertices, &whole);
        layers.push(Layer { key: "scan", label: "Scan".into(), over: Some("deltas"), frames });
    }
    let added = difference(&whole, &alone);
    layers.push(Layer { key: "fit", label: "Fit".into(), over: None, frames: alone });
    layers.push(Layer { key: "deltas", label: "Fit and deltas".into(), over: Some("fit"), frames: added });
    Ok(ViewClip { name: id.to_string(), fps: motion.fps, start_s: 0.0, layers })
}

/// `a - b`, point by point.
pub(super) fn difference(a: &Frames, b: &Frames) -> Frames {
    Frames::from_points(a.points_per_frame(), a.points().iter().zip(b.points()).map(|(a, b)| *a - *b).collect())
}
