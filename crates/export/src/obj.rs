use crate::{Animation, ExportError, Result};
use glam::Vec3;
use softtissue_monitor::Monitor;
use softtissue_store::{StoreError, create_dir, write_atomic};
use std::path::{Path, PathBuf};

/// Writes a folder of one OBJ a frame, `frame_00000.obj` and so on: vertices in template order, metres, Y up, and the
/// triangles, with texture coordinates where there are any. Returns the paths. A folder that holds frames past the last one is refused, so that no
/// reader takes an older, longer sequence for this one.
pub fn write_obj_sequence(dir: &Path, animation: &Animation, monitor: &dyn Monitor) -> Result<Vec<PathBuf>> {
    animation.check()?;
    let frames = animation.vertices.len();
    let paths = ObjFolder::create(dir, frames)?.paths;
    let faces = faces(animation);
    monitor.begin("OBJ sequence", frames as u64, "frames");
    for (path, frame) in paths.iter().zip(animation.vertices.iter()) {
        if monitor.should_stop() {
            return Err(ExportError::Stopped);
        }
        write_frame(path, animation, frame, &faces)?;
        monitor.advance(1, "");
    }
    monitor.end();
    Ok(paths)
}

/// A folder of one OBJ a frame, whose meshes need not share a topology.
pub struct ObjFolder {
    paths: Vec<PathBuf>,
}

/// A mesh with normals, metres, Y up.
#[derive(Clone, Copy, Debug)]
pub struct SurfaceFrame<'a> {
    /// Whose surface, for the file's first line.
    pub name: &'a str,
    /// Frames a second.
    pub fps: f32,
    /// `[V]`.
    pub positions: &'a [Vec3],
    /// `[V]`, unit length.
    pub normals: &'a [Vec3],
    /// `[F, 3]`.
    pub faces: &'a [[u32; 3]],
}

impl ObjFolder {
    /// Takes a folder for `frames` files, `frame_00000.obj` and so on.
    ///
    /// # Errors
    /// The disk, or a folder that holds frames past the last one.
    pub fn create(dir: &Path, frames: usize) -> Result<Self> {
        create_dir(dir)?;
        let paths: Vec<PathBuf> = (0..frames).map(|t| dir.join(format!("frame_{t:05}.obj"))).collect();
        refuse_other_frames(dir, &paths)?;
        Ok(Self { paths })
    }

    /// Writes frame `t`.
    ///
    /// # Errors
    /// The disk, or a frame that the folder was not made for.
    pub fn write(&self, t: usize, frame: &SurfaceFrame) -> Result<()> {
        let Some(path) = self.paths.get(t) else {
            return Err(ExportError::Animation {
                reason: format!("frame {t} of a folder for {} frames", self.paths.len()),
            });
        };
        Ok(write_atomic(path, |w| {
            writeln!(w, "# {} at {} frames a second, metres, Y up", one_line(frame.name), frame.fps)?;
            frame.positions.iter().try_for_each(|p| writeln!(w, "v {} {} {}", p.x, p.y, p.z))?;
            frame.normals.iter().try_for_each(|n| writeln!(w, "vn {} {} {}", n.x, n.y, n.z))?;
            frame.faces.iter().try_for_each(|f| {
                let [a, b, c] = f.map(|i| i + 1);
                writeln!(w, "f {a}//{a} {b}//{b} {c}//{c}")
            })
        })?)
    }
}

/// The first frame as an OBJ file.
pub(crate) fn write_first_frame(path: &Path, animation: &Animation) -> Result<()> {
    write_frame(path, animation, animation.vertices.frame(0), &faces(animation))
}

fn write_frame(path: &Path, animation: &Animation, frame: &[Vec3], faces: &str) -> Result<()> {
    Ok(write_atomic(path, |w| {
        writeln!(w, "# {} at {} frames a second, metres, Y up", one_line(animation.name), animation.fps)?;
        // The shortest decimals that read back as the same f32.
        frame.iter().try_for_each(|p| writeln!(w, "v {} {} {}", p.x, p.y, p.z))?;
        w.write_all(faces.as_bytes())
    })?)
}

/// Texture coordinates and faces, the same in every frame.
fn faces(animation: &Animation) -> String {
    let faces = &animation.topology.faces;
    let mut text = String::new();
    let Some(uv) = &animation.uv else {
        faces.iter().for_each(|f| text += &format!("f {} {} {}\n", f[0] + 1, f[1] + 1, f[2] + 1));
        return text;
    };
    uv.coordinates.iter().for_each(|c| text += &format!("vt {} {}\n", c.x, c.y));
    for (f, t) in faces.iter().zip(uv.faces) {
        let [a, b, c] = [0, 1, 2].map(|i| format!("{}/{}", f[i] + 1, t[i] + 1));
        text += &format!("f {a} {b} {c}\n");
    }
    text
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
