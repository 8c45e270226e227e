use crate::posing::Posing;
use crate::{BundleError, Result};
use glam::{Mat3, Vec3};
use softtissue_body::{BodyModel, Pose, ShapedBody};
use softtissue_geometry::{Adjacency, face_normals, vertex_normals};

/// Another body in the same topology that shows the deltas: each is turned from the local frame of the moving body's
/// surface into that of the shown one and scaled with the size of the surface there (Dyna 2015, sec. 6.3, in vertex
/// form).
#[derive(Clone, Debug)]
pub(crate) struct Retarget {
    shaped: ShapedBody,
    posing: Posing,
    /// `shown_from_moving` of each vertex, `[V]`.
    transfer: Vec<Mat3>,
    deltas: Vec<Vec3>,
}

/// Scales of the surface stay inside these: a crease of a stylised mesh must not blow a delta up.
const SCALES: (f32, f32) = (0.25, 4.0);

impl Retarget {
    /// `shown` is the rest mesh `[V]` of the body that shows, metres.
    pub(crate) fn new(body: &BodyModel, moving: &ShapedBody, shown: Vec<Vec3>) -> Result<Self> {
        let v = body.vertex_count();
        if shown.len() != v {
            return Err(BundleError::Input(format!(
                "a mesh of {} vertices where the body has {v}; give one of its topology",
                shown.len()
            )));
        }
        if let Some(i) = shown.iter().position(|p| !p.is_finite()) {
            return Err(BundleError::Input(format!("a mesh whose vertex {i} is not finite; mend it")));
        }
        let adjacency = Adjacency::new(&body.topology);
        let (from, to) = (frames(body, &adjacency, &moving.vertices), frames(body, &adjacency, &shown));
        let transfer = from.iter().zip(&to).map(|(from, to)| to.0 * from.0.transpose() * scale(from.1, to.1)).collect();
        let joints = body.joint_regressor.joints(&shown);
        let shaped = ShapedBody { vertices: shown, joints };
        Ok(Self { shaped, posing: Posing::new(body), transfer, deltas: vec![Vec3::ZERO; v] })
    }

    /// Posed vertices `[V]` of the shown body with the moving one's deltas.
    pub(crate) fn show(&mut self, body: &BodyModel, pose: Pose, deltas: &[Vec3], shift: Vec3, vertices: &mut [Vec3]) {
        for ((shown, transfer), delta) in self.deltas.iter_mut().zip(&self.transfer).zip(deltas) {
            *shown = *transfer * *delta;
        }
        self.posing.run(body, &self.shaped, pose);
        self.posing.add_deltas(&self.deltas, shift, vertices);
    }
}

fn scale(from: f32, to: f32) -> f32 {
    if from > 0.0 { (to / from).sqrt().clamp(SCALES.0, SCALES.1) } else { 1.0 }
}

/// An orthonormal frame on the surface at each vertex (its last axis the normal) and the area round it.
fn frames(body: &BodyModel, adjacency: &Adjacency, vertices: &[Vec3]) -> Vec<(Mat3, f32)> {
    let faces = &body.topology.faces;
    let (normals, crosses) = (vertex_normals(vertices, faces), face_normals(vertices, faces));
    (0..vertices.len())
        .map(|v| {
            let area = adjacency.faces(v).iter().map(|f| crosses[*f as usize].length()).sum();
            let normal = normals[v];
            let round = adjacency.neighbours(v).iter();
            let tangent = round.map(|n| vertices[*n as usize] - vertices[v]).map(|e| e - e.dot(normal) * normal);
            let tangent = tangent.map(Vec3::normalize_or_zero).find(|t| *t != Vec3::ZERO);
            match tangent {
                Some(t) if normal != Vec3::ZERO => (Mat3::from_cols(t, normal.cross(t), normal), area),
                _ => (Mat3::IDENTITY, area),
            }
        })
        .collect()
}
