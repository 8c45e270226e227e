use crate::{ExportError, Result};
use glam::Vec2;
use softtissue_geometry::{Frames, Topology};

/// A mesh that moves.
#[derive(Clone, Copy, Debug)]
pub struct Animation<'a> {
    /// What it is called in other programs.
    pub name: &'a str,
    /// Connectivity.
    pub topology: &'a Topology,
    /// Texture coordinates, where there are any.
    pub uv: Option<Uv<'a>>,
    /// Frames a second.
    pub fps: f32,
    /// Posed vertices `[T, V]`, metres, Y up.
    pub vertices: &'a Frames,
    /// Kept in the file for whoever opens it (provenance, licence, ...); null for nothing.
    pub extras: &'a serde_json::Value,
}

/// Texture coordinates with seams of their own.
#[derive(Clone, Copy, Debug)]
pub struct Uv<'a> {
    /// Coordinates in `[0, 1]^2`, origin at the lower left.
    pub coordinates: &'a [Vec2],
    /// `[F, 3]` into `coordinates`, corner for corner with the mesh's faces.
    pub faces: &'a [[u32; 3]],
}

/// Most numbers that an export holds in memory at once (2 GiB of f32).
const MOST_NUMBERS: usize = 1 << 29;

impl Animation<'_> {
    /// Refuses what no file can hold.
    pub(crate) fn check(&self) -> Result<()> {
        let fail = |reason: String| Err(ExportError::Animation { reason });
        let (v, t) = (self.topology.vertex_count, self.vertices.len());
        if t == 0 || v == 0 {
            return fail("it has no frame or no vertex".into());
        }
        if self.vertices.points_per_frame() != v {
            return fail(format!("its frames have {} vertices, its topology {v}", self.vertices.points_per_frame()));
        }
        if !(self.fps.is_finite() && self.fps > 0.0) {
            return fail(format!("its rate is {} frames a second, expected more than 0", self.fps));
        }
        if let Some(uv) = &self.uv {
            let (faces, has) = (self.topology.faces.len(), uv.coordinates.len());
            if uv.faces.len() != faces || uv.faces.as_flattened().iter().any(|&i| i as usize >= has) {
                return fail(format!("its texture coordinates do not belong to its {faces} faces; leave them out"));
            }
        }
        if let Err(e) = self.topology.check_indices() {
            return fail(format!("{e}; mend the mesh"));
        }
        if t.saturating_mul(3 * v) > MOST_NUMBERS {
            return fail(format!("{t} frames of {v} vertices need more than 2 GiB; export it in parts"));
        }
        match self.vertices.points().iter().position(|p| !p.is_finite()) {
            Some(i) => fail(format!("vertex {} of frame {} is {}", i % v, i / v, self.vertices.points()[i])),
            None => Ok(()),
        }
    }
}
