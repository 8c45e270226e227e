use crate::Precision;
use crate::blocks::BLOCK;
use crate::correctives::Correctives;
use glam::{Affine3A, Mat3, Vec3};
use softtissue_body::{BodyModel, Pose, ShapedBody, SkinWeights};
use softtissue_geometry::rotation_from_axis_angle;
use std::ops::Range;
use std::sync::Arc;

/// Skinning of one body with all its memory taken at the start.
#[derive(Clone, Debug)]
pub(crate) struct Posing {
    /// Shared by all bodies of a bundle.
    correctives: Arc<Correctives>,
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
        Self::sharing(body, Arc::new(Correctives::new(body, Precision::F32)))
    }

    pub(crate) fn sharing(body: &BodyModel, correctives: Arc<Correctives>) -> Self {
        let v = body.vertex_count();
        Self {
            correctives,
            features: vec![0.0; 9 * (body.joint_count() - 1)],
            joints: Vec::with_capacity(body.joint_count()),
            offsets: vec![Vec3::ZERO; v],
            transforms: vec![Affine3A::IDENTITY; v],
            skinned: vec![Vec3::ZERO; v],
        }
    }

    pub(crate) fn correctives(&self) -> &Arc<Correctives> {
        &self.correctives
    }

    /// Poses the body; [`BodyModel::posed`] without allocation.
    pub(crate) fn run(&mut self, body: &BodyModel, shaped: &ShapedBody, pose: Pose) {
        self.take(body, shaped, pose);
        self.correct(body, 0..self.blocks());
        self.skin(body, shaped);
    }

    /// The first third of posing: joints and what the correctives depend on.
    pub(crate) fn take(&mut self, body: &BodyModel, shaped: &ShapedBody, pose: Pose) {
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
    }

    /// Blocks of the correctives.
    pub(crate) fn blocks(&self) -> usize {
        (3 * self.offsets.len()).div_ceil(BLOCK)
    }

    /// The second third: some blocks of the correctives.
    pub(crate) fn correct(&mut self, body: &BodyModel, blocks: Range<usize>) {
        self.correctives.add(body, &self.features, bytemuck::cast_slice_mut(&mut self.offsets), blocks);
    }

    /// The last third: linear blending.
    pub(crate) fn skin(&mut self, body: &BodyModel, shaped: &ShapedBody) {
        let joints = &self.joints;
        let rest = shaped.vertices.iter().zip(&self.offsets);
        let out = self.transforms.iter_mut().zip(&mut self.skinned);
        for ((skin, (rest, offset)), (transform, skinned)) in body.skin.iter().zip(rest).zip(out) {
            *transform = blend(joints, skin);
            *skinned = transform.transform_point3(*rest + *offset);
        }
    }

    /// Posed vertices with deltas of the rest mesh, `[V]`, moved by `shift`.
    pub(crate) fn add_deltas(&self, deltas: &[Vec3], shift: Vec3, vertices: &mut [Vec3]) {
        let posed = self.skinned.iter().zip(&self.transforms).zip(deltas);
        for (vertex, ((skinned, transform), delta)) in vertices.iter_mut().zip(posed) {
            *vertex = *skinned + transform.transform_vector3(*delta) + shift;
        }
    }
}

/// [`SkinWeights::blend`] where the compiler can see it: it runs for every vertex.
#[inline(always)]
fn blend(joints: &[Affine3A], skin: &SkinWeights) -> Affine3A {
    let mut sum = Affine3A::ZERO;
    for (joint, weight) in skin.joints.iter().zip(skin.weights) {
        if weight > 0.0 {
            let transform = &joints[usize::from(*joint)];
            sum.matrix3 += transform.matrix3 * weight;
            sum.translation += transform.translation * weight;
        }
    }
    sum
}
