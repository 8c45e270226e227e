use crate::ObjFrame;
use glam::{DVec3, Vec3};
use softtissue_geometry::{Topology, signed_volume, vertex_normals};
use std::collections::HashSet;

/// One frame of a scan as its file has it: vertices in file order, so that correspondence survives.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FrameMesh {
    /// `[V]`, the file's units and axes.
    pub positions: Vec<Vec3>,
    /// `[V]` or empty where the file has none.
    pub normals: Vec<Vec3>,
    /// Polygons, 0-based; empty for a point cloud.
    pub faces: Vec<Vec<u32>>,
}

impl From<ObjFrame> for FrameMesh {
    fn from(frame: ObjFrame) -> Self {
        Self { positions: frame.positions, normals: vec![], faces: frame.faces }
    }
}

impl FrameMesh {
    /// Says which face names a vertex that is not there.
    pub(crate) fn check_faces(&self) -> Result<(), String> {
        let count = self.positions.len();
        let stray = |(f, corners): (usize, &Vec<u32>)| corners.iter().find(|i| **i as usize >= count).map(|i| (f, *i));
        match self.faces.iter().enumerate().find_map(stray) {
            Some((f, i)) => Err(format!("face {f}: it names vertex {i}, the last one is {}", count - 1)),
            None => Ok(()),
        }
    }

    /// The file's normals, or those of its faces, or none: `[V]` or empty. Indices must have been checked.
    pub(crate) fn normals_or_from_faces(&self) -> Vec<Vec3> {
        if !self.normals.is_empty() || self.faces.is_empty() {
            return self.normals.clone();
        }
        vertex_normals(&self.positions, &self.triangles())
    }

    /// Its polygons as fans of triangles.
    pub fn triangles(&self) -> Vec<[u32; 3]> {
        let fan = |c: &Vec<u32>| (1..c.len() - 1).map(|k| [c[0], c[k], c[k + 1]]).collect::<Vec<_>>();
        self.faces.iter().flat_map(fan).collect()
    }
}

/// What is odd about the faces of registered scans, of which only the vertices are used.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Oddities {
    /// Most faces are wound against the template's.
    pub flipped: bool,
    /// An edge that more than two faces share.
    pub crowded_edge: Option<[u32; 2]>,
}

/// Edges of a body are this many times as long as evenly spread vertices would have them at most; between vertices in
/// another order they cross the body.
const LONGEST_EDGE: f32 = 10.0;

/// The template that registered scans must match.
pub(crate) struct Template<'a> {
    pub topology: &'a Topology,
    /// Sorted.
    edges: Vec<[u32; 2]>,
    /// Triangles, their least vertex first.
    triangles: HashSet<[u32; 3]>,
}

impl<'a> Template<'a> {
    pub fn new(topology: &'a Topology) -> Self {
        let triangles = topology.faces.iter().map(|f| least_first(*f)).collect();
        Self { topology, edges: topology.edges(), triangles }
    }

    /// Says what is wrong with a vertex count.
    pub fn check_count(&self, count: usize) -> Result<(), String> {
        let wanted = self.topology.vertex_count;
        if count == wanted {
            return Ok(());
        }
        Err(format!(
            "{count} vertices, but the template has {wanted}: bring the body that it is registered to, or register it \
             anew (`softtissue import scans --register`)"
        ))
    }

