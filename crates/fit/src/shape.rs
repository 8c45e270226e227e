//! Shape of a subject: shape coefficients and the poses of a few frames, found together.

use crate::accumulate::{Sums, Surface};
use crate::cholesky::Cholesky;
use crate::normal::{Correctives, Normal, reduce, shape_translations};
use crate::objective::{Objective, WeightedBody};
use crate::pose_state::PoseState;
use crate::solve::damp;
use crate::{FitConfig, ObjectiveKind};
use glam::{Vec3, Vec3A};
use rayon::prelude::*;
use softtissue_body::BodyModel;

/// Steps of the joint problem at most; it converges in about six.
const MAX_STEPS: usize = 25;
/// Largest change of a shape coefficient at which the shape counts as found.
const SHAPE_TOLERANCE: f64 = 1e-3;

/// Shape coefficients and frames' poses.
struct Unknowns {
    beta: Vec<f64>,
    poses: Vec<PoseState>,
}

/// The normal equations of all frames at one point.
pub(crate) struct Joint {
    pub value: f64,
    pub frames: Vec<Normal>,
}

/// Fits `beta` to frames of one subject `[frames][V]` in the mesh's order, poses free, by Levenberg-Marquardt; each
/// frame's pose is eliminated by its Schur complement. Frames may be of any motion.
pub(crate) fn fit_shape(
    body: &BodyModel,
    weighted: &WeightedBody,
    kind: ObjectiveKind,
    frames: &[Vec<Vec3>],
    config: &FitConfig,
) -> Vec<f32> {
    let packed = &weighted.packed;
    let count = body.vertex_count();
    let directions: Vec<Vec3> = body.shape_directions.chunks_exact(count).flat_map(|d| packed.sorted(d)).collect();
    let moved: Vec<Vec<Vec3A>> = body
        .shape_directions
        .chunks_exact(count)
        .map(|d| body.joint_regressor.joints(d).into_iter().map(Vec3A::from).collect())
        .collect();
    let with_shape: Vec<Vec<f32>> =
        directions.chunks_exact(count).map(|d| packed.products(&weighted.weights, d)).collect();
    let scans: Vec<Vec<Vec3>> = frames.iter().map(|f| packed.sorted(f)).collect();
    let objective = |beta: &[f64]| {
        let beta: Vec<f32> = beta.iter().map(|b| *b as f32).collect();
        Objective::new(weighted.clone(), kind, &body.shaped(&beta), None).with_priors(config.pose_prior, 0.0)
    };
    let evaluate = |at: &Unknowns| -> Joint {
        let objective = objective(&at.beta);
        let normal = |(state, scan): (&PoseState, &Vec<Vec3>)| {
            let kinematics = objective.kinematics(state);
            let surface = Surface { shape_directions: &directions, ..objective.surface() };
            let mut sums = Sums::new(packed, at.beta.len());
            surface.accumulate(&kinematics, scan, &mut sums);
            let translations = shape_translations(&packed.parents, &kinematics, &moved);
            let cross = surface.cross(&kinematics, state, scan);
            let correctives = Correctives { gram: &weighted.gram, cross: &cross, with_shape: &with_shape };
            let mut normal = reduce(&packed.parents, &kinematics, &sums, correctives, &translations);
            objective.add_priors(&mut normal, &kinematics, state, None);
            normal
        };
        let frames: Vec<Normal> = at.poses.par_iter().zip(&scans).map(normal).collect();
        let prior = config.shape_prior * at.beta.iter().map(|b| b * b).sum::<f64>();
        Joint { value: frames.iter().map(|f| f.value).sum::<f64>() / frames.len() as f64 + prior, frames }
    };
    let mean = objective(&vec![0.0; moved.len()]);
    let poses = scans.par_iter().map(|scan| mean.start(scan)).collect();
    let mut at = Unknowns { beta: vec![0.0; moved.len()], poses };
    let mut joint = evaluate(&at);
    let mut damping = 1e-4;
    for _ in 0..MAX_STEPS {
        let Some((shape_step, pose_steps)) = joint_step(&joint, &at.beta, config.shape_prior, damping) else {
            damping *= 10.0;
            continue;
        };
        let beta: Vec<f64> = at.beta.iter().zip(&shape_step).map(|(b, d)| b + d).collect();
        let here = objective(&at.beta);
        let stepped = |(state, step): (&PoseState, &Vec<f64>)| state.stepped(step, &here.kinematics(state));
        let next = Unknowns { beta, poses: at.poses.iter().zip(&pose_steps).map(stepped).collect() };
        let next_joint = evaluate(&next);
        let small = shape_step.iter().all(|d| d.abs() < SHAPE_TOLERANCE);
        let small = small && pose_steps.iter().flatten().all(|d| d.abs() < 10.0 * config.tolerance);
        if next_joint.value < joint.value {
            (at, joint) = (next, next_joint);
            damping = (damping * 0.1f64).max(1e-9);
        } else if damping > 1e6 {
            break;
        } else {
            damping *= 10.0;
        }
        if small {
            break;
        }
    }
    at.beta.iter().map(|b| *b as f32).collect()
}

/// The damped step of shape and poses.
pub(crate) fn joint_step(joint: &Joint, beta: &[f64], prior: f64, damping: f64) -> Option<(Vec<f64>, Vec<Vec<f64>>)> {
    let shapes = beta.len();
    let scale = 1.0 / joint.frames.len() as f64;
    let mut matrix = vec![0.0; shapes * shapes];
    let mut right: Vec<f64> = beta.iter().map(|b| -prior * b).collect();
    for s in 0..shapes {
        matrix[s * shapes + s] = prior;
    }
    let mut eliminated = Vec::with_capacity(joint.frames.len());
    for frame in &joint.frames {
        let n = frame.gradient.len();
        let m = n - shapes;
        let entry = |a: usize, b: usize| frame.hessian[a * n + b];
        let mut pose_matrix: Vec<f64> = (0..m).flat_map(|a| frame.hessian[a * n..a * n + m].to_vec()).collect();
        damp(&mut pose_matrix, m, damping);
        let factor = Cholesky::new(pose_matrix, m)?;
        let solved = |mut column: Vec<f64>| {
            factor.solve(&mut column);
            column
        };
        let columns: Vec<Vec<f64>> = (0..shapes).map(|s| solved((0..m).map(|a| entry(m + s, a)).collect())).collect();
        let own = solved(frame.gradient[..m].iter().map(|g| -g).collect());
        for s in 0..shapes {
            right[s] -= scale * (frame.gradient[m + s] + (0..m).map(|a| entry(m + s, a) * own[a]).sum::<f64>());
            for t in 0..shapes {
                let through: f64 = (0..m).map(|a| entry(m + s, a) * columns[t][a]).sum();
                let damped = if s == t { 1.0 + damping } else { 1.0 };
                matrix[s * shapes + t] += scale * (entry(m + s, m + t) * damped - through);
            }
        }
        eliminated.push((own, columns));
    }
    if shapes == 0 {
        return Some((vec![], eliminated.into_iter().map(|(own, _)| own).collect()));
    }
    Cholesky::new(matrix, shapes)?.solve(&mut right);
    let steps = eliminated.iter().map(|(own, columns)| {
        let from_shape = |a: usize| columns.iter().zip(&right).map(|(c, d)| c[a] * d).sum::<f64>();
        own.iter().enumerate().map(|(a, x)| x - from_shape(a)).collect()
    });
    let steps: Vec<Vec<f64>> = steps.collect();
    right.iter().chain(steps.iter().flatten()).all(|x| x.is_finite()).then_some((right, steps))
}
