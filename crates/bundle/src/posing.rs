use crate::matrix::add_combination;
use glam::{Affine3A, Mat3, Vec3};
use softtissue_body::{BodyModel, Pose, ShapedBody};
use softtissue_geometry::rotation_from_axis_angle;

/// Skinning of one body with all its memory taken at the start.
#[derive(Clone, Debug)]
pub(crate) struct Posing {
    features: Vec<f32>,
    joints: Vec<Affine3A>,
    offsets: Vec<Vec3>,
    /// Blended `posed_from_rest` of every vertex, `[V]`.
    pub(crate) transforms: Vec<Affine3A>,
    /// Posed vertices without deltas, `[V]`.
    pub(crate) skinned: Vec<Vec3>,
}

impl Posing {
    pub(crate) fn new(body: &BodyModel) -> Self {
        let v = body.vertex_count();
        Self {
            features: vec![0.0; 9 * (body.joint_count() - 1)],
            joints: Vec::with_capacity(body.joint_count()),
            offsets: vec![Vec3::ZERO; v],
            transforms: vec![Affine3A::IDENTITY; v],
            skinned: vec![Vec3::ZERO; v],
        }
    }

    /// Poses the body; [`BodyModel::posed`] without allocation.
    pub(crate) fn run(&mut self, body: &BodyModel, shaped: &ShapedBody, pose: Pose) {
        self.joints.clear();
        for (j, (joint, w)) in shaped.joints.iter().zip(pose.rotations).enumerate() {
            let rotation = rotation_from_axis_angle(*w);
            if j > 0 {
                let entries = (rotation - Mat3::IDENTITY).transpose().to_cols_array();
                self.features[9 * (j - 1)..9 * j].copy_from_slice(&entries);
            }
            let about_joint = Affine3A::from_mat3_translation(rotation, *joint - rotation * *joint);
            let transform = match body.skeleton.parents[j] {
                Some(parent) => self.joints[usize::from(parent)] * about_joint,
                None => Affine3A::from_translation(pose.translation) * about_joint,
            };
            self.joints.push(transform);
        }
        self.offsets.fill(Vec3::ZERO);
        let directions = bytemuck::cast_slice(&body.pose_directions);
        add_combination(directions, &self.features, bytemuck::cast_slice_mut(&mut self.offsets));
        for (v, skin) in body.skin.iter().enumerate() {
            let transform = skin.blend(&self.joints);
            self.transforms[v] = transform;
            self.skinned[v] = transform.transform_point3(shaped.vertices[v] + self.offsets[v]);
        }
    }

    /// Posed vertices with deltas of the rest mesh, `[V]`, moved by `shift`.
    pub(crate) fn add_deltas(&self, deltas: &[Vec3], shift: Vec3, vertices: &mut [Vec3]) {
        for (v, vertex) in vertices.iter_mut().enumerate() {
            *vertex = self.skinned[v] + self.transforms[v].transform_vector3(deltas[v]) + shift;
        }
    }
}
