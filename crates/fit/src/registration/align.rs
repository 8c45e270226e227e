//! Normal equations of pose and shape from point-to-plane distances (Chen and Medioni 1992): each scan point is held
//! against the tangent plane of the body where it is closest, so that the body may slide along itself.

use super::model::{Pair, Posed, Registrar};
use crate::normal::{Normal, ShapeTranslations};
use crate::pose_state::PoseState;
use crate::solve::damped_step;
use glam::{Quat, Vec3, Vec3A};

/// Shape blendshapes and what they do to the joints.
pub(crate) struct ShapeSpace<'a> {
    /// `[S][V]`.
    pub directions: &'a [Vec3],
    /// Change of each bone's translation at the pose, `[S][J]`.
    pub translations: ShapeTranslations,
}

/// Relative damping of a step.
const DAMPING: f64 = 1e-3;
/// Largest turn or move of a step, radians and metres.
const LARGEST_STEP: f64 = 0.5;

impl Registrar<'_> {
    /// Half gradient and Gauss-Newton matrix of the weighted mean squared point-to-plane distance, m^2, by turns of
    /// joints about world axes, translation and, if wanted, shape. Soft parts count little. Pose correctives are held.
    pub fn normal(&self, posed: &Posed, pairs: &[Pair], shape: Option<&ShapeSpace>) -> Normal {
        let (joints, v) = (self.parents.len(), posed.vertices.len());
        let shapes = shape.map_or(0, |s| s.translations.len());
        let n = 3 * joints + 3 + shapes;
        let mut normal = Normal { value: 0.0, gradient: vec![0.0; n], hessian: vec![0.0; n * n] };
        let mut chain = vec![0.0f32; joints];
        let (mut at, mut row) = (Vec::<usize>::new(), Vec::<f64>::new());
        let mut total = 0.0;
        for pair in pairs {
            let corners = || pair.corners.iter().map(|c| *c as usize).zip(pair.weights);
            let rigid: f32 = corners().map(|(c, w)| self.rigid[c] * w).sum();
            let weight = f64::from(pair.weight * rigid);
            if weight <= 0.0 {
                continue;
            }
            let foot = pair.interpolate(&posed.vertices);
            let residual = f64::from(pair.normal.dot(foot - pair.point));
            chain.fill(0.0);
            corners().for_each(|(c, w)| self.chains[c].iter().for_each(|(j, b)| chain[*j] += b * w));
            at.clear();
            row.clear();
            let arm = Vec3A::from(foot) - posed.kinematics.origin;
            for (j, b) in chain.iter().enumerate().filter(|(_, b)| **b > 0.0) {
                let turn = (arm - posed.kinematics.centres[j]).cross(pair.normal.into()) * *b;
                at.extend(3 * j..3 * j + 3);
                row.extend(turn.to_array().map(f64::from));
            }
            at.extend(3 * joints..3 * joints + 3);
            row.extend(pair.normal.to_array().map(f64::from));
            if let Some(shape) = shape {
                for s in 0..shapes {
                    let mut moved = Vec3A::ZERO;
                    for (c, w) in corners() {
                        let skin = &self.body.skin[c];
                        let bones: Vec3A = skin
                            .joints
                            .iter()
                            .zip(skin.weights)
                            .map(|(k, b)| shape.translations[s][usize::from(*k)] * b)
                            .sum();
                        let field = posed.posed_from_rest[c].matrix3 * Vec3A::from(shape.directions[s * v + c]);
                        moved += (field + bones) * w;
                    }
                    at.push(3 * joints + 3 + s);
                    row.push(f64::from(Vec3A::from(pair.normal).dot(moved)));
                }
            }
            total += weight;
            normal.value += weight * residual * residual;
            for (i, x) in at.iter().zip(&row) {
                normal.gradient[*i] += weight * residual * x;
                for (j, y) in at.iter().zip(&row) {
                    normal.hessian[i * n + j] += weight * x * y;
                }
            }
        }
        let scale = 1.0 / total.max(1e-12);
        normal.value *= scale;
        normal.gradient.iter_mut().chain(&mut normal.hessian).for_each(|x| *x *= scale);
        normal
    }

    /// Adds the pull of the joints towards rest and, with the root, towards a predicted pose.
    pub fn add_priors(&self, normal: &mut Normal, posed: &Posed, state: &PoseState, predicted: Option<&PoseState>) {
        let rest = PoseState { rotations: vec![Quat::IDENTITY; self.parents.len()], translation: state.translation };
        let turns = state.turn_since(&rest);
        crate::solve::pull(normal, &posed.kinematics, &turns, |_| self.config.pose_prior, 1);
        if let Some(predicted) = predicted {
            let turns = state.turn_since(predicted);
            crate::solve::pull(normal, &posed.kinematics, &turns, |_| self.config.smoothness, 0);
        }
    }

    /// One damped step of the pose, and how large it was; the pose itself where the matrix gives none.
    pub fn step(&self, normal: &Normal, posed: &Posed, state: &PoseState) -> (PoseState, f64) {
        let Some(mut step) = damped_step(normal, DAMPING) else { return (state.clone(), 0.0) };
        let size = step.iter().fold(0.0f64, |m, x| m.max(x.abs()));
        if size > LARGEST_STEP {
            step.iter_mut().for_each(|x| *x *= LARGEST_STEP / size);
        }
        (state.stepped(&step, &posed.kinematics), size)
    }
}
