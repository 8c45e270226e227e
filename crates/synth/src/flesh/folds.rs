use super::columns::Columns;
use super::elements::edge_matrix;
use glam::Vec3;
use softtissue_body::{BodyModel, Pose, ShapedBody};

/// Relative volume of a skinned element under which its nodes stand still.
const FOLDED: f32 = 0.12;

/// One joint's turn: name and axis-angle.
type Turn = (&'static str, [f32; 3]);

/// Poses at the ends of the joints' everyday range, from the rest pose, an A-pose. Each stands for its mirror image
/// too.
const ENDS: [&[Turn]; 11] = [
    &[("left_hip", [-1.5, 0.0, 0.0]), ("left_knee", [1.5, 0.0, 0.0])],
    &[("left_hip", [-0.9, 0.0, 0.35]), ("left_knee", [1.3, 0.0, 0.0])],
    &[("left_hip", [-0.9, 0.0, -0.12]), ("right_hip", [0.4, 0.0, 0.12])],
    &[("left_hip", [0.0, 0.0, 0.45]), ("right_hip", [0.0, 0.0, -0.45])],
    &[("left_hip", [0.0, 0.0, -0.15]), ("right_hip", [0.0, 0.0, 0.15])],
    &[("left_hip", [0.0, 0.5, 0.0]), ("right_hip", [0.0, 0.5, 0.0])],
    &[("left_hip", [0.4, 0.0, -0.12]), ("left_knee", [1.2, 0.0, 0.0])],
    &[("left_hip", [-1.0, 0.0, 0.15]), ("right_hip", [-1.0, 0.0, -0.15])],
    &[("left_shoulder", [0.0, 0.0, 1.4]), ("left_collar", [0.0, 0.0, 0.3])],
    &[("left_shoulder", [0.0, 0.0, -0.6])],
    &[("left_shoulder", [-1.1, -1.1, 0.0]), ("left_elbow", [0.0, -1.2, 0.0])],
];

/// Nodes of elements that skinning itself folds in an everyday pose, `[layers + 1, V]`: creases of hip, crotch and
/// armpit. No choice of displacement keeps such an element upright, so its nodes follow the skinned body. The choice
/// depends on the person alone, never on the motion.
pub fn folded_nodes(body: &BodyModel, shaped: &ShapedBody, columns: &Columns) -> Vec<bool> {
    let v = body.vertex_count();
    let mut folded = vec![false; columns.rest.len()];
    for pose in ENDS {
        let mut rotations = vec![Vec3::ZERO; body.joint_count()];
        for (name, w) in pose {
            if let Some(j) = body.skeleton.index(name) {
                rotations[j] = Vec3::from_array(*w);
            }
        }
        let transforms = body.vertex_transforms(
            &body.joint_transforms(&shaped.joints, Pose { rotations: &rotations, translation: Vec3::ZERO }),
        );
        let offsets = body.pose_offsets(&rotations);
        let posed: Vec<Vec3> =
            columns.rest.iter().enumerate().map(|(n, p)| transforms[n % v].transform_point3(*p + offsets[n % v])).collect();
        for t in &columns.tetrahedra {
            let rest = edge_matrix(t.nodes, &columns.rest).determinant();
            if rest <= 0.0 || edge_matrix(t.nodes, &posed).determinant() < FOLDED * rest {
                t.nodes.iter().for_each(|&n| folded[n as usize] = true);
            }
        }
    }
    (0..folded.len()).map(|n| folded[n] || folded[n / v * v + body.mirror.vertices[n % v] as usize]).collect()
}
