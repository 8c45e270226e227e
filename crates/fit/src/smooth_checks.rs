//! Unit tests of the solve of all frames together.

use crate::figure::figure;
use crate::motion::fit_motion;
use crate::pose_state::PoseState;
use crate::smooth::{PIECES, Pieces};
use crate::{FitConfig, FittedMotion, Objective, ObjectiveKind, PackedBody, WeightedBody, region_weights};
use glam::{Quat, Vec3};
use softtissue_body::{BodyModel, ShapedBody};
use softtissue_clips::{ClipId, ScanClip};
use softtissue_geometry::Frames;
use softtissue_monitor::Silent;
use softtissue_random::Draws;
use std::f32::consts::TAU;
use std::sync::Arc;

const FPS: f32 = 60.0;
/// Root, spine, neck and collars.
const TRUNK: [usize; 7] = [0, 3, 6, 9, 12, 13, 14];

/// A person's motion with flesh and noise.
struct Clip {
    body: BodyModel,
    shaped: ShapedBody,
    /// True poses.
    states: Vec<PoseState>,
    /// True deltas, `[frames, V]`.
    flesh: Frames,
    scan: ScanClip,
}

impl Clip {
    /// `flesh` metres of a swing of 5 Hz that all of the trunk's surface shares, and `noise` metres a coordinate.
    fn new(frames: usize, flesh: f32, noise: f32) -> Self {
        let body = figure(5, 6);
        let shaped = body.shaped(&[0.5, -0.5, 0.3]);
        let states: Vec<PoseState> = (0..frames).map(|t| person(t as f32 / FPS)).collect();
        let (mut rotations, mut deltas) = (Frames::new(24), Frames::new(body.vertex_count()));
        for (t, state) in states.iter().enumerate() {
            rotations.push(&state.axis_angles());
            deltas.push(&swing(&body, t as f32 / FPS, flesh));
        }
        let translations: Vec<Vec3> = states.iter().map(|s| s.translation).collect();
        let mut vertices = body.posed_frames(&shaped, &rotations, &translations, Some(&deltas));
        let mut draws = Draws::new(8, "noise", 0, 0);
        let mut number = || noise * draws.normal() as f32;
        vertices.points_mut().iter_mut().for_each(|p| *p += Vec3::new(number(), number(), number()));
        let scan = ScanClip { id: ClipId::new("a", "swing", 0), fps: FPS, vertices };
        Self { body, shaped, states, flesh: deltas, scan }
    }

    fn objective(&self, config: &FitConfig) -> Objective {
        let packed = Arc::new(PackedBody::new(&self.body));
        let weighted = WeightedBody::new(packed, &region_weights(&self.body.regions));
        Objective::new(weighted, ObjectiveKind::Unposed, &self.shaped, None)
            .with_priors(config.pose_prior, config.smoothness)
    }

    /// The motion frame by frame.
    fn fitted(&self, objective: &Objective, config: &FitConfig) -> FittedMotion {
        fit_motion(objective, &self.scan, 1, config, &Silent).unwrap()
    }
}

/// Joints that accelerate as those of the generator's people: root 0.1, spine 0.05, limbs 0.6 degrees a frame squared.
fn person(t: f32) -> PoseState {
    let wave = |size: f32, hz: f32, phase: f32| size * (TAU * hz * t + phase).sin();
    let rotation = |j: usize| {
        let (size, hz) = match j {
            0 => (0.15, 1.0),
            _ if TRUNK.contains(&j) => (0.06, 1.0),
            _ => (0.35, 1.5),
        };
        let phase = j as f32 * 1.7;
        let turn =
            Vec3::new(wave(size, hz, phase), wave(size, 0.7 * hz, phase + 1.0), wave(size, 0.8 * hz, phase + 2.0));
        Quat::from_scaled_axis(turn)
    };
    let translation = Vec3::new(wave(0.1, 0.7, 0.0), wave(0.03, 1.5, 1.0), wave(0.1, 0.9, 2.0));
    PoseState { rotations: (0..24).map(rotation).collect(), translation }
}

