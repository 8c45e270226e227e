//! One frame: its pose, then its surface.

use super::model::{Pair, Registrar};
use crate::pose_state::PoseState;
use crate::{FitError, Result};
use glam::Vec3;
use softtissue_body::ShapedBody;
use softtissue_clips::{ClipId, RawFrame};

/// Fewer points than this are no body.
const LEAST_POINTS: usize = 200;
/// More points than this for each vertex tell a surface no more.
const POINTS_A_VERTEX: usize = 8;
/// Step, radians and metres, at which a pose is found.
const SMALL: f64 = 1e-3;

/// Distances of a frame's points from the registered surface, metres.
pub(crate) struct Distances {
    /// Median over all points that were asked; those without a place count as out of reach.
    pub median: f32,
    /// Of the points on trunk and limbs that have a place.
    pub judged: Vec<f32>,
}

/// Refuses a frame that cannot be a body.
pub(crate) fn check_points(clip: &ClipId, frame: usize, scan: &RawFrame) -> Result<()> {
    if let Some(vertex) = scan.points.iter().position(|p| !p.is_finite()) {
        return Err(FitError::NotFinite { clip: clip.to_string(), frame, vertex });
    }
    if scan.points.len() < LEAST_POINTS {
        return Err(FitError::Sparse { clip: clip.clone(), frame, points: scan.points.len() });
    }
    Ok(())
}

impl Registrar<'_> {
    fn stride(&self, scan: &RawFrame) -> usize {
        scan.points.len().div_ceil(self.config.pose_points).max(1)
    }

    /// The pose nearest a scan, from a prediction; `displacement` is what the model has at rest besides its shape.
    pub fn pose(
        &self,
        shaped: &ShapedBody,
        displacement: &[Vec3],
        scan: &RawFrame,
        predicted: &PoseState,
    ) -> PoseState {
        let mut state = predicted.clone();
        for step in 0..self.config.pose_iterations {
            // fast limbs may be far from where they were predicted
            let outlier = self.config.outlier * if step < 2 { 2.0 } else { 1.0 };
            let posed = self.posed(shaped, &state, displacement);
            let pairs = self.pairs(&posed, scan, self.stride(scan), self.config.reach, outlier);
            let mut normal = self.normal(&posed, &pairs, None);
            self.add_priors(&mut normal, &posed, &state, Some(predicted));
            let (next, size) = self.step(&normal, &posed, &state);
            state = next;
            if size < SMALL {
                break;
            }
        }
        state
    }

    /// Displacements `[V]` and vertices `[V]` of a scan at a pose.
    pub fn frame_surface(
        &self,
        shaped: &ShapedBody,
        detail: &[Vec3],
        prior: &[Vec3],
        scan: &RawFrame,
        state: &PoseState,
    ) -> (Vec<Vec3>, Vec<Vec3>) {
        let mut posed = self.posed(shaped, state, prior);
        let mut displacement = prior.to_vec();
        let stride = scan.points.len().div_ceil(POINTS_A_VERTEX * prior.len()).max(1);
        for round in 0..self.config.rounds {
            let outlier = self.config.outlier * if round == 0 { 2.0 } else { 1.0 };
            let pairs = self.pairs(&posed, scan, stride, self.config.reach, outlier);
            displacement = self.surface(&posed, &pairs, detail, prior, &displacement);
            posed.displace(self, &displacement);
        }
        (displacement, posed.vertices)
    }

    /// How far the points of a scan lie from a surface.
    pub fn distances(&self, vertices: &[Vec3], scan: &RawFrame) -> Distances {
        let normals = softtissue_geometry::vertex_normals(vertices, &self.body.topology.faces);
        let pairs = self.pairs_on(vertices, &normals, scan, self.stride(scan), self.config.reach, 1.0);
        let asked = scan.points.len().div_ceil(self.stride(scan));
        let mut all: Vec<f32> = pairs.iter().map(|p| p.distance).collect();
        all.resize(asked.max(1), self.config.reach);
        let middle = all.len() / 2;
        let median = *all.select_nth_unstable_by(middle, f32::total_cmp).1;
        let judged = |p: &&Pair| self.judged[p.nearest()];
        Distances { median, judged: pairs.iter().filter(judged).map(|p| p.distance).collect() }
    }
}
