//! Moves the vertices of a fixed topology along the surfaces of figures: evening out, homotopy between figures.

use super::figure::Figure;
use super::skeleton::JOINTS;
use super::surface_nets::QuadMesh;
use glam::{Mat3, Quat, Vec3};
use rayon::prelude::*;
use softtissue_geometry::vertex_normals;

/// Neighbours along quad edges and the mirror permutation: what stays the same for every shape.
#[derive(Clone, Debug)]
pub struct Net {
    /// `[V]`.
    pub mirror: Vec<u32>,
    neighbours: Vec<Vec<u32>>,
    left: Vec<u32>,
}

impl Net {
    /// Of a mesh of quads.
    pub fn new(mesh: &QuadMesh) -> Self {
        Self::of_polygons(&mesh.quads, &mesh.mirror, &mesh.positions)
    }

    /// Of polygons of any number of corners. The left half is the one of larger x; the middle belongs to it.
    pub fn of_polygons<const N: usize>(polygons: &[[u32; N]], mirror: &[u32], positions: &[Vec3]) -> Self {
        let mut neighbours = vec![Vec::new(); positions.len()];
        for polygon in polygons {
            for c in 0..N {
                neighbours[polygon[c] as usize].push(polygon[(c + 1) % N]);
                neighbours[polygon[(c + 1) % N] as usize].push(polygon[c]);
            }
        }
        for n in &mut neighbours {
            n.sort_unstable();
            n.dedup();
        }
        // Of a pair on one side of x = 0, as a body that is not quite symmetric has, one is taken all the same.
        let rank = |v: u32| (positions[v as usize].x, v);
        let is_left = |v: &u32| mirror[*v as usize] == *v || rank(*v) > rank(mirror[*v as usize]);
        let left = (0..positions.len() as u32).filter(is_left).collect();
        Self { mirror: mirror.to_vec(), neighbours, left }
    }

    /// Vertices joined to `v` by a quad edge.
    pub fn neighbours(&self, v: usize) -> &[u32] {
        &self.neighbours[v]
    }
    /// Vertices on the left or on the middle plane.
    pub fn left(&self) -> &[u32] {
        &self.left
    }

    /// Computes the left half by `f` and sets the right half to its exact mirror image.
    fn update(&self, f: impl Fn(usize) -> Vec3 + Sync) -> Vec<Vec3> {
        let values: Vec<Vec3> = self.left.par_iter().with_min_len(64).map(|v| f(*v as usize)).collect();
        let mut out = vec![Vec3::ZERO; self.mirror.len()];
        for (v, mut p) in self.left.iter().zip(values) {
            let m = self.mirror[*v as usize];
            if m == *v {
                p.x = 0.0;
            }
            out[*v as usize] = p;
            out[m as usize] = Vec3::new(-p.x, p.y, p.z);
        }
        out
    }

    /// One round of plain smoothing, which takes the steps off a fresh net.
    pub fn smooth(&self, positions: &[Vec3]) -> Vec<Vec3> {
        self.update(|v| {
            let near = &self.neighbours[v];
            let mean = near.iter().map(|n| positions[*n as usize]).sum::<Vec3>() / near.len() as f32;
            positions[v].lerp(mean, 0.5)
        })
    }

    /// Moves every vertex along the mesh's own normal until it meets the surface. Inside a thin tip the nearest
    /// surface is the side, so Newton steps alone would dent the tip.
    pub fn march(&self, figure: &Figure, positions: &[Vec3], faces: &[[u32; 3]], steps: usize) -> Vec<Vec3> {
        let normals = vertex_normals(positions, faces);
        let marched = self.update(|v| {
            let mut p = positions[v];
            for _ in 0..steps {
                p -= normals[v] * figure.surface(p).sample(p).0.clamp(-0.01, 0.01);
            }
            p
        });
        self.project(figure, &marched, 2)
    }

