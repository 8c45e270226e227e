//! A clip's poses together: every frame's objective and, between frames, the squared angular accelerations of the
//! joints. Frame by frame, a pose follows the coherent part of the flesh's motion, because some joints are hardly seen;
//! over a clip, what swings fast through weakly seen joints is cheaper as a delta.

use crate::banded::Banded;
use crate::motion::FittedMotion;
use crate::objective::Objective;
use crate::pose_state::{Kinematics, PoseState};
use crate::solve::Workspace;
use crate::{FitConfig, FitError, Result};
use glam::{Mat3A, Vec3};
use softtissue_clips::ScanClip;
use softtissue_monitor::Monitor;

/// How a long clip is divided.
#[derive(Clone, Copy)]
pub(crate) struct Pieces {
    /// Frames that are solved together at most.
    pub length: usize,
    /// The last of them, which are solved again with the next piece: they have not seen what follows.
    pub overlap: usize,
}

/// A frame's influence on others has died away after 40: the poses are those of one piece to 1e-4 rad (a test).
pub(crate) const PIECES: Pieces = Pieces { length: 200, overlap: 40 };
/// Steps at most.
const MAX_STEPS: usize = 4;
const FIRST_DAMPING: f64 = 1e-6;
const MOST_DAMPING: f64 = 1e3;
/// Largest step, radians and metres, at which the poses count as found.
const TOLERANCE: f64 = 5e-4;

/// One frame's objective, half its gradient and its Gauss-Newton matrix, turns about the axes of each joint's parent.
struct Local {
    value: f64,
    gradient: Vec<f64>,
    hessian: Vec<f64>,
}

/// What squared second differences cost: `[3 J + 3]`, in the order of a step's entries.
pub(crate) struct Stiffness(Vec<f64>);

impl Objective {
    /// Solves the frames of a fitted motion, which are all of the scan's, again, together. Returns the trips over the
    /// vertices that this took, all frames' together.
    pub(crate) fn smooth(
        &self,
        fitted: &mut FittedMotion,
        scan: &ScanClip,
        config: &FitConfig,
        monitor: &dyn Monitor,
    ) -> Result<usize> {
        self.smooth_in_pieces(fitted, scan, config, PIECES, monitor)
    }

    pub(crate) fn smooth_in_pieces(
        &self,
        fitted: &mut FittedMotion,
        scan: &ScanClip,
        config: &FitConfig,
        pieces: Pieces,
        monitor: &dyn Monitor,
    ) -> Result<usize> {
        let frames = fitted.states.len();
        assert_eq!(frames, scan.vertices.len(), "frames of a motion and its scan");
        if frames < 3 || !config.solves_together() {
            return Ok(0);
        }
        let stiffness = self.stiffness(config, f64::from(scan.fps));
        let (mut begin, mut evaluations) = (0, 0);
        loop {
            if monitor.should_stop() {
                return Err(FitError::Stopped);
            }
            let end = frames.min(begin + pieces.length);
            let scans: Vec<Vec<Vec3>> = (begin..end).map(|t| self.body.packed.sorted(scan.vertices.frame(t))).collect();
            evaluations += scans.len() * self.smooth_piece(fitted, begin, &scans, &stiffness);
            if end == frames {
                return Ok(evaluations);
            }
            begin = end - pieces.overlap;
        }
    }

    /// A second difference of frequency `f` is `(2 pi f / fps)^2` times the motion: at `hz` it costs as much as the
    /// distance that the motion makes of all that hangs on the joint.
    pub(crate) fn stiffness(&self, config: &FitConfig, fps: f64) -> Stiffness {
        let of = |hz: f64| if hz > 0.0 { (fps / (std::f64::consts::TAU * hz)).powi(4) } else { 0.0 };
        let (limb, trunk, root) = (of(config.limb_hz), of(config.trunk_hz), of(config.root_hz));
        let group = |(j, in_trunk): (usize, &bool)| match (j, in_trunk) {
            (0, _) => root,
            (_, true) => trunk,
            (_, false) => limb,
        };
        let groups = self.body.packed.trunk.iter().enumerate().map(group);
        let mut cost: Vec<f64> = self.inertia().into_iter().zip(groups).flat_map(|(h, g)| [h * g; 3]).collect();
        cost.extend([root; 3]);
        Stiffness(cost)
    }

