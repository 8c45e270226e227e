use super::{PredictedSurface, SurfacePredictor};
use crate::{HeightConfig, ImplicitError, Interpolation, MeshField, SignedDistance};
use glam::Vec3;
use softtissue_geometry::{Mesh, Topology, vertex_normals};
use std::borrow::Cow;
use std::sync::Arc;

/// A surface that is known as a mesh.
#[derive(Clone, Debug)]
pub struct MeshFrame {
    /// The mesh, metres.
    pub mesh: Mesh,
    /// Its heights over all observers, `[N]`, metres, closed where it is not met. Of a mesh that was drawn from heights these:
    /// read off it again they would not all be the same, as where the body touches itself another part is met first.
    pub heights: Vec<f32>,
}

/// Predicts what is known as a mesh for every frame: a method of registered meshes, or heights drawn over the posed body.
pub struct MeshPredictor<F> {
    frame_of: F,
    start: usize,
    frame: MeshFrame,
}

impl<F: FnMut(usize, usize) -> MeshFrame> MeshPredictor<F> {
    /// `frame_of` gives the surface at a frame, the second number, of the rollout that began at the first.
    pub fn new(frame_of: F) -> Self {
        let none = Topology { vertex_count: 0, faces: Vec::new(), quads: Vec::new() };
        let frame = MeshFrame { mesh: Mesh::new(Vec::new(), Arc::new(none)), heights: Vec::new() };
        Self { frame_of, start: 0, frame }
    }
}

impl<F: FnMut(usize, usize) -> MeshFrame> SurfacePredictor for MeshPredictor<F> {
    type Error = ImplicitError;

    fn restart(&mut self, start: usize) -> Result<(), ImplicitError> {
        self.start = start;
        Ok(())
    }

    fn predict(&mut self, t: usize) -> Result<Box<dyn PredictedSurface + '_>, ImplicitError> {
        self.frame = (self.frame_of)(self.start, t);
        let MeshFrame { mesh, heights } = &self.frame;
        Ok(Box::new(KnownMesh { field: MeshField::new(mesh), heights }))
    }
}

/// A mesh's field, and what it was drawn from.
struct KnownMesh<'a> {
    field: MeshField<'a>,
    heights: &'a [f32],
}

impl SignedDistance for KnownMesh<'_> {
    fn values(&self, points: &[Vec3], out: &mut [f32]) {
        self.field.values(points, out);
    }
}

impl PredictedSurface for KnownMesh<'_> {
    fn mesh(&self, _: &[Vec3]) -> Result<Cow<'_, Mesh>, ImplicitError> {
        Ok(Cow::Borrowed(self.field.source()))
    }

    fn heights(&self) -> &[f32] {
        self.heights
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
