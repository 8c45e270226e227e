//! What an animation is written as, told by the name of the file.

use crate::exit::UsageError;
use anyhow::Result;
use softtissue_body::BodyModel;
use softtissue_export::{
    Animation, GltfConfig, PointCache, Uv, write_gltf, write_obj_sequence, write_point_cache, write_usd,
};
use softtissue_geometry::Frames;
use softtissue_monitor::Monitor;
use std::path::Path;

/// Formats that `animate` writes, beside pictures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// `.glb` or `.gltf`.
    Gltf,
    /// `.usda`.
    Usd,
    /// `.pc2` or `.mdd`, with the mesh beside it.
    Cache(PointCache),
    /// A folder.
    ObjSequence,
}

impl Format {
    /// By the ending of `out`; without one, or with a slash at the end, it is a folder.
    pub fn of(out: &Path) -> Result<Self> {
        let ending = out.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
        let folder = ending.is_empty() || out.as_os_str().as_encoded_bytes().ends_with(b"/");
        Ok(match (ending.as_str(), PointCache::of(out)) {
            _ if folder => Self::ObjSequence,
            ("glb" | "gltf", _) => Self::Gltf,
            ("usda", _) => Self::Usd,
            (_, Some(kind)) => Self::Cache(kind),
            _ => {
                return Err(UsageError(format!(
                    "--out {}: nothing is written as .{ending}; end it in .glb, .gltf, .usda, .pc2, .mdd or .png, or in a \
                     slash for a folder of OBJ files",
                    out.display()
                ))
                .into());
            }
        })
    }

    /// Writes posed vertices `[T, V]`, metres, and returns what is to be said of it.
    #[expect(clippy::too_many_arguments, reason = "what is written, and where to")]
    pub fn write(
        self,
        out: &Path,
        name: &str,
        body: &BodyModel,
        extras: &serde_json::Value,
        vertices: &Frames,
        fps: f32,
        monitor: &dyn Monitor,
    ) -> Result<String> {
        let BodyModel { topology, uv, .. } = body;
        let uv = (!uv.faces.is_empty()).then_some(Uv { coordinates: &uv.coordinates, faces: &uv.faces });
        let animation = Animation { name, topology, uv, fps, vertices, extras };
        let (place, frames) = (out.display(), vertices.len());
        Ok(match self {
            Self::Gltf => {
                let report = write_gltf(out, &animation, &GltfConfig::default(), monitor)?;
                let (targets, error, size) = (report.targets, report.max_error_m * 1e3, report.bytes as f64 / 1e6);
                format!("{place}: {frames} frames, {targets} morph targets, at most {error:.2} mm off, {size:.1} MB")
            }
            Self::Usd => {
                write_usd(out, &animation, monitor)?;
                format!("{place}: {frames} frames")
            }
            Self::Cache(kind) => {
                let mesh = write_point_cache(out, kind, &animation, monitor)?;
                format!("{place}: {frames} frames that move {}", mesh.display())
            }
            Self::ObjSequence => {
                write_obj_sequence(out, &animation, monitor)?;
                format!("{place}: {frames} OBJ files")
            }
        })
    }
}
