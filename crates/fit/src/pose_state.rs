use glam::{Affine3A, Mat3, Mat3A, Quat, Vec3, Vec3A};
use softtissue_body::Pose;
use softtissue_geometry::axis_angle_from_rotation;

/// A pose on the rotation group, where steps have no singularity: `[J]` local rotations and the root's translation.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct PoseState {
    pub rotations: Vec<Quat>,
    pub translation: Vec3,
}

impl PoseState {
    pub fn from_pose(pose: Pose) -> Self {
        let rotations = pose.rotations.iter().map(|w| Quat::from_scaled_axis(*w)).collect();
        Self { rotations, translation: pose.translation }
    }

    /// Axis-angle rotations, angles in `[0, pi]`.
    pub fn axis_angles(&self) -> Vec<Vec3> {
        self.rotations.iter().map(|q| axis_angle_from_rotation(Mat3::from_quat(*q))).collect()
    }

    /// The pose after a step: `step[3 j..3 j + 3]` turns joint `j` about **world** axes, the last three numbers move
    /// the root.
    pub fn stepped(&self, step: &[f64], kinematics: &Kinematics) -> Self {
        let vector = |i: usize| Vec3A::new(step[i] as f32, step[i + 1] as f32, step[i + 2] as f32);
        let rotations = self.rotations.iter().enumerate().map(|(j, q)| {
            let local = kinematics.parent_rotations[j].transpose() * vector(3 * j);
            (Quat::from_scaled_axis(local.into()) * *q).normalize()
        });
        let rotations: Vec<Quat> = rotations.collect();
        let moved: Vec3 = vector(3 * self.rotations.len()).into();
        Self { rotations, translation: self.translation + moved }
    }

    /// The pose that follows `previous` and this one at constant velocity.
    pub fn extrapolated(&self, previous: &Self) -> Self {
        let turn = |(now, before): (&Quat, &Quat)| (*now * before.inverse() * *now).normalize();
        Self {
            rotations: self.rotations.iter().zip(&previous.rotations).map(turn).collect(),
            translation: 2.0 * self.translation - previous.translation,
        }
    }

    /// Rotation vectors `log(R R0^T)` of each joint against another pose, in its parent's frame.
    pub fn turn_since(&self, before: &Self) -> Vec<Vec3> {
        let turn = |(a, b): (&Quat, &Quat)| axis_angle_from_rotation(Mat3::from_quat(*a * b.inverse()));
        self.rotations.iter().zip(&before.rotations).map(turn).collect()
    }
}

/// The skeleton's transforms at a pose.
pub(crate) struct Kinematics {
    /// `posed_from_rest` of each bone, `[J]`.
    pub transforms: Vec<Affine3A>,
    /// Rotation of each joint's parent in the world, `[J]`.
    pub parent_rotations: Vec<Mat3A>,
    /// Where the joints are, relative to the root joint, `[J]`.
    pub centres: Vec<Vec3A>,
    /// Where the root joint is; twists of bones are taken about it.
    pub origin: Vec3A,
    /// `R_j - I` of joints 1..J, row-major.
    pub features: Vec<f32>,
    /// Local rotations, `[J]`.
    pub locals: Vec<Mat3A>,
}

impl Kinematics {
    pub fn new(parents: &[Option<usize>], joints: &[Vec3], pose: &PoseState) -> Self {
        let locals: Vec<Mat3A> = pose.rotations.iter().map(|q| Mat3A::from_quat(*q)).collect();
        let mut transforms: Vec<Affine3A> = Vec::with_capacity(joints.len());
        let mut parent_rotations = Vec::with_capacity(joints.len());
        for (j, joint) in joints.iter().enumerate() {
            let joint = Vec3A::from(*joint);
            let about_joint = Affine3A { matrix3: locals[j], translation: joint - locals[j] * joint };
            let above = parents[j].map_or(Affine3A::from_translation(pose.translation), |p| transforms[p]);
            parent_rotations.push(above.matrix3);
            transforms.push(above * about_joint);
        }
        let at = |j: usize| transforms[j].transform_point3a(joints[j].into());
        let origin = at(0);
        let centres = (0..joints.len()).map(|j| at(j) - origin).collect();
        let features = locals[1..].iter().flat_map(|r| {
            let d = *r - Mat3A::IDENTITY;
            d.transpose().to_cols_array()
        });
        let features = features.collect();
        Self { transforms, parent_rotations, centres, origin, features, locals }
    }
}