    /// Projects every vertex onto the figure.
    pub fn project(&self, figure: &Figure, positions: &[Vec3], steps: usize) -> Vec<Vec3> {
        self.update(|v| figure.project(positions[v], steps))
    }

    /// Tangential smoothing of `positions - anchor` (of the positions themselves where `anchor` is none).
    pub fn relax(&self, figure: &Figure, positions: &[Vec3], anchor: Option<&[Vec3]>, rounds: usize) -> Vec<Vec3> {
        let mut positions = positions.to_vec();
        for _ in 0..rounds {
            let offset = |v: usize| positions[v] - anchor.map_or(Vec3::ZERO, |a| a[v]);
            positions = self.update(|v| {
                let near = &self.neighbours[v];
                let (mut mean, mut total) = (Vec3::ZERO, 0.0);
                for n in near {
                    // without an anchor vertices gather where the figure has detail
                    let weight = if anchor.is_none() { figure.detail(positions[*n as usize]) } else { 1.0 };
                    mean += offset(*n as usize) * weight;
                    total += weight;
                }
                mean /= total;
                let step = (mean - offset(v)) * 0.5;
                let n = figure.normal(positions[v]);
                figure.project(positions[v] + step - n * step.dot(n), 1)
            });
        }
        positions
    }
}

/// Moves a body's vertices with its bones from one figure to another: an affine map for each joint that carries
/// bone onto bone, blended by skin weights (`[V]` rows of 24).
pub fn carry(positions: &[Vec3], weights: &[[f32; JOINTS]], from: &Figure, to: &Figure) -> Vec<Vec3> {
    let maps: Vec<(Mat3, Vec3, Vec3)> = (0..JOINTS)
        .map(|j| {
            let girth = to.scale / from.scale;
            let linear = match bone_end(j) {
                Some(end) => {
                    let (a, b) = (from.joints[end] - from.joints[j], to.joints[end] - to.joints[j]);
                    let u = a.normalize();
                    let stretch = b.length() / a.length();
                    let along = Mat3::from_cols(u * u.x, u * u.y, u * u.z);
                    Mat3::from_quat(Quat::from_rotation_arc(u, b.normalize()))
                        * (Mat3::IDENTITY * girth + along * (stretch - girth))
                }
                None => Mat3::IDENTITY * girth,
            };
            (linear, from.joints[j], to.joints[j])
        })
        .collect();
    positions
        .iter()
        .zip(weights)
        .map(|(p, w)| {
            maps.iter().zip(w).filter(|(_, w)| **w > 0.0).map(|((m, a, b), w)| (*m * (*p - *a) + *b) * *w).sum()
        })
        .collect()
}

/// The joint at the far end of the bone that a joint turns.
pub fn bone_end(joint: usize) -> Option<usize> {
    [
        Some(3),
        Some(4),
        Some(5),
        Some(6),
        Some(7),
        Some(8),
        Some(9),
        Some(10),
        Some(11),
        Some(12),
        None,
        None,
        Some(15),
        Some(16),
        Some(17),
        None,
        Some(18),
        Some(19),
        Some(20),
        Some(21),
        Some(22),
        Some(23),
        None,
        None,
    ][joint]
}

/// The mesh of `figure` in the topology of the neutral mesh, by homotopy along the knobs in `stages` stages.
pub fn fit_figure(net: &Net, neutral: &[Vec3], weights: &[[f32; JOINTS]], figure: &Figure, stages: usize) -> Vec<Vec3> {
    let mut before = Figure::new(Default::default());
    let base = before.clone();
    let mut positions = neutral.to_vec();
    for stage in 1..=stages {
        let now = Figure::new(figure.parameters.scaled(stage as f32 / stages as f32));
        positions = net.project(&now, &carry(&positions, weights, &before, &now), 2);
        let anchor = carry(neutral, weights, &base, &now);
        positions = net.relax(&now, &positions, Some(&anchor), 5);
        before = now;
    }
    net.project(figure, &positions, 3)
}