    /// Says which polygon joins vertices that the template does not. Quads may be split along either diagonal, so
    /// polygons are compared by their border edges. What is odd but does no harm is given back.
    pub fn check_faces<'f>(&self, faces: impl Iterator<Item = &'f [u32]>) -> Result<Oddities, String> {
        let (mut with, mut against) = (0usize, 0usize);
        let mut borders = Vec::new();
        for (f, corners) in faces.enumerate() {
            let n = corners.len();
            let edges = (0..n).map(|k| [corners[k], corners[(k + 1) % n]]).map(|[a, b]| [a.min(b), a.max(b)]);
            let before = borders.len();
            borders.extend(edges);
            let foreign = borders[before..].iter().filter(|edge| self.edges.binary_search(edge).is_err()).count();
            if foreign > usize::from(n == 3) {
                return Err(format!(
                    "face {} joins vertices that the template does not: same count, other connectivity; export in the \
                     template's vertex order",
                    f + 1
                ));
            }
            let triples = (0..n).map(|k| [0, 1, 2].map(|i| corners[(k + i) % n]));
            for [a, b, c] in triples.take(if n == 3 { 1 } else { n }) {
                with += usize::from(self.triangles.contains(&least_first([a, b, c])));
                against += usize::from(self.triangles.contains(&least_first([a, c, b])));
            }
        }
        borders.sort_unstable();
        let crowded_edge = borders.windows(3).find(|w| w[0] == w[2]).map(|w| w[0]);
        Ok(Oddities { flipped: against > with, crowded_edge })
    }

    /// Says why a frame, metres and Y up, cannot be the template in another pose: inside out, or with vertices in another
    /// order, which only its edges tell where a file has no faces.
    pub fn check_shape(&self, points: &[Vec3]) -> Result<(), String> {
        let (low, high) = points.iter().fold((Vec3::MAX, Vec3::MIN), |(l, h), p| (l.min(*p), h.max(*p)));
        let [x, y, z] = (high - low).to_array();
        let even = (2.0 * (x * y + y * z + z * x) / points.len() as f32).sqrt();
        let length = |[a, b]: &[u32; 2]| points[*a as usize].distance(points[*b as usize]);
        let longest = self.edges.iter().max_by(|a, b| length(a).total_cmp(&length(b)));
        if let Some(edge) = longest.filter(|edge| length(edge) > LONGEST_EDGE * even) {
            let [a, b] = edge;
            return Err(format!(
                "vertices {a} and {b}, neighbours in the template, are {:.2} m apart: the vertices are in another order \
                 (export in the template's), or one strays (mend or drop the frame)",
                length(edge)
            ));
        }
        let middle = (low + high) / 2.0;
        let centred: Vec<Vec3> = points.iter().map(|p| *p - middle).collect();
        if signed_volume(&centred, &self.topology.faces) < 0.0 {
            return Err("the body is inside out: one axis is mirrored; export it again with right-handed axes".into());
        }
        Ok(())
    }
}

/// A triangle of the same winding that begins with its least vertex.
fn least_first([a, b, c]: [u32; 3]) -> [u32; 3] {
    if a <= b && a <= c {
        [a, b, c]
    } else if b <= c {
        [b, c, a]
    } else {
        [c, a, b]
    }
}

/// Turns normals round that look inwards on the whole, from the middle of the points; whether they did.
pub(crate) fn turn_outwards(points: &[Vec3], normals: &mut [Vec3]) -> bool {
    let middle = points.iter().map(|p| p.as_dvec3()).sum::<DVec3>() / points.len().max(1) as f64;
    let outwards: f64 = points.iter().zip(&*normals).map(|(p, n)| n.as_dvec3().dot(p.as_dvec3() - middle)).sum();
    let inwards = outwards < 0.0;
    if inwards {
        normals.iter_mut().for_each(|n| *n = -*n);
    }
    inwards
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A tetrahedron, outwards.
    fn tetrahedron() -> (Topology, Vec<Vec3>) {
        let faces = vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
        (Topology { vertex_count: 4, faces, quads: vec![] }, vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z])
    }

    #[test]
    fn odd_faces_are_told_from_foreign_ones() {
        let (topology, points) = tetrahedron();
        let template = Template::new(&topology);
        let look = |faces: &[[u32; 3]]| template.check_faces(faces.iter().map(|f| f.as_slice())).unwrap();
        assert_eq!(look(&topology.faces), Oddities::default());
        assert_eq!(look(&[[2, 1, 0], [3, 2, 1]]), Oddities { flipped: false, crowded_edge: None }, "one of each");
        let flipped: Vec<[u32; 3]> = topology.faces.iter().map(|[a, b, c]| [*b, *a, *c]).collect();
        assert_eq!(look(&flipped), Oddities { flipped: true, crowded_edge: None });
        let twice = [&topology.faces[..], &flipped[..1]].concat();
        assert_eq!(look(&twice).crowded_edge, Some([0, 1]));
        let mirrored: Vec<Vec3> = points.iter().map(|p| Vec3::new(-p.x, p.y, p.z)).collect();
        assert_eq!(template.check_shape(&points), Ok(()));
        assert!(template.check_shape(&mirrored).unwrap_err().contains("mirrored"));
    }

    #[test]
    fn normals_that_look_inwards_are_turned() {
        let (topology, points) = tetrahedron();
        let outwards = vertex_normals(&points, &topology.faces);
        let mut normals = outwards.clone();
        assert!(!turn_outwards(&points, &mut normals));
        normals.iter_mut().for_each(|n| *n = -*n);
        assert!(turn_outwards(&points, &mut normals));
        assert_eq!(normals, outwards);
    }
}
