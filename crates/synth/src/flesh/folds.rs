use super::columns::Columns;
use super::elements::edge_matrix;
use glam::Vec3;
use softtissue_body::{BodyModel, Pose, ShapedBody};
use softtissue_geometry::reflect_axis_angle_x;

/// Relative volume of a skinned element under which its nodes stand still.
const FOLDED: f32 = 0.12;

/// One joint's turn: name and axis-angle.
type Turn = (&'static str, [f32; 3]);

/// Poses at the ends of the legs' everyday range, from the rest pose, an A-pose. Each stands for its mirror image too.
const LEGS: [&[Turn]; 8] = [
    &[("left_hip", [-1.6, 0.0, 0.0]), ("left_knee", [2.0, 0.0, 0.0])],
    &[("left_hip", [-0.9, 0.0, 0.35]), ("left_knee", [1.3, 0.0, 0.0])],
    &[("left_hip", [-0.9, 0.0, -0.12]), ("right_hip", [0.4, 0.0, 0.12])],
    &[("left_hip", [0.0, 0.0, 0.45]), ("right_hip", [0.0, 0.0, -0.45])],
    &[("left_hip", [0.0, 0.0, -0.15]), ("right_hip", [0.0, 0.0, 0.15])],
    &[("left_hip", [0.0, 0.5, 0.0]), ("right_hip", [0.0, 0.5, 0.0])],
    &[("left_hip", [0.4, 0.0, -0.12]), ("left_knee", [1.2, 0.0, 0.0])],
    &[("left_hip", [-0.7, 0.0, 0.1]), ("right_hip", [-0.7, 0.0, -0.1])],
];

/// The same of the arms: hanging, swinging, raised, reaching forward, wings.
const ARMS: [&[Turn]; 7] = [
    &[("left_shoulder", [0.0, 0.0, -0.9])],
    &[("left_shoulder", [0.6, -0.2, -1.0])],
    &[("left_shoulder", [0.4, -0.2, -0.6])],
    &[("left_shoulder", [-0.6, -0.3, -0.6])],
    &[("left_shoulder", [-0.2, -0.1, 1.5]), ("left_collar", [0.0, 0.0, 0.4])],
    &[("left_shoulder", [-0.9, -0.7, 0.2]), ("left_collar", [0.0, -0.3, 0.1])],
    &[("left_shoulder", [0.2, -0.4, 0.5]), ("left_collar", [0.0, 0.0, 0.1])],
];

/// What skinning folds in everyday poses: no displacement keeps such an element upright. The choice depends on the
/// person alone, never on the motion.
pub struct Folds {
    /// Nodes of elements folded by the legs (hip and crotch): they follow the skinned body, `[layers + 1, V]`.
    pub still: Vec<bool>,
    /// Elements folded by the arms: in the armpit skin meets skin that it is not tied to, so they are cut,
    /// `[tetrahedra]`.
    pub cut: Vec<bool>,
}

impl Folds {
    /// Looks at every pose of the two lists and at its mirror image.
    pub fn new(body: &BodyModel, shaped: &ShapedBody, columns: &Columns) -> Self {
        let v = body.vertex_count();
        let legs = folded_elements(body, shaped, columns, &LEGS);
        let cut = folded_elements(body, shaped, columns, &ARMS);
        let mut still = vec![false; columns.rest.len()];
        for (t, _) in columns.tetrahedra.iter().zip(legs).filter(|(_, folded)| *folded) {
            for n in t.nodes.map(|n| n as usize) {
                still[n] = true;
                still[n / v * v + body.mirror.vertices[n % v] as usize] = true;
            }
        }
        Self { still, cut }
    }
}

fn folded_elements(body: &BodyModel, shaped: &ShapedBody, columns: &Columns, poses: &[&[Turn]]) -> Vec<bool> {
    let v = body.vertex_count();
    let mut folded = vec![false; columns.tetrahedra.len()];
    for (pose, mirrored) in poses.iter().flat_map(|p| [(p, false), (p, true)]) {
        let mut rotations = vec![Vec3::ZERO; body.joint_count()];
        for (name, w) in *pose {
            if let Some(j) = body.skeleton.index(name) {
                let w = Vec3::from_array(*w);
                let image = usize::from(body.mirror.joints[j]);
                if mirrored { rotations[image] = reflect_axis_angle_x(w) } else { rotations[j] = w }
            }
        }
        let transforms = body.vertex_transforms(
            &body.joint_transforms(&shaped.joints, Pose { rotations: &rotations, translation: Vec3::ZERO }),
        );
        let offsets = body.pose_offsets(&rotations);
        let posed: Vec<Vec3> = (0..columns.rest.len())
            .map(|n| transforms[n % v].transform_point3(columns.rest[n] + offsets[n % v]))
            .collect();
        for (t, folded) in columns.tetrahedra.iter().zip(&mut folded) {
            let rest = edge_matrix(t.nodes, &columns.rest).determinant();
            *folded |= rest <= 0.0 || edge_matrix(t.nodes, &posed).determinant() < FOLDED * rest;
        }
    }
    folded
}
