use crate::{BodyError, BodyModel, Result};
use glam::{Affine3A, Mat3, Vec3};
use rayon::prelude::*;
use softtissue_geometry::rotation_from_axis_angle;

/// One frame's pose: `[J]` axis-angle rotations relative to the parent (joint 0: the root's orientation), and
/// the translation added after posing.
#[derive(Clone, Copy, Debug)]
pub struct Pose<'a> {
    /// `[J]`, radians.
    pub rotations: &'a [Vec3],
    /// Metres.
    pub translation: Vec3,
}

/// The body at one shape, unposed: `T + Bs(beta)` and its joints.
#[derive(Clone, Debug, PartialEq)]
pub struct ShapedBody {
    /// Rest vertices `[V]`.
    pub vertices: Vec<Vec3>,
    /// Rest joints `[J]`.
    pub joints: Vec<Vec3>,
}

/// A blended matrix with a smaller determinant is refused by [`BodyModel::unpose`].
const SMALLEST_DETERMINANT: f32 = 0.1;

impl BodyModel {
    /// `T + Bs(beta)` and `J(beta)`. Missing coefficients count as zero, surplus ones are ignored.
    pub fn shaped(&self, beta: &[f32]) -> ShapedBody {
        let v = self.vertex_count();
        let mut vertices = self.template.clone();
        for (b, directions) in beta.iter().zip(self.shape_directions.chunks_exact(v)) {
            for (x, d) in vertices.iter_mut().zip(directions) {
                *x += *d * *b;
            }
        }
        let joints = self.joint_regressor.joints(&vertices);
        ShapedBody { vertices, joints }
    }

    /// `R_j - I` of joints 1..J, row-major, `[9 (J - 1)]`.
    pub fn pose_features(&self, rotations: &[Vec3]) -> Vec<f32> {
        assert_eq!(rotations.len(), self.joint_count(), "joints of a pose");
        rotations[1..]
            .iter()
            .flat_map(|w| {
                let d = rotation_from_axis_angle(*w) - Mat3::IDENTITY;
                d.transpose().to_cols_array()
            })
            .collect()
    }

    /// Pose correctives `Bp(theta)`, `[V]`.
    pub fn pose_offsets(&self, rotations: &[Vec3]) -> Vec<Vec3> {
        let v = self.vertex_count();
        let mut offsets = vec![Vec3::ZERO; v];
        for (f, directions) in self.pose_features(rotations).iter().zip(self.pose_directions.chunks_exact(v)) {
            if *f != 0.0 {
                for (x, d) in offsets.iter_mut().zip(directions) {
                    *x += *d * *f;
                }
            }
        }
        offsets
    }

    /// `posed_from_rest` of every joint, `[J]`.
    pub fn joint_transforms(&self, joints: &[Vec3], pose: Pose) -> Vec<Affine3A> {
        assert_eq!(pose.rotations.len(), self.joint_count(), "joints of a pose");
        let mut transforms: Vec<Affine3A> = Vec::with_capacity(joints.len());
        for (j, (joint, w)) in joints.iter().zip(pose.rotations).enumerate() {
            let about_joint = {
                let r = rotation_from_axis_angle(*w);
                Affine3A::from_mat3_translation(r, *joint - r * *joint)
            };
            transforms.push(match self.skeleton.parents[j] {
                Some(p) => transforms[p as usize] * about_joint,
                None => Affine3A::from_translation(pose.translation) * about_joint,
            });
        }
        transforms
    }

    /// `posed_from_rest` of every vertex by linear blending, `[V]`.
    pub fn vertex_transforms(&self, joint_transforms: &[Affine3A]) -> Vec<Affine3A> {
        self.skin.iter().map(|s| s.blend(joint_transforms)).collect()
    }

    /// Posed vertices `[V]`, with an optional displacement of the rest mesh.
    pub fn posed(&self, shaped: &ShapedBody, pose: Pose, deltas: Option<&[Vec3]>) -> Vec<Vec3> {
        let transforms = self.joint_transforms(&shaped.joints, pose);
        let offsets = self.pose_offsets(pose.rotations);
        (0..self.vertex_count())
            .into_par_iter()
            .with_min_len(512)
            .map(|v| {
                let rest = shaped.vertices[v] + offsets[v] + deltas.map_or(Vec3::ZERO, |d| d[v]);
                self.skin[v].blend(&transforms).transform_point3(rest)
            })
            .collect()
    }

    /// SoftSMPL eq. 3: the rest-frame displacement `W^-1(S, theta) - T - Bs(beta) - Bp(theta)` of posed
    /// vertices `S`, `[V]`. A blended matrix near singular is an error, never a silent NaN.
    pub fn unposed_deltas(&self, shaped: &ShapedBody, pose: Pose, posed: &[Vec3]) -> Result<Vec<Vec3>> {
        assert_eq!(posed.len(), self.vertex_count(), "vertices to unpose");
        let transforms = self.joint_transforms(&shaped.joints, pose);
        let offsets = self.pose_offsets(pose.rotations);
        (0..self.vertex_count())
            .into_par_iter()
            .with_min_len(512)
            .map(|v| {
                let m = self.skin[v].blend(&transforms);
                let determinant = m.matrix3.determinant();
                if determinant.is_nan() || determinant < SMALLEST_DETERMINANT {
                    return Err(BodyError::Singular { vertex: v, determinant });
                }
                Ok(m.inverse().transform_point3(posed[v]) - shaped.vertices[v] - offsets[v])
            })
            .collect()
    }
}

impl crate::SkinWeights {
    /// Weighted sum of joint transforms.
    pub fn blend(&self, transforms: &[Affine3A]) -> Affine3A {
        let mut sum = Affine3A::ZERO;
        for (j, w) in self.joints.iter().zip(self.weights) {
            if w > 0.0 {
                let t = &transforms[*j as usize];
                sum.matrix3 += t.matrix3 * w;
                sum.translation += t.translation * w;
            }
        }
        sum
    }
}

impl crate::JointRegressor {
    /// `[J]` joints of a rest mesh.
    pub fn joints(&self, vertices: &[Vec3]) -> Vec<Vec3> {
        self.rows.iter().map(|row| row.iter().map(|(v, w)| vertices[*v as usize] * *w).sum()).collect()
    }
}
