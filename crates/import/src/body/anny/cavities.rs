use super::bones::{JOINTS, Rows};
use super::mesh::BaseMesh;
use super::source::Source;
use crate::Result;
use glam::{Vec2, Vec3};
use softtissue_body::UvAtlas;
use softtissue_geometry::Topology;
use std::collections::{BTreeMap, BTreeSet};

/// The joint that the face hangs from.
const HEAD: usize = 15;

/// The body without its inner cavities. They are charts of their own in the atlas: of the charts of the head all but the
/// largest. The rim of each is closed by a fan round a new vertex in its middle.
pub struct Cut {
    /// Which vertex of the base mesh each kept vertex is; then come the middles.
    pub kept: Vec<u32>,
    /// The rim of each cavity, kept vertices in order round it.
    pub rims: Vec<Vec<u32>>,
    /// Symmetry of kept vertices and middles, `[V]`.
    pub mirror: Vec<u32>,
    /// Quads of kept vertices.
    quads: Vec<[u32; 4]>,
    /// Triangles that close the rims.
    caps: Vec<[u32; 3]>,
    /// Texture coordinates of the quads' corners, then of the caps'.
    uv_quads: Vec<[u32; 4]>,
    /// Atlas; its faces are those of [`Cut::topology`].
    pub uv: UvAtlas,
    /// How each quad is split: along its first diagonal or its second.
    first_diagonal: Vec<bool>,
}

/// Cuts the cavities out.
pub fn cut(base: &BaseMesh, bones: &Rows, source: &Source) -> Result<Cut> {
    let refuse = |reason: &str| source.place("3dobjs/base.obj").refuse(format!("{reason}; get the package again"));
    let charts = charts(base);
    let mut heads: Vec<&Vec<usize>> = charts.iter().filter(|quads| is_of_head(base, bones, quads)).collect();
    heads.sort_by_key(|quads| std::cmp::Reverse(quads.len()));
    let removed: BTreeSet<usize> = heads.iter().skip(1).flat_map(|quads| quads.iter().copied()).collect();

    let stays: Vec<usize> = (0..base.quads.len()).filter(|q| !removed.contains(q)).collect();
    let kept: Vec<u32> = stays.iter().flat_map(|q| base.quads[*q]).collect::<BTreeSet<u32>>().into_iter().collect();
    let new_of: BTreeMap<u32, u32> = kept.iter().enumerate().map(|(new, old)| (*old, new as u32)).collect();
    let quads: Vec<[u32; 4]> = stays.iter().map(|q| base.quads[*q].map(|v| new_of[&v])).collect();
    let uv_quads: Vec<[u32; 4]> = stays.iter().map(|q| base.uv_quads[*q]).collect();
    let rims = rims(&quads).ok_or_else(|| refuse("its cavities have rims that cross"))?;

    let n = kept.len() as u32;
    let mut mirror = Vec::with_capacity(kept.len() + rims.len());
    for old in &kept {
        let other = new_of.get(&base.mirror[*old as usize]);
        mirror.push(*other.ok_or_else(|| refuse("its symmetry does not keep the cavities"))?);
    }
    for rim in &rims {
        let image: BTreeSet<u32> = rim.iter().map(|v| mirror[*v as usize]).collect();
        let other = rims.iter().position(|r| r.iter().copied().collect::<BTreeSet<u32>>() == image);
        mirror.push(n + other.ok_or_else(|| refuse("its symmetry does not keep the rims"))? as u32);
    }
    let caps = rims
        .iter()
        .enumerate()
        .flat_map(|(k, rim)| (0..rim.len()).map(move |i| [rim[i], rim[(i + 1) % rim.len()], n + k as u32]))
        .collect();
    let mut cut = Cut { kept, rims, mirror, quads, caps, uv_quads, uv: UvAtlas::default(), first_diagonal: vec![] };
    cut.split(&base.vertices);
    cut.lay_out(base);
    Ok(cut)
}

/// Quads of the body by chart: those that share corners of the atlas.
fn charts(base: &BaseMesh) -> Vec<Vec<usize>> {
    let mut parent: Vec<u32> = (0..base.coordinates.len() as u32).collect();
    fn root(parent: &mut [u32], mut i: u32) -> u32 {
        while parent[i as usize] != i {
            parent[i as usize] = parent[parent[i as usize] as usize];
            i = parent[i as usize];
        }
        i
    }
    for quad in &base.uv_quads {
        let first = root(&mut parent, quad[0]);
        for corner in &quad[1..] {
            let other = root(&mut parent, *corner);
            parent[other as usize] = first;
        }
    }
    let mut charts: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for (q, quad) in base.uv_quads.iter().enumerate() {
        charts.entry(root(&mut parent, quad[0])).or_default().push(q);
    }
    charts.into_values().collect()
}

/// Whether a chart hangs from the head.
fn is_of_head(base: &BaseMesh, bones: &Rows, quads: &[usize]) -> bool {
    let share: f32 = quads.iter().flat_map(|q| base.quads[*q]).map(|v| bones[v as usize][HEAD]).sum();
    share > 0.5 * 4.0 * quads.len() as f32
}

