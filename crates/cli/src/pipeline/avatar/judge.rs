//! The paper's table: networks, what stands still, and methods of registered meshes on the same scans.

use super::scene::{AvatarScene, Part};
use super::show::AvatarShow;
use crate::exit::InputError;
use crate::pipeline::bundle::BundleMethod;
use anyhow::Result;
use burn::tensor::Device;
use softtissue_avatar::{
    AvatarBody, AvatarClip, AvatarError, AvatarModel, Candidate, Conditioning, PoseSource, PoseTrack,
};
use softtissue_body::{Pose, RegionMap};
use softtissue_clips::{ClipId, MotionClip};
use softtissue_eval::measures::looped;
use softtissue_eval::surfaces::{HeightTrace, STILL, SurfaceCurves, SurfaceFigures, SurfaceMetrics, cycle_figures};
use softtissue_eval::viewer::ViewClip;
use softtissue_eval::{BodyAlone, Method};
use softtissue_geometry::{Frames, Mesh};
use softtissue_implicit::{
    FreeRollout, MeshField, MeshFrame, MeshPredictor, RolloutClip, RolloutConfig, RolloutTally, SurfacePredictor,
    drawn_over,
};
use std::collections::BTreeMap;
use std::time::Instant;

/// Frames of the rollout that shows whether heights grow (AutoAvatar's minute at 60 a second).
const CYCLE_FRAMES: f32 = 3600.0;

/// What stands in the table.
pub struct Rivals<'a> {
    /// Avatars, each with the words that go before its rows; the first is the run's own.
    pub avatars: &'a [(String, AvatarModel)],
    /// Bundles, on motions that they have not seen.
    pub bundles: &'a [BundleMethod],
}

/// What was found.
pub struct AvatarJudgement {
    /// All figures.
    pub metrics: SurfaceMetrics,
    /// What the report plays: whole rollouts of the clips that training has not seen.
    pub shown: Vec<ViewClip>,
}

/// The clips of both sets over one avatar's observers.
struct Sets {
    observers: usize,
    poses: PoseSource,
    interpolation: Vec<AvatarClip>,
    extrapolation: Vec<AvatarClip>,
}

impl Sets {
    fn both(&self) -> [&[AvatarClip]; 2] {
        [&self.interpolation, &self.extrapolation]
    }
}

/// Judges avatars and bundles on the clips that the run left out.
pub fn judge_avatars(scene: &AvatarScene, rivals: &Rivals, device: &Device) -> Result<AvatarJudgement> {
    let config = &scene.config.autoavatar;
    let subject = scene.subject()?;
    let wanted = scene.judged(&subject)?;
    for (prefix, model) in rivals.avatars {
        check_unseen(scene, prefix, model, &subject, &wanted)?;
    }
    let Some((_, own)) = rivals.avatars.first() else { return Err(InputError("no avatar to judge".into()).into()) };
    let poses = if own.info.poses == PoseSource::Fitted { "fitted" } else { "rough" };
    let mut metrics = SurfaceMetrics::new(&subject, poses, config.grid);
    let mut shown = Vec::new();
    let history = rivals.avatars.iter().map(|(_, m)| m.config.history).max().unwrap_or(1);
    let mut kept: Option<Sets> = None;
    for (i, (prefix, model)) in rivals.avatars.iter().enumerate() {
        let avatar = AvatarBody::new(&model.config, scene.body, device)?;
        let (observers, poses) = (avatar.observers.len(), model.info.poses);
        let sets = match kept.take() {
            Some(sets) if sets.observers == observers && sets.poses == poses => sets,
            _ => Sets {
                observers,
                poses,
                interpolation: scene.clips(&avatar, poses, &wanted[0])?,
                extrapolation: scene.clips(&avatar, poses, &wanted[1])?,
            },
        };
        let judge = Judge::new(scene, &avatar, model, history);
        if i == 0 {
            judge.meshes(&mut metrics, &sets, rivals.bundles)?;
        }
        let rollouts = judge.networks(&mut metrics, &sets, prefix)?;
        judge.cycles(&mut metrics, prefix, &subject)?;
        if i == 0 {
            let show = AvatarShow { scene, avatar: &avatar, poses };
            let count = scene.config.eval.playback_clips;
            for (c, clip) in sets.extrapolation.iter().enumerate().take(count) {
                let of = |conditioning: Conditioning| Some(rollouts.get(&conditioning)?.get(c)?.clone());
                shown.extend(show.clip(clip, history, &of)?);
            }
        }
        kept = Some(sets);
    }
    Ok(AvatarJudgement { metrics, shown })
}

