use super::field::Waves;
use glam::Vec3;
use softtissue_body::BodyModel;
use softtissue_geometry::{reflect_axis_angle_x, vertex_normals};
use softtissue_random::Draws;

/// Joints whose bending deforms the body beyond its pose correctives; left ones stand for their mirror images too.
const JOINTS: [&str; 7] = ["spine1", "spine2", "spine3", "left_hip", "left_knee", "left_shoulder", "left_elbow"];
/// Deformations a joint.
const MODES: usize = 2;
/// Reach of a deformation round its joint, metres.
const REACH: f32 = 0.13;
/// Largest displacement of a mode at an angle where `1 - cos 2a` is one, metres.
const SIZE: f32 = 0.0025;

/// Pose deformation outside the correctives: `sum_m F_m (1 - cos(2 w_j . a_m))`, a smooth function of the pose that
/// is not linear in `R - I`. Zero in the rest pose, mirror-symmetric up to each person's own strengths.
#[derive(Clone, Debug)]
pub struct PoseMismatch {
    modes: Vec<Mode>,
}

#[derive(Clone, Debug)]
struct Mode {
    joint: usize,
    axis: Vec3,
    /// `[V]`, metres.
    field: Vec<Vec3>,
}

impl PoseMismatch {
    /// No mismatch.
    pub fn none() -> Self {
        Self { modes: vec![] }
    }

    /// The deformation common to all people of a run, with the strengths (0.7-1.3) of person `subject`.
    pub fn draw(body: &BodyModel, seed: u64, subject: u64) -> Self {
        let normals = vertex_normals(&body.template, &body.topology.faces);
        let joints = body.joint_regressor.joints(&body.template);
        let mut draws = Draws::new(seed, "synth-mismatch", 0, 0);
        let mut own = Draws::new(seed, "synth-mismatch-strength", subject, 0);
        let mut modes = Vec::new();
        for (name, mode) in JOINTS.iter().flat_map(|n| (0..MODES).map(move |m| (n, m))) {
            // one wave and one axis are drawn whether or not the body has the joint
            let waves = Waves::draw(&mut draws, 4, 0.15, 0.4);
            let bend = if mode == 0 { Vec3::X } else { Vec3::Z };
            let axis =
                (bend + 0.3 * Vec3::from_array(std::array::from_fn(|_| draws.normal() as f32))).normalize_or(bend);
            let Some(joint) = body.skeleton.index(name) else { continue };
            let mut field: Vec<Vec3> = (0..body.vertex_count())
                .map(|v| {
                    let near = (-0.5 * (body.template[v].distance(joints[joint]) / REACH).powi(2)).exp();
                    normals[v] * (near * influence(body, v, joint) * waves.at(body.template[v]))
                })
                .collect();
            let mirrored = reflected(body, &field);
            let other = usize::from(body.mirror.joints[joint]);
            if other == joint {
                field.iter_mut().zip(&mirrored).for_each(|(x, y)| *x = 0.5 * (*x + *y));
            }
            let scale = SIZE / field.iter().map(|x| x.length()).fold(1e-9, f32::max);
            let scaled = |field: &[Vec3], s: f32| field.iter().map(|x| *x * (scale * s)).collect();
            modes.push(Mode { joint, axis, field: scaled(&field, own.range(0.7, 1.3) as f32) });
            if other != joint {
                let axis = reflect_axis_angle_x(axis);
                modes.push(Mode { joint: other, axis, field: scaled(&mirrored, own.range(0.7, 1.3) as f32) });
            }
        }
        Self { modes }
    }

    /// Adds the deformation at a pose to a rest-frame displacement `[V]`.
    pub fn add(&self, rotations: &[Vec3], displacement: &mut [Vec3]) {
        for mode in &self.modes {
            let s = 1.0 - (2.0 * rotations[mode.joint].dot(mode.axis)).cos();
            displacement.iter_mut().zip(&mode.field).for_each(|(d, f)| *d += *f * s);
        }
    }
}

/// How much a vertex belongs to a joint, its parent or its children, 0..1.
fn influence(body: &BodyModel, v: usize, joint: usize) -> f32 {
    let parents = &body.skeleton.parents;
    let parent = |j: usize| parents[j].map(usize::from);
    let skin = &body.skin[v];
    skin.joints
        .iter()
        .zip(skin.weights)
        .filter(|(j, _)| {
            let j = usize::from(**j);
            j == joint || parent(joint) == Some(j) || parent(j) == Some(joint)
        })
        .map(|(_, w)| w)
        .sum()
}

/// A displacement seen in the mirror `x -> -x`, `[V]`.
fn reflected(body: &BodyModel, field: &[Vec3]) -> Vec<Vec3> {
    body.mirror.vertices.iter().map(|&m| field[m as usize] * Vec3::new(-1.0, 1.0, 1.0)).collect()
}
