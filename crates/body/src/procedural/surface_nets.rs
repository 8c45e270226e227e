//! Surface nets (Gibson 1998) on a mirror-symmetric rectilinear grid: one vertex in each cell that the surface
//! crosses, one quad for each crossed grid edge. The middle cell column straddles `x = 0`, so that vertices are
//! either on the mirror plane or in exact pairs, and no quad is its own mirror image.

use super::implicit::Implicit;
use crate::{BodyError, Result};
use glam::Vec3;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// An all-quad closed mesh with its mirror permutation.
#[derive(Clone, Debug)]
pub struct QuadMesh {
    /// `[V]`.
    pub positions: Vec<Vec3>,
    /// Counter-clockwise from outside.
    pub quads: Vec<[u32; 4]>,
    /// `[V]`, an involution.
    pub mirror: Vec<u32>,
}

/// Node coordinates of a rectilinear grid; `x` is symmetric with an even count.
#[derive(Clone, Debug)]
pub struct Grid {
    /// Node planes along x.
    pub x: Vec<f32>,
    /// Node planes along y.
    pub y: Vec<f32>,
    /// Node planes along z.
    pub z: Vec<f32>,
}

/// Planes from `from` to beyond `to`, spaced by `spacing(at)`.
pub fn planes(from: f32, to: f32, spacing: impl Fn(f32) -> f32) -> Vec<f32> {
    let mut at = vec![from];
    let mut last = from;
    while last < to {
        last += spacing(last);
        at.push(last);
    }
    at
}

/// Symmetric planes from half a cell on each side of zero to beyond `to`.
pub fn symmetric_planes(to: f32, spacing: impl Fn(f32) -> f32) -> Vec<f32> {
    let right = planes(spacing(0.0) * 0.5, to, spacing);
    right.iter().rev().map(|x| -x).chain(right.iter().copied()).collect()
}

struct Field<'a> {
    grid: &'a Grid,
    size: [usize; 3],
    values: Vec<f32>,
    warp: &'a (dyn Fn(Vec3) -> Vec3 + Sync),
}

impl Field<'_> {
    fn index(&self, n: [usize; 3]) -> usize {
        (n[0] * self.size[1] + n[1]) * self.size[2] + n[2]
    }
    fn value(&self, n: [usize; 3]) -> f32 {
        self.values[self.index(n)]
    }
    fn inside(&self, n: [usize; 3]) -> bool {
        self.value(n) < 0.0
    }
    fn at(&self, n: [usize; 3]) -> Vec3 {
        let p = Vec3::new(self.grid.x[n[0]], self.grid.y[n[1]], self.grid.z[n[2]]);
        let q = (self.warp)(Vec3::new(p.x.abs(), p.y, p.z));
        Vec3::new(q.x.copysign(p.x), q.y, q.z)
    }
    fn fill(&mut self, n: [usize; 3]) {
        let mirrored = [self.size[0] - 1 - n[0], n[1], n[2]];
        for n in [n, mirrored] {
            let i = self.index(n);
            self.values[i] = -1e-3;
        }
    }
}

fn corner(cell: [usize; 3], c: usize) -> [usize; 3] {
    [cell[0] + (c & 1), cell[1] + (c >> 1 & 1), cell[2] + (c >> 2 & 1)]
}

/// Corners of the six faces of a cell, in order round the face.
const FACES: [[usize; 4]; 6] = [[0, 2, 6, 4], [1, 3, 7, 5], [0, 1, 5, 4], [2, 3, 7, 6], [0, 1, 3, 2], [4, 5, 7, 6]];

/// Fills outside nodes until no cell holds two sheets and no face a saddle, so that the net is a manifold.
fn resolve_saddles(field: &mut Field) -> Result<()> {
    for _ in 0..64 {
        let mut changed = false;
        for i in 0..field.size[0] - 1 {
            for j in 0..field.size[1] - 1 {
                for k in 0..field.size[2] - 1 {
                    changed |= resolve_cell(field, [i, j, k]);
                }
            }
        }
        if !changed {
            return Ok(());
        }
    }
    Err(BodyError::Generator("the surface net has saddles that do not resolve".into()))
}

fn resolve_cell(field: &mut Field, cell: [usize; 3]) -> bool {
    let inside: [bool; 8] = std::array::from_fn(|c| field.inside(corner(cell, c)));
    let count = inside.iter().filter(|x| **x).count();
    if count == 0 || count == 8 {
        return false;
    }
    let saddle = FACES
        .iter()
        .find(|f| inside[f[0]] == inside[f[2]] && inside[f[1]] == inside[f[3]] && inside[f[0]] != inside[f[1]]);
    let candidates: Vec<usize> = match saddle {
        Some(f) => f.iter().copied().filter(|c| !inside[*c]).collect(),
        // Without saddles, two sheets mean lone corners on a space diagonal.
        None if is_split(&inside) => (0..8).filter(|c| !inside[*c]).collect(),
        None => return false,
    };
    let nearest = candidates
        .into_iter()
        .min_by(|a, b| field.value(corner(cell, *a)).total_cmp(&field.value(corner(cell, *b))))
        .expect("a crossed cell has an outside corner");
    field.fill(corner(cell, nearest));
    true
}

