//! Unit tests of the objective's derivatives, which no public call shows.

use crate::accumulate::{Sums, Surface};
use crate::figure::{figure, smooth_pose};
use crate::normal::{Correctives, Normal, reduce, shape_translations};
use crate::pose_state::PoseState;
use crate::solve::{Stop, Workspace};
use crate::{Objective, ObjectiveKind, PackedBody, WeightedBody};
use glam::{Vec3, Vec3A};
use softtissue_body::{BodyModel, Pose};
use std::sync::Arc;

fn weights(body: &BodyModel) -> Vec<f32> {
    (0..body.vertex_count()).map(|v| 0.3 + (v % 7) as f32 * 0.2).collect()
}

fn state(seed: u64, size: f32) -> PoseState {
    let (rotations, translation) = smooth_pose(seed, 0.7, size);
    PoseState::from_pose(Pose { rotations: &rotations, translation })
}

struct Case {
    body: BodyModel,
    weighted: WeightedBody,
    scan: Vec<Vec3>,
    at: PoseState,
    kind: ObjectiveKind,
}

impl Case {
    fn new(kind: ObjectiveKind) -> Self {
        let body = figure(5, 6);
        let weighted = WeightedBody::new(Arc::new(PackedBody::new(&body)), &weights(&body));
        let (rotations, translation) = smooth_pose(3, 0.7, 0.35);
        let pose = Pose { rotations: &rotations, translation };
        let posed = body.posed(&body.shaped(&[0.5, 1.0, -0.5]), pose, None);
        let scan = weighted.packed.sorted(&posed);
        let (rotations, translation) = smooth_pose(3, 0.72, 0.35);
        let at = PoseState::from_pose(Pose { rotations: &rotations, translation: translation + 0.01 });
        Self { body, weighted, scan, at, kind }
    }

    fn normal(&self, beta: &[f32], at: &PoseState) -> Normal {
        let objective = Objective::new(self.weighted.clone(), self.kind, &self.body.shaped(beta), None);
        let v = self.body.vertex_count();
        let packed = &self.weighted.packed;
        let directions: Vec<Vec3> = self.body.shape_directions.chunks_exact(v).flat_map(|d| packed.sorted(d)).collect();
        let regress = |d: &[Vec3]| self.body.joint_regressor.joints(d).into_iter().map(Vec3A::from).collect::<Vec<_>>();
        let moved: Vec<Vec<Vec3A>> = self.body.shape_directions.chunks_exact(v).map(regress).collect();
        let kinematics = objective.kinematics(at);
        let surface = Surface { shape_directions: &directions, ..objective.surface() };
        let mut sums = Sums::new(packed, beta.len());
        surface.accumulate(&kinematics, &self.scan, &mut sums);
        let translations = shape_translations(&packed.parents, &kinematics, &moved);
        assert!((surface.value(&kinematics, &self.scan) / sums.value - 1.0).abs() < 1e-6);
        let cross = surface.cross(&kinematics, at, &self.scan);
        let with_shape: Vec<Vec<f32>> =
            directions.chunks_exact(v).map(|d| packed.products(&self.weighted.weights, d)).collect();
        let correctives = Correctives { gram: &self.weighted.gram, cross: &cross, with_shape: &with_shape };
        reduce(&packed.parents, &kinematics, &sums, correctives, &translations)
    }

    fn moved(&self, beta: &[f32], parameter: usize, h: f64) -> f64 {
        let mut beta = beta.to_vec();
        let mut step = vec![0.0; 75];
        if parameter < 75 {
            step[parameter] = h;
        } else {
            beta[parameter - 75] += h as f32;
        }
        let objective = Objective::new(self.weighted.clone(), self.kind, &self.body.shaped(&beta), None);
        let at = self.at.stepped(&step, &objective.kinematics(&self.at));
        objective.surface().value(&objective.kinematics(&at), &self.scan)
    }
}

