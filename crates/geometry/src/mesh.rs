use glam::Vec3;
use std::collections::HashMap;
use std::sync::Arc;

/// Connectivity without positions. Quads, where a mesh has them, are kept beside their triangles.
#[derive(Clone, Debug, PartialEq, Eq, Default)]
pub struct Topology {
    /// Vertices `V`.
    pub vertex_count: usize,
    /// Triangles `[F, 3]`, counter-clockwise seen from outside.
    pub faces: Vec<[u32; 3]>,
    /// Quads that the triangles were split from, if any: quad `q` is triangles `2q` and `2q + 1`.
    pub quads: Vec<[u32; 4]>,
}

/// What makes a list of triangles no closed manifold.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TopologyError {
    /// An index points past the last vertex.
    #[error("face {face} names vertex {index} of a mesh with {vertex_count}")]
    IndexOutOfRange {
        /// Which face.
        face: usize,
        /// The index.
        index: u32,
        /// Vertices there are.
        vertex_count: usize,
    },
    /// A face uses a vertex twice.
    #[error("face {face} uses a vertex twice")]
    Degenerate {
        /// Which face.
        face: usize,
    },
    /// A directed edge in more than one face, or without its opposite.
    #[error("the edge {from}-{to} does not lie between exactly two faces of the same winding")]
    EdgeNotManifold {
        /// First vertex.
        from: u32,
        /// Second vertex.
        to: u32,
    },
}

impl Topology {
    /// Checks indices and that no face is degenerate.
    pub fn check_indices(&self) -> Result<(), TopologyError> {
        for (face, f) in self.faces.iter().enumerate() {
            for &index in f {
                if index as usize >= self.vertex_count {
                    return Err(TopologyError::IndexOutOfRange { face, index, vertex_count: self.vertex_count });
                }
            }
            if f[0] == f[1] || f[1] == f[2] || f[2] == f[0] {
                return Err(TopologyError::Degenerate { face });
            }
        }
        Ok(())
    }

    /// Checks that the mesh is closed, edge-manifold and consistently wound; returns its genus
    /// by Euler's formula (for a connected mesh).
    pub fn check_closed_manifold(&self) -> Result<i64, TopologyError> {
        self.check_indices()?;
        let mut directed: HashMap<(u32, u32), u32> = HashMap::with_capacity(self.faces.len() * 3);
        for f in &self.faces {
            for k in 0..3 {
                *directed.entry((f[k], f[(k + 1) % 3])).or_default() += 1;
            }
        }
        for (&(from, to), &count) in &directed {
            if count != 1 || directed.get(&(to, from)) != Some(&1) {
                return Err(TopologyError::EdgeNotManifold { from, to });
            }
        }
        let euler = self.vertex_count as i64 - directed.len() as i64 / 2 + self.faces.len() as i64;
        Ok((2 - euler) / 2)
    }

    /// Undirected edges, each once, smaller index first, sorted.
    pub fn edges(&self) -> Vec<[u32; 2]> {
        let mut edges: Vec<[u32; 2]> = self
            .faces
            .iter()
            .flat_map(|f| [[f[0], f[1]], [f[1], f[2]], [f[2], f[0]]])
            .map(|[a, b]| [a.min(b), a.max(b)])
            .collect();
        edges.sort_unstable();
        edges.dedup();
        edges
    }

