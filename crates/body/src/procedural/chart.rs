//! One chart of the atlas: a disk of quads flattened onto an ellipse.

use super::shape_space::symmetric_eigen;
use glam::{DVec2, Vec3};
use softtissue_geometry::Topology;
use std::collections::{BTreeMap, BTreeSet};

/// Longest to shortest axis of a chart's ellipse.
const LARGEST_ASPECT: f64 = 4.0;
/// Rounds of over-relaxation.
const ROUNDS: usize = 300;
const OVER_RELAXATION: f64 = 1.85;

/// A flattened chart.
#[derive(Clone, Debug)]
pub struct Flat {
    /// Triangles, indices into the mesh's faces.
    pub faces: Vec<usize>,
    /// Plane coordinates of the chart's vertices.
    pub uv: BTreeMap<u32, DVec2>,
}

impl Flat {
    /// Lowest and highest coordinates.
    pub fn bounds(&self) -> (DVec2, DVec2) {
        self.uv.values().fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(l, h), p| (l.min(*p), h.max(*p)))
    }
    /// Area in the plane.
    pub fn area(&self, topology: &Topology) -> f64 {
        self.faces.iter().map(|t| self.signed_area(topology.faces[*t])).sum()
    }
    fn signed_area(&self, face: [u32; 3]) -> f64 {
        let [a, b, c] = face.map(|v| self.uv[&v]);
        0.5 * (b - a).perp_dot(c - a)
    }
}

/// Flattens a set of quads, or gives none if it is no disk or a triangle comes out folded.
pub fn flatten(topology: &Topology, positions: &[Vec3], quads: &[usize]) -> Option<Flat> {
    let faces: Vec<usize> = quads.iter().flat_map(|q| [2 * q, 2 * q + 1]).collect();
    let border = boundary_loop(topology, &faces)?;
    let mut uv = on_ellipse(positions, &border);
    let fixed: BTreeSet<u32> = border.iter().copied().collect();
    let mut near: BTreeMap<u32, BTreeSet<u32>> = BTreeMap::new();
    for &t in &faces {
        let f = topology.faces[t];
        for c in 0..3 {
            near.entry(f[c]).or_default().extend([f[(c + 1) % 3], f[(c + 2) % 3]]);
        }
    }
    // rows of (slot, weight) with weights 1 / length, normalised: positive, so Tutte's theorem holds
    let slots: BTreeMap<u32, usize> = near.keys().enumerate().map(|(i, v)| (*v, i)).collect();
    let rows: Vec<(usize, Vec<(usize, f64)>)> = near
        .iter()
        .filter(|(v, _)| !fixed.contains(v))
        .map(|(v, n)| {
            let weight = |o: &u32| 1.0 / f64::from(positions[*v as usize].distance(positions[*o as usize])).max(1e-6);
            let total: f64 = n.iter().map(weight).sum();
            (slots[v], n.iter().map(|o| (slots[o], weight(o) / total)).collect())
        })
        .collect();
    let mut at: Vec<DVec2> = near.keys().map(|v| uv.get(v).copied().unwrap_or(DVec2::ZERO)).collect();
    for _ in 0..ROUNDS {
        for (slot, row) in &rows {
            let mean: DVec2 = row.iter().map(|(o, w)| at[*o] * *w).sum();
            at[*slot] = at[*slot].lerp(mean, OVER_RELAXATION);
        }
    }
    uv = near.keys().copied().zip(at).collect();
    let flat = Flat { faces, uv };
    let least = 1e-7 * flat.area(topology);
    let folded = flat.faces.iter().any(|t| flat.signed_area(topology.faces[*t]) <= least);
    (!folded).then_some(flat)
}

/// The border of a disk, counter-clockwise; none for anything but a disk.
fn boundary_loop(topology: &Topology, faces: &[usize]) -> Option<Vec<u32>> {
    let directed: BTreeSet<[u32; 2]> = faces
        .iter()
        .flat_map(|t| {
            let [a, b, c] = topology.faces[*t];
            [[a, b], [b, c], [c, a]]
        })
        .collect();
    let mut next = BTreeMap::new();
    for &[a, b] in directed.iter().filter(|[a, b]| !directed.contains(&[*b, *a])) {
        if next.insert(a, b).is_some() {
            return None;
        }
    }
    let vertices: BTreeSet<u32> = faces.iter().flat_map(|t| topology.faces[*t]).collect();
    let edges = (directed.len() + next.len()) / 2;
    if vertices.len() as i64 - edges as i64 + faces.len() as i64 != 1 {
        return None;
    }
    let start = *next.keys().next()?;
    let mut border = vec![start];
    let mut at = next[&start];
    while at != start {
        border.push(at);
        at = *next.get(&at)?;
    }
    (border.len() == next.len()).then_some(border)
}

/// Spreads the border over an ellipse of the chart's aspect, by length, its far end on the long axis (v).
fn on_ellipse(positions: &[Vec3], border: &[u32]) -> BTreeMap<u32, DVec2> {
    let at = |v: u32| positions[v as usize].as_dvec3();
    let mean = border.iter().map(|v| at(*v)).sum::<glam::DVec3>() / border.len() as f64;
    let mut covariance = vec![vec![0.0; 3]; 3];
    for v in border {
        let d = (at(*v) - mean).to_array();
        for i in 0..3 {
            for k in 0..3 {
                covariance[i][k] += d[i] * d[k];
            }
        }
    }
    let (values, vectors) = symmetric_eigen(covariance);
    let mut order = [0, 1, 2];
    order.sort_by(|a, b| values[*b].total_cmp(&values[*a]));
    let axis = glam::DVec3::from_array(std::array::from_fn(|i| vectors[i][order[0]]));
    let axis = if axis.y < 0.0 { -axis } else { axis };
    let aspect = (values[order[0]] / values[order[1]].max(1e-12)).sqrt().min(LARGEST_ASPECT);
    let end = (0..border.len())
        .max_by(|a, b| (at(border[*a]) - mean).dot(axis).total_cmp(&(at(border[*b]) - mean).dot(axis)))
        .unwrap_or(0);
    let ring: Vec<u32> = (0..border.len()).map(|i| border[(end + i) % border.len()]).collect();
    let mut lengths = vec![0.0];
    for i in 0..ring.len() {
        lengths.push(lengths[i] + at(ring[i]).distance(at(ring[(i + 1) % ring.len()])).max(1e-6));
    }
    // arc length of the ellipse (sin, aspect cos), tabulated; the angle runs counter-clockwise from the far end
    const STEPS: usize = 1440;
    let point = |angle: f64| DVec2::new(-angle.sin(), aspect * angle.cos());
    let angle = |i: usize| i as f64 * std::f64::consts::TAU / STEPS as f64;
    let mut arc = vec![0.0];
    for i in 0..STEPS {
        arc.push(arc[i] + point(angle(i)).distance(point(angle(i + 1))));
    }
    let (total, around) = (lengths[ring.len()], arc[STEPS]);
    ring.iter()
        .zip(&lengths)
        .map(|(v, l)| {
            let s = l / total * around;
            let i = arc.partition_point(|a| *a <= s).clamp(1, STEPS) - 1;
            let t = (s - arc[i]) / (arc[i + 1] - arc[i]);
            (*v, point(angle(i) + t * (angle(1) - angle(0))))
        })
        .collect()
}