/// An error on what training has seen is none to compare.
fn check_unseen(
    scene: &AvatarScene,
    prefix: &str,
    model: &AvatarModel,
    subject: &str,
    [halves, wholes]: &[Vec<(ClipId, Part)>; 2],
) -> Result<()> {
    let refuse = |what: String| -> Result<()> {
        let whose = if prefix.is_empty() { "the run's avatar" } else { prefix.trim_end_matches('/') };
        Err(InputError(format!("{whose} {what}; train it with the settings of this run, or leave it out")).into())
    };
    if model.info.provenance["scans"]["fingerprint"].as_str() != Some(&scene.scans.fingerprint) {
        return refuse("was learned from other scans".into());
    }
    if model.info.subject != subject {
        return refuse(format!("is of {} and not of {subject}", model.info.subject));
    }
    if model.body.topology.hash() != scene.body.topology.hash() {
        return refuse("stands on another body".into());
    }
    if model.body.template != scene.body.template {
        return refuse("stands on another body of this topology".into());
    }
    let rate = |ids: &[(ClipId, Part)]| -> Result<Vec<f32>> {
        ids.iter().map(|(id, _)| Ok(scene.motion(model.info.poses, id)?.fps)).collect()
    };
    if let Some(fps) = [rate(halves)?, rate(wholes)?].concat().into_iter().find(|fps| *fps != model.info.fps) {
        return refuse(format!("is for {} frames a second, and {fps} are judged here", model.info.fps));
    }
    let list = |key: &str| -> Option<Vec<&str>> {
        Some(model.info.provenance[key].as_array()?.iter().filter_map(serde_json::Value::as_str).collect())
    };
    let (Some(trained), Some(selected), Some(half)) = (list("trained_on"), list("selected_on"), list("first_half_of"))
    else {
        return refuse("does not say what it was trained on".into());
    };
    let seen = |id: &str| trained.contains(&id) || selected.contains(&id);
    if let Some((id, _)) = wholes.iter().find(|(id, _)| seen(&id.to_string())) {
        return refuse(format!("has seen {id}, which is judged here"));
    }
    let whole = |id: &str| seen(id) && !half.contains(&id);
    match halves.iter().find(|(id, _)| whole(&id.to_string())) {
        Some((id, _)) => refuse(format!("has seen the second half of {id}, which is judged here")),
        None => Ok(()),
    }
}

/// What is kept of a row beside its figures.
#[derive(Default)]
struct Row {
    /// Through the clips of the extrapolation set.
    rollouts: Vec<FreeRollout>,
    /// Of the first of these, with its surfaces drawn and measured.
    frame_ms: Option<f64>,
}

/// One avatar's judgement.
struct Judge<'a> {
    scene: &'a AvatarScene<'a>,
    avatar: &'a AvatarBody,
    model: &'a AvatarModel,
    history: usize,
    /// Observers whose volume and motion count.
    judged: Vec<usize>,
    /// The region of each observer.
    regions: RegionMap,
}

impl<'a> Judge<'a> {
    fn new(scene: &'a AvatarScene<'a>, avatar: &'a AvatarBody, model: &'a AvatarModel, history: usize) -> Self {
        let regions = RegionMap(avatar.observers.pick(&scene.body.regions.0));
        Self { scene, avatar, model, history, judged: avatar.moving(), regions }
    }

    /// Every network of the avatar; its rollouts through the clips of the extrapolation set.
    fn networks(
        &self,
        metrics: &mut SurfaceMetrics,
        sets: &Sets,
        prefix: &str,
    ) -> Result<BTreeMap<Conditioning, Vec<FreeRollout>>> {
        let monitor = self.scene.monitor;
        let mut rollouts = BTreeMap::new();
        for learned in &self.model.networks {
            let candidate = Candidate {
                body: self.avatar,
                conditioning: learned.conditioning,
                network: &learned.network,
                grid: self.scene.config.autoavatar.grid,
            };
            let name = format!("{prefix}{}", learned.conditioning.name());
            let Row { rollouts: free, frame_ms } =
                self.row(metrics, sets.both(), &name, |clip| candidate.on(clip, monitor))?;
            if let (Some(curves), Some(frame_ms)) = (&mut metrics.over_time, frame_ms) {
                curves.frame_ms.insert(name, frame_ms);
            }
            rollouts.insert(learned.conditioning, free);
        }
        Ok(rollouts)
    }

