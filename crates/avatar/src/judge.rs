use crate::avatar::{AvatarBody, Playback};
use crate::clip::AvatarClip;
use crate::config::Conditioning;
use crate::network::AvatarNetwork;
use crate::{AvatarError, Result};
use glam::Vec3;
use serde::{Deserialize, Serialize};
use softtissue_implicit::{
    MarchingCubes, ObserverFrame, SignedDistance, VolumeProbe, VolumeProbeConfig, mean_distance,
};
use softtissue_monitor::Monitor;
use std::collections::BTreeMap;

/// Frames of a rollout after which it is judged (table 1).
pub const ROLLOUTS: [usize; 6] = [1, 2, 4, 8, 16, 30];
/// Frames between the starts of rollouts (sec. 4.1).
const RESTART: usize = 20;
/// How far from an observer a surface is sought, metres.
pub const REACH: f32 = 0.1;

/// A network that is judged.
#[derive(Clone, Copy)]
pub struct Candidate<'a> {
    /// What it stands on.
    pub body: &'a AvatarBody,
    /// What it sees.
    pub conditioning: Conditioning,
    /// Without autodiff.
    pub network: &'a AvatarNetwork,
    /// Cells along the longest side of the grid that surfaces are drawn from.
    pub grid: usize,
}

/// A mean that is still being taken.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Mean {
    sum: f64,
    count: u32,
}

impl Mean {
    fn add(&mut self, x: Option<f64>) {
        if let Some(x) = x {
            self.sum += x;
            self.count += 1;
        }
    }

    fn value(self) -> Option<f64> {
        (self.count > 0).then(|| self.sum / f64::from(self.count))
    }
}

/// Sums over rollouts of one network.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RolloutTally {
    distance: BTreeMap<usize, Mean>,
    volume: BTreeMap<usize, Mean>,
    /// Squared changes of predicted and of true heights.
    motion: [f64; 2],
    rollouts: u32,
}

/// The paper's table 1, a row: what is not measured is absent.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RolloutFigures {
    /// Mean distance of scan points from the predicted surface, mm, by frames of rollout.
    pub distance_mm: BTreeMap<usize, f64>,
    /// Mean squared error of the change of volume, by frames of rollout.
    pub volume_change: BTreeMap<usize, f64>,
    /// Root mean square change of predicted heights from frame to frame over that of true ones, of all observers but
    /// those on face, hands and feet: 0 stands still, 1 moves as much as the scans.
    pub height_energy: Option<f64>,
    /// Rollouts that were judged.
    pub rollouts: u32,
}

impl RolloutTally {
    /// Means.
    pub fn figures(&self) -> RolloutFigures {
        let means = |of: &BTreeMap<usize, Mean>| of.iter().filter_map(|(n, m)| Some((*n, m.value()?))).collect();
        let [found, wanted] = self.motion;
        RolloutFigures {
            distance_mm: means(&self.distance),
            volume_change: means(&self.volume),
            height_energy: (wanted > 0.0).then(|| (found / wanted).sqrt()),
            rollouts: self.rollouts,
        }
    }

    /// Adds the rollouts of a clip: begun at every 20th frame that the clip lets be judged, from true heights, and as long
    /// as it lasts, up to 30 frames.
    ///
    /// # Errors
    /// A surface that cannot be drawn, or a stop.
    pub fn add(&mut self, candidate: &Candidate, clip: &AvatarClip, monitor: &dyn Monitor) -> Result<()> {
        let history = candidate.body.config.history;
        let first = clip.frames.start.max(history).next_multiple_of(RESTART);
        for start in (first..clip.frames.end).step_by(RESTART) {
            let end = clip.frames.end.min(start + ROLLOUTS[ROLLOUTS.len() - 1]);
            self.add_rollout(candidate, clip, start..end, monitor)?;
        }
        Ok(())
    }

    fn add_rollout(
        &mut self,
        candidate: &Candidate,
        clip: &AvatarClip,
        frames: std::ops::Range<usize>,
        monitor: &dyn Monitor,
    ) -> Result<()> {
        let Candidate { body, conditioning, network, .. } = *candidate;
        let history = clip.history(frames.start, body.config.history);
        let mut play = Playback::new(body, network, conditioning, history)?;
        let moving = body.moving();
        let probe = VolumeProbe::new(moving.len(), &VolumeProbeConfig::default());
        let mut before: Option<Vec<f32>> = None;
        let mut shares: Option<[Vec<f32>; 2]> = None;
        for (n, t) in (1..).zip(frames) {
            if monitor.should_stop() {
                return Err(AvatarError::Stopped);
            }
            let observers = &clip.observers[t];
            let field = play.step(&clip.track, t, observers);
            let heights = field.heights();
            if let Some(before) = &before {
                for &i in &moving {
                    self.motion[0] += f64::from(heights[i] - before[i]).powi(2);
                    self.motion[1] += f64::from(clip.heights[t][i] - clip.heights[t - 1][i]).powi(2);
                }
            }
            before = Some(heights);
            let Some(scan) = &clip.scans[t] else {
                shares = None;
                continue;
            };
            let judged = ROLLOUTS.contains(&n);
            if judged {
                let distance = scan_distance(&field, observers, scan.points(), candidate.grid)?;
                self.distance.entry(n).or_default().add(distance.map(|m| 1000.0 * m));
            }
            if judged || ROLLOUTS.contains(&(n + 1)) {
                let places: Vec<Vec3> = moving.iter().map(|i| observers.positions[*i]).collect();
                let now = [probe.shares(scan, &places), probe.shares(&field, &places)];
                if let (true, Some(before)) = (judged && n > 1, &shares) {
                    let error = VolumeProbe::change_error([&before[0], &now[0]], [&before[1], &now[1]]);
                    self.volume.entry(n).or_default().add(error);
                }
                shares = Some(now);
            } else {
                shares = None;
            }
        }
        self.rollouts += 1;
        Ok(())
    }
}

/// Mean distance of points from the surface of a field, metres; `None` where it has none.
fn scan_distance(
    field: &dyn SignedDistance,
    observers: &ObserverFrame,
    points: &[Vec3],
    grid: usize,
) -> Result<Option<f64>> {
    let cubes = MarchingCubes { resolution: grid, ..MarchingCubes::default() };
    let surface = cubes.surface_near(field, &observers.positions, REACH);
    let surface = surface.map_err(|e| AvatarError::Data(e.to_string()))?;
    Ok(mean_distance(points, &surface.mesh))
}