    /// Levenberg-Marquardt on all frames of a piece; the two frames before it are held. Returns the trips over each
    /// frame's vertices.
    fn smooth_piece(
        &self,
        fitted: &mut FittedMotion,
        begin: usize,
        scans: &[Vec<Vec3>],
        stiffness: &Stiffness,
    ) -> usize {
        let (fixed, n) = (begin.min(2), stiffness.0.len());
        let mut works: Vec<Workspace> = scans.iter().map(|_| Workspace::new(self)).collect();
        let mut states: Vec<PoseState> = fitted.states[begin - fixed..begin + scans.len()].to_vec();
        let (mut locals, mut value) = self.locals(&states, fixed, scans, &mut works, stiffness);
        let (mut damping, mut evaluations) = (FIRST_DAMPING, 1);
        while evaluations <= MAX_STEPS && damping < MOST_DAMPING {
            let Some(step) = joint_step(&locals, &states, fixed, stiffness, damping) else {
                damping *= 100.0;
                continue;
            };
            let mut next = states.clone();
            next[fixed..].iter_mut().zip(step.chunks_exact(n)).for_each(|(s, d)| *s = s.turned(d));
            let (next_locals, next_value) = self.locals(&next, fixed, scans, &mut works, stiffness);
            evaluations += 1;
            if next_value.is_nan() || next_value >= value {
                damping *= 100.0;
                continue;
            }
            (states, locals, value) = (next, next_locals, next_value);
            if step.iter().all(|x| x.abs() < TOLERANCE) {
                break;
            }
        }
        for (i, (state, local)) in states.into_iter().skip(fixed).zip(&locals).enumerate() {
            fitted.states[begin + i] = state;
            fitted.values[begin + i] = local.value;
        }
        evaluations
    }

    /// Normal equations of each frame and the value of the whole.
    fn locals(
        &self,
        states: &[PoseState],
        fixed: usize,
        scans: &[Vec<Vec3>],
        works: &mut [Workspace],
        stiffness: &Stiffness,
    ) -> (Vec<Local>, f64) {
        let locals: Vec<Local> = states[fixed..]
            .iter()
            .zip(scans)
            .zip(works)
            .map(|((state, scan), work)| {
                let kinematics = self.kinematics(state);
                let normal = self.normal_with_prior(&kinematics, state, None, scan, work);
                Local::new(&normal.gradient, &normal.hessian, normal.value, &kinematics)
            })
            .collect();
        let value = locals.iter().map(|l| l.value).sum::<f64>() + stiffness.cost(states);
        (locals, value)
    }
}

impl Stiffness {
    /// What the accelerations of a motion cost.
    pub(crate) fn cost(&self, states: &[PoseState]) -> f64 {
        let squares = |a: Vec<f64>| a.iter().zip(&self.0).map(|(a, w)| w * a * a).sum::<f64>();
        (1..states.len().saturating_sub(1)).map(|t| squares(acceleration(states, t))).sum()
    }

    /// Half the gradient of the cost by the steps of all frames but the first `fixed`, `[frames][3 J + 3]`; turns of
    /// successive frames count as if they were about the same axes, which at a scan's frame rate they nearly are.
    pub(crate) fn half_gradient(&self, states: &[PoseState], fixed: usize) -> Vec<f64> {
        let n = self.0.len();
        let mut gradient = vec![0.0; (states.len() - fixed) * n];
        for t in 1..states.len().saturating_sub(1) {
            let a = acceleration(states, t);
            for (row, x) in parts(t, fixed) {
                let row = &mut gradient[row * n..(row + 1) * n];
                row.iter_mut().zip(&self.0).zip(&a).for_each(|((g, w), a)| *g += w * x * a);
            }
        }
        gradient
    }

    /// Adds half the cost's second derivative.
    fn add_to(&self, matrix: &mut Banded, frames: usize, fixed: usize) {
        let n = self.0.len();
        for t in 1..frames.saturating_sub(1) {
            for (row, x) in parts(t, fixed) {
                for (column, y) in parts(t, fixed).filter(|(column, _)| *column <= row) {
                    for (i, w) in self.0.iter().enumerate() {
                        *matrix.at(row * n + i, column * n + i) += w * x * y;
                    }
                }
            }
        }
    }
}

