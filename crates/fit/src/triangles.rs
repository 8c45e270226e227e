//! The deltas in triangle form (Dyna, Pons-Moll et al. 2015, secs. 3.3, 3.5 and 4): every triangle's deformation relative
//! to the template, and the mesh that matches such deformations best.
//!
//! In the paper the edges of a triangle are `R*_t (S_t + D_t) Q_t v_te` (eq. 18). Here pose `R*` and pose correctives
//! `Q` are undone before, vertex by vertex, by the body's own skinning, and the shape `S` with the subject's template is
//! taken off (eq. 13); what is left of the edges is `D_t v_te`, with `v_te` the template's. Eq. 12 is linear, so that
//! the `D_t` of the remainder are what the paper's `T_t - S_t` is for this body. What differs is the body: skinning
//! per vertex for BlendSCAPE's rotation per triangle, and SMPL's additive correctives for its factor `Q`.

use crate::sparse::SparseCholesky;
use crate::{FitError, Result};
use glam::{DMat3, DVec3, Vec3};
use softtissue_geometry::Topology;
use std::collections::BTreeMap;

/// What extracts deformations of triangles from deltas of vertices and stitches them together again. Both are least
/// squares whose matrices depend on the template alone: factored once, solved for every frame.
pub struct TriangleForm {
    faces: Vec<[u32; 3]>,
    /// The template's edges from a triangle's first corner to the other two, metres.
    edges: Vec<[DVec3; 2]>,
    vertices: usize,
    extraction: SparseCholesky,
    stitching: SparseCholesky,
}

/// A frame of deltas as deformations.
#[derive(Clone, Debug, PartialEq)]
pub struct TriangleDeltas {
    /// `D_t` of each triangle, `[F]`: an edge of the template becomes the edge and `D_t` times it.
    pub gradients: Vec<DMat3>,
    /// Mean delta of the vertices, metres: edges do not tell where a mesh lies.
    pub place: DVec3,
}

impl TriangleForm {
    /// For deltas of a mesh `template [V]`, in one piece. `smoothness` is the weight of the squared difference of
    /// neighbouring triangles' deformations beside the squared error of their edges (lambda of eq. 12), square metres.
    pub fn new(template: &[Vec3], topology: &Topology, smoothness: f64) -> Result<Self> {
        if !(smoothness > 0.0 && smoothness.is_finite()) {
            let remedy = "write more than 0: two edges do not tell how a triangle deforms along its normal";
            return Err(FitError::Config { field: "triangle_smoothness", value: smoothness.to_string(), remedy });
        }
        assert_eq!(template.len(), topology.vertex_count, "vertices of the template");
        let faces = topology.faces.clone();
        let edges: Vec<[DVec3; 2]> = faces
            .iter()
            .map(|f| {
                let [a, b, c] = f.map(|v| template[v as usize].as_dvec3());
                [b - a, c - a]
            })
            .collect();
        let factored = |n: usize, entries: Vec<(usize, usize, f64)>| {
            SparseCholesky::new(n, &entries).ok_or(FitError::Mesh {
                reason: "its triangles' edges do not hold it together: it needs to be one piece without empty triangles",
            })
        };
        let extraction = factored(3 * faces.len(), extraction_entries(&edges, &faces, smoothness))?;
        let stitching = factored(template.len(), stitching_entries(&faces))?;
        Ok(Self { faces, edges, vertices: template.len(), extraction, stitching })
    }

    /// Deformations of a frame of deltas `[V]` (eq. 12).
    pub fn gradients(&self, deltas: &[Vec3]) -> TriangleDeltas {
        assert_eq!(deltas.len(), self.vertices, "vertices of a frame");
        let n = 3 * self.faces.len();
        // A right side for each row of the D_t; its unknowns are the rows' entries, triangle after triangle.
        let mut sides = vec![0.0; 3 * n];
        for (t, (face, edges)) in self.faces.iter().zip(&self.edges).enumerate() {
            let [a, b, c] = face.map(|v| deltas[v as usize].as_dvec3());
            for (edge, change) in edges.iter().zip([b - a, c - a]) {
                for row in 0..3 {
                    for i in 0..3 {
                        sides[row * n + 3 * t + i] += change[row] * edge[i];
                    }
                }
            }
        }
        self.extraction.solve(&mut sides, 3);
        let row = |t: usize, row: usize| DVec3::from_slice(&sides[row * n + 3 * t..]);
        let gradient = |t| DMat3::from_cols(row(t, 0), row(t, 1), row(t, 2)).transpose();
        let place = deltas.iter().map(|d| d.as_dvec3()).sum::<DVec3>() / self.vertices.max(1) as f64;
        TriangleDeltas { gradients: (0..self.faces.len()).map(gradient).collect(), place }
    }