/// A swing fore and aft, up and down, largest in the middle of the trunk.
fn swing(body: &BodyModel, t: f32, size: f32) -> Vec<Vec3> {
    let now = size * (TAU * 5.0 * t).sin();
    let at = |(p, skin): (&Vec3, &softtissue_body::SkinWeights)| {
        let height = ((p.y - 1.06) / 0.4).clamp(0.0, 1.0);
        let here = if matches!(skin.joints[0], 3 | 6 | 9) { (std::f32::consts::PI * height).sin() } else { 0.0 };
        Vec3::new(0.0, 0.3, 1.0) * (now * here)
    };
    body.template.iter().zip(&body.skin).map(at).collect()
}

/// Joints' second differences at frame `t`, radians a frame squared.
fn acceleration(states: &[PoseState], t: usize) -> Vec<Vec3> {
    let (before, after) = (states[t].turn_since(&states[t - 1]), states[t + 1].turn_since(&states[t]));
    after.iter().zip(&before).map(|(a, b)| *a - *b).collect()
}

/// Rms difference of the trunk's accelerations.
fn trunk_error(found: &[PoseState], truth: &[PoseState]) -> f32 {
    let square = |t: usize| {
        let (a, b) = (acceleration(found, t), acceleration(truth, t));
        TRUNK.iter().map(|j| a[*j].distance_squared(b[*j])).sum::<f32>()
    };
    ((1..truth.len() - 1).map(square).sum::<f32>() / (truth.len() - 2) as f32).sqrt()
}

/// How much of the true deltas a fit keeps: found times true over true squared.
fn kept(clip: &Clip, objective: &Objective, states: &[PoseState]) -> f32 {
    let (mut product, mut square) = (0.0, 0.0);
    for (t, state) in states.iter().enumerate() {
        let sorted = objective.body.packed.sorted(clip.scan.vertices.frame(t));
        let (found, _) = objective.deltas(state, &sorted);
        for (a, b) in found.iter().zip(clip.flesh.frame(t)) {
            product += a.dot(*b);
            square += b.length_squared();
        }
    }
    product / square
}

#[test]
fn flesh_that_swings_fast_is_taken_out_of_the_trunk_and_kept_in_the_deltas() {
    let clip = Clip::new(90, 0.012, 5e-4);
    let config = FitConfig::default();
    let objective = clip.objective(&config);
    let mut fitted = clip.fitted(&objective, &config);
    let (error, share) = (trunk_error(&fitted.states, &clip.states), kept(&clip, &objective, &fitted.states));
    objective.smooth(&mut fitted, &clip.scan, &config, &Silent).unwrap();
    let (smooth_error, smooth_share) =
        (trunk_error(&fitted.states, &clip.states), kept(&clip, &objective, &fitted.states));
    println!("accelerations {error} and {smooth_error}, kept {share} and {smooth_share}");
    assert!(smooth_error < 0.5 * error, "{smooth_error} rad a frame squared, {error} frame by frame");
    assert!(smooth_share > share, "{smooth_share} of the true deltas, {share} frame by frame");
}

#[test]
fn a_clip_in_pieces_has_no_seam() {
    let config = FitConfig::default();
    let clip = Clip::new(PIECES.length + 60, 0.01, 5e-4);
    let objective = clip.objective(&config);
    let mut in_pieces = clip.fitted(&objective, &config);
    let mut whole = in_pieces.clone();
    let trips = objective.smooth(&mut in_pieces, &clip.scan, &config, &Silent).unwrap();
    let one = Pieces { length: usize::MAX, overlap: 0 };
    objective.smooth_in_pieces(&mut whole, &clip.scan, &config, one, &Silent).unwrap();
    assert!(trips > 2 * clip.states.len());
    let apart = |t: usize| {
        let turns = in_pieces.states[t].turn_since(&whole.states[t]);
        turns.iter().map(|w| w.length()).fold(0.0, f32::max)
    };
    let worst = (0..clip.states.len()).map(apart).fold(0.0, f32::max);
    assert!(worst < 1e-4, "{worst} rad from the clip in one piece");
    // the trunk's accelerations are no more wrong where the second piece begins than elsewhere
    let error = |frames: std::ops::Range<usize>| trunk_error(&in_pieces.states[frames.clone()], &clip.states[frames]);
    let begin = PIECES.length - PIECES.overlap;
    let (seam, elsewhere) = (error(begin - 5..begin + 5), error(20..begin - 20));
    println!("worst {worst}, seam {seam}, elsewhere {elsewhere}");
    assert!(seam < 1.3 * elsewhere, "{seam} rad a frame squared at the seam, {elsewhere} elsewhere");
}