/// The free frames in the second difference round frame `t`, counted from the first of them, and their factors.
fn parts(t: usize, fixed: usize) -> impl Iterator<Item = (usize, f64)> {
    [(t - 1, 1.0), (t, -2.0), (t + 1, 1.0)].into_iter().filter_map(move |(f, x)| Some((f.checked_sub(fixed)?, x)))
}

impl Local {
    fn new(gradient: &[f64], hessian: &[f64], value: f64, kinematics: &Kinematics) -> Self {
        let n = gradient.len();
        let axes: Vec<[[f64; 3]; 3]> = kinematics.parent_rotations.iter().map(columns).collect();
        let mut half = hessian.to_vec();
        let mut local = Self { value, gradient: gradient.to_vec(), hessian: hessian.to_vec() };
        for (j, axes) in axes.iter().enumerate() {
            for (c, axis) in axes.iter().enumerate() {
                local.gradient[3 * j + c] = (0..3).map(|k| axis[k] * gradient[3 * j + k]).sum();
                for i in 0..n {
                    half[i * n + 3 * j + c] = (0..3).map(|k| axis[k] * hessian[i * n + 3 * j + k]).sum();
                }
            }
        }
        local.hessian.copy_from_slice(&half);
        for (j, axes) in axes.iter().enumerate() {
            for (c, axis) in axes.iter().enumerate() {
                for i in 0..n {
                    local.hessian[(3 * j + c) * n + i] = (0..3).map(|k| axis[k] * half[(3 * j + k) * n + i]).sum();
                }
            }
        }
        local
    }
}

fn columns(m: &Mat3A) -> [[f64; 3]; 3] {
    m.to_cols_array_2d().map(|c| c.map(f64::from))
}

impl PoseState {
    /// The pose after a step whose turns are about the axes of each joint's parent.
    pub(crate) fn turned(&self, step: &[f64]) -> Self {
        let vector = |i: usize| Vec3::new(step[i] as f32, step[i + 1] as f32, step[i + 2] as f32);
        let turn = |(j, q): (usize, &glam::Quat)| (glam::Quat::from_scaled_axis(vector(3 * j)) * *q).normalize();
        let rotations: Vec<glam::Quat> = self.rotations.iter().enumerate().map(turn).collect();
        Self { translation: self.translation + vector(3 * rotations.len()), rotations }
    }
}

/// Second differences round frame `t`, in the order of a step's entries, per frame squared.
fn acceleration(states: &[PoseState], t: usize) -> Vec<f64> {
    let turns = |a: usize, b: usize| states[b].turn_since(&states[a]);
    let (before, after) = (turns(t - 1, t), turns(t, t + 1));
    let mut all: Vec<f64> = before.iter().zip(&after).flat_map(|(b, a)| (*a - *b).to_array().map(f64::from)).collect();
    let moved = states[t + 1].translation - 2.0 * states[t].translation + states[t - 1].translation;
    all.extend(moved.to_array().map(f64::from));
    all
}

/// The step of all frames but the first `fixed`, `[frames][3 J + 3]`; `None` if the damped matrix is not positive.
fn joint_step(
    locals: &[Local],
    states: &[PoseState],
    fixed: usize,
    stiffness: &Stiffness,
    damping: f64,
) -> Option<Vec<f64>> {
    let n = stiffness.0.len();
    let mut matrix = Banded::zeros(locals.len() * n, 2 * n);
    let mut right = stiffness.half_gradient(states, fixed);
    for (t, local) in locals.iter().enumerate() {
        let mean = (0..n).map(|i| local.hessian[i * n + i]).sum::<f64>() / n as f64;
        for i in 0..n {
            right[t * n + i] = -(right[t * n + i] + local.gradient[i]);
            for j in 0..=i {
                *matrix.at(t * n + i, t * n + j) = local.hessian[i * n + j];
            }
            *matrix.at(t * n + i, t * n + i) += damping * local.hessian[i * n + i] + 1e-8 * mean;
        }
    }
    stiffness.add_to(&mut matrix, states.len(), fixed);
    let factor = matrix.cholesky()?;
    factor.solve(&mut right);
    right.iter().all(|x| x.is_finite()).then_some(right)
}
