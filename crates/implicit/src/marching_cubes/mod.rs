//! Meshes of the zero level of a field by marching cubes, from coarse cells to fine ones.

mod cases;
mod grid;
#[cfg(test)]
mod tests;

use crate::{ImplicitError, PointTree, Result, SignedDistance};
use cases::{EDGES, cases};
use glam::Vec3;
use grid::Grid;
use serde::{Deserialize, Serialize};
use softtissue_geometry::{Mesh, Topology};
use std::sync::Arc;

/// Where on an edge a vertex may lie, from either end: nearer to a corner triangles would lose their area.
const MARGIN: f32 = 1e-4;

/// How a field becomes a mesh.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MarchingCubes {
    /// Cells along the longest side of the box. Default 256 (AutoAvatar, sec. 4.1); half of it is four times as fast, and
    /// the surface is off by the square of a cell.
    pub resolution: usize,
    /// A coarse cell is opened if the field at its middle is at most this many times the half diagonal. 1 is enough where
    /// the field's gradient is at most 1, as that of a true distance; less may lose thin parts that hang together with
    /// nothing found, more costs values. Default 1.5.
    pub slack: f32,
}

impl Default for MarchingCubes {
    fn default() -> Self {
        Self { resolution: 256, slack: 1.5 }
    }
}

/// A surface that was found: closed, each edge in two triangles.
#[derive(Clone, Debug)]
pub struct SurfaceMesh {
    /// Outward triangles; none where the field is of one sign.
    pub mesh: Mesh,
    /// Unit gradients of the field at the vertices, `[V]`.
    pub normals: Vec<Vec3>,
}

impl MarchingCubes {
    /// The surface within the box from `low` to `high`, metres. What reaches the box's border is closed there.
    ///
    /// Starting from eight cells or more along the longest side, cells that may hold the surface are halved until they are
    /// as fine as asked; then whatever the surface runs into is opened too, so that a part found is found whole.
    ///
    /// # Errors
    /// An empty box or too many cells.
    pub fn surface(&self, field: &dyn SignedDistance, low: Vec3, high: Vec3) -> Result<SurfaceMesh> {
        Ok(with_normals(self.found(field, low, high, |_, _| true)?, field))
    }

    /// The surface that comes within `reach`, metres, of any of `points`, such as the vertices of a posed body: coarse cells
    /// farther away are not looked into.
    ///
    /// # Errors
    /// No point, or too many cells.
    pub fn surface_near(&self, field: &dyn SignedDistance, points: &[Vec3], reach: f32) -> Result<SurfaceMesh> {
        Ok(with_normals(self.found_near(field, points, reach)?, field))
    }

    /// [`surface_near`](Self::surface_near) without its normals, which take a few values of the field at every vertex.
    ///
    /// # Errors
    /// No point, or too many cells.
    pub fn mesh_near(&self, field: &dyn SignedDistance, points: &[Vec3], reach: f32) -> Result<Mesh> {
        Ok(self.found_near(field, points, reach)?.0)
    }

    /// A mesh and the size of its cells, metres.
    fn found_near(&self, field: &dyn SignedDistance, points: &[Vec3], reach: f32) -> Result<(Mesh, f32)> {
        let low = points.iter().copied().fold(Vec3::INFINITY, Vec3::min) - reach;
        let high = points.iter().copied().fold(Vec3::NEG_INFINITY, Vec3::max) + reach;
        let tree = PointTree::new(points);
        self.found(field, low, high, |middle, half_diagonal| {
            tree.nearest(&[middle], 1).distances.first().is_some_and(|d| *d <= reach + half_diagonal)
        })
    }

    fn found(
        &self,
        field: &dyn SignedDistance,
        low: Vec3,
        high: Vec3,
        wanted: impl Fn(Vec3, f32) -> bool,
    ) -> Result<(Mesh, f32)> {
        let longest = (high - low).max_element();
        let sound = longest.is_finite() && (high - low).min_element() > 0.0 && (4..=1024).contains(&self.resolution);
        let refused = ImplicitError::Grid { resolution: self.resolution, longest };
        let mut grid = sound.then(|| Grid::new(low, high, self.resolution)).flatten().ok_or(refused)?;
        let cells = grid.candidates(field, self.slack, wanted);
        let cells = grid.followed(field, cells);
        Ok((triangulated(&grid, &cells), grid.step()))
    }
}

fn with_normals((mesh, step): (Mesh, f32), field: &dyn SignedDistance) -> SurfaceMesh {
    let normals = field.normals(&mesh.positions, 0.25 * step);
    SurfaceMesh { mesh, normals }
}

/// The triangles of cells, ascending, with one vertex for each crossed edge of the grid.
fn triangulated(grid: &Grid, cells: &[usize]) -> Mesh {
    let mut corners: Vec<u64> = Vec::new();
    for &cell in cells {
        let pattern = grid.pattern(cell);
        for triangle in &cases()[usize::from(pattern)] {
            corners.extend(triangle.map(|e| {
                let (corner, axis) = EDGES[usize::from(e)];
                grid.corner(cell, corner) as u64 * 3 + axis as u64
            }));
        }
    }
    let mut edges = corners.clone();
    edges.sort_unstable();
    edges.dedup();
    let vertex = |edge: &u64| {
        let (corner, axis) = ((edge / 3) as usize, (edge % 3) as usize);
        let other = grid.beyond(corner, axis);
        let (a, b) = (grid.value(corner), grid.value(other));
        let share = (a / (a - b)).clamp(MARGIN, 1.0 - MARGIN);
        grid.position(corner).lerp(grid.position(other), share)
    };
    let positions: Vec<Vec3> = edges.iter().map(vertex).collect();
    let index = |edge: u64| edges.binary_search(&edge).unwrap_or_default() as u32;
    let faces = corners.as_chunks::<3>().0.iter().map(|t| t.map(index)).collect();
    let topology = Topology { vertex_count: positions.len(), faces, quads: Vec::new() };
    Mesh::new(positions, Arc::new(topology))
}