    /// The deltas `[V]` whose edges match the deformations best, each edge of each triangle alike (the stitching of
    /// eqs. 2 and 19).
    pub fn stitch(&self, deformed: &TriangleDeltas) -> Vec<Vec3> {
        assert_eq!(deformed.gradients.len(), self.faces.len(), "triangles of a frame");
        let n = self.vertices;
        let mut sides = vec![0.0; 3 * n];
        for ((face, edges), gradient) in self.faces.iter().zip(&self.edges).zip(&deformed.gradients) {
            for (end, edge) in face[1..].iter().zip(edges) {
                let change = *gradient * *edge;
                for axis in 0..3 {
                    sides[axis * n + *end as usize] += change[axis];
                    sides[axis * n + face[0] as usize] -= change[axis];
                }
            }
        }
        self.stitching.solve(&mut sides, 3);
        let at = |v: usize| DVec3::new(sides[v], sides[n + v], sides[2 * n + v]);
        let shift = deformed.place - (0..n).map(at).sum::<DVec3>() / n.max(1) as f64;
        (0..n).map(|v| (at(v) + shift).as_vec3()).collect()
    }

    /// Deltas through the triangle form and back: what of them is no smooth deformation, scanner noise above all, is
    /// taken off the more the larger the smoothness.
    pub fn round_trip(&self, deltas: &[Vec3]) -> Vec<Vec3> {
        self.stitch(&self.gradients(deltas))
    }
}

/// Lower triangle of the normal equations of eq. 12 for one row of the `D_t`.
fn extraction_entries(edges: &[[DVec3; 2]], faces: &[[u32; 3]], smoothness: f64) -> Vec<(usize, usize, f64)> {
    let mut entries = vec![];
    for (t, edges) in edges.iter().enumerate() {
        for i in 0..3 {
            for j in 0..=i {
                entries.push((3 * t + i, 3 * t + j, edges.iter().map(|e| e[i] * e[j]).sum()));
            }
        }
    }
    for (s, t) in neighbours(faces) {
        for i in 0..3 {
            entries.push((3 * s + i, 3 * s + i, smoothness));
            entries.push((3 * t + i, 3 * t + i, smoothness));
            entries.push((3 * t + i, 3 * s + i, -smoothness));
        }
    }
    entries
}

/// Lower triangle of the stitching's normal equations for one axis. The first vertex is held: edges do not see where
/// the mesh lies.
fn stitching_entries(faces: &[[u32; 3]]) -> Vec<(usize, usize, f64)> {
    let mut entries = vec![(0, 0, 1.0)];
    for face in faces {
        let a = face[0] as usize;
        for end in &face[1..] {
            let b = *end as usize;
            entries.extend([(a, a, 1.0), (b, b, 1.0), (a.max(b), a.min(b), -1.0)]);
        }
    }
    entries
}

/// Pairs of triangles with a common edge, the smaller index first, in order.
fn neighbours(faces: &[[u32; 3]]) -> Vec<(usize, usize)> {
    let mut of_edge: BTreeMap<(u32, u32), Vec<usize>> = BTreeMap::new();
    for (t, f) in faces.iter().enumerate() {
        for (a, b) in [(f[0], f[1]), (f[1], f[2]), (f[2], f[0])] {
            of_edge.entry((a.min(b), a.max(b))).or_default().push(t);
        }
    }
    of_edge.values().flat_map(|around| around.windows(2).map(|pair| (pair[0], pair[1]))).collect()
}
