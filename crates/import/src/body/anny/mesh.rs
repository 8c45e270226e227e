use super::source::Source;
use crate::Result;
use glam::{Vec2, Vec3};
use std::collections::BTreeMap;

/// Metres in a unit of the package's coordinates.
pub const METRES: f32 = 0.1;
/// More vertices than any base mesh has.
const VERTICES: usize = 100_000;

/// The base mesh: the body with its texture coordinates, and the helpers that joints are read from.
pub struct BaseMesh {
    /// All vertices, metres, Y up, facing +Z.
    pub vertices: Vec<Vec3>,
    /// Texture coordinates.
    pub coordinates: Vec<Vec2>,
    /// Quads of the body.
    pub quads: Vec<[u32; 4]>,
    /// The same corners in `coordinates`.
    pub uv_quads: Vec<[u32; 4]>,
    /// The vertex on the other side.
    pub mirror: Vec<u32>,
    /// Vertices of each helper cube `joint-NAME`, by NAME.
    pub cubes: BTreeMap<String, Vec<u32>>,
}

impl BaseMesh {
    /// Reads `base.obj` and the table of its symmetry.
    pub fn read(source: &Source) -> Result<Self> {
        const OBJ: &str = "3dobjs/base.obj";
        let bytes = source.read(OBJ)?;
        let text = String::from_utf8_lossy(&bytes);
        let mut reader = Reader::default();
        for (number, line) in text.lines().enumerate() {
            reader.line(line).map_err(|reason| source.place(OBJ).refuse(format!("line {}: {reason}", number + 1)))?;
        }
        let mut mesh = reader.mesh;
        let count = mesh.vertices.len() as u32;
        let inside = mesh.quads.iter().flatten().chain(mesh.cubes.values().flatten()).all(|v| *v < count)
            && mesh.uv_quads.iter().flatten().all(|t| (*t as usize) < mesh.coordinates.len());
        if mesh.quads.is_empty() || !inside {
            return Err(source
                .place(OBJ)
                .refuse("it has no group `body`, or faces past its last vertex; get the package again"));
        }
        for cube in mesh.cubes.values_mut() {
            cube.sort_unstable();
            cube.dedup();
        }
        mesh.mirror = read_mirror(source, count)?;
        Ok(mesh)
    }

    /// Middle of a helper cube of somebody with these vertices.
    pub fn cube(&self, vertices: &[Vec3], name: &str) -> Option<Vec3> {
        let cube = self.cubes.get(name).filter(|c| !c.is_empty())?;
        Some(cube.iter().map(|v| vertices[*v as usize]).sum::<Vec3>() / cube.len() as f32)
    }

    /// Lowest and highest point of somebody's body, metres.
    pub fn body_extent(&self, vertices: &[Vec3]) -> (f32, f32) {
        let heights = self.quads.iter().flatten().map(|v| vertices[*v as usize].y);
        heights.fold((f32::MAX, f32::MIN), |(low, high), y| (low.min(y), high.max(y)))
    }

    /// Volume of somebody's body with its cavities, cubic metres.
    #[cfg(test)]
    pub fn body_volume(&self, vertices: &[Vec3]) -> f64 {
        let at = |v: u32| vertices[v as usize].as_dvec3();
        let tetrahedron = |a: glam::DVec3, b: glam::DVec3, c: glam::DVec3| a.cross(b).dot(c) / 6.0;
        let quad = |q: &[u32; 4]| {
            let [a, b, c, d] = q.map(at);
            tetrahedron(a, b, c) + tetrahedron(a, c, d)
        };
        self.quads.iter().map(quad).sum()
    }
}

/// `mesh_metadata/hm08.mirror`: a vertex, its partner, and on which side it lies.
fn read_mirror(source: &Source, count: u32) -> Result<Vec<u32>> {
    const TABLE: &str = "mesh_metadata/hm08.mirror";
    let refuse = |reason: &str| source.place(TABLE).refuse(format!("{reason}; get the package again"));
    let bytes = source.read(TABLE)?;
    let text = String::from_utf8_lossy(&bytes);
    let mut mirror: Vec<u32> = (0..count).collect();
    for line in text.lines() {
        let mut words = line.split_whitespace().map(str::parse::<u32>);
        let (Some(Ok(a)), Some(Ok(b))) = (words.next(), words.next()) else { continue };
        if a >= count || b >= count {
            return Err(refuse("it names a vertex past the last"));
        }
        mirror[a as usize] = b;
    }
    if (0..count).any(|v| mirror[mirror[v as usize] as usize] != v) {
        return Err(refuse("its symmetry does not lead back"));
    }
    Ok(mirror)
}

#[derive(Default)]
struct Reader {
    mesh: BaseMesh,
    group: String,
}

impl Default for BaseMesh {
    fn default() -> Self {
        let (vertices, coordinates, quads) = (Vec::new(), Vec::new(), Vec::new());
        Self { vertices, coordinates, quads, uv_quads: Vec::new(), mirror: Vec::new(), cubes: BTreeMap::new() }
    }
}

impl Reader {
    fn line(&mut self, line: &str) -> std::result::Result<(), String> {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => {
                let [x, y, z] = numbers(words)?;
                self.mesh.vertices.push(Vec3::new(x, y, z) * METRES);
            }
            Some("vt") => {
                let [u, v] = numbers(words)?;
                self.mesh.coordinates.push(Vec2::new(u, v).clamp(Vec2::ZERO, Vec2::ONE));
            }
            Some("g") => self.group = words.next().unwrap_or_default().to_owned(),
            Some("f") => self.face(words)?,
            _ => {}
        }
        if self.mesh.vertices.len().max(self.mesh.coordinates.len()).max(self.mesh.quads.len()) > VERTICES {
            return Err(format!("more than {VERTICES} vertices or faces"));
        }
        Ok(())
    }

    fn face<'a>(&mut self, words: impl Iterator<Item = &'a str>) -> std::result::Result<(), String> {
        let index = |word: Option<&str>| word?.parse::<u32>().ok()?.checked_sub(1);
        let corner = |word: &str| {
            let mut parts = word.split('/');
            Some((index(parts.next())?, index(parts.next()).unwrap_or(0)))
        };
        let corners: Option<Vec<(u32, u32)>> = words.map(corner).collect();
        let corners = corners.ok_or("a face corner that is no index")?;
        if let Some(joint) = self.group.strip_prefix("joint-") {
            let cube = self.mesh.cubes.entry(joint.to_owned()).or_default();
            cube.extend(corners.iter().map(|c| c.0));
        } else if self.group == "body" {
            let quad: [(u32, u32); 4] = corners.try_into().map_err(|_| "a face of the body that is no quad")?;
            self.mesh.quads.push(quad.map(|c| c.0));
            self.mesh.uv_quads.push(quad.map(|c| c.1));
        }
        Ok(())
    }
}

fn numbers<'a, const N: usize>(words: impl Iterator<Item = &'a str>) -> std::result::Result<[f32; N], String> {
    let numbers: Vec<f32> = words.take(N).filter_map(|w| w.parse().ok()).filter(|x: &f32| x.is_finite()).collect();
    numbers.try_into().map_err(|_| format!("expected {N} numbers"))
}
