use crate::{ImportError, Result};
use glam::Vec3;
use softtissue_geometry::{Mesh, Topology};
use softtissue_store::read_limited;
use std::path::Path;
use std::sync::Arc;

/// What an importer is willing to accept.
#[derive(Clone, Copy, Debug)]
pub struct ImportLimits {
    /// Bytes of one file. Default 256 MiB.
    pub file_bytes: u64,
    /// Vertices of one mesh. Default one million.
    pub vertices: usize,
    /// Faces of one mesh. Default four million.
    pub faces: usize,
    /// Corners of one face. Default 64.
    pub face_corners: usize,
    /// Frames of one sequence. Default 100,000.
    pub frames: usize,
    /// Points of one clip, frames times vertices. Default 16 million.
    pub clip_points: usize,
}

impl Default for ImportLimits {
    fn default() -> Self {
        Self {
            file_bytes: 256 << 20,
            vertices: 1_000_000,
            faces: 4_000_000,
            face_corners: 64,
            frames: 100_000,
            clip_points: 16_000_000,
        }
    }
}

/// A mesh with its vertices in file order: correspondence between frames survives.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct ObjFrame {
    /// Vertices in the order of their `v` lines.
    pub positions: Vec<Vec3>,
    /// Colours of the vertices, red, green and blue from 0 to 1, where every `v` line has them (`v x y z r g b`);
    /// otherwise empty.
    pub colors: Vec<Vec3>,
    /// Polygons, 0-based.
    pub faces: Vec<Vec<u32>>,
}

/// Reads the `v` and `f` lines of an OBJ file and nothing else, in file order. No material file is opened.
pub fn read_obj_frame(path: &Path, limits: &ImportLimits) -> Result<ObjFrame> {
    let bytes = read_limited(path, limits.file_bytes)?;
    // a byte order mark must not hide the first vertex
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&bytes);
    let mut frame = ObjFrame::default();
    let mut reader = Lines { path, limits, frame: &mut frame };
    for (n, line) in bytes.split(|b| *b == b'\n').enumerate() {
        reader.line(n + 1, line.trim_ascii())?;
    }
    if frame.positions.is_empty() {
        return Err(ImportError::file(path, "it holds no vertex (`v x y z`); is it a Wavefront OBJ file?"));
    }
    let count = frame.positions.len();
    if frame.colors.len() != count {
        frame.colors.clear();
    }
    if let Some((f, i)) =
        frame.faces.iter().enumerate().find_map(|(f, c)| c.iter().find(|i| **i as usize >= count).map(|i| (f, *i)))
    {
        return Err(ImportError::file(
            path,
            format!("face {} names vertex {} of {count}; export the mesh again", f + 1, i + 1),
        ));
    }
    Ok(frame)
}

struct Lines<'a> {
    path: &'a Path,
    limits: &'a ImportLimits,
    frame: &'a mut ObjFrame,
}

impl Lines<'_> {
    fn line(&mut self, number: usize, line: &[u8]) -> Result<()> {
        let (keyword, rest) = match line.iter().position(u8::is_ascii_whitespace) {
            Some(at) => line.split_at(at),
            None => (line, &[][..]),
        };
        let outcome = match keyword {
            b"v" => self.vertex(rest),
            b"f" => self.face(rest),
            _ => Ok(()),
        };
        outcome.map_err(|reason| ImportError::Line { path: self.path.to_owned(), line: number, reason })
    }

    fn vertex(&mut self, rest: &[u8]) -> std::result::Result<(), String> {
        if self.frame.positions.len() == self.limits.vertices {
            return Err(format!("more than {} vertices", self.limits.vertices));
        }
        let mut xyz = [0.0f32; 3];
        let mut words = words(rest);
        for x in &mut xyz {
            let word = words.next().ok_or("a vertex needs three numbers")?;
            let number = std::str::from_utf8(word).ok().and_then(|w| w.parse().ok());
            *x = number.ok_or_else(|| format!("{:?} is no number (write decimals with a point)", text(word)))?;
            if !x.is_finite() {
                return Err(format!("the coordinate {} is not finite; mend or drop the frame", text(word)));
            }
        }
        self.frame.positions.push(Vec3::from_array(xyz));
        let colors: Vec<f32> = words.take(3).map_while(|w| std::str::from_utf8(w).ok()?.parse().ok()).collect();
        // One more number is a weight (`v x y z w`), not a colour.
        if let [r, g, b] = colors[..] {
            self.frame.colors.push(Vec3::new(r, g, b));
        }
        Ok(())
    }

    fn face(&mut self, rest: &[u8]) -> std::result::Result<(), String> {
        if self.frame.faces.len() == self.limits.faces {
            return Err(format!("more than {} faces", self.limits.faces));
        }
        let mut corners = Vec::with_capacity(4);
        for word in words(rest) {
            if corners.len() == self.limits.face_corners {
                return Err(format!("a face of more than {} corners", self.limits.face_corners));
            }
            let vertex = word.split(|b| *b == b'/').next().and_then(|w| std::str::from_utf8(w).ok());
            let index: i64 =
                vertex.and_then(|w| w.parse().ok()).ok_or_else(|| format!("{:?} is no face corner", text(word)))?;
            let resolved =
                if index < 0 { (self.frame.positions.len() as i64).saturating_add(index) } else { index - 1 };
            match u32::try_from(resolved) {
                Ok(i) => corners.push(i),
                Err(_) => {
                    return Err(format!(
                        "the vertex index {index} points outside the mesh (indices count from 1, or from -1 backwards)"
                    ));
                }
            }
        }
        if corners.len() < 3 {
            return Err("a face needs at least three corners".into());
        }
        self.frame.faces.push(corners);
        Ok(())
    }
}

fn words(rest: &[u8]) -> impl Iterator<Item = &[u8]> {
    rest.split(u8::is_ascii_whitespace).filter(|w| !w.is_empty())
}

/// At most 40 bytes of a word, for messages.
fn text(word: &[u8]) -> std::borrow::Cow<'_, str> {
    String::from_utf8_lossy(&word[..word.len().min(40)])
}

/// Reads a general OBJ mesh through `tobj`: vertices may be reordered, materials are never opened.
pub fn read_mesh(path: &Path, limits: &ImportLimits) -> Result<Mesh> {
    let bytes = read_limited(path, limits.file_bytes)?;
    let options = tobj::LoadOptions { triangulate: true, single_index: true, ..Default::default() };
    let (models, _) = tobj::load_obj_buf(&mut bytes.as_slice(), &options, |_| Err(tobj::LoadError::GenericFailure))
        .map_err(|e| ImportError::file(path, format!("{e}; is it a Wavefront OBJ file?")))?;
    let mut positions = Vec::new();
    let mut faces = Vec::new();
    for model in models {
        let base = positions.len() as u32;
        positions.extend(model.mesh.positions.as_chunks::<3>().0.iter().map(|p| Vec3::from_array(*p)));
        faces.extend(model.mesh.indices.as_chunks::<3>().0.iter().map(|f| f.map(|i| i + base)));
    }
    if positions.is_empty() || positions.len() > limits.vertices || faces.len() > limits.faces {
        return Err(ImportError::file(
            path,
            format!("{} vertices and {} faces are not between one and the limits", positions.len(), faces.len()),
        ));
    }
    if let Some(v) = positions.iter().position(|p| !p.is_finite()) {
        return Err(ImportError::file(path, format!("vertex {} is not finite; mend the mesh", v + 1)));
    }
    let topology = Topology { vertex_count: positions.len(), faces, quads: vec![] };
    Ok(Mesh::new(positions, Arc::new(topology)))
}
