//! AutoAvatar's protocol (Bai et al. 2022, sec. 4.1): whatever predicts surfaces is started again every 20 frames from the
//! truth before, rolls on by itself, and is judged after 1, 2, 4, 8, 16 and 30 frames. Who predicts is known by a trait
//! alone, so that networks and registered meshes stand in one table.

mod free;
mod meshes;

pub use free::FreeRollout;
pub use meshes::{MeshFrame, MeshPredictor, drawn_over};

use crate::{ImplicitError, ObserverFrame, RawSurface, SignedDistance, VolumeProbe, VolumeProbeConfig, mean_distance};
use glam::Vec3;
use serde::{Deserialize, Serialize};
use softtissue_geometry::Mesh;
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::ops::Range;

/// When predictions are judged.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RolloutConfig {
    /// Frames of rollout after which it is judged, ascending. Default 1, 2, 4, 8, 16, 30 (table 1).
    pub lengths: Vec<usize>,
    /// Frames between the starts of rollouts. Default 20 (sec. 4.1).
    pub restart: usize,
    /// Where volume is looked at.
    pub volume: VolumeProbeConfig,
}

impl Default for RolloutConfig {
    fn default() -> Self {
        Self { lengths: vec![1, 2, 4, 8, 16, 30], restart: 20, volume: VolumeProbeConfig::default() }
    }
}

impl RolloutConfig {
    /// The frames of each rollout in a clip whose `frames` may be judged, if a start needs `history` frames of the clip
    /// before it: the 20th, the 40th and so on, each as long as the clip lasts and the longest length asks.
    pub fn windows(&self, frames: Range<usize>, history: usize) -> Vec<Range<usize>> {
        let restart = self.restart.max(1);
        let longest = self.lengths.iter().copied().max().unwrap_or(0);
        let first = frames.start.max(history).max(1).next_multiple_of(restart);
        (first..frames.end).step_by(restart).map(|t| t..frames.end.min(t + longest)).collect()
    }
}

/// A surface that was predicted.
pub trait PredictedSurface: SignedDistance {
    /// It as a mesh, near `points`, metres.
    ///
    /// # Errors
    /// A surface that no mesh can be made of.
    fn mesh(&self, points: &[Vec3]) -> Result<Cow<'_, Mesh>, ImplicitError>;

    /// Its heights over all observers, `[N]`, metres, closed where it is not met: the lowest height there would be a jump by
    /// centimetres, and counted as motion.
    fn heights(&self) -> &[f32];
}

/// What predicts the surfaces of a clip frame by frame.
pub trait SurfacePredictor {
    /// What can go wrong, a stop among it.
    type Error: From<ImplicitError>;
    /// Starts a rollout at frame `start`, knowing the truth of the frames before it.
    ///
    /// # Errors
    /// A history that it cannot start from.
    fn restart(&mut self, start: usize) -> Result<(), Self::Error>;
    /// The surface of frame `t`, the one after the last.
    ///
    /// # Errors
    /// A prediction that failed.
    fn predict(&mut self, t: usize) -> Result<Box<dyn PredictedSurface + '_>, Self::Error>;
}

/// What is true of a clip.
#[derive(Clone, Debug)]
pub struct RolloutClip<'a> {
    /// Frames that a prediction may be compared with.
    pub frames: Range<usize>,
    /// Frames before a start that a prediction needs; the same for all that are compared, so that they start alike.
    pub history: usize,
    /// Observer points, `[T]` of `[N]`.
    pub observers: &'a [ObserverFrame],
    /// Scans, `[T]`; none where one is missing.
    pub scans: &'a [Option<RawSurface>],
    /// True heights, `[T]` of `[N]`, metres.
    pub heights: &'a [Vec<f32>],
    /// Whether the scan was seen there, `[T]` of `[N]`: elsewhere a true height is a guess, and its change no motion.
    pub known: &'a [Vec<bool>],
    /// Observers whose volume and motion count: not those of head, hands and feet (sec. 4.1).
    pub judged: &'a [usize],
}

/// A mean that is still being taken.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Mean {
    sum: f64,
    count: u32,
}

/// Sums over the rollouts of one predictor.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RolloutTally {
    distance: BTreeMap<usize, Mean>,
    volume: BTreeMap<usize, Mean>,
    /// Squared changes of predicted and of true heights.
    motion: [f64; 2],
    rollouts: u32,
    lost: u32,
}

