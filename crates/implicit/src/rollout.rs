//! AutoAvatar's protocol (Bai et al. 2022, sec. 4.1): whatever predicts surfaces is started again every 20 frames from the
//! truth before, rolls on by itself, and is judged after 1, 2, 4, 8, 16 and 30 frames. Who predicts is known by a trait
//! alone, so that networks and registered meshes stand in one table.

use crate::{
    HeightConfig, ImplicitError, MeshField, ObserverFrame, RawSurface, SignedDistance, VolumeProbe, VolumeProbeConfig,
    heights, mean_distance,
};
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
    /// How heights are read off predictions.
    pub heights: HeightConfig,
    /// Where volume is looked at.
    pub volume: VolumeProbeConfig,
}

impl Default for RolloutConfig {
    fn default() -> Self {
        Self {
            lengths: vec![1, 2, 4, 8, 16, 30],
            restart: 20,
            heights: HeightConfig::default(),
            volume: VolumeProbeConfig::default(),
        }
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
}

impl PredictedSurface for MeshField<'_> {
    fn mesh(&self, _: &[Vec3]) -> Result<Cow<'_, Mesh>, ImplicitError> {
        Ok(Cow::Borrowed(self.source()))
    }
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
        }
    }

    /// Adds the rollouts of a clip. A surface that is nowhere has no distance, and a frame without a scan is passed over.
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
                self.add_motion(surface.as_ref(), clip, t, config, &mut before);
                self.add_frame(surface.as_ref(), clip, (n, t), config, &probe, &mut before)?;
            }
            self.rollouts += 1;
        }
        Ok(())
    }

    fn add_motion(
        &mut self,
        surface: &dyn PredictedSurface,
        clip: &RolloutClip,
        t: usize,
        config: &RolloutConfig,
        before: &mut Before,
    ) {
        let at = &clip.observers[t];
        let pick = |field: &[Vec3]| clip.judged.iter().map(|i| field[*i]).collect::<Vec<Vec3>>();
        let now = heights(surface, &pick(&at.positions), &pick(&at.normals), &config.heights);
        if let Some(last) = &before.heights {
            for ((i, now), last) in clip.judged.iter().zip(&now).zip(last) {
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
        if judged && let Some(distance) = mean_distance(scan.points(), surface.mesh(at)?.as_ref()) {
            self.distance.entry(n).or_default().add(1000.0 * distance);
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
mod tests {
    use super::*;
    use crate::shapes::{Shape, draw};
    use crate::{MarchingCubes, RawSurfaceConfig};
    use softtissue_clips::RawFrame;
    use softtissue_random::Draws;

    const FRAMES: usize = 75;

    /// A ball that breathes.
    fn radius(t: usize) -> f32 {
        0.1 + 0.005 * (0.4 * t as f32).sin()
    }

    struct Ball(Shape);
    impl SignedDistance for Ball {
        fn values(&self, points: &[Vec3], out: &mut [f32]) {
            self.0.values(points, out);
        }
    }
    impl PredictedSurface for Ball {
        fn mesh(&self, points: &[Vec3]) -> Result<Cow<'_, Mesh>, ImplicitError> {
            let cubes = MarchingCubes { resolution: 48, ..Default::default() };
            Ok(Cow::Owned(cubes.surface_near(&self.0, points, 0.06)?.mesh))
        }
    }

    /// Predicts a ball of a radius that depends on the rollout's start and the frame.
    struct Fake<F> {
        radius: F,
        start: usize,
        asked: Vec<Range<usize>>,
    }
    impl<F: Fn(usize, usize) -> f32> SurfacePredictor for Fake<F> {
        type Error = ImplicitError;
        fn restart(&mut self, start: usize) -> Result<(), ImplicitError> {
            self.start = start;
            self.asked.push(start..start);
            Ok(())
        }
        fn predict(&mut self, t: usize) -> Result<Box<dyn PredictedSurface + '_>, ImplicitError> {
            let asked = self.asked.last_mut().expect("a start before a prediction");
            assert_eq!(asked.end, t, "one frame after the other");
            asked.end += 1;
            Ok(Box::new(Ball(Shape::Sphere { centre: Vec3::ZERO, radius: (self.radius)(self.start, t) })))
        }
    }

    /// Scans of the ball and observers at its mean radius.
    fn truth() -> (Vec<ObserverFrame>, Vec<Option<RawSurface>>, Vec<Vec<f32>>) {
        let mut draws = Draws::new(10, "ball", 0, 0);
        let mut directions = |n: usize| -> Vec<Vec3> {
            std::iter::repeat_with(|| draw(&mut draws, 1.0))
                .filter(|p| p.length() < 1.0)
                .map(|p| p.normalize())
                .take(n)
                .collect()
        };
        let (normals, at) = (directions(1500), directions(60));
        let scan = |t: usize| {
            let points = normals.iter().map(|n| *n * radius(t)).collect();
            RawSurface::new(&RawFrame { points, normals: normals.clone() }, &RawSurfaceConfig::default()).unwrap()
        };
        let positions = at.iter().map(|n| *n * 0.1).collect();
        let observers = ObserverFrame { positions, normals: at };
        let heights = (0..FRAMES).map(|t| vec![radius(t) - 0.1; 60]).collect();
        (vec![observers; FRAMES], (0..FRAMES).map(|t| Some(scan(t))).collect(), heights)
    }

    /// Figures of a predictor, and which frames it was asked for.
    fn judged(predicted: impl Fn(usize, usize) -> f32, missing: &[usize]) -> (RolloutFigures, Vec<Range<usize>>) {
        let (observers, mut scans, heights) = truth();
        missing.iter().for_each(|t| scans[*t] = None);
        let judged: Vec<usize> = (0..60).collect();
        let clip = RolloutClip {
            frames: 0..FRAMES,
            history: 3,
            observers: &observers,
            scans: &scans,
            heights: &heights,
            judged: &judged,
        };
        let mut fake = Fake { radius: predicted, start: 0, asked: Vec::new() };
        let mut tally = RolloutTally::default();
        tally.add(&mut fake, &clip, &RolloutConfig::default()).unwrap();
        (tally.figures(), fake.asked)
    }

    #[test]
    fn rollouts_start_every_twenty_frames_where_there_is_a_history() {
        let config = RolloutConfig::default();
        assert_eq!(config.windows(0..75, 3), [20..50, 40..70, 60..75]);
        assert_eq!(config.windows(50..95, 3), [60..90, 80..95]);
        assert_eq!(config.windows(40..61, 3), [40..61, 60..61]);
        assert_eq!(config.windows(0..80, 25), [40..70, 60..80]);
        assert!(config.windows(0..20, 3).is_empty() && config.windows(7..7, 0).is_empty());
    }

    #[test]
    fn who_knows_the_truth_is_not_wrong_and_moves_as_it_does() {
        let (figures, asked) = judged(|_, t| radius(t), &[]);
        assert_eq!(asked, [20..50, 40..70, 60..75]);
        assert_eq!(figures.rollouts, 3);
        assert_eq!(figures.distance_mm.keys().copied().collect::<Vec<_>>(), [1, 2, 4, 8, 16, 30]);
        assert_eq!(figures.volume_change.keys().copied().collect::<Vec<_>>(), [2, 4, 8, 16, 30]);
        // what remains is a tenth of a millimetre of the mesh's chords and the scan's arcs; the points that lie as near to
        // the surface, 4 of 100 vertices have one at either frame, change a share by a tenth
        assert!(figures.distance_mm.values().all(|d| *d < 0.1), "{figures:?}");
        assert!(figures.volume_change.values().all(|e| *e < 5e-4), "{figures:?}");
        assert!((figures.height_energy.unwrap() - 1.0).abs() < 0.02, "{figures:?}");
    }

    /// An error of a millimetre a frame is as many millimetres after as many frames.
    #[test]
    fn who_drifts_is_as_wrong_as_the_rollout_is_long() {
        let (figures, _) = judged(|start, t| radius(t) + 0.001 * (t - start + 1) as f32, &[]);
        for (n, mm) in &figures.distance_mm {
            assert!((mm - *n as f64).abs() < 0.1, "{mm} mm after {n} frames");
        }
        assert!(figures.volume_change.values().all(|e| *e > 5e-4), "{figures:?}");
    }

    #[test]
    fn who_stands_still_has_no_energy_and_pays_in_volume() {
        let (still, _) = judged(|_, _| 0.1, &[]);
        let (exact, _) = judged(|_, t| radius(t), &[]);
        assert_eq!(still.height_energy, Some(0.0));
        for (n, error) in &exact.volume_change {
            assert!(*error < 0.5 * still.volume_change[n], "after {n} frames");
        }
    }

    #[test]
    fn a_missing_scan_is_passed_over() {
        // the second frame of each rollout: neither it nor the change from it to the third is measured
        let (figures, _) = judged(|_, t| radius(t), &[21, 41, 61]);
        assert!(figures.distance_mm.contains_key(&1) && !figures.distance_mm.contains_key(&2));
        assert!(figures.volume_change.contains_key(&4) && !figures.volume_change.contains_key(&2));
    }

    /// Registered meshes are judged by the same code.
    #[test]
    fn a_mesh_is_a_prediction_too() {
        let ball = Ball(Shape::Sphere { centre: Vec3::ZERO, radius: 0.1 });
        let mesh = ball.mesh(&[Vec3::ZERO, Vec3::splat(0.1), Vec3::splat(-0.1)]).unwrap().into_owned();
        let field = MeshField::new(&mesh);
        assert_eq!(field.mesh(&[]).unwrap().positions, mesh.positions);
        let at = [Vec3::X * 0.095];
        let height = heights(&field, &at, &[Vec3::X], &HeightConfig::default());
        assert!((height[0] - 0.005).abs() < 2e-4, "{}", height[0]);
    }
}