    /// What stands still, the body alone and bundles: rows that are known as meshes on the body's topology.
    fn meshes(&self, metrics: &mut SurfaceMetrics, sets: &Sets, bundles: &[BundleMethod]) -> Result<()> {
        let (scene, topology) = (self.scene, &self.scene.body.topology);
        let spread = self.avatar.observers.vertices_from_observers(&scene.body.template, topology);
        let all = sets.interpolation.iter().chain(&sets.extrapolation);
        let posed: BTreeMap<String, Frames> =
            all.map(|clip| Ok((clip.id.to_string(), scene.posed(sets.poses, &clip.id)?))).collect::<Result<_>>()?;
        self.row(metrics, sets.both(), STILL, |clip| {
            let posed = &posed[&clip.id.to_string()];
            let (spread, heights) = (&spread, &self.avatar.heights);
            MeshPredictor::new(move |start, t| {
                let last = &clip.heights[start - 1];
                let drawn = drawn_over(posed.frame(t), topology, spread, last, heights);
                MeshFrame { mesh: Mesh::new(drawn, topology.clone()), heights: last.clone() }
            })
        })?;
        if bundles.is_empty() {
            return Ok(());
        }
        let alone = BodyAlone { vertex_count: scene.body.vertex_count() };
        let methods = bundles.iter().map(|m| m as &dyn Method);
        for method in std::iter::once(&alone as &dyn Method).chain(methods) {
            let mut meshes = BTreeMap::new();
            for clip in &sets.extrapolation {
                meshes.insert(clip.id.to_string(), self.displaced(method, sets.poses, &clip.id)?);
            }
            // they have seen the motions of the other set whole
            self.row(metrics, [&[], &sets.extrapolation], method.name(), |clip| {
                let meshes = &meshes[&clip.id.to_string()];
                MeshPredictor::new(move |_, t| {
                    let mesh = Mesh::new(meshes.frame(t).to_vec(), topology.clone());
                    let heights = self.avatar.heights_of(&MeshField::new(&mesh), &clip.observers[t]);
                    MeshFrame { mesh, heights }
                })
            })?;
        }
        Ok(())
    }

    /// The body with a method's displacements, over the person's template, as free rollouts from the clip's first frame:
    /// `[T, V]`, metres.
    fn displaced(&self, method: &dyn Method, poses: PoseSource, id: &ClipId) -> Result<Frames> {
        let scene = self.scene;
        let subject = scene.fit.subject(&id.subject)?;
        let motion = scene.motion(poses, id)?;
        let failed = |e| InputError(format!("{} failed on {id}: {e}", method.name()));
        let mut deltas = method.rollout(&id.subject, &subject.beta, &motion).map_err(failed)?;
        for t in 0..deltas.len() {
            deltas.frame_mut(t).iter_mut().zip(&subject.template).for_each(|(d, detail)| *d += *detail);
        }
        let shaped = scene.body.shaped(&subject.beta);
        Ok(scene.body.posed_frames(&shaped, &motion.rotations, &motion.translations, Some(&deltas)))
    }