/// Whether inside or outside corners fall apart under edge adjacency.
fn is_split(inside: &[bool; 8]) -> bool {
    [true, false].into_iter().any(|side| {
        let Some(start) = (0..8).find(|c| inside[*c] == side) else { return false };
        let mut seen = 1u8 << start;
        for _ in 0..8 {
            for c in 0..8 {
                if inside[c] == side && seen >> c & 1 == 0 && [1, 2, 4].iter().any(|b| seen >> (c ^ b) & 1 == 1) {
                    seen |= 1 << c;
                }
            }
        }
        (0..8).any(|c| inside[c] == side && seen >> c & 1 == 0)
    })
}

/// Extracts the surface of `implicit` on the grid warped by `warp`, a map of the half `x > 0` into itself. Only
/// nodes with `x > 0` are sampled; the rest is their mirror image.
pub fn surface_net(implicit: &Implicit, grid: &Grid, warp: &(dyn Fn(Vec3) -> Vec3 + Sync)) -> Result<QuadMesh> {
    let size = [grid.x.len(), grid.y.len(), grid.z.len()];
    if !size[0].is_multiple_of(2) || size.iter().any(|n| *n < 4) {
        return Err(BodyError::Generator(format!("a grid of {size:?} nodes has no middle column")));
    }
    let mut field = Field { grid, size, values: Vec::new(), warp };
    let sheets: Vec<Vec<f32>> = (0..size[0])
        .into_par_iter()
        .map(|i| {
            let i = i.max(size[0] - 1 - i);
            let nodes = (0..size[1]).flat_map(|j| (0..size[2]).map(move |k| [i, j, k]));
            nodes.map(|n| implicit.sample(field.at(n)).0).collect()
        })
        .collect();
    field.values = sheets.concat();
    resolve_saddles(&mut field)?;

    let mut vertex_of: BTreeMap<[usize; 3], u32> = BTreeMap::new();
    let mut positions = Vec::new();
    for i in 0..size[0] - 1 {
        for j in 0..size[1] - 1 {
            for k in 0..size[2] - 1 {
                if let Some(p) = cell_vertex(&field, [i, j, k]) {
                    vertex_of.insert([i, j, k], positions.len() as u32);
                    positions.push(p);
                }
            }
        }
    }
    let mut mirror = vec![0u32; positions.len()];
    for (cell, v) in &vertex_of {
        mirror[*v as usize] = vertex_of[&[size[0] - 2 - cell[0], cell[1], cell[2]]];
    }
    let quads = quads_of(&field, &vertex_of)?;
    Ok(QuadMesh { positions, quads, mirror })
}

fn cell_vertex(field: &Field, cell: [usize; 3]) -> Option<Vec3> {
    let mut sum = Vec3::ZERO;
    let mut count = 0;
    for c in 0..8 {
        for b in [1, 2, 4] {
            if c & b == 0 {
                let (p, q) = (corner(cell, c), corner(cell, c | b));
                let (f, g) = (field.value(p), field.value(q));
                if (f < 0.0) != (g < 0.0) {
                    sum += field.at(p).lerp(field.at(q), f / (f - g));
                    count += 1;
                }
            }
        }
    }
    (count > 0).then(|| sum / count as f32)
}

fn quads_of(field: &Field, vertex_of: &BTreeMap<[usize; 3], u32>) -> Result<Vec<[u32; 4]>> {
    let mut quads = Vec::new();
    for i in 0..field.size[0] {
        for j in 0..field.size[1] {
            for k in 0..field.size[2] {
                let n = [i, j, k];
                for axis in 0..3 {
                    let mut to = n;
                    to[axis] += 1;
                    if to[axis] >= field.size[axis] || field.inside(n) == field.inside(to) {
                        continue;
                    }
                    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                    if n[u] == 0 || n[v] == 0 || n[u] + 1 >= field.size[u] || n[v] + 1 >= field.size[v] {
                        return Err(BodyError::Generator("the surface touches the border of its grid".into()));
                    }
                    let cell = |du: usize, dv: usize| {
                        let mut c = n;
                        c[u] -= du;
                        c[v] -= dv;
                        vertex_of[&c]
                    };
                    let mut quad = [cell(1, 1), cell(0, 1), cell(0, 0), cell(1, 0)];
                    if !field.inside(n) {
                        quad.reverse();
                    }
                    quads.push(quad);
                }
            }
        }
    }
    Ok(quads)
}