#[test]
fn the_gradient_of_the_accelerations_is_that_of_finite_differences() {
    let clip = Clip::new(8, 0.0, 0.0);
    let objective = clip.objective(&FitConfig::default());
    let stiffness = objective.stiffness(&FitConfig::default(), f64::from(FPS));
    let fixed = 2;
    let gradient = stiffness.half_gradient(&clip.states, fixed);
    let n = gradient.len() / (clip.states.len() - fixed);
    let cost = |entry: usize, h: f64| {
        let mut states = clip.states.clone();
        let mut step = vec![0.0; n];
        step[entry % n] = h;
        states[fixed + entry / n] = states[fixed + entry / n].turned(&step);
        stiffness.cost(&states)
    };
    let h = 2e-3;
    let numeric: Vec<f64> = (0..gradient.len()).map(|i| (cost(i, h) - cost(i, -h)) / (4.0 * h)).collect();
    // the turn of a frame, at most 0.06 radians, is the linearised gradient's relative error
    let size = |g: &[f64]| g.iter().map(|x| x * x).sum::<f64>().sqrt();
    let difference: Vec<f64> = gradient.iter().zip(&numeric).map(|(a, b)| a - b).collect();
    println!("{}", size(&difference) / size(&numeric));
    assert!(size(&numeric) > 0.0 && size(&difference) < 0.02 * size(&numeric), "{gradient:?} for {numeric:?}");
}

#[test]
fn the_solve_lowers_the_objective_of_the_clip() {
    let config = FitConfig::default();
    let clip = Clip::new(30, 0.01, 5e-4);
    let objective = clip.objective(&config);
    let stiffness = objective.stiffness(&config, f64::from(FPS));
    let mut fitted = clip.fitted(&objective, &config);
    // the smoothness of single frames is no part of it
    let value = |states: &[PoseState]| {
        let surface = |(t, s): (usize, &PoseState)| {
            let scan = objective.body.packed.sorted(clip.scan.vertices.frame(t));
            objective.surface().value(&objective.kinematics(s), &scan)
        };
        states.iter().enumerate().map(surface).sum::<f64>() + stiffness.cost(states)
    };
    let before = value(&fitted.states);
    objective.smooth(&mut fitted, &clip.scan, &config, &Silent).unwrap();
    let after = value(&fitted.states);
    println!("{before} {after}");
    assert!(after < 0.9 * before, "{after} m^2 after {before}");
}

#[test]
fn free_accelerations_leave_the_motion_as_it_was() {
    let clip = Clip::new(6, 0.01, 5e-4);
    let free = FitConfig { limb_hz: 0.0, trunk_hz: 0.0, root_hz: 0.0, ..Default::default() };
    let objective = clip.objective(&free);
    let fitted = clip.fitted(&objective, &free);
    let mut after = fitted.clone();
    assert_eq!(objective.smooth(&mut after, &clip.scan, &free, &Silent).unwrap(), 0);
    assert_eq!((&after.states, &after.values), (&fitted.states, &fitted.values));
    let trunk_alone = FitConfig { trunk_hz: 17.0, ..free };
    assert!(objective.smooth(&mut after, &clip.scan, &trunk_alone, &Silent).unwrap() > 0);
    assert_ne!(after.states, fitted.states);
}
