use crate::avatar::AvatarBody;
use crate::features::PoseTrack;
use crate::{AvatarError, Result};
use glam::Vec3;
use rayon::prelude::*;
use softtissue_body::{BodyModel, Pose, ShapedBody};
use softtissue_clips::{ClipId, MotionClip, RawFrame, RawScans};
use softtissue_implicit::{ObserverFrame, PointTree, RawSurface, RawSurfaceConfig};
use softtissue_monitor::Monitor;
use softtissue_random::Draws;
use std::ops::Range;

/// A clip as training and evaluation see it: motion, observers, true heights and scan points of every frame.
#[derive(Clone, Debug)]
pub struct AvatarClip {
    /// Who, what, which take.
    pub id: ClipId,
    /// Poses.
    pub track: PoseTrack,
    /// Observers on the posed body, `[T]`.
    pub observers: Vec<ObserverFrame>,
    /// True heights of the scans, `[T]` of `[M]`, metres; of a missing scan those of the scan before.
    pub heights: Vec<Vec<f32>>,
    /// Whether the scan was seen where a height is, `[T]` of `[M]`: elsewhere it is guessed.
    pub known: Vec<Vec<bool>>,
    /// Scans, thinned out, `[T]`; `None` where one is missing.
    pub scans: Vec<Option<RawSurface>>,
    /// Frames that a prediction may be compared with.
    pub frames: Range<usize>,
}

/// Which part of which clip, and how its scans are taken.
#[derive(Clone, Debug)]
pub struct ClipRequest<'a> {
    /// The motion that drives the body.
    pub motion: &'a MotionClip,
    /// Frames that a prediction may be compared with; those before give its history.
    pub frames: Range<usize>,
    /// Points kept of a scan.
    pub kept_points: usize,
    /// Points further than this from every observer are left out, metres.
    pub outlier: f32,
    /// Seed of the choice of points.
    pub seed: u64,
}

impl AvatarClip {
    /// Reads a clip's scans and their heights over the posed body.
    ///
    /// # Errors
    /// A scan that cannot be read, or none at all.
    pub fn read(
        avatar: &AvatarBody,
        body: &BodyModel,
        shaped: &ShapedBody,
        scans: &dyn RawScans,
        request: &ClipRequest,
        monitor: &dyn Monitor,
    ) -> Result<Self> {
        let motion = request.motion;
        let id = &motion.id;
        let frames: Vec<(ObserverFrame, Option<Scan>)> = (0..motion.len())
            .into_par_iter()
            .map(|t| {
                if monitor.should_stop() {
                    return Err(AvatarError::Stopped);
                }
                let pose = Pose { rotations: motion.rotations.frame(t), translation: motion.translations[t] };
                let observers = avatar.observers.frame(&body.posed(shaped, pose, None), &body.topology);
                let raw = scans.frame(id, t)?;
                let scan = raw.map(|raw| Scan::new(avatar, &observers, raw, request, t)).transpose()?;
                Ok((observers, scan))
            })
            .collect::<Result<_>>()?;
        let Some(first) = frames.iter().find_map(|(_, scan)| scan.as_ref()) else {
            return Err(AvatarError::Data(format!("there is no raw scan of {id}; leave the clip out")));
        };
        let mut clip = Self {
            id: id.clone(),
            track: PoseTrack::new(motion),
            observers: Vec::with_capacity(frames.len()),
            heights: Vec::with_capacity(frames.len()),
            known: Vec::with_capacity(frames.len()),
            scans: Vec::with_capacity(frames.len()),
            frames: request.frames.clone(),
        };
        let mut last = first.heights.clone();
        for (observers, scan) in frames {
            clip.observers.push(observers);
            if let Some(scan) = &scan {
                last.clone_from(&scan.heights);
            }
            clip.heights.push(last.clone());
            clip.known.push(scan.as_ref().map_or_else(|| vec![false; last.len()], |s| s.known.clone()));
            clip.scans.push(scan.map(|s| s.surface));
        }
        Ok(clip)
    }

    /// Frames that a rollout of `length` may begin at: its scans are there, and so is its history.
    pub fn starts(&self, history: usize, length: usize) -> Vec<usize> {
        let first = self.frames.start.max(history);
        let last = (self.frames.end + 1).saturating_sub(length);
        (first..last).filter(|t| (*t..t + length).all(|t| self.scans[t].is_some())).collect()
    }

    /// True heights of the `history` frames before `t`, the newest last.
    pub fn history(&self, t: usize, history: usize) -> &[Vec<f32>] {
        &self.heights[t - history..t]
    }
}

/// One frame's scan.
struct Scan {
    heights: Vec<f32>,
    known: Vec<bool>,
    surface: RawSurface,
}

impl Scan {
    fn new(
        avatar: &AvatarBody,
        observers: &ObserverFrame,
        raw: RawFrame,
        request: &ClipRequest,
        t: usize,
    ) -> Result<Self> {
        let config = RawSurfaceConfig::default();
        let id = &request.motion.id;
        let data = |e: softtissue_implicit::ImplicitError| AvatarError::Data(format!("{id}, frame {t}: {e}"));
        let near = near(raw, observers, request.outlier);
        let whole = RawSurface::new(&near, &config).map_err(data)?;
        let mut heights = whole.heights(observers, &avatar.heights);
        avatar.close(&mut heights.values, &heights.known);
        let mut draws = Draws::new(request.seed, &format!("autoavatar/scan/{id}"), 0, t as u64);
        let mut chosen = draws.permutation(near.points.len());
        chosen.truncate(request.kept_points);
        chosen.sort_unstable();
        let pick = |of: &[Vec3]| chosen.iter().map(|i| of[*i]).collect();
        let thinned = RawFrame { points: pick(&near.points), normals: pick(&near.normals) };
        Ok(Self {
            heights: heights.values,
            known: heights.known,
            surface: RawSurface::new(&thinned, &config).map_err(data)?,
        })
    }
}

/// The points with normals that lie within `reach` metres of an observer.
fn near(raw: RawFrame, observers: &ObserverFrame, reach: f32) -> RawFrame {
    let distances = PointTree::new(&observers.positions).nearest(&raw.points, 1).distances;
    let pairs = raw.points.into_iter().zip(raw.normals).zip(distances);
    let kept = pairs.filter(|((_, normal), distance)| *distance <= reach && *normal != Vec3::ZERO);
    let (points, normals) = kept.map(|(pair, _)| pair).unzip();
    RawFrame { points, normals }
}
