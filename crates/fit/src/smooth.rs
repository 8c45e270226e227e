//! A clip's poses together: every frame's objective and, between frames, the squared angular accelerations of the
//! joints. Frame by frame, a pose follows the coherent part of the flesh's motion, because some joints are hardly seen;
//! over a clip, what swings fast through weakly seen joints is cheaper as a delta.

use crate::banded::Banded;
use crate::motion::FittedMotion;
use crate::objective::Objective;
use crate::pose_state::{Kinematics, PoseState};
use crate::solve::Workspace;
use glam::{Mat3A, Vec3};

/// Frames that are solved together at most; longer clips are solved piece by piece, ...
const PIECE: usize = 400;
/// ... of which the last frames are solved again with the next.
const OVERLAP: usize = 40;
/// Steps at most.
const MAX_STEPS: usize = 4;
/// Largest step, radians and metres, at which the poses count as found.
const TOLERANCE: f64 = 5e-4;

/// One frame's normal equations, turns about the axes of each joint's parent.
struct Local {
    value: f64,
    gradient: Vec<f64>,
    hessian: Vec<f64>,
}

/// What accelerations cost: `[3 J + 3]`, in the order of a step's entries.
struct Stiffness(Vec<f64>);

impl Objective {
    /// Solves the frames of a fitted motion again, together. `scan(t)` gives frame `t` sorted, `[V]`.
    pub(crate) fn smooth(&self, fitted: &mut FittedMotion, clip_smoothness: f64, scan: impl Fn(usize) -> Vec<Vec3>) {
        let stiffness = self.stiffness(clip_smoothness);
        let frames = fitted.states.len();
        let mut begin = 0;
        while frames >= 3 && clip_smoothness > 0.0 {
            let end = frames.min(begin + PIECE);
            let scans: Vec<Vec<Vec3>> = (begin..end).map(&scan).collect();
            self.smooth_piece(fitted, begin, &scans, &stiffness);
            if end == frames {
                break;
            }
            begin = end - OVERLAP;
        }
    }

    fn stiffness(&self, clip_smoothness: f64) -> Stiffness {
        let e = |n: &str| std::env::var(n).ok().and_then(|x| x.parse::<f64>().ok()).unwrap_or(1.0);
        let (trunk, root, mv, limb) = (e("F_TRUNK"), e("F_ROOT"), e("F_MOVE"), e("F_LIMB"));
        let f = |j: usize| match j { 0 => root, 3 | 6 | 9 | 12 | 13 | 14 => trunk, _ => limb };
        let mut cost: Vec<f64> = self.inertia().iter().enumerate().flat_map(|(j, h)| [f(j) * clip_smoothness * h; 3]).collect();
        cost.extend([mv * clip_smoothness; 3]);
        Stiffness(cost)
    }

    fn smooth_piece(&self, fitted: &mut FittedMotion, begin: usize, scans: &[Vec<Vec3>], stiffness: &Stiffness) {
        let fixed = begin.min(2);
        let mut works: Vec<Workspace> = scans.iter().map(|_| Workspace::new(self)).collect();
        let mut states: Vec<PoseState> = fitted.states[begin - fixed..begin + scans.len()].to_vec();
        let (mut locals, mut value) = self.locals(&states, fixed, scans, &mut works, stiffness);
        let mut damping = 1e-6;
        for _ in 0..MAX_STEPS {
            let Some(step) = joint_step(&locals, &states, fixed, stiffness, damping) else {
                damping *= 100.0;
                continue;
            };
            let n = stiffness.0.len();
            let mut next = states.clone();
            next[fixed..].iter_mut().zip(step.chunks_exact(n)).for_each(|(s, d)| *s = s.turned(d));
            let (next_locals, next_value) = self.locals(&next, fixed, scans, &mut works, stiffness);
            if next_value >= value {
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
            fitted.evaluations[begin + i] += MAX_STEPS;
        }
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
        let accelerations: f64 = (1..states.len().saturating_sub(1))
            .map(|t| {
                let a = acceleration(states, t);
                a.iter().zip(&stiffness.0).map(|(a, w)| w * a * a).sum::<f64>()
            })
            .sum();
        let value = locals.iter().map(|l| l.value).sum::<f64>() + accelerations;
        (locals, value)
    }
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
    fn turned(&self, step: &[f64]) -> Self {
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

/// The step of all frames but the fixed ones, `[frames][3 J + 3]`; turns of successive frames count as if they were
/// about the same axes, which at a scan's frame rate they nearly are.
fn joint_step(
    locals: &[Local],
    states: &[PoseState],
    fixed: usize,
    stiffness: &Stiffness,
    damping: f64,
) -> Option<Vec<f64>> {
    let n = stiffness.0.len();
    let mut matrix = Banded::zeros(locals.len() * n, 2 * n);
    let mut right = vec![0.0; locals.len() * n];
    for (t, local) in locals.iter().enumerate() {
        let mean = (0..n).map(|i| local.hessian[i * n + i]).sum::<f64>() / n as f64;
        for i in 0..n {
            right[t * n + i] = -local.gradient[i];
            for j in 0..=i {
                *matrix.at(t * n + i, t * n + j) = local.hessian[i * n + j];
            }
            *matrix.at(t * n + i, t * n + i) += damping * local.hessian[i * n + i] + 1e-8 * mean;
        }
    }
    for t in 1..states.len() - 1 {
        let a = acceleration(states, t);
        let parts = [(t - 1, 1.0), (t, -2.0), (t + 1, 1.0)];
        for (row, x) in parts.iter().filter(|(f, _)| *f >= fixed).map(|(f, x)| (f - fixed, x)) {
            for i in 0..n {
                right[row * n + i] -= stiffness.0[i] * x * a[i];
                for (column, y) in parts.iter().filter(|(f, _)| *f >= fixed && *f - fixed <= row) {
                    *matrix.at(row * n + i, (column - fixed) * n + i) += stiffness.0[i] * x * y;
                }
            }
        }
    }
    let factor = matrix.cholesky()?;
    factor.solve(&mut right);
    right.iter().all(|x| x.is_finite()).then_some(right)
}
