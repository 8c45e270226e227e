//! What a motion descriptor gives away: before and after the poses are disentangled.

use super::context::Context;
use super::softsmpl::descriptor_config;
use anyhow::Result;
use rayon::prelude::*;
use softtissue_body::BodyModel;
use softtissue_bundle::Bundle;
use softtissue_bundle::descriptor::{Descriptor, FeatureKind};
use softtissue_clips::{ClipId, FitSet};
use softtissue_eval::LeakMetrics;
use softtissue_eval::measures::{ProbeClip, leak};
use std::collections::BTreeMap;

/// Probes fitted motions of all clips, described by joint rotations (`pose`) and, where the bundle has them, by learned
/// poses (`disentangled-pose`); each also by its first block alone, the pose without velocities (`/static`).
pub fn judge_leak(
    context: &Context,
    body: &BodyModel,
    fit: &FitSet,
    clips: &[ClipId],
    bundle: &Bundle,
) -> Result<BTreeMap<String, LeakMetrics>> {
    let mut found = BTreeMap::new();
    let mut probe = |name: &str, descriptor: &Descriptor| -> Result<()> {
        let whole = described(descriptor, body, fit, clips)?;
        let first = descriptor.blocks().first().map_or(0, |block| block.range.end);
        found.insert(format!("{name}/static"), leak(&whole.iter().map(|c| first_block(c, first)).collect::<Vec<_>>()));
        found.insert(name.to_owned(), leak(&whole));
        Ok(())
    };
    probe("pose", &Descriptor::new(&descriptor_config(context, FeatureKind::Pose), body, None)?)?;
    if bundle.descriptor.features == FeatureKind::DisentangledPose {
        let parts = bundle.model.descriptor_parts(&bundle.descriptor);
        probe("disentangled-pose", &Descriptor::with_parts(&bundle.descriptor, body, parts)?)?;
    }
    Ok(found)
}

fn described(descriptor: &Descriptor, body: &BodyModel, fit: &FitSet, clips: &[ClipId]) -> Result<Vec<ProbeClip>> {
    clips
        .par_iter()
        .map(|id| {
            let motion = fit.motion(id)?;
            let shaped = body.shaped(&fit.subject(&id.subject)?.beta);
            let features = descriptor.run(body, &shaped, &motion.rotations, &motion.translations);
            Ok(ProbeClip { id: id.clone(), fps: motion.fps, features, width: descriptor.len() })
        })
        .collect()
}

fn first_block(clip: &ProbeClip, width: usize) -> ProbeClip {
    let features = clip.features.chunks_exact(clip.width).flat_map(|frame| frame[..width].iter().copied()).collect();
    ProbeClip { features, width, ..clip.clone() }
}
