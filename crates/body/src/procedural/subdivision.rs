use super::surface_nets::QuadMesh;
use glam::Vec3;
use std::collections::BTreeMap;

/// Catmull and Clark's (1978) rules as a sparse matrix: lifts a field on the `V` vertices of an all-quad mesh
/// of genus 0 to the `4V - 6` vertices of its subdivision. Rows are affine (they sum to one). The first `V`
/// vertices of the fine mesh belong to the coarse vertices, then one for each edge, then one for each quad.
#[derive(Clone, Debug, PartialEq)]
pub struct SubdivisionMap {
    coarse: usize,
    start: Vec<u32>,
    entries: Vec<(u32, f32)>,
}

impl SubdivisionMap {
    /// Vertices of the coarse mesh.
    pub fn coarse_count(&self) -> usize {
        self.coarse
    }
    /// Vertices of the fine mesh.
    pub fn fine_count(&self) -> usize {
        self.start.len() - 1
    }
    /// The (coarse vertex, weight) pairs of a fine vertex, ascending.
    pub fn row(&self, fine: usize) -> &[(u32, f32)] {
        &self.entries[self.start[fine] as usize..self.start[fine + 1] as usize]
    }
    /// A vector field on the fine mesh. Panics if `field` is not `[V]`.
    pub fn lift(&self, field: &[Vec3]) -> Vec<Vec3> {
        assert_eq!(field.len(), self.coarse, "vertices of the coarse mesh");
        (0..self.fine_count()).map(|v| self.row(v).iter().map(|(c, w)| field[*c as usize] * *w).sum()).collect()
    }
    /// A scalar field on the fine mesh. Panics if `field` is not `[V]`.
    pub fn lift_scalar(&self, field: &[f32]) -> Vec<f32> {
        assert_eq!(field.len(), self.coarse, "vertices of the coarse mesh");
        (0..self.fine_count()).map(|v| self.row(v).iter().map(|(c, w)| field[*c as usize] * *w).sum()).collect()
    }
}

struct Edge {
    index: usize,
    ends: [u32; 2],
    quads: Vec<usize>,
}

/// The subdivided mesh (positions lifted, mirror permutation carried over) and the map to it.
pub fn subdivide(mesh: &QuadMesh) -> (QuadMesh, SubdivisionMap) {
    let v = mesh.positions.len();
    let mut edges: BTreeMap<[u32; 2], Edge> = BTreeMap::new();
    let key = |a: u32, b: u32| [a.min(b), a.max(b)];
    for (q, quad) in mesh.quads.iter().enumerate() {
        for c in 0..4 {
            let ends = key(quad[c], quad[(c + 1) % 4]);
            let index = edges.len();
            edges.entry(ends).or_insert(Edge { index, ends, quads: vec![] }).quads.push(q);
        }
    }
    let edge_vertex = |a: u32, b: u32| (v + edges[&key(a, b)].index) as u32;
    let face_vertex = |q: usize| (v + edges.len() + q) as u32;

    let mut quads = Vec::with_capacity(mesh.quads.len() * 4);
    for (q, quad) in mesh.quads.iter().enumerate() {
        for c in 0..4 {
            let (before, at, after) = (quad[(c + 3) % 4], quad[c], quad[(c + 1) % 4]);
            quads.push([at, edge_vertex(at, after), face_vertex(q), edge_vertex(before, at)]);
        }
    }
    let map = rows(mesh, &edges);
    let mut mirror = mesh.mirror.clone();
    let mut ordered: Vec<&Edge> = edges.values().collect();
    ordered.sort_by_key(|e| e.index);
    mirror.extend(ordered.iter().map(|e| {
        let [a, b] = e.ends.map(|i| mesh.mirror[i as usize]);
        edge_vertex(a, b)
    }));
    let by_corners: BTreeMap<[u32; 4], usize> = mesh.quads.iter().enumerate().map(|(q, c)| (sorted(*c), q)).collect();
    mirror.extend(mesh.quads.iter().map(|c| face_vertex(by_corners[&sorted(c.map(|i| mesh.mirror[i as usize]))])));
    let positions = map.lift(&mesh.positions);
    (QuadMesh { positions, quads, mirror }, map)
}

fn sorted(mut corners: [u32; 4]) -> [u32; 4] {
    corners.sort_unstable();
    corners
}

fn rows(mesh: &QuadMesh, edges: &BTreeMap<[u32; 2], Edge>) -> SubdivisionMap {
    let v = mesh.positions.len();
    let mut around: Vec<(Vec<usize>, Vec<[u32; 2]>)> = vec![Default::default(); v];
    for (q, quad) in mesh.quads.iter().enumerate() {
        quad.iter().for_each(|i| around[*i as usize].0.push(q));
    }
    for e in edges.values() {
        e.ends.iter().for_each(|i| around[*i as usize].1.push(e.ends));
    }
    let mut map = SubdivisionMap { coarse: v, start: vec![0], entries: Vec::new() };
    let mut push = |row: BTreeMap<u32, f32>| {
        map.entries.extend(row);
        map.start.push(map.entries.len() as u32);
    };
    for (i, (faces, edges)) in around.iter().enumerate() {
        // Catmull-Clark: (F + 2 R + (n - 3) P) / n with F the mean face point and R the mean edge midpoint.
        let n = edges.len() as f32;
        let mut row = BTreeMap::from([(i as u32, (n - 3.0) / n)]);
        for q in faces {
            mesh.quads[*q].iter().for_each(|c| *row.entry(*c).or_default() += 1.0 / (4.0 * n * n));
        }
        for ends in edges {
            ends.iter().for_each(|c| *row.entry(*c).or_default() += 1.0 / (n * n));
        }
        push(row);
    }
    let mut ordered: Vec<&Edge> = edges.values().collect();
    ordered.sort_by_key(|e| e.index);
    for e in ordered {
        let mut row = BTreeMap::new();
        e.ends.iter().for_each(|c| *row.entry(*c).or_default() += 0.25);
        for q in &e.quads {
            mesh.quads[*q].iter().for_each(|c| *row.entry(*c).or_default() += 0.0625);
        }
        push(row);
    }
    for quad in &mesh.quads {
        push(quad.iter().map(|c| (*c, 0.25)).collect());
    }
    map
}
