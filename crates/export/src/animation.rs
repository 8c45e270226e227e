use crate::{ExportError, Result};
use softtissue_geometry::{Frames, Topology};

/// A mesh that moves.
#[derive(Clone, Copy, Debug)]
pub struct Animation<'a> {
    /// What it is called in other programs.
    pub name: &'a str,
    /// Connectivity.
    pub topology: &'a Topology,
    /// Frames a second.
    pub fps: f32,
    /// Posed vertices `[T, V]`, metres, Y up.
    pub vertices: &'a Frames,
    /// Kept in the file for whoever opens it (provenance, licence, ...); null for nothing.
    pub extras: &'a serde_json::Value,
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
