use crate::skinning::row_major;
use crate::{BodyError, BodyModel, Pose, Result, ShapedBody, SkinWeights};
use glam::{Affine3A, Mat3, Mat3A, Vec3, Vec3A};
use rayon::prelude::*;
use softtissue_geometry::{left_jacobian, rotation_derivatives};

/// Derivatives of a field of vertices, one field a parameter.
///
/// Parameters in order: the `3 J` axis-angle numbers joint by joint, the 3 of the root's translation, the `S`
/// shape coefficients.
#[derive(Clone, Debug)]
pub struct Jacobian {
    vertex_count: usize,
    columns: Vec<Vec3>,
}

impl Jacobian {
    /// Parameters `3 J + 3 + S`.
    pub fn parameter_count(&self) -> usize {
        self.columns.len().checked_div(self.vertex_count).unwrap_or(0)
    }
    /// Derivative of all vertices with respect to one parameter, `[V]`.
    pub fn column(&self, parameter: usize) -> &[Vec3] {
        &self.columns[parameter * self.vertex_count..(parameter + 1) * self.vertex_count]
    }
}

/// What a parameter does to the skeleton's transforms and to the rest mesh.
enum Parameter {
    /// Axis `axis` of joint `joint`.
    Angle { joint: usize, axis: usize },
    /// A component of the translation.
    Translation(Vec3A),
    /// A shape coefficient.
    Shape(usize),
}

/// The kinematic part of all derivatives at one pose.
struct Kinematics<'a> {
    body: &'a BodyModel,
    transforms: Vec<Affine3A>,
    /// Where each joint is, `[J]`.
    centres: Vec<Vec3A>,
    /// World axes about which the three angles of each joint turn, `[J]`.
    axes: Vec<Mat3A>,
    /// Derivative of the local rotation by its three angles, row-major, `[J][3]`.
    rotations: Vec<[[f32; 9]; 3]>,
    /// `below[j][k]`: bone `k` hangs at joint `j`.
    below: Vec<Vec<bool>>,
    /// Derivative of each bone's translation by each shape coefficient, `[S][J]`.
    shape_translations: Vec<Vec<Vec3A>>,
}

impl BodyModel {
    /// Derivatives of [`posed`](Self::posed) vertices with respect to pose and shape, `[3 J + 3 + S, V]`.
    pub fn posed_jacobian(&self, shaped: &ShapedBody, pose: Pose, deltas: Option<&[Vec3]>) -> Jacobian {
        let kinematics = Kinematics::new(self, shaped, pose);
        let offsets = self.pose_offsets(pose.rotations);
        let blended: Vec<Mat3A> = self.skin.iter().map(|s| s.blend(&kinematics.transforms).matrix3).collect();
        let columns = kinematics.columns(|parameter, v| {
            let rest = shaped.vertices[v] + offsets[v] + deltas.map_or(Vec3::ZERO, |d| d[v]);
            kinematics.bone_motion(parameter, v, rest.into()) + blended[v] * kinematics.rest_motion(parameter, v)
        });
        Jacobian { vertex_count: self.vertex_count(), columns }
    }

    /// Derivatives of [`unposed_deltas`](Self::unposed_deltas) with respect to pose and shape, the posed
    /// vertices held, `[3 J + 3 + S, V]`.
    ///
    /// With `u = B^-1 s` and `B` the blended transform, `du = -B^-1 dB u`.
    pub fn unposed_jacobian(&self, shaped: &ShapedBody, pose: Pose, posed: &[Vec3]) -> Result<Jacobian> {
        assert_eq!(posed.len(), self.vertex_count(), "vertices to unpose");
        let kinematics = Kinematics::new(self, shaped, pose);
        let inverse = |(v, s): (usize, &SkinWeights)| {
            let m = s.rest_from_posed(&kinematics.transforms);
            m.map_err(|determinant| BodyError::Singular { vertex: v, determinant })
        };
        let rest_from_posed: Vec<Affine3A> = self.skin.iter().enumerate().map(inverse).collect::<Result<_>>()?;
        let columns = kinematics.columns(|parameter, v| {
            let m = &rest_from_posed[v];
            let unposed = m.transform_point3a(posed[v].into());
            -(m.matrix3 * kinematics.bone_motion(parameter, v, unposed)) - kinematics.rest_motion(parameter, v)
        });
        Ok(Jacobian { vertex_count: self.vertex_count(), columns })
    }
}

