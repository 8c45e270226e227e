use crate::{ImplicitError, Interpolation, PointTree, Result};
use glam::{Vec2, Vec3};
use softtissue_body::UvAtlas;
use softtissue_geometry::{Topology, closest_on_triangle};
use std::collections::BTreeMap;

/// How far outside a triangle the centre of a texel may lie that draws from it, texels: what bilinear sampling at the
/// border of a chart touches.
const GUTTER: f32 = 1.5;
/// A texel this near to a triangle, squared texels, counts as inside: rounding.
const INSIDE: f32 = 1e-8;

/// The body's texture as a picture of `size x size` texels: what each draws from the vertices, and what each vertex
/// samples.
///
/// The texel of column `c` and row `r` is number `r * size + c` and has its centre at `u = (c + 0.5) / size`,
/// `v = (r + 0.5) / size`. Inside a chart it takes the barycentric mean of its triangle, in the gutter the value at the
/// closest point of the nearest triangle, anywhere else that of the nearest texel of these, so that no texel is empty.
/// Vertices on a seam lie in several charts; they sample the one that holds most of their faces. Of the four texels round
/// its place a vertex takes those of its own chart, so that charts that lie close together do not mix.
#[derive(Clone, Debug)]
pub struct Atlas {
    covered: Vec<bool>,
    texels_from_vertices: Interpolation,
    vertices_from_texels: Interpolation,
}

/// What a texel draws from.
#[derive(Clone, Copy)]
struct Source {
    /// From the triangle, squared texels.
    distance: f32,
    face: u32,
    weights: [f32; 3],
}

impl Atlas {
    /// Lays out the texture of a body in `size x size` texels.
    ///
    /// # Errors
    /// A body without texture coordinates, a size outside 4 to 4096.
    pub fn new(topology: &Topology, uv: &UvAtlas, size: usize) -> Result<Self> {
        if uv.faces.is_empty() || uv.faces.len() != topology.faces.len() {
            return Err(ImplicitError::NoTexture { faces: topology.faces.len() });
        }
        if !(4..=4096).contains(&size) {
            return Err(ImplicitError::AtlasSize { size });
        }
        // in texels, so that the centre of a texel is at its column and row
        let places: Vec<Vec2> = uv.coordinates.iter().map(|c| *c * size as f32 - 0.5).collect();
        let mut sources = rasterised(&places, &uv.faces, size);
        let covered = sources.iter().map(|s| s.is_some_and(|s| s.distance < INSIDE)).collect();
        pad(&mut sources, size);
        let sources: Vec<Source> = sources.into_iter().flatten().collect();
        if sources.len() != size * size {
            return Err(ImplicitError::NoTexture { faces: topology.faces.len() });
        }
        let row = |s: &Source| topology.faces[s.face as usize].into_iter().zip(s.weights).collect();
        let texels_from_vertices = Interpolation::from_rows(topology.vertex_count, sources.iter().map(row).collect());
        let charts = charts(uv);
        let texel_charts: Vec<u32> = sources.iter().map(|s| charts[uv.faces[s.face as usize][0] as usize]).collect();
        let rows = sample_places(topology, uv).into_iter().map(|place| match place {
            Some(place) => samples(places[place as usize], charts[place as usize], &texel_charts, size),
            // a vertex of no face has no place
            None => vec![(0, 1.0)],
        });
        let vertices_from_texels = Interpolation::from_rows(size * size, rows.collect());
        Ok(Self { covered, texels_from_vertices, vertices_from_texels })
    }

    /// Which texels have their centre in a triangle, `[size * size]`.
    pub fn covered(&self) -> &[bool] {
        &self.covered
    }
    /// Scatter: `size * size` rows of `V` sources, three a row.
    pub fn texels_from_vertices(&self) -> &Interpolation {
        &self.texels_from_vertices
    }
    /// Gather: `V` rows of `size * size` sources, four a row.
    pub fn vertices_from_texels(&self) -> &Interpolation {
        &self.vertices_from_texels
    }
}

