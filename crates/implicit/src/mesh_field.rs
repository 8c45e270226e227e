use crate::SignedDistance;
use glam::Vec3;
use rayon::prelude::*;
use softtissue_geometry::{Mesh, SurfaceTree, face_normals};
use std::collections::HashMap;

/// The exact signed distance to a closed mesh: the closest place, and which side of it by the angle-weighted normal of the
/// face, edge or vertex that it lies on (Baerentzen and Aanaes 2005). Where the mesh passes through itself the sign is
/// that of its nearest sheet.
pub struct MeshField<'a> {
    mesh: &'a Mesh,
    tree: SurfaceTree<'a>,
    faces: Vec<Vec3>,
    edges: HashMap<[u32; 2], Vec3>,
    vertices: Vec<Vec3>,
}

/// Farther away nothing is sought, metres.
const REACH: f32 = 1e4;
/// Points below which a second thread does not pay.
const POINTS_A_TASK: usize = 64;

impl<'a> MeshField<'a> {
    /// The field of a mesh.
    pub fn new(mesh: &'a Mesh) -> Self {
        let (positions, triangles) = (&mesh.positions, &mesh.topology.faces);
        let faces: Vec<Vec3> = face_normals(positions, triangles).into_iter().map(Vec3::normalize_or_zero).collect();
        let mut edges: HashMap<[u32; 2], Vec3> = HashMap::with_capacity(triangles.len() * 3 / 2);
        let mut vertices = vec![Vec3::ZERO; positions.len()];
        for (triangle, normal) in triangles.iter().zip(&faces) {
            for i in 0..3 {
                let [a, b, c] = [0, 1, 2].map(|k| triangle[(i + k) % 3]);
                *edges.entry([a.min(b), a.max(b)]).or_default() += *normal;
                let [at, next, last] = [a, b, c].map(|v| positions[v as usize]);
                vertices[a as usize] += *normal * angle(next - at, last - at);
            }
        }
        Self { mesh, tree: SurfaceTree::new(positions, triangles), faces, edges, vertices }
    }

    /// The mesh.
    pub fn source(&self) -> &'a Mesh {
        self.mesh
    }

    fn value(&self, point: Vec3) -> f32 {
        let Some(place) = self.tree.closest(point, Vec3::ZERO, REACH) else { return REACH };
        let corners = self.mesh.topology.faces[place.face as usize];
        let on: Vec<usize> = (0..3).filter(|i| place.weights[*i] > 0.0).collect();
        let normal = match on[..] {
            [a] => self.vertices[corners[a] as usize],
            [a, b] => {
                let (a, b) = (corners[a], corners[b]);
                self.edges[&[a.min(b), a.max(b)]]
            }
            _ => self.faces[place.face as usize],
        };
        let closest: Vec3 = (0..3).map(|i| self.mesh.positions[corners[i] as usize] * place.weights[i]).sum();
        if normal.dot(point - closest) < 0.0 { -place.distance } else { place.distance }
    }
}

impl SignedDistance for MeshField<'_> {
    fn values(&self, points: &[Vec3], out: &mut [f32]) {
        let pairs = points.par_iter().zip(out).with_min_len(POINTS_A_TASK);
        pairs.for_each(|(p, out)| *out = self.value(*p));
    }
}

fn angle(a: Vec3, b: Vec3) -> f32 {
    let cosine = a.normalize_or_zero().dot(b.normalize_or_zero());
    cosine.clamp(-1.0, 1.0).acos()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes::{cuboid, draw};
    use softtissue_random::Draws;

    /// Edges and corners too, where the normal of a single face would tell the wrong side.
    #[test]
    fn the_distance_to_a_cuboid_is_exact() {
        let half = Vec3::new(0.5, 0.4, 0.1);
        let mesh = cuboid(half);
        let mut draws = Draws::new(5, "mesh-field", 0, 0);
        let points: Vec<Vec3> = (0..2000).map(|_| draw(&mut draws, 0.8)).collect();
        let mut values = vec![0.0; points.len()];
        MeshField::new(&mesh).values(&points, &mut values);
        for (p, value) in points.iter().zip(values) {
            let q = p.abs() - half;
            let wanted = q.max(Vec3::ZERO).length() + q.max_element().min(0.0);
            assert!((value - wanted).abs() < 1e-6, "{value} and {wanted} at {p}");
        }
    }
}
