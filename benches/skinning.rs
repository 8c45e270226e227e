//! Forward skinning and its inverse against SMPL's formulas as one writes them with NumPy: every blendshape and every
//! joint for every vertex, dense, on one core.

use crate::{assert_close, body, pose, swing};
use divan::{Bencher, black_box};
use glam::{Affine3A, Vec3};
use softtissue_body::{BodyModel, Pose, ShapedBody};

/// What is posed: a body, its shape and a pose.
fn scene(level: u8) -> (&'static BodyModel, ShapedBody, Vec<Vec3>) {
    let body = body(level);
    (body, body.shaped(&[0.5, -0.5]), swing(body.joint_count(), 7))
}

#[divan::bench(args = [0, 1])]
fn posed(bencher: Bencher, level: u8) {
    let (body, shaped, rotations) = scene(level);
    bencher.bench_local(|| body.posed(black_box(&shaped), pose(&rotations), None));
}

#[divan::bench(args = [0, 1])]
fn posed_plainly(bencher: Bencher, level: u8) {
    let (body, shaped, rotations) = scene(level);
    let plain = Plain::new(body);
    let ours = body.posed(&shaped, pose(&rotations), None);
    assert_close(&plain.posed(body, &shaped, pose(&rotations)), &ours, 1e-5);
    bencher.bench_local(|| plain.posed(body, black_box(&shaped), pose(&rotations)));
}

#[divan::bench(args = [0, 1])]
fn unposed(bencher: Bencher, level: u8) {
    let (body, shaped, rotations) = scene(level);
    let scan = body.posed(&shaped, pose(&rotations), None);
    bencher.bench_local(|| body.unposed_deltas(&shaped, pose(&rotations), black_box(&scan)).expect("no fold"));
}

#[divan::bench(args = [0, 1])]
fn unposed_plainly(bencher: Bencher, level: u8) {
    let (body, shaped, rotations) = scene(level);
    let plain = Plain::new(body);
    let scan = body.posed(&shaped, pose(&rotations), None);
    let ours = body.unposed_deltas(&shaped, pose(&rotations), &scan).expect("no fold");
    assert_close(&plain.unposed(body, &shaped, pose(&rotations), &scan), &ours, 1e-5);
    bencher.bench_local(|| plain.unposed(body, &shaped, pose(&rotations), black_box(&scan)));
}

/// Skin weights as SMPL's files hold them: dense.
struct Plain {
    /// `[V, J]`.
    weights: Vec<f32>,
}

impl Plain {
    fn new(body: &BodyModel) -> Self {
        let joints = body.joint_count();
        let mut weights = vec![0.0; body.vertex_count() * joints];
        for (row, skin) in weights.chunks_exact_mut(joints).zip(&body.skin) {
            skin.joints.iter().zip(skin.weights).for_each(|(j, w)| row[usize::from(*j)] += w);
        }
        Self { weights }
    }

    /// `T + Bs + Bp`, the blendshapes one after the other.
    fn rest(body: &BodyModel, shaped: &ShapedBody, rotations: &[Vec3]) -> Vec<Vec3> {
        let mut rest = shaped.vertices.clone();
        let fields = body.pose_directions.chunks_exact(rest.len());
        for (feature, field) in body.pose_features(rotations).iter().zip(fields) {
            rest.iter_mut().zip(field).for_each(|(x, d)| *x += *feature * *d);
        }
        rest
    }

    /// `sum_j w_vj G_j` of a vertex, over all joints.
    fn blended(&self, vertex: usize, joints: &[Affine3A]) -> Affine3A {
        let mut sum = Affine3A::ZERO;
        for (weight, joint) in self.weights[vertex * joints.len()..].iter().zip(joints) {
            sum.matrix3 += joint.matrix3 * *weight;
            sum.translation += joint.translation * *weight;
        }
        sum
    }

    fn posed(&self, body: &BodyModel, shaped: &ShapedBody, pose: Pose) -> Vec<Vec3> {
        let joints = body.joint_transforms(&shaped.joints, pose);
        let rest = Self::rest(body, shaped, pose.rotations);
        rest.iter().enumerate().map(|(v, x)| self.blended(v, &joints).transform_point3(*x)).collect()
    }

    fn unposed(&self, body: &BodyModel, shaped: &ShapedBody, pose: Pose, scan: &[Vec3]) -> Vec<Vec3> {
        let joints = body.joint_transforms(&shaped.joints, pose);
        let rest = Self::rest(body, shaped, pose.rotations);
        let delta =
            |(v, (x, rest)): (usize, (&Vec3, &Vec3))| self.blended(v, &joints).inverse().transform_point3(*x) - *rest;
        scan.iter().zip(&rest).enumerate().map(delta).collect()
    }
}