    /// A row, on the clips of the interpolation and of the extrapolation set.
    fn row<'c, P>(
        &self,
        metrics: &mut SurfaceMetrics,
        sets: [&'c [AvatarClip]; 2],
        name: &str,
        mut predictor: impl FnMut(&'c AvatarClip) -> P,
    ) -> Result<Row>
    where
        P: SurfacePredictor,
        P::Error: Into<AvatarError>,
    {
        let monitor = self.scene.monitor;
        monitor.begin(&format!("judging {name}"), (sets[0].len() + sets[1].len()) as u64, "clips");
        let protocol = RolloutConfig::default();
        let mut row = Row::default();
        for (set, extrapolation) in sets.into_iter().zip([false, true]) {
            let (mut tally, mut decibels, mut rollouts) = (RolloutTally::default(), Vec::new(), Vec::new());
            for (c, clip) in set.iter().enumerate() {
                if monitor.should_stop() {
                    return Err(AvatarError::Stopped.into());
                }
                let truth = clip.truth(self.history, &self.judged);
                let mut predictor = predictor(clip);
                tally.add(&mut predictor, &truth, &protocol).map_err(Into::into)?;
                let timed = extrapolation && c == 0;
                let begun = Instant::now();
                let free = FreeRollout::of(&mut predictor, &truth, timed).map_err(Into::into)?;
                decibels.extend(self.trace(&truth, &free).spectral_db(&free.heights));
                if timed {
                    let fps = self.model.info.fps;
                    let curves = || SurfaceCurves { clip: clip.id.to_string(), fps, ..SurfaceCurves::default() };
                    let curves = metrics.over_time.get_or_insert_with(curves);
                    curves.start = free.start;
                    let milliseconds = 1000.0 * begun.elapsed().as_secs_f64();
                    row.frame_ms = Some(milliseconds / free.heights.len().max(1) as f64);
                    curves.distance_mm.insert(name.to_owned(), free.distance_mm.clone());
                }
                rollouts.push(free);
                monitor.advance(1, &clip.id.to_string());
            }
            let spectral_db = (!decibels.is_empty()).then(|| decibels.iter().sum::<f64>() / decibels.len() as f64);
            let figures = SurfaceFigures { rollout: tally.figures(), spectral_db };
            let table = if extrapolation { &mut metrics.extrapolation } else { &mut metrics.interpolation };
            if !set.is_empty() {
                table.insert(name.to_owned(), figures);
            }
            row.rollouts = rollouts;
        }
        monitor.end();
        Ok(row)
    }

    /// True heights of the frames of a free rollout.
    fn trace<'t>(&'t self, truth: &RolloutClip<'t>, free: &FreeRollout) -> HeightTrace<'t> {
        let frames = free.start..free.start + free.heights.len();
        HeightTrace {
            regions: &self.regions,
            fps: self.model.info.fps,
            heights: &truth.heights[frames.clone()],
            known: &truth.known[frames],
        }
    }

    /// Whether the heights of networks that feed on them grow over a motion that is played over and over: the first clip
    /// of the interpolation set, or else of training, for `eval.bounded_seconds` but 3600 frames at most.
    fn cycles(&self, metrics: &mut SurfaceMetrics, prefix: &str, subject: &str) -> Result<()> {
        let (scene, model) = (self.scene, self.model);
        let seconds = scene.config.eval.bounded_seconds.min(CYCLE_FRAMES / model.info.fps);
        let mut candidates = scene.interpolation(subject)?;
        candidates.extend(scene.own(subject, &scene.split.train, Part::Whole));
        let feeding: Vec<_> = model.networks.iter().filter(|l| l.conditioning.sees_heights()).collect();
        let Some((id, _)) = candidates.into_iter().next().filter(|_| seconds > 0.0 && !feeding.is_empty()) else {
            return Ok(());
        };
        let motion = scene.motion(model.info.poses, &id)?;
        let history = model.config.history;
        let clips = scene.clips(self.avatar, model.info.poses, &[(id.clone(), Part::Whole)])?;
        let Some(clip) = clips.first().filter(|c| c.heights.len() > history) else { return Ok(()) };
        let long = looped(std::slice::from_ref(&motion), seconds);
        let trace =
            HeightTrace { regions: &self.regions, fps: model.info.fps, heights: &clip.heights, known: &clip.known };
        for learned in feeding {
            let candidate = Candidate {
                body: self.avatar,
                conditioning: learned.conditioning,
                network: &learned.network,
                grid: scene.config.autoavatar.grid,
            };
            let frames = long.len().saturating_sub(history);
            let name = format!("{prefix}{}", learned.conditioning.name());
            scene.monitor.begin(&format!("long rollout of {name}"), frames as u64, "frames");
            let found = cycle_figures(&trace, &id.to_string(), frames, |see| {
                let mut seen = |heights: &[f32]| {
                    see(heights);
                    scene.monitor.advance(1, "");
                };
                let observers = self.observers_of(&long)?;
                let track = PoseTrack::new(&long);
                candidate.heights_over(&track, &clip.heights[..history], observers, scene.monitor, &mut seen)?;
                Ok::<(), anyhow::Error>(())
            })?;
            scene.monitor.end();
            if let Some(found) = found {
                metrics.cycles.insert(name, found);
            }
        }
        Ok(())
    }

    /// The observers of a motion's frames.
    fn observers_of<'m>(
        &'m self,
        motion: &'m MotionClip,
    ) -> Result<impl FnMut(usize) -> softtissue_implicit::ObserverFrame + 'm> {
        let body = self.scene.body;
        let shaped = body.shaped(&self.scene.fit.subject(&motion.id.subject)?.beta);
        Ok(move |t: usize| {
            let pose = Pose { rotations: motion.rotations.frame(t), translation: motion.translations[t] };
            self.avatar.observers.frame(&body.posed(&shaped, pose, None), &body.topology)
        })
    }
}