/// Closed walks along the edges that only one quad has, in the direction that a triangle on them needs; by their least
/// vertex. `None` where walks cross.
fn rims(quads: &[[u32; 4]]) -> Option<Vec<Vec<u32>>> {
    let edges: BTreeSet<(u32, u32)> = quads.iter().flat_map(|q| (0..4).map(move |c| (q[c], q[(c + 1) % 4]))).collect();
    let mut next = BTreeMap::new();
    for &(a, b) in edges.iter().filter(|(a, b)| !edges.contains(&(*b, *a))) {
        if next.insert(b, a).is_some() {
            return None;
        }
    }
    let mut rims = Vec::new();
    while let Some((&start, _)) = next.first_key_value() {
        let mut rim = vec![start];
        let mut at = next.remove(&start)?;
        while at != start {
            rim.push(at);
            at = next.remove(&at)?;
        }
        rims.push(rim);
    }
    Some(rims)
}

impl Cut {
    /// Vertices `V`.
    pub fn vertex_count(&self) -> usize {
        self.kept.len() + self.rims.len()
    }

    /// Somebody's vertices of the base mesh, cut: kept ones, then the middles of the rims.
    pub fn vertices(&self, whole: &[Vec3]) -> Vec<Vec3> {
        let mut vertices: Vec<Vec3> = self.kept.iter().map(|v| whole[*v as usize]).collect();
        for rim in &self.rims {
            vertices.push(rim.iter().map(|v| vertices[*v as usize]).sum::<Vec3>() / rim.len() as f32);
        }
        vertices
    }

    /// Skin weights `[V]`.
    pub fn weights(&self, bones: &Rows) -> Vec<[f32; JOINTS]> {
        let mut weights: Vec<[f32; JOINTS]> = self.kept.iter().map(|v| bones[*v as usize]).collect();
        for rim in &self.rims {
            let mean = |j: usize| rim.iter().map(|v| weights[*v as usize][j]).sum::<f32>() / rim.len() as f32;
            weights.push(std::array::from_fn(mean));
        }
        weights
    }

    /// Connectivity: each quad as two triangles, then the caps.
    pub fn topology(&self) -> Topology {
        let mut faces: Vec<[u32; 3]> = self.split_of(&self.quads);
        faces.extend(&self.caps);
        Topology { vertex_count: self.vertex_count(), faces, quads: self.quads.clone() }
    }

    fn split_of(&self, quads: &[[u32; 4]]) -> Vec<[u32; 3]> {
        let triangles = |([a, b, c, d], first): (&[u32; 4], &bool)| {
            if *first { [[*a, *b, *c], [*a, *c, *d]] } else { [[*a, *b, *d], [*b, *c, *d]] }
        };
        quads.iter().zip(&self.first_diagonal).flat_map(triangles).collect()
    }

    /// Splits each quad along its shorter diagonal, alike on both sides: the base mesh is symmetric to rounding only, so
    /// that lengths count in steps and ties go by an index that does not know left from right.
    fn split(&mut self, whole: &[Vec3]) {
        let vertices = self.vertices(whole);
        let neutral = |v: u32| v.min(self.mirror[v as usize]);
        let length = |a: u32, b: u32| (vertices[a as usize].distance(vertices[b as usize]) * 1e4).round();
        let first = |[a, b, c, d]: &[u32; 4]| {
            let (ac, bd) = (length(*a, *c), length(*b, *d));
            ac < bd || (ac == bd && neutral(*a).min(neutral(*c)) < neutral(*b).min(neutral(*d)))
        };
        self.first_diagonal = self.quads.iter().map(first).collect();
    }

    /// The atlas: coordinates of the base mesh that are still used, and the middle of each rim's.
    fn lay_out(&mut self, base: &BaseMesh) {
        let used: BTreeSet<u32> = self.uv_quads.iter().flatten().copied().collect();
        let new_of: BTreeMap<u32, u32> = used.iter().enumerate().map(|(new, old)| (*old, new as u32)).collect();
        let mut coordinates: Vec<Vec2> = used.iter().map(|t| base.coordinates[*t as usize]).collect();
        let uv_quads: Vec<[u32; 4]> = self.uv_quads.iter().map(|q| q.map(|t| new_of[&t])).collect();
        let mut corner_of: BTreeMap<u32, u32> = BTreeMap::new();
        for (quad, uv) in self.quads.iter().zip(&uv_quads) {
            for (v, t) in quad.iter().zip(uv) {
                corner_of.entry(*v).or_insert(*t);
            }
        }
        let mut faces = self.split_of(&uv_quads);
        for rim in &self.rims {
            let corners: Vec<u32> = rim.iter().map(|v| corner_of[v]).collect();
            let middle = corners.iter().map(|t| coordinates[*t as usize]).sum::<Vec2>() / corners.len() as f32;
            let at = coordinates.len() as u32;
            coordinates.push(middle);
            faces.extend((0..corners.len()).map(|i| [corners[i], corners[(i + 1) % corners.len()], at]));
        }
        self.uv = UvAtlas { coordinates, faces };
    }
}
