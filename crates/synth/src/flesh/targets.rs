use super::assembly::Assembly;
use glam::{Mat3, Quat, Vec3};
use softtissue_body::{BodyModel, Pose, ShapedBody};
use softtissue_clips::MotionClip;

/// The skinned body at one frame.
#[derive(Clone, Debug)]
pub struct Target {
    /// Skinned positions of the nodes in use, m.
    pub nodes: Vec<[f32; 4]>,
    /// Skinned skin `[V]`.
    pub skin: Vec<Vec3>,
    /// Linear part of each vertex' blended skinning matrix, `[V]`.
    pub linear: Vec<Mat3>,
    /// The nearest rotation to it, `[V]`.
    pub rotations: Vec<Mat3>,
    /// Posed joints `[J]`.
    pub joints: Vec<Vec3>,
}

impl Target {
    /// Skins every node of a column with the weights of its skin vertex; pose correctives move whole columns.
    pub fn new(body: &BodyModel, shaped: &ShapedBody, assembly: &Assembly, motion: &MotionClip, frame: usize) -> Self {
        let pose = Pose { rotations: motion.rotations.frame(frame), translation: motion.translations[frame] };
        let joint_transforms = body.joint_transforms(&shaped.joints, pose);
        let offsets = body.pose_offsets(pose.rotations);
        let transforms = body.vertex_transforms(&joint_transforms);
        let nodes = assembly
            .nodes
            .iter()
            .zip(&assembly.rest)
            .map(|(node, rest)| {
                let v = node.vertex as usize;
                transforms[v].transform_point3(*rest + offsets[v]).extend(0.0).to_array()
            })
            .collect();
        let skin =
            (0..body.vertex_count()).map(|v| transforms[v].transform_point3(shaped.vertices[v] + offsets[v])).collect();
        let joint_rotations: Vec<Mat3> = joint_transforms.iter().map(|t| Mat3::from(t.matrix3)).collect();
        let linear: Vec<Mat3> = transforms.iter().map(|t| Mat3::from(t.matrix3)).collect();
        let rotations = linear
            .iter()
            .zip(&body.skin)
            .map(|(m, s)| nearest_rotation(*m).unwrap_or(joint_rotations[s.joints[0] as usize]))
            .collect();
        let joints = joint_transforms.iter().zip(&shaped.joints).map(|(t, j)| t.transform_point3(*j)).collect();
        Self { nodes, skin, linear, rotations, joints }
    }
}

/// Polar decomposition by Newton's iteration (Higham 1986); `None` where the matrix is near singular.
pub fn nearest_rotation(m: Mat3) -> Option<Mat3> {
    let mut r = m;
    for _ in 0..6 {
        if r.determinant() < 0.05 {
            return None;
        }
        r = (r + r.inverse().transpose()) * 0.5;
    }
    Some(r)
}

/// Mean angular velocity between two frames, rad/s.
pub fn angular_velocity(from: Mat3, to: Mat3, seconds: f32) -> Vec3 {
    Quat::from_mat3(&(to * from.transpose())).normalize().to_scaled_axis() / seconds
}

/// Weights of four frames round an interval for a position at `s` in `[0, 1]`: Catmull-Rom.
pub fn catmull_rom(s: f32) -> [f32; 4] {
    let (s2, s3) = (s * s, s * s * s);
    [0.5 * (2.0 * s2 - s3 - s), 0.5 * (3.0 * s3 - 5.0 * s2 + 2.0), 0.5 * (4.0 * s2 - 3.0 * s3 + s), 0.5 * (s3 - s2)]
}

/// Its derivative with respect to `s`.
pub fn catmull_rom_rate(s: f32) -> [f32; 4] {
    let s2 = s * s;
    [
        0.5 * (4.0 * s - 3.0 * s2 - 1.0),
        0.5 * (9.0 * s2 - 10.0 * s),
        0.5 * (8.0 * s - 9.0 * s2 + 1.0),
        0.5 * (3.0 * s2 - 2.0 * s),
    ]
}

/// Checks that a motion fits a body: joints, finite numbers, angles that mean something.
pub fn check_motion(body: &BodyModel, motion: &MotionClip) -> Result<(), String> {
    if motion.is_empty() {
        return Err("the motion has no frame".into());
    }
    let joints = motion.rotations.points_per_frame();
    if joints != body.joint_count() || motion.rotations.len() != motion.len() {
        return Err(format!(
            "the motion has {joints} joints, the body {}; use a motion made for it",
            body.joint_count()
        ));
    }
    if !(motion.fps.is_finite() && motion.fps > 0.0) {
        return Err(format!("a rate of {} frames a second; correct fps", motion.fps));
    }
    let bad = (0..motion.len())
        .find(|&t| !motion.translations[t].is_finite() || motion.rotations.frame(t).iter().any(|w| !w.is_finite()));
    match bad {
        Some(t) => Err(format!("the motion is not finite in frame {t}; mend the source")),
        None => Ok(()),
    }
}
