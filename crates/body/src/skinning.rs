use crate::correctives::pose_offsets_into;
use crate::{BodyError, BodyModel, Result};
use glam::{Affine3A, Mat3, Vec3};
use rayon::prelude::*;
use softtissue_geometry::{Frames, rotation_from_axis_angle};

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

/// A blended matrix with a smaller determinant is refused when unposing: noise would grow more than threefold.
pub const SMALLEST_DETERMINANT: f32 = 0.1;

/// Frames that share one pass over the pose blendshapes in the calls for many frames.
const BATCH: usize = 8;

/// Vertices below which a second thread does not pay.
const VERTICES_A_TASK: usize = 512;

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
        rotations[1..].iter().flat_map(|w| row_major(rotation_from_axis_angle(*w) - Mat3::IDENTITY)).collect()
    }

    /// Pose correctives `Bp(theta)`, `[V]`.
    pub fn pose_offsets(&self, rotations: &[Vec3]) -> Vec<Vec3> {
        self.pose_offsets_of_features(&[self.pose_features(rotations)]).pop().expect("one pose gives one field")
    }

    /// Pose correctives of several poses given by their [features](Self::pose_features), `[poses][V]`: one
    /// product `[poses, P] x [P, 3 V]`, so that the blendshapes, which are what costs, are read once for all.
    pub fn pose_offsets_of_features(&self, features: &[Vec<f32>]) -> Vec<Vec<Vec3>> {
        let mut offsets: Vec<Vec<Vec3>> = features.iter().map(|_| vec![Vec3::ZERO; self.vertex_count()]).collect();
        pose_offsets_into(&self.pose_directions, self.vertex_count(), features, &mut offsets);
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

    /// Where the joints of a pose are, `[J]`, metres.
    pub fn posed_joints(&self, joints: &[Vec3], pose: Pose) -> Vec<Vec3> {
        let transforms = self.joint_transforms(joints, pose);
        joints.iter().zip(&transforms).map(|(joint, t)| t.transform_point3(*joint)).collect()
    }

    /// `posed_from_rest` of every vertex by linear blending, `[V]`.
    pub fn vertex_transforms(&self, joint_transforms: &[Affine3A]) -> Vec<Affine3A> {
        self.skin.iter().map(|s| s.blend(joint_transforms)).collect()
    }

    /// Posed vertices `[V]`, with an optional displacement of the rest mesh.
    pub fn posed(&self, shaped: &ShapedBody, pose: Pose, deltas: Option<&[Vec3]>) -> Vec<Vec3> {
        let offsets = self.pose_offsets(pose.rotations);
        self.skinned(shaped, pose, &offsets, deltas)
    }

    /// Posed vertices of many frames `[T, V]`; `rotations` is `[T, J]`, `translations` `[T]`, `deltas` `[T, V]`.
    /// The same numbers as [`posed`](Self::posed), frame by frame, at a fraction of the cost.
    pub fn posed_frames(
        &self,
        shaped: &ShapedBody,
        rotations: &Frames,
        translations: &[Vec3],
        deltas: Option<&Frames>,
    ) -> Frames {
        let v = self.vertex_count();
        let mut out = Frames::zeros(v, rotations.len());
        self.batches(rotations, translations, out.points_mut(), |pose, t, offsets, frame| {
            frame.copy_from_slice(&self.skinned(shaped, pose, offsets, deltas.map(|d| d.frame(t))));
            Ok(())
        })
        .expect("posing cannot fail");
        out
    }

    /// SoftSMPL eq. 3: the rest-frame displacement `W^-1(S, theta) - T - Bs(beta) - Bp(theta)` of posed
    /// vertices `S`, `[V]`. A blended matrix near singular is an error, never a silent NaN.
    pub fn unposed_deltas(&self, shaped: &ShapedBody, pose: Pose, posed: &[Vec3]) -> Result<Vec<Vec3>> {
        let offsets = self.pose_offsets(pose.rotations);
        self.unskinned(shaped, pose, &offsets, posed)
    }

    /// [`unposed_deltas`](Self::unposed_deltas) of many frames, `[T, V]`.
    pub fn unposed_delta_frames(
        &self,
        shaped: &ShapedBody,
        rotations: &Frames,
        translations: &[Vec3],
        posed: &Frames,
    ) -> Result<Frames> {
        assert_eq!(posed.len(), rotations.len(), "frames to unpose");
        let mut out = Frames::zeros(self.vertex_count(), rotations.len());
        self.batches(rotations, translations, out.points_mut(), |pose, t, offsets, frame| {
            frame.copy_from_slice(&self.unskinned(shaped, pose, offsets, posed.frame(t))?);
            Ok(())
        })?;
        Ok(out)
    }

    fn skinned(&self, shaped: &ShapedBody, pose: Pose, offsets: &[Vec3], deltas: Option<&[Vec3]>) -> Vec<Vec3> {
        let transforms = self.joint_transforms(&shaped.joints, pose);
        (0..self.vertex_count())
            .into_par_iter()
            .with_min_len(VERTICES_A_TASK)
            .map(|v| {
                let rest = shaped.vertices[v] + offsets[v] + deltas.map_or(Vec3::ZERO, |d| d[v]);
                self.skin[v].blend(&transforms).transform_point3(rest)
            })
            .collect()
    }

    fn unskinned(&self, shaped: &ShapedBody, pose: Pose, offsets: &[Vec3], posed: &[Vec3]) -> Result<Vec<Vec3>> {
        assert_eq!(posed.len(), self.vertex_count(), "vertices to unpose");
        let transforms = self.joint_transforms(&shaped.joints, pose);
        (0..self.vertex_count())
            .into_par_iter()
            .with_min_len(VERTICES_A_TASK)
            .map(|v| {
                let rest_from_posed = self.skin[v].rest_from_posed(&transforms);
                let rest_from_posed =
                    rest_from_posed.map_err(|determinant| BodyError::Singular { vertex: v, determinant })?;
                Ok(rest_from_posed.transform_point3(posed[v]) - shaped.vertices[v] - offsets[v])
            })
            .collect()
    }

    /// Runs `each(pose, frame index, pose offsets, output frame)` over all frames, in parallel over batches.
    fn batches<F>(&self, rotations: &Frames, translations: &[Vec3], out: &mut [Vec3], each: F) -> Result<()>
    where
        F: Fn(Pose, usize, &[Vec3], &mut [Vec3]) -> Result<()> + Sync,
    {
        assert_eq!(rotations.len(), translations.len(), "frames of a motion");
        let v = self.vertex_count();
        out.par_chunks_mut(BATCH * v).enumerate().try_for_each(|(batch, out)| {
            let first = batch * BATCH;
            let features: Vec<Vec<f32>> =
                (first..first + out.len() / v).map(|t| self.pose_features(rotations.frame(t))).collect();
            let offsets = self.pose_offsets_of_features(&features);
            out.chunks_exact_mut(v).zip(&offsets).enumerate().try_for_each(|(i, (frame, offsets))| {
                let t = first + i;
                each(Pose { rotations: rotations.frame(t), translation: translations[t] }, t, offsets, frame)
            })
        })
    }
}

/// The nine entries of a matrix, row by row: the order of the pose features.
pub(crate) fn row_major(m: Mat3) -> [f32; 9] {
    m.transpose().to_cols_array()
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

    /// The inverse of [`blend`](Self::blend); the determinant where it is below [`SMALLEST_DETERMINANT`].
    pub fn rest_from_posed(&self, transforms: &[Affine3A]) -> std::result::Result<Affine3A, f32> {
        let posed_from_rest = self.blend(transforms);
        let determinant = posed_from_rest.matrix3.determinant();
        // a NaN compares false, so it is refused as well
        if determinant >= SMALLEST_DETERMINANT { Ok(posed_from_rest.inverse()) } else { Err(determinant) }
    }
}

impl crate::JointRegressor {
    /// `[J]` joints of a rest mesh (or, being linear, joint displacements of a displacement field).
    pub fn joints(&self, vertices: &[Vec3]) -> Vec<Vec3> {
        self.rows.iter().map(|row| row.iter().map(|(v, w)| vertices[*v as usize] * *w).sum()).collect()
    }
}