impl<'a> Kinematics<'a> {
    fn new(body: &'a BodyModel, shaped: &ShapedBody, pose: Pose) -> Self {
        let transforms = body.joint_transforms(&shaped.joints, pose);
        let joints = body.joint_count();
        let parent = |j: usize| body.skeleton.parents[j].map(usize::from);
        let world = |j: usize| parent(j).map_or(Mat3A::IDENTITY, |p| transforms[p].matrix3);
        let below = body.skeleton.descendants();
        let v = body.vertex_count();
        let shape_translations = body
            .shape_directions
            .chunks_exact(v.max(1))
            .map(|directions| {
                // A_j = A_p (R_j, J_j - R_j J_j), so dt_j = dt_p + (A_p - A_j) dJ_j with A the rotation parts
                let moved = body.joint_regressor.joints(directions);
                let mut translations: Vec<Vec3A> = Vec::with_capacity(joints);
                for j in 0..joints {
                    let above = parent(j).map_or(Vec3A::ZERO, |p| translations[p]);
                    translations.push(above + (world(j) - transforms[j].matrix3) * Vec3A::from(moved[j]));
                }
                translations
            })
            .collect();
        Self {
            body,
            centres: (0..joints).map(|j| transforms[j].transform_point3a(shaped.joints[j].into())).collect(),
            axes: (0..joints).map(|j| world(j) * Mat3A::from(left_jacobian(pose.rotations[j]))).collect(),
            rotations: pose.rotations.iter().map(|w| rotation_derivatives(*w).map(row_major)).collect(),
            below,
            shape_translations,
            transforms,
        }
    }

    fn columns(&self, value: impl Fn(&Parameter, usize) -> Vec3A + Sync) -> Vec<Vec3> {
        let v = self.body.vertex_count();
        let angles =
            (0..self.body.joint_count()).flat_map(|joint| (0..3).map(move |axis| Parameter::Angle { joint, axis }));
        let translations = Mat3::IDENTITY.to_cols_array_2d().map(|e| Parameter::Translation(Vec3A::from_array(e)));
        let shape = (0..self.body.shape_count()).map(Parameter::Shape);
        let parameters: Vec<Parameter> = angles.chain(translations).chain(shape).collect();
        let mut columns = vec![Vec3::ZERO; parameters.len() * v];
        columns.par_chunks_mut(v.max(1)).zip(&parameters).for_each(|(column, parameter)| {
            for (i, x) in column.iter_mut().enumerate() {
                *x = value(parameter, i).into();
            }
        });
        columns
    }

    /// `dB p`: how the blended transform's change moves the rest point `p` of vertex `v`.
    fn bone_motion(&self, parameter: &Parameter, v: usize, p: Vec3A) -> Vec3A {
        let skin = &self.body.skin[v];
        let bones = skin.joints.iter().map(|&k| k as usize).zip(skin.weights).filter(|(_, w)| *w > 0.0);
        match *parameter {
            Parameter::Translation(e) => e * skin.weights.iter().sum::<f32>(),
            Parameter::Shape(s) => bones.map(|(k, w)| self.shape_translations[s][k] * w).sum(),
            Parameter::Angle { joint, axis } => {
                let arms = bones.filter(|(k, _)| self.below[joint][*k]);
                let arm: Vec3A =
                    arms.map(|(k, w)| (self.transforms[k].transform_point3a(p) - self.centres[joint]) * w).sum();
                self.axes[joint].col(axis).cross(arm)
            }
        }
    }

    /// Change of the rest position of vertex `v`, deltas held.
    fn rest_motion(&self, parameter: &Parameter, v: usize) -> Vec3A {
        let count = self.body.vertex_count();
        match *parameter {
            Parameter::Translation(_) | Parameter::Angle { joint: 0, .. } => Vec3A::ZERO,
            Parameter::Shape(s) => self.body.shape_directions[s * count + v].into(),
            Parameter::Angle { joint, axis } => {
                let first = 9 * (joint - 1);
                let entries = self.rotations[joint][axis].iter().enumerate();
                entries.map(|(i, d)| Vec3A::from(self.body.pose_directions[(first + i) * count + v]) * *d).sum()
            }
        }
    }
}