#[test]
fn gradients_are_those_of_finite_differences() {
    for kind in [ObjectiveKind::Posed, ObjectiveKind::Unposed] {
        let case = Case::new(kind);
        let beta = [0.1f32, -0.3, 0.4];
        let normal = case.normal(&beta, &case.at);
        let scale = normal.gradient.iter().fold(0.0f64, |m, g| m.max(g.abs()));
        for (i, g) in normal.gradient.iter().enumerate() {
            let h = 2e-3;
            // central differences of f32 values, extrapolated once to the fourth order
            let difference = |h: f64| (case.moved(&beta, i, h) - case.moved(&beta, i, -h)) / (2.0 * h);
            let numeric = (4.0 * difference(h) - difference(2.0 * h)) / 3.0;
            assert!((2.0 * g - numeric).abs() < 2e-3 * scale, "{kind:?}, parameter {i}: {} for {numeric}", 2.0 * g);
        }
    }
}

/// Where the residual vanishes the matrix is half the objective's second derivative: it predicts curvature along each
/// parameter and how the gradient changes along one. For the posed objective the correctives' own part takes blended
/// matrices for rotations, which they are not quite where bones meet at an angle.
#[test]
fn the_matrix_is_that_of_gauss_newton() {
    for kind in [ObjectiveKind::Posed, ObjectiveKind::Unposed] {
        let mut case = Case::new(kind);
        let beta = [0.1f32, -0.3, 0.4];
        let rotations = case.at.axis_angles();
        let pose = Pose { rotations: &rotations, translation: case.at.translation };
        case.scan = case.weighted.packed.sorted(&case.body.posed(&case.body.shaped(&beta), pose, None));
        let normal = case.normal(&beta, &case.at);
        let n = normal.gradient.len();
        let tolerance = if kind == ObjectiveKind::Unposed { 2e-3 } else { 2e-2 };
        assert!(normal.value < 1e-12);
        for i in 0..n {
            // the value's fourth order in the step is taken out by extrapolation
            let second = |h: f64| (case.moved(&beta, i, h) + case.moved(&beta, i, -h)) / (2.0 * h * h);
            let curvature = (4.0 * second(1e-2) - second(2e-2)) / 3.0;
            let own = normal.hessian[i * n + i];
            assert!(
                (own - curvature).abs() < tolerance * own.max(1e-4),
                "{kind:?}, parameter {i}: {own} for {curvature}"
            );
        }
        // off the diagonal, by the gradient after a step along one parameter
        let mut step = vec![0.0; 75];
        step[3 * 17] = 2e-3;
        let objective = Objective::new(case.weighted.clone(), kind, &case.body.shaped(&beta), None);
        let stepped = case.at.stepped(&step, &objective.kinematics(&case.at));
        let after = case.normal(&beta, &stepped);
        let scale = (0..n).map(|i| (normal.hessian[i * n + 51] * 2e-3).abs()).fold(0.0, f64::max);
        for i in 0..n {
            let predicted = normal.hessian[i * n + 51] * 2e-3;
            assert!(
                (after.gradient[i] - predicted).abs() < 2e-2 * scale,
                "{kind:?} {i}: {} for {predicted}",
                after.gradient[i]
            );
        }
    }
}

#[test]
fn a_pose_is_recovered_from_nothing() {
    let body = figure(8, 9);
    let weighted = WeightedBody::new(Arc::new(PackedBody::new(&body)), &weights(&body));
    let shaped = body.shaped(&[0.5, -0.5, 1.0]);
    for kind in [ObjectiveKind::Posed, ObjectiveKind::Unposed] {
        let objective = Objective::new(weighted.clone(), kind, &shaped, None);
        let mut work = Workspace::new(&objective);
        for seed in 0..8 {
            let truth = state(seed, 0.4);
            let (rotations, translation) = (truth.axis_angles(), truth.translation);
            let scan = weighted.packed.sorted(&body.posed(&shaped, Pose { rotations: &rotations, translation }, None));
            let start = objective.start(&scan);
            let stop = Stop { tolerance: 5e-4, least_gain: 1e-5, max_iterations: 30 };
            let solution = objective.solve(start, None, &scan, stop, &mut work);
            let worst = solution.state.turn_since(&truth).iter().map(|w| w.length()).fold(0.0, f32::max);
            assert!(worst < 1e-3, "{kind:?}, seed {seed}: {worst} rad after {} evaluations", solution.evaluations);
            assert!(solution.state.translation.distance(translation) < 5e-4);
        }
    }
}