    /// A 64-bit FNV-1a of the counts and triangles, as 16 hexadecimal digits: names a topology in files.
    pub fn hash(&self) -> String {
        let mut h = 0xcbf2_9ce4_8422_2325u64;
        let mut eat = |x: u32| {
            for byte in x.to_le_bytes() {
                h = (h ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
            }
        };
        eat(self.vertex_count as u32);
        self.faces.iter().flatten().for_each(|&i| eat(i));
        format!("{h:016x}")
    }
}

/// Positions on a shared topology.
#[derive(Clone, Debug)]
pub struct Mesh {
    /// `[V]`, metres.
    pub positions: Vec<Vec3>,
    /// Connectivity.
    pub topology: Arc<Topology>,
}

impl Mesh {
    /// Joins positions and topology. Panics if the counts differ.
    pub fn new(positions: Vec<Vec3>, topology: Arc<Topology>) -> Self {
        assert_eq!(positions.len(), topology.vertex_count, "vertices of a mesh");
        Self { positions, topology }
    }
}

/// For each vertex the vertices it shares an edge with, and the faces it lies in (compressed rows).
#[derive(Clone, Debug)]
pub struct Adjacency {
    neighbour_start: Vec<u32>,
    neighbours: Vec<u32>,
    face_start: Vec<u32>,
    faces: Vec<u32>,
}

impl Adjacency {
    /// Builds both lists; neighbours are sorted.
    pub fn new(topology: &Topology) -> Self {
        let v = topology.vertex_count;
        let edges = topology.edges();
        let (neighbour_start, neighbours) = rows(v, edges.iter().flat_map(|&[a, b]| [(a, b), (b, a)]));
        let (face_start, faces) =
            rows(v, topology.faces.iter().enumerate().flat_map(|(f, t)| t.map(|i| (i, f as u32))));
        Self { neighbour_start, neighbours, face_start, faces }
    }
    /// Vertices joined to `v` by an edge.
    pub fn neighbours(&self, v: usize) -> &[u32] {
        &self.neighbours[self.neighbour_start[v] as usize..self.neighbour_start[v + 1] as usize]
    }
    /// Faces round `v`.
    pub fn faces(&self, v: usize) -> &[u32] {
        &self.faces[self.face_start[v] as usize..self.face_start[v + 1] as usize]
    }
}

fn rows(count: usize, pairs: impl Iterator<Item = (u32, u32)> + Clone) -> (Vec<u32>, Vec<u32>) {
    let mut start = vec![0u32; count + 1];
    for (row, _) in pairs.clone() {
        start[row as usize + 1] += 1;
    }
    for i in 0..count {
        start[i + 1] += start[i];
    }
    let mut at = start.clone();
    let mut items = vec![0u32; start[count] as usize];
    for (row, item) in pairs {
        items[at[row as usize] as usize] = item;
        at[row as usize] += 1;
    }
    for i in 0..count {
        items[start[i] as usize..start[i + 1] as usize].sort_unstable();
    }
    (start, items)
}

/// Unnormalised face normals (length = twice the area), `[F]`.
pub fn face_normals(positions: &[Vec3], faces: &[[u32; 3]]) -> Vec<Vec3> {
    faces
        .iter()
        .map(|f| {
            let [a, b, c] = f.map(|i| positions[i as usize]);
            (b - a).cross(c - a)
        })
        .collect()
}

/// Area-weighted unit vertex normals, `[V]`; zero where all faces are degenerate.
pub fn vertex_normals(positions: &[Vec3], faces: &[[u32; 3]]) -> Vec<Vec3> {
    let mut normals = vec![Vec3::ZERO; positions.len()];
    for (f, n) in faces.iter().zip(face_normals(positions, faces)) {
        for &i in f {
            normals[i as usize] += n;
        }
    }
    normals.iter_mut().for_each(|n| *n = n.normalize_or_zero());
    normals
}

/// Enclosed volume in cubic metres, by the divergence theorem; positive for outward faces. Summed in f64.
pub fn signed_volume(positions: &[Vec3], faces: &[[u32; 3]]) -> f64 {
    faces
        .iter()
        .map(|f| {
            let [a, b, c] = f.map(|i| positions[i as usize].as_dvec3());
            a.dot(b.cross(c)) / 6.0
        })
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    pub(crate) fn tetrahedron() -> Mesh {
        let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
        let faces = vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
        Mesh::new(positions, Arc::new(Topology { vertex_count: 4, faces, quads: vec![] }))
    }

    #[test]
    fn tetrahedron_is_closed_and_has_a_sixth_of_volume() {
        let m = tetrahedron();
        assert_eq!(m.topology.check_closed_manifold(), Ok(0));
        assert!((signed_volume(&m.positions, &m.topology.faces) - 1.0 / 6.0).abs() < 1e-12);
        let adjacency = Adjacency::new(&m.topology);
        assert_eq!(adjacency.neighbours(2), [0, 1, 3]);
        assert_eq!(adjacency.faces(3), [1, 2, 3]);
    }

    #[test]
    fn flipped_and_missing_faces_are_found() {
        let mut t = (*tetrahedron().topology).clone();
        t.faces[0] = [0, 1, 2];
        assert!(matches!(t.check_closed_manifold(), Err(TopologyError::EdgeNotManifold { .. })));
        t.faces[0] = [0, 2, 9];
        assert!(matches!(t.check_indices(), Err(TopologyError::IndexOutOfRange { index: 9, .. })));
    }
}
