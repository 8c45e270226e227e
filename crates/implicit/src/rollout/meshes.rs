use super::{PredictedSurface, SurfacePredictor};
use crate::{HeightConfig, ImplicitError, Interpolation, MeshField};
use glam::Vec3;
use softtissue_geometry::{Mesh, Topology, vertex_normals};
use std::borrow::Cow;
use std::sync::Arc;

/// Predicts what is known as a mesh for every frame: a method of registered meshes, or heights drawn over the posed body.
pub struct MeshPredictor<F> {
    mesh_of: F,
    start: usize,
    mesh: Mesh,
}

impl<F: FnMut(usize, usize) -> Mesh> MeshPredictor<F> {
    /// `mesh_of` gives the mesh at a frame, the second number, of the rollout that began at the first.
    pub fn new(mesh_of: F) -> Self {
        let none = Topology { vertex_count: 0, faces: Vec::new(), quads: Vec::new() };
        Self { mesh_of, start: 0, mesh: Mesh::new(Vec::new(), Arc::new(none)) }
    }
}

impl<F: FnMut(usize, usize) -> Mesh> SurfacePredictor for MeshPredictor<F> {
    type Error = ImplicitError;

    fn restart(&mut self, start: usize) -> Result<(), ImplicitError> {
        self.start = start;
        Ok(())
    }

    fn predict(&mut self, t: usize) -> Result<Box<dyn PredictedSurface + '_>, ImplicitError> {
        self.mesh = (self.mesh_of)(self.start, t);
        Ok(Box::new(MeshField::new(&self.mesh)))
    }
}

impl PredictedSurface for MeshField<'_> {
    fn mesh(&self, _: &[Vec3]) -> Result<Cow<'_, Mesh>, ImplicitError> {
        Ok(Cow::Borrowed(self.source()))
    }
}

/// Heights over the observers, `[N]`, metres, as a surface on the body's own mesh: the vertices of the posed body, `[V]`,
/// moved along their normals by what `spread` makes of the heights. Where the surface is not met the body stays.
pub fn drawn_over(
    posed: &[Vec3],
    topology: &Topology,
    spread: &Interpolation,
    heights: &[f32],
    config: &HeightConfig,
) -> Vec<Vec3> {
    let met: Vec<f32> = heights.iter().map(|h| if *h > config.lowest { *h } else { 0.0 }).collect();
    let normals = vertex_normals(posed, &topology.faces);
    let spread = spread.apply(&met, 1);
    posed.iter().zip(&normals).zip(spread).map(|((p, n), h)| *p + *n * h).collect()
}
