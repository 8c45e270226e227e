use super::*;
use crate::shapes::{Shape, draw};
use crate::{HeightConfig, Interpolation, MarchingCubes, MeshField, Observers, RawSurfaceConfig, heights};
use softtissue_clips::RawFrame;
use softtissue_random::Draws;

const FRAMES: usize = 75;

/// A ball that breathes.
fn radius(t: usize) -> f32 {
    0.1 + 0.005 * (0.4 * t as f32).sin()
}

struct Ball {
    shape: Shape,
    /// Over the observers of [`truth`].
    heights: Vec<f32>,
}
impl Ball {
    fn new(radius: f32) -> Self {
        Self { shape: Shape::Sphere { centre: Vec3::ZERO, radius }, heights: vec![radius - 0.1; 60] }
    }
}
impl SignedDistance for Ball {
    fn values(&self, points: &[Vec3], out: &mut [f32]) {
        self.shape.values(points, out);
    }
}
impl PredictedSurface for Ball {
    fn mesh(&self, points: &[Vec3]) -> Result<Cow<'_, Mesh>, ImplicitError> {
        let cubes = MarchingCubes { resolution: 48, ..Default::default() };
        Ok(Cow::Owned(cubes.mesh_near(&self.shape, points, 0.06)?))
    }
    fn heights(&self) -> &[f32] {
        &self.heights
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
        Ok(Box::new(Ball::new((self.radius)(self.start, t))))
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

/// Has `judge` look at the ball's clip, some of whose scans are missing.
fn on_the_clip<T>(missing: &[usize], judge: impl FnOnce(&RolloutClip) -> T) -> T {
    let (observers, mut scans, heights) = truth();
    missing.iter().for_each(|t| scans[*t] = None);
    let judged: Vec<usize> = (0..60).collect();
    let known: Vec<Vec<bool>> = scans.iter().map(|s| vec![s.is_some(); 60]).collect();
    judge(&RolloutClip {
        frames: 0..FRAMES,
        history: 3,
        observers: &observers,
        scans: &scans,
        heights: &heights,
        known: &known,
        judged: &judged,
    })
}

/// Figures of a predictor, and which frames it was asked for.
fn judged(predicted: impl Fn(usize, usize) -> f32, missing: &[usize]) -> (RolloutFigures, Vec<Range<usize>>) {
    on_the_clip(missing, |clip| {
        let mut fake = Fake { radius: predicted, start: 0, asked: Vec::new() };
        let mut tally = RolloutTally::default();
        tally.add(&mut fake, clip, &RolloutConfig::default()).unwrap();
        (tally.figures(), fake.asked)
    })
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

/// A surface that is nowhere has no distance, which would make the mean of those that are left better than it is.
#[test]
fn a_surface_that_vanished_is_counted() {
    // the ball is a cell too small to be found from the fourth frame of each rollout on
    let (figures, _) = judged(|start, t| if t < start + 3 { radius(t) } else { 1e-4 }, &[27]);
    assert_eq!(figures.distance_mm.keys().copied().collect::<Vec<_>>(), [1, 2]);
    // after 4, 8 and 16 frames of 20..50, but there is no scan at 27, and 30; after 4, 8 and 16 and 30 of 40..70; after 4
    // and 8 of 60..75
    assert_eq!(figures.lost, 3 + 4 + 2);
    assert_eq!(judged(|_, t| radius(t), &[]).0.lost, 0);
}

/// What no scan has seen is no motion to be missed.
#[test]
fn a_guessed_height_is_no_motion() {
    let mut still = Fake { radius: |_, _| 0.1, start: 0, asked: Vec::new() };
    on_the_clip(&[], |clip| {
        let unseen = vec![vec![false; 60]; FRAMES];
        let mut tally = RolloutTally::default();
        tally.add(&mut still, &RolloutClip { known: &unseen, ..clip.clone() }, &RolloutConfig::default()).unwrap();
        assert_eq!(tally.figures().height_energy, None);
    });
}

#[test]
fn a_free_rollout_is_started_once_and_measured_in_every_frame() {
    let free = |distances| {
        on_the_clip(&[50], |clip| {
            let drifting = |start: usize, t: usize| radius(t) + 1e-4 * (t - start + 1) as f32;
            let mut fake = Fake { radius: drifting, start: 0, asked: Vec::new() };
            let free = FreeRollout::of(&mut fake, clip, distances).unwrap();
            assert_eq!((fake.asked.len(), fake.asked.first()), (1, Some(&(3..FRAMES))));
            free
        })
    };
    let found = free(true);
    assert_eq!((found.start, found.heights.len(), found.distance_mm.len()), (3, FRAMES - 3, FRAMES - 3));
    for (n, (heights, mm)) in (1..).zip(found.heights.iter().zip(&found.distance_mm)) {
        let drift = 1e-4 * n as f32;
        let wanted = radius(n + 2) - 0.1 + drift;
        assert!(heights.iter().all(|h| (h - wanted).abs() < 1e-5), "{heights:?} and {wanted} after {n}");
        match mm {
            Some(mm) => assert!((mm - 1000.0 * f64::from(drift)).abs() < 0.15, "{mm} mm after {n} frames"),
            None => assert_eq!(n + 2, 50),
        }
    }
    let unmeasured = free(false);
    assert!(unmeasured.distance_mm.is_empty() && unmeasured.heights == found.heights);
}

fn ball_mesh() -> Mesh {
    Ball::new(0.1).mesh(&[Vec3::ZERO, Vec3::splat(0.1), Vec3::splat(-0.1)]).unwrap().into_owned()
}

/// Registered meshes are judged by the same code.
#[test]
fn a_mesh_is_a_prediction_too() {
    let mesh = ball_mesh();
    let field = MeshField::new(&mesh);
    let at = [Vec3::X * 0.095];
    let height = heights(&field, &at, &[Vec3::X], &HeightConfig::default());
    assert!((height[0] - 0.005).abs() < 2e-4, "{}", height[0]);

    let grown = |factor: f32| Mesh::new(mesh.positions.iter().map(|p| *p * factor).collect(), mesh.topology.clone());
    let figures = |of: &dyn Fn(usize, usize) -> f32| {
        on_the_clip(&[], |clip| {
            let frame = |start, t| {
                let mesh = grown(10.0 * of(start, t));
                let ObserverFrame { positions, normals } = &clip.observers[t];
                let heights = heights(&MeshField::new(&mesh), positions, normals, &HeightConfig::default());
                MeshFrame { mesh, heights }
            };
            let mut meshes = MeshPredictor::new(frame);
            let mut tally = RolloutTally::default();
            tally.add(&mut meshes, clip, &RolloutConfig::default()).unwrap();
            tally.figures()
        })
    };
    let exact = figures(&|_, t| radius(t));
    assert!(exact.distance_mm.values().all(|mm| *mm < 0.15), "{exact:?}");
    assert!((exact.height_energy.unwrap() - 1.0).abs() < 0.02, "{exact:?}");
    let late = figures(&|start, t| radius(t) + 0.001 * (t + 1 - start) as f32);
    assert!((late.distance_mm[&8] - 8.0).abs() < 0.15, "{late:?}");

    // heights that are kept stand still, whatever is read off the mesh
    on_the_clip(&[], |clip| {
        let frame = |_, t| MeshFrame { mesh: grown(10.0 * radius(t)), heights: vec![0.01; 60] };
        let mut kept = MeshPredictor::new(frame);
        let mut tally = RolloutTally::default();
        tally.add(&mut kept, clip, &RolloutConfig::default()).unwrap();
        assert_eq!(tally.figures().height_energy, Some(0.0));
        let free = FreeRollout::of(&mut kept, clip, false).unwrap();
        assert!(free.heights.iter().all(|h| *h == [0.01; 60]));
    });
}

#[test]
fn heights_are_drawn_over_the_body_where_they_are_met() {
    let mesh = ball_mesh();
    let observers = Observers::all(mesh.positions.len());
    let spread = observers.vertices_from_observers(&mesh.positions, &mesh.topology);
    let config = HeightConfig::default();
    let heights: Vec<f32> = mesh.positions.iter().map(|p| if p.y > 0.0 { 0.01 } else { config.lowest }).collect();
    let drawn = drawn_over(&mesh.positions, &mesh.topology, &spread, &heights, &config);
    for (from, to) in mesh.positions.iter().zip(&drawn) {
        let wanted = if from.y > 0.0 { 0.01 } else { 0.0 };
        assert!((to.length() - from.length() - wanted).abs() < 2e-4, "{from} {to}");
    }
    let identity = Interpolation::from_rows(1, vec![vec![(0, 1.0)]; mesh.positions.len()]);
    assert_eq!(drawn_over(&mesh.positions, &mesh.topology, &identity, &[0.0], &config), mesh.positions);
}
