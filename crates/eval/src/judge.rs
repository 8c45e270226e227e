use crate::tally::Reference;
use crate::{BodyAlone, ClipTally, EvalError, Method, MethodTally, Result, Tally};
use rayon::prelude::*;
use softtissue_body::BodyModel;
use softtissue_clips::{ClipId, FitSet, MotionClip, ScanSet, TruthSet};
use softtissue_geometry::Frames;
use softtissue_monitor::Monitor;
use std::collections::BTreeMap;
use std::time::Instant;

/// Where the clips to judge lie.
#[derive(Clone, Copy)]
pub struct Scene<'a> {
    /// The body they were fitted with.
    pub body: &'a BodyModel,
    /// Shapes, fitted motions and scan deltas.
    pub fit: &'a FitSet,
    /// The scans, for their rough pose channel; without them that channel is left out.
    pub scans: Option<&'a ScanSet>,
    /// Truth, for data that have it. Without it the scans' deltas are the reference.
    pub truth: Option<&'a TruthSet>,
}

/// What drives the regressor at test time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Channel {
    /// The true motion: what the gates are about.
    Exact,
    /// The motion fitted to the test scan, which carries flesh motion into the input.
    Fitted,
    /// The motion with smooth errors of one or two degrees.
    Rough,
}

impl Scene<'_> {
    /// The channel whose figures bear a method's plain name: the exact one where there is truth.
    pub fn main_channel(&self) -> Channel {
        if self.truth.is_some() { Channel::Exact } else { Channel::Fitted }
    }

    /// A clip's motion in a channel, where it exists.
    pub fn motion(&self, id: &ClipId, channel: Channel) -> Result<Option<MotionClip>> {
        Ok(match channel {
            Channel::Exact => self.truth.map(|t| t.motion(id)).transpose()?,
            Channel::Fitted => Some(self.fit.motion(id)?),
            Channel::Rough => self.scans.map(|s| s.rough_motion(id)).transpose()?.flatten(),
        })
    }

    /// Reference deltas of a clip (truth where there is any) and the scans' deltas, checked for size.
    pub fn deltas(&self, id: &ClipId) -> Result<(Frames, Frames, f32)> {
        let scan = self.fit.deltas(id)?;
        let fps = scan.fps;
        let reference = match self.truth {
            Some(truth) => truth.deltas(id)?.deltas,
            None => scan.deltas.clone(),
        };
        let scan = scan.deltas;
        check_size(id, "the scan deltas", &scan, scan.len(), self.body.vertex_count())?;
        check_size(id, "the true deltas", &reference, scan.len(), self.body.vertex_count())?;
        Ok((reference, scan, fps))
    }

    /// Fitted shape of a clip's subject.
    pub fn beta(&self, id: &ClipId) -> Result<Vec<f32>> {
        Ok(self.fit.subject(&id.subject)?.beta)
    }
}

/// Judges methods on clips and adds the outcome to a tally: clip after clip from disk, several at a time, the
/// results in the order of `clips` whatever the thread count. The body alone is always judged too. `fold` names the
/// fold of a protocol. Rollout speed is timed by itself, on the first clip.
pub fn judge(
    tally: &mut Tally,
    scene: &Scene,
    methods: &[&dyn Method],
    clips: &[ClipId],
    fold: Option<&str>,
    monitor: &dyn Monitor,
) -> Result<()> {
    let alone = BodyAlone { vertex_count: scene.body.vertex_count() };
    let mut all: Vec<&dyn Method> = vec![&alone];
    all.extend(methods.iter().filter(|m| m.name() != alone.name()));
    monitor.begin("judge", clips.len() as u64, "clips");
    let judged: Result<Vec<ClipTally>> = clips
        .par_iter()
        .map(|id| {
            if monitor.should_stop() {
                return Err(EvalError::Stopped);
            }
            let clip = judge_clip(scene, &all, id, fold)?;
            monitor.advance(1, &id.to_string());
            Ok(clip)
        })
        .collect();
    monitor.end();
    tally.clips.extend(judged?);
    tally.truth = scene.truth.is_some();
    tally.vertices = scene.body.vertex_count();
    if let Some(id) = clips.first() {
        for method in methods.iter().filter(|m| m.name() != alone.name()) {
            let speed = frames_per_second(scene, *method, id)?;
            tally.speeds.entry(method.name().to_owned()).or_insert(speed);
        }
    }
    Ok(())
}

fn judge_clip(scene: &Scene, methods: &[&dyn Method], id: &ClipId, fold: Option<&str>) -> Result<ClipTally> {
    let (deltas, scan, fps) = scene.deltas(id)?;
    let beta = scene.beta(id)?;
    let reference = Reference::new(&scene.body.regions, fps, &deltas, &scan);
    let mut by_name = BTreeMap::new();
    for channel in [Channel::Exact, Channel::Fitted, Channel::Rough] {
        let Some(motion) = scene.motion(id, channel)? else { continue };
        let main = channel == scene.main_channel();
        for method in methods.iter().filter(|m| main || !m.main_channel_only()) {
            let predicted = rollout(*method, id, &beta, &motion, deltas.len(), scene.body.vertex_count())?;
            by_name.insert(name_in(method.name(), channel, main), MethodTally::of(&predicted, &reference));
        }
    }
    let spectra = reference.means.into_iter().map(|(r, (_, s))| (r, s)).collect();
    Ok(ClipTally {
        id: id.clone(),
        fold: fold.map(ToOwned::to_owned),
        beta_1: beta.get(1).copied(),
        fps,
        frames: deltas.len(),
        spectra,
        methods: by_name,
    })
}

/// `ridge` in the main channel, `ridge/fitted` and `ridge/rough` in the others.
fn name_in(name: &str, channel: Channel, main: bool) -> String {
    match channel {
        _ if main => name.to_owned(),
        Channel::Exact => format!("{name}/exact"),
        Channel::Fitted => format!("{name}/fitted"),
        Channel::Rough => format!("{name}/rough"),
    }
}

/// A checked rollout: as many frames as asked for, `V` vertices each.
pub(crate) fn rollout(
    method: &dyn Method,
    id: &ClipId,
    beta: &[f32],
    motion: &MotionClip,
    frames: usize,
    vertices: usize,
) -> Result<Frames> {
    let predicted = method.rollout(&id.subject, beta, motion).map_err(|source| EvalError::Method {
        method: method.name().to_owned(),
        clip: id.clone(),
        source,
    })?;
    check_size(id, &format!("the prediction of {}", method.name()), &predicted, frames, vertices)?;
    Ok(predicted)
}

pub(crate) fn check_size(id: &ClipId, what: &str, frames: &Frames, length: usize, vertices: usize) -> Result<()> {
    if frames.len() == length && frames.points_per_frame() == vertices {
        return Ok(());
    }
    let sizes =
        format!("{} frames of {} vertices, expected {length} of {vertices}", frames.len(), frames.points_per_frame());
    Err(EvalError::Size { clip: id.clone(), what: what.to_owned(), sizes })
}

/// One timed rollout after all others, so that everything is warm and nothing else runs.
fn frames_per_second(scene: &Scene, method: &dyn Method, id: &ClipId) -> Result<f64> {
    let beta = scene.beta(id)?;
    let motion = scene.motion(id, scene.main_channel())?.map_or_else(|| scene.fit.motion(id), Ok)?;
    let start = Instant::now();
    rollout(method, id, &beta, &motion, motion.len(), scene.body.vertex_count())?;
    Ok(motion.len() as f64 / start.elapsed().as_secs_f64().max(1e-9))
}
