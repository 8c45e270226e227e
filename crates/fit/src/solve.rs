use crate::FitConfig;
use crate::accumulate::Sums;
use crate::cholesky::Cholesky;
use crate::cross::Cross;
use crate::normal::Normal;
use crate::objective::Objective;
use crate::pose_state::{Kinematics, PoseState};
use glam::{Quat, Vec3};

/// When a frame counts as solved.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stop {
    /// Largest step, radians and metres.
    pub tolerance: f64,
    /// Least share of the objective that a step must promise to take away.
    pub least_gain: f64,
    pub max_iterations: usize,
}

impl Stop {
    pub fn of(config: &FitConfig) -> Self {
        Self { tolerance: config.tolerance, least_gain: config.least_gain, max_iterations: config.max_iterations }
    }
}

/// What one thread keeps between frames of a clip.
pub(crate) struct Workspace {
    sums: Sums,
    cross: Option<Cross>,
}

impl Workspace {
    pub fn new(objective: &Objective) -> Self {
        Self { sums: Sums::new(&objective.body.packed, 0), cross: None }
    }
}

/// A solved frame.
#[derive(Clone, Debug)]
pub(crate) struct Solution {
    pub state: PoseState,
    /// Objective, m^2.
    pub value: f64,
    /// Trips over the vertices.
    pub evaluations: usize,
}

/// Turn of a joint, radians, after which the part between bones and correctives is made anew.
const OLD: f32 = 0.25;
/// Ratio of a step to the one before above which that part is made anew as well, ...
const SLOW: f64 = 0.2;
/// ... once, after so many evaluations.
const PATIENCE: usize = 5;
const FIRST_DAMPING: f64 = 1e-4;
const LEAST_DAMPING: f64 = 1e-4;
/// Largest turn or move of a step, radians and metres.
const LARGEST_STEP: f64 = 1.0;
const MOST_DAMPING: f64 = 1e6;

impl Objective {
    /// Levenberg-Marquardt from a start; `scan` sorted, `[V]`. Damping is relative to the matrix's diagonal
    /// (Marquardt); a step that does not lower the objective is taken back.
    pub(crate) fn solve(
        &self,
        start: PoseState,
        before: Option<&PoseState>,
        scan: &[Vec3],
        stop: Stop,
        work: &mut Workspace,
    ) -> Solution {
        let (mut state, mut damping) = (start, FIRST_DAMPING);
        let mut kinematics = self.kinematics(&state);
        let mut normal = self.normal_with_prior(&kinematics, &state, before, scan, work);
        let (mut evaluations, mut last_size) = (1, f64::INFINITY);
        while evaluations < stop.max_iterations && damping < MOST_DAMPING {
            // an old part between bones and correctives can make the matrix singular, so a wild step is no step
            let Some(step) = damped_step(&normal, damping).filter(|s| largest(s) < LARGEST_STEP) else {
                damping *= 10.0;
                continue;
            };
            let next = state.stepped(&step, &kinematics);
            let size = largest(&step);
            let promised: f64 = -normal.gradient.iter().zip(&step).map(|(g, d)| g * d).sum::<f64>();
            if size < stop.tolerance || promised < stop.least_gain * normal.value {
                state = next;
                break;
            }
            if size > SLOW * last_size && evaluations == PATIENCE {
                work.cross = None;
            }
            last_size = size;
            let next_kinematics = self.kinematics(&next);
            let next_normal = self.normal_with_prior(&next_kinematics, &next, before, scan, work);
            evaluations += 1;
            let gain = (normal.value - next_normal.value) / promised;
            if gain > 0.0 {
                (state, kinematics, normal) = (next, next_kinematics, next_normal);
                damping = if gain > 0.5 { (damping * 0.1).max(LEAST_DAMPING) } else { damping };
            } else {
                damping *= 10.0;
            }
        }
        Solution { state, value: normal.value, evaluations }
    }

    pub(crate) fn normal_with_prior(
        &self,
        kinematics: &Kinematics,
        state: &PoseState,
        before: Option<&PoseState>,
        scan: &[Vec3],
        work: &mut Workspace,
    ) -> Normal {
        let cross = match work.cross.take() {
            Some(cross) if !cross.is_older_than(state, OLD) => cross,
            _ => self.surface().cross(kinematics, state, scan),
        };
        let mut normal = self.normal(kinematics, scan, &cross, &mut work.sums);
        work.cross = Some(cross);
        self.add_priors(&mut normal, kinematics, state, before);
        normal
    }

    /// Adds the pull of the joints towards rest and towards the frame before.
    pub(crate) fn add_priors(
        &self,
        normal: &mut Normal,
        kinematics: &Kinematics,
        state: &PoseState,
        before: Option<&PoseState>,
    ) {
        let at_rest =
            PoseState { rotations: vec![Quat::IDENTITY; state.rotations.len()], translation: state.translation };
        if !self.pose_prior.is_empty() {
            pull(normal, kinematics, &state.turn_since(&at_rest), |j| self.pose_prior[j], 1);
        }
        if let (Some(before), true) = (before, self.smoothness > 0.0) {
            pull(normal, kinematics, &state.turn_since(before), |_| self.smoothness, 0);
        }
    }
}

/// Adds weighted squared turns of the joints from `first` on.
pub(crate) fn pull(
    normal: &mut Normal,
    kinematics: &Kinematics,
    turns: &[Vec3],
    weight_of: impl Fn(usize) -> f64,
    first: usize,
) {
    let n = normal.gradient.len();
    for (j, turn) in turns.iter().enumerate().skip(first) {
        let weight = weight_of(j);
        // log(exp(d) R) changes by J^-1 d with J the left Jacobian, and J^-T w = w: the gradient is the turn itself
        let world = kinematics.parent_rotations[j] * *turn;
        normal.value += weight * f64::from(turn.length_squared());
        for c in 0..3 {
            normal.gradient[3 * j + c] += weight * f64::from(world[c]);
            normal.hessian[(3 * j + c) * n + 3 * j + c] += weight;
        }
    }
}

fn largest(step: &[f64]) -> f64 {
    step.iter().fold(0.0, |m, x| m.max(x.abs()))
}

/// `-(H + damping diag H)^-1 g`; `None` if that is no descent.
pub(crate) fn damped_step(normal: &Normal, damping: f64) -> Option<Vec<f64>> {
    let n = normal.gradient.len();
    let mut matrix = normal.hessian.clone();
    damp(&mut matrix, n, damping);
    let factor = Cholesky::new(matrix, n)?;
    let mut step: Vec<f64> = normal.gradient.iter().map(|g| -g).collect();
    factor.solve(&mut step);
    step.iter().all(|x| x.is_finite()).then_some(step)
}

/// Adds Marquardt's damping, and a ridge a hundred-millionth of the mean so that a joint without vertices stays put.
pub(crate) fn damp(matrix: &mut [f64], n: usize, damping: f64) {
    let mean = (0..n).map(|i| matrix[i * n + i]).sum::<f64>() / n as f64;
    for i in 0..n {
        matrix[i * n + i] += damping * matrix[i * n + i] + 1e-8 * mean;
    }
}
