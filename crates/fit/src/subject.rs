use crate::motion::fit_motion;
use crate::objective::{Objective, WeightedBody, check_frame};
use crate::packed::PackedBody;
use crate::set::clip_deltas;
use crate::shape::fit_shape;
use crate::template::{speeds, subject_template};
use crate::weights::{refined_weights, region_weights, strays};
use crate::{FitConfig, FitError, Result};
use glam::Vec3;
use rayon::prelude::*;
use softtissue_body::BodyModel;
use softtissue_clips::{ClipId, ScanClip, ScanSet};
use softtissue_geometry::{Adjacency, Frames};
use softtissue_monitor::{Monitor, Silent};
use std::sync::Arc;

/// Everything about a subject that its clips' fits need.
pub(crate) struct SubjectModel {
    pub name: String,
    pub beta: Vec<f32>,
    /// `[V]`, zero when it is not wanted.
    pub template: Vec<Vec3>,
    pub fit_weight: Vec<f32>,
    pub objective: Objective,
}

/// Fits shape, fit weights and subject template to source clips. With `shared` weights the subject is new: its clips
/// are cut to their first frames and the weights are taken as they are.
#[expect(clippy::too_many_arguments, reason = "one subject's whole context, used in one place")]
pub(crate) fn fit_subject(
    scans: &ScanSet,
    name: &str,
    sources: &[ClipId],
    shared: Option<&[f32]>,
    body: &BodyModel,
    packed: &Arc<PackedBody>,
    config: &FitConfig,
    monitor: &dyn Monitor,
) -> Result<SubjectModel> {
    let read = |id: &ClipId| -> Result<ScanClip> {
        let mut clip = scans.scan(id)?;
        if shared.is_some() {
            clip.vertices = clip.vertices.slice(0..clip.vertices.len().min(config.new_subject_frames));
        }
        Ok(clip)
    };
    let first_weight = shared.map_or_else(|| region_weights(&body.regions), <[f32]>::to_vec);
    let weighted = WeightedBody::new(packed.clone(), &first_weight);
    let frames = first_frames(sources, &read, config.shape_frames, body.vertex_count())?;
    let beta = fit_shape(body, &weighted, config.objective, &frames, config);
    if monitor.should_stop() {
        return Err(FitError::Stopped);
    }
    let shaped = body.shaped(&beta);
    let plain = Objective::new(weighted.clone(), config.objective, &shaped, None)
        .with_priors(config.pose_prior, config.smoothness);
    let mut model = SubjectModel {
        name: name.to_owned(),
        beta,
        template: vec![Vec3::ZERO; body.vertex_count()],
        fit_weight: first_weight,
        objective: plain,
    };
    if !config.subject_template && (shared.is_some() || !config.refine_weights) {
        return Ok(model);
    }
    let first = first_pass(&model.objective, sources, &read, body, config, shared.is_some(), monitor)?;
    if shared.is_none() && config.refine_weights {
        let deltas: Vec<Frames> = first.iter().map(|p| p.deltas.clone()).collect();
        model.fit_weight = refined_weights(&body.regions, &model.fit_weight, &strays(&deltas));
    }
    if config.subject_template && !first.is_empty() {
        let frames = first.iter().flat_map(|p| p.speeds.iter().copied().zip(p.deltas.iter()));
        model.template = subject_template(frames.collect(), config.template_share);
    }
    let weighted = WeightedBody::new(packed.clone(), &model.fit_weight);
    let objective = Objective::new(weighted, config.objective, &shaped, Some(&model.template));
    model.objective = objective.with_priors(config.pose_prior, config.smoothness);
    Ok(model)
}

/// First frames of the clips in turn, then frames a twelfth of a second later, and so on, until there are `wanted`.
fn first_frames(
    sources: &[ClipId],
    read: &impl Fn(&ClipId) -> Result<ScanClip>,
    wanted: usize,
    vertex_count: usize,
) -> Result<Vec<Vec<Vec3>>> {
    let rounds = wanted.div_ceil(sources.len());
    let mut by_clip = Vec::with_capacity(sources.len());
    for id in sources.iter().take(wanted) {
        let clip = read(id)?;
        let step = (clip.fps / 12.0).ceil() as usize;
        let mut taken = Vec::new();
        for t in (0..clip.vertices.len()).step_by(step).take(rounds) {
            let frame = clip.vertices.frame(t);
            check_frame(&id.to_string(), t, frame, vertex_count)?;
            taken.push(frame.to_vec());
        }
        by_clip.push(taken);
    }
    let in_turn = (0..rounds).flat_map(|round| by_clip.iter().filter_map(move |frames| frames.get(round)));
    Ok(in_turn.take(wanted).cloned().collect())
}

/// The first pass over a clip.
struct FirstPass {
    speeds: Vec<f32>,
    deltas: Frames,
}

fn first_pass(
    objective: &Objective,
    sources: &[ClipId],
    read: &(impl Fn(&ClipId) -> Result<ScanClip> + Sync),
    body: &BodyModel,
    config: &FitConfig,
    new_subject: bool,
    monitor: &dyn Monitor,
) -> Result<Vec<FirstPass>> {
    let adjacency = Adjacency::new(&body.topology);
    let pass = |id: &ClipId| {
        if monitor.should_stop() {
            return Err(FitError::Stopped);
        }
        let scan = read(id)?;
        let stride = config.first_pass_stride;
        let fitted = fit_motion(objective, &scan, stride, config, &Silent)?;
        let distance_m = fitted.median_distance();
        if distance_m > config.refuse_beyond {
            // a left-out clip that is no use must not end the work on the others
            return if new_subject { Ok(None) } else { Err(FitError::NotThisBody { clip: id.clone(), distance_m }) };
        }
        let (deltas, _) = clip_deltas(objective, &fitted, &scan.vertices, stride, &adjacency);
        let speeds = speeds(&scan.vertices, scan.fps).into_iter().step_by(stride).collect();
        Ok(Some(FirstPass { speeds, deltas }))
    };
    let passes: Vec<Option<FirstPass>> = sources.par_iter().map(pass).collect::<Result<_>>()?;
    Ok(passes.into_iter().flatten().collect())
}