/// A row of the paper's table 1; what was not measured is absent.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RolloutFigures {
    /// Mean distance of scan points from the predicted surface, mm, by frames of rollout.
    pub distance_mm: BTreeMap<usize, f64>,
    /// Mean squared error of the change of volume, by frames of rollout; from two on.
    pub volume_change: BTreeMap<usize, f64>,
    /// Root mean square change of predicted heights from frame to frame over that of true ones: 0 stands still, 1 moves as
    /// much as the scans. The distance alone rewards standing still (sec. 4.2).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub height_energy: Option<f64>,
    /// Rollouts that were judged.
    pub rollouts: u32,
    /// Frames with a scan, of those judged, whose predicted surface was nowhere: no distance has them.
    #[serde(default)]
    pub lost: u32,
}

impl Mean {
    fn add(&mut self, x: f64) {
        self.sum += x;
        self.count += 1;
    }
}

/// What a rollout carries from one frame to the next.
#[derive(Default)]
struct Before {
    heights: Option<Vec<f32>>,
    /// Shares of volume inside the scan and inside the prediction.
    shares: Option<[Vec<f32>; 2]>,
}

impl RolloutTally {
    /// Means so far.
    pub fn figures(&self) -> RolloutFigures {
        let means = |of: &BTreeMap<usize, Mean>| of.iter().map(|(n, m)| (*n, m.sum / f64::from(m.count))).collect();
        let [found, wanted] = self.motion;
        RolloutFigures {
            distance_mm: means(&self.distance),
            volume_change: means(&self.volume),
            height_energy: (wanted > 0.0).then(|| (found / wanted).sqrt()),
            rollouts: self.rollouts,
            lost: self.lost,
        }
    }

    /// Adds the rollouts of a clip. A surface that is nowhere has no distance and is counted as lost, and a frame without a
    /// scan is passed over.
    ///
    /// # Errors
    /// The predictor's.
    pub fn add<P: SurfacePredictor>(
        &mut self,
        predictor: &mut P,
        clip: &RolloutClip,
        config: &RolloutConfig,
    ) -> Result<(), P::Error> {
        let probe = VolumeProbe::new(clip.judged.len(), &config.volume);
        for window in config.windows(clip.frames.clone(), clip.history) {
            predictor.restart(window.start)?;
            let mut before = Before::default();
            for (n, t) in (1..).zip(window) {
                let surface = predictor.predict(t)?;
                self.add_motion(surface.as_ref(), clip, t, &mut before);
                self.add_frame(surface.as_ref(), clip, (n, t), config, &probe, &mut before)?;
            }
            self.rollouts += 1;
        }
        Ok(())
    }

    fn add_motion(&mut self, surface: &dyn PredictedSurface, clip: &RolloutClip, t: usize, before: &mut Before) {
        let all = surface.heights();
        let now: Vec<f32> = clip.judged.iter().map(|i| all[*i]).collect();
        if let Some(last) = &before.heights {
            let seen = |i: usize| clip.known[t][i] && clip.known[t - 1][i];
            for ((i, now), last) in clip.judged.iter().zip(&now).zip(last).filter(|((i, _), _)| seen(**i)) {
                self.motion[0] += f64::from(now - last).powi(2);
                self.motion[1] += f64::from(clip.heights[t][*i] - clip.heights[t - 1][*i]).powi(2);
            }
        }
        before.heights = Some(now);
    }

    fn add_frame(
        &mut self,
        surface: &dyn PredictedSurface,
        clip: &RolloutClip,
        (n, t): (usize, usize),
        config: &RolloutConfig,
        probe: &VolumeProbe,
        before: &mut Before,
    ) -> Result<(), ImplicitError> {
        let Some(scan) = &clip.scans[t] else {
            before.shares = None;
            return Ok(());
        };
        let at = &clip.observers[t].positions;
        let judged = config.lengths.contains(&n);
        if judged {
            match mean_distance(scan.points(), surface.mesh(at)?.as_ref()) {
                Some(distance) => self.distance.entry(n).or_default().add(1000.0 * distance),
                None => self.lost += 1,
            }
        }
        if !judged && !config.lengths.contains(&(n + 1)) {
            before.shares = None;
            return Ok(());
        }
        let places: Vec<Vec3> = clip.judged.iter().map(|i| at[*i]).collect();
        let now = [probe.shares(scan, &places), probe.shares(surface, &places)];
        if judged && let Some(last) = &before.shares {
            let error = VolumeProbe::change_error([&last[0], &now[0]], [&last[1], &now[1]]);
            error.into_iter().for_each(|e| self.volume.entry(n).or_default().add(e));
        }
        before.shares = Some(now);
        Ok(())
    }
}

#[cfg(test)]
mod tests;