/// The nearest triangle within [`GUTTER`] of each texel; of equally near ones the first.
fn rasterised(places: &[Vec2], faces: &[[u32; 3]], size: usize) -> Vec<Option<Source>> {
    let mut out: Vec<Option<Source>> = vec![None; size * size];
    for (face, corners) in (0..).zip(faces) {
        let [a, b, c] = corners.map(|i| places[i as usize]);
        let texel = |x: f32| x.clamp(0.0, (size - 1) as f32) as usize;
        let low = (a.min(b).min(c) - GUTTER).ceil();
        let high = (a.max(b).max(c) + GUTTER).floor();
        for r in texel(low.y)..=texel(high.y) {
            for c_ in texel(low.x)..=texel(high.x) {
                let centre = Vec3::new(c_ as f32, r as f32, 0.0);
                let (weights, closest) = closest_on_triangle(centre, a.extend(0.0), b.extend(0.0), c.extend(0.0));
                let distance = closest.distance_squared(centre);
                let best = out[r * size + c_].map_or(GUTTER * GUTTER, |s| s.distance);
                if distance < best {
                    out[r * size + c_] = Some(Source { distance, face, weights });
                }
            }
        }
    }
    out
}

/// Gives texels without a source that of the nearest texel with one.
fn pad(sources: &mut [Option<Source>], size: usize) {
    let centre = |i: usize| Vec3::new((i % size) as f32, (i / size) as f32, 0.0);
    let (full, empty): (Vec<usize>, Vec<usize>) = (0..sources.len()).partition(|i| sources[*i].is_some());
    let tree = PointTree::new(&full.iter().map(|i| centre(*i)).collect::<Vec<_>>());
    let nearest = tree.nearest(&empty.iter().map(|i| centre(*i)).collect::<Vec<_>>(), 1);
    for (i, from) in empty.into_iter().zip(nearest.indices) {
        sources[i] = sources[full[from as usize]];
    }
}

/// The chart of each texture coordinate: the lowest coordinate that faces join it with.
fn charts(uv: &UvAtlas) -> Vec<u32> {
    fn root(parents: &mut [u32], mut i: u32) -> u32 {
        while parents[i as usize] != i {
            parents[i as usize] = parents[parents[i as usize] as usize];
            i = parents[i as usize];
        }
        i
    }
    let mut parents: Vec<u32> = (0..uv.coordinates.len() as u32).collect();
    for [a, b, c] in &uv.faces {
        for (a, b) in [(*a, *b), (*b, *c)] {
            let (a, b) = (root(&mut parents, a), root(&mut parents, b));
            parents[a.max(b) as usize] = a.min(b);
        }
    }
    (0..parents.len() as u32).map(|i| root(&mut parents, i)).collect()
}

/// The texture coordinate that each vertex samples, `[V]`: the one in most of its faces, of equal ones the lowest.
fn sample_places(topology: &Topology, uv: &UvAtlas) -> Vec<Option<u32>> {
    let mut counts: Vec<BTreeMap<u32, usize>> = vec![BTreeMap::new(); topology.vertex_count];
    for (vertices, places) in topology.faces.iter().zip(&uv.faces) {
        for (v, place) in vertices.iter().zip(places) {
            *counts[*v as usize].entry(*place).or_default() += 1;
        }
    }
    let most =
        |c: &BTreeMap<u32, usize>| c.iter().max_by_key(|(place, n)| (**n, std::cmp::Reverse(**place))).map(|(p, _)| *p);
    counts.iter().map(most).collect()
}

/// Bilinear weights of the texels round a place, of those of its own chart; the nearest texel of the chart if none of the
/// four is, and of any chart if it has none.
fn samples(place: Vec2, chart: u32, texel_charts: &[u32], size: usize) -> Vec<(u32, f32)> {
    let last = (size - 1) as f32;
    let place = place.clamp(Vec2::ZERO, Vec2::splat(last));
    let corner = place.floor();
    let part = place - corner;
    let mut all = Vec::with_capacity(4);
    for (dr, wr) in [(0.0, 1.0 - part.y), (1.0, part.y)] {
        for (dc, wc) in [(0.0, 1.0 - part.x), (1.0, part.x)] {
            let (r, c) = ((corner.y + dr).min(last) as usize, (corner.x + dc).min(last) as usize);
            all.push(((r * size + c) as u32, wr * wc));
        }
    }
    let own: Vec<(u32, f32)> = all.iter().filter(|(t, _)| texel_charts[*t as usize] == chart).copied().collect();
    let total: f32 = own.iter().map(|(_, w)| w).sum();
    if total > 1e-3 {
        return own.into_iter().map(|(t, w)| (t, w / total)).collect();
    }
    let far = |t: &usize| Vec2::new((t % size) as f32, (t / size) as f32).distance_squared(place);
    let texels = (0..texel_charts.len()).filter(|t| texel_charts[*t] == chart);
    match texels.min_by(|a, b| far(a).total_cmp(&far(b)).then(a.cmp(b))) {
        Some(texel) => vec![(texel as u32, 1.0)],
        None => all,
    }
}
