use crate::{Animation, ExportError, Result};
use softtissue_monitor::Monitor;
use softtissue_store::{StoreError, create_dir, write_atomic};
use std::path::{Path, PathBuf};

/// Writes a folder of one OBJ a frame, `frame_00000.obj` and so on: vertices in template order, metres, Y up, and the
/// triangles. Returns the paths. A folder that holds frames past the last one is refused, so that no
/// reader takes an older, longer sequence for this one.
pub fn write_obj_sequence(dir: &Path, animation: &Animation, monitor: &dyn Monitor) -> Result<Vec<PathBuf>> {
    animation.check()?;
    create_dir(dir)?;
    let frames = animation.vertices.len();
    let paths: Vec<PathBuf> = (0..frames).map(|t| dir.join(format!("frame_{t:05}.obj"))).collect();
    refuse_other_frames(dir, &paths)?;
    let faces: String =
        animation.topology.faces.iter().map(|f| format!("f {} {} {}\n", f[0] + 1, f[1] + 1, f[2] + 1)).collect();
    monitor.begin("OBJ sequence", frames as u64, "frames");
    for (path, frame) in paths.iter().zip(animation.vertices.iter()) {
        if monitor.should_stop() {
            return Err(ExportError::Stopped);
        }
        write_atomic(path, |w| {
            writeln!(w, "# {} at {} frames a second, metres, Y up", one_line(animation.name), animation.fps)?;
            // The shortest decimals that read back as the same f32.
            frame.iter().try_for_each(|p| writeln!(w, "v {} {} {}", p.x, p.y, p.z))?;
            w.write_all(faces.as_bytes())
        })?;
        monitor.advance(1, "");
    }
    monitor.end();
    Ok(paths)
}

fn refuse_other_frames(dir: &Path, paths: &[PathBuf]) -> Result<()> {
    let io = |e| StoreError::io("read", dir, e);
    for entry in std::fs::read_dir(dir).map_err(io)? {
        let path = entry.map_err(io)?.path();
        let name = path.file_name().and_then(|n| n.to_str()).unwrap_or_default();
        if name.starts_with("frame_") && name.ends_with(".obj") && !paths.contains(&path) {
            return Err(ExportError::Target {
                path: dir.to_owned(),
                reason: format!("it already holds {name}; choose another folder"),
            });
        }
    }
    Ok(())
}

fn one_line(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect()
}
