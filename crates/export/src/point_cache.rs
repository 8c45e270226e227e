use crate::obj::write_first_frame;
use crate::{Animation, ExportError, Result};
use softtissue_monitor::Monitor;
use softtissue_store::write_atomic;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Kinds of point caches.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PointCache {
    /// PC2 (3ds Max, Blender, Cinema 4D): little-endian, a header of 32 bytes, one sample a frame.
    Pc2,
    /// MDD (LightWave, Blender, Houdini): big-endian, the times of all frames in seconds, then the frames.
    Mdd,
}

impl PointCache {
    /// The kind that a file name ends in.
    pub fn of(path: &Path) -> Option<Self> {
        match path.extension()?.to_str()?.to_ascii_lowercase().as_str() {
            "pc2" => Some(Self::Pc2),
            "mdd" => Some(Self::Mdd),
            _ => None,
        }
    }

    fn header(self, animation: &Animation, w: &mut dyn Write) -> std::io::Result<()> {
        // `Animation::check` bounds both far below what these fields hold.
        let (points, frames) = (animation.topology.vertex_count as i32, animation.vertices.len() as i32);
        match self {
            Self::Pc2 => {
                w.write_all(b"POINTCACHE2\0")?;
                w.write_all(&1i32.to_le_bytes())?;
                w.write_all(&points.to_le_bytes())?;
                // start frame, frames a sample
                w.write_all(&0f32.to_le_bytes())?;
                w.write_all(&1f32.to_le_bytes())?;
                w.write_all(&frames.to_le_bytes())
            }
            Self::Mdd => {
                w.write_all(&frames.to_be_bytes())?;
                w.write_all(&points.to_be_bytes())?;
                (0..frames).try_for_each(|t| w.write_all(&(t as f32 / animation.fps).to_be_bytes()))
            }
        }
    }
}

/// Writes a point cache, vertices in metres, Y up, and beside it, under the same name with `.obj`, the first frame as the
/// mesh that the cache moves: a cache holds no faces. Returns the mesh's path. PC2 does not tell the frame rate; its
/// samples are frames of the scene.
pub fn write_point_cache(
    path: &Path,
    kind: PointCache,
    animation: &Animation,
    monitor: &dyn Monitor,
) -> Result<PathBuf> {
    animation.check()?;
    monitor.begin("point cache", animation.vertices.len() as u64, "frames");
    let mut stopped = false;
    let written = write_atomic(path, |w| {
        kind.header(animation, w)?;
        for frame in animation.vertices.iter() {
            if monitor.should_stop() {
                stopped = true;
                return Err(std::io::ErrorKind::Interrupted.into());
            }
            let bytes: Vec<u8> = match kind {
                PointCache::Pc2 => frame.iter().flat_map(|p| p.to_array()).flat_map(f32::to_le_bytes).collect(),
                PointCache::Mdd => frame.iter().flat_map(|p| p.to_array()).flat_map(f32::to_be_bytes).collect(),
            };
            w.write_all(&bytes)?;
            monitor.advance(1, "");
        }
        Ok(())
    });
    if stopped {
        return Err(ExportError::Stopped);
    }
    written?;
    monitor.end();
    let mesh = path.with_extension("obj");
    write_first_frame(&mesh, animation)?;
    Ok(mesh)
}
