//! The texture atlas: front and back charts of each body part, flattened by Tutte's (1963) embedding onto ellipses,
//! which cannot fold over, and packed on shelves.

use super::chart::{Flat, flatten};
use crate::UvAtlas;
use glam::{DVec2, Vec2, Vec3};
use softtissue_geometry::{Topology, face_normals};
use std::collections::BTreeMap;

/// Smaller pieces are given to their neighbour, quads.
const SMALLEST_CHART: usize = 12;
/// Gap between charts, share of the atlas.
const MARGIN: f64 = 0.004;

/// Lays out `topology` (all quads) with charts by `label` of each quad.
pub fn atlas(topology: &Topology, positions: &[Vec3], labels: &[u32]) -> UvAtlas {
    let neighbours = quad_neighbours(topology);
    let labels = absorb_crumbs(&neighbours, labels);
    let mut flats = Vec::new();
    let mut waiting = components(&neighbours, &labels);
    waiting.reverse();
    while let Some(quads) = waiting.pop() {
        match flatten(topology, positions, &quads) {
            Some(flat) => flats.push(flat),
            None => waiting.extend(bisect(&neighbours, &quads)),
        }
    }
    pack(topology, positions, &flats)
}

fn quad_neighbours(topology: &Topology) -> Vec<Vec<usize>> {
    let mut by_edge: BTreeMap<[u32; 2], Vec<usize>> = BTreeMap::new();
    for (q, quad) in topology.quads.iter().enumerate() {
        for c in 0..4 {
            let (a, b) = (quad[c], quad[(c + 1) % 4]);
            by_edge.entry([a.min(b), a.max(b)]).or_default().push(q);
        }
    }
    let mut out = vec![Vec::new(); topology.quads.len()];
    for pair in by_edge.values() {
        if let [a, b] = pair[..] {
            out[a].push(b);
            out[b].push(a);
        }
    }
    out
}

/// Connected sets of quads of one label, ordered by their first quad.
fn components(neighbours: &[Vec<usize>], labels: &[u32]) -> Vec<Vec<usize>> {
    let mut seen = vec![false; labels.len()];
    let mut out = Vec::new();
    for start in 0..labels.len() {
        if seen[start] {
            continue;
        }
        seen[start] = true;
        let mut piece = vec![start];
        let mut at = 0;
        while at < piece.len() {
            for &n in &neighbours[piece[at]] {
                if !seen[n] && labels[n] == labels[start] {
                    seen[n] = true;
                    piece.push(n);
                }
            }
            at += 1;
        }
        out.push(piece);
    }
    out
}

/// Gives small pieces the label that most of their border has.
fn absorb_crumbs(neighbours: &[Vec<usize>], labels: &[u32]) -> Vec<u32> {
    let mut labels = labels.to_vec();
    for _ in 0..4 {
        for piece in components(neighbours, &labels) {
            if piece.len() >= SMALLEST_CHART {
                continue;
            }
            let mut border: BTreeMap<u32, usize> = BTreeMap::new();
            for &q in &piece {
                for &n in neighbours[q].iter().filter(|n| labels[**n] != labels[q]) {
                    *border.entry(labels[n]).or_default() += 1;
                }
            }
            if let Some((&label, _)) = border.iter().max_by_key(|(l, count)| (**count, std::cmp::Reverse(**l))) {
                piece.iter().for_each(|q| labels[*q] = label);
            }
        }
    }
    labels
}

/// Cuts a set of quads between its two most distant members.
fn bisect(neighbours: &[Vec<usize>], quads: &[usize]) -> Vec<Vec<usize>> {
    let distances = |from: usize| -> BTreeMap<usize, usize> {
        let mut out: BTreeMap<usize, usize> = quads.iter().map(|q| (*q, usize::MAX)).collect();
        out.insert(from, 0);
        let mut queue = vec![from];
        let mut at = 0;
        while at < queue.len() {
            let next = out[&queue[at]] + 1;
            for n in &neighbours[queue[at]] {
                if out.get(n) == Some(&usize::MAX) {
                    out.insert(*n, next);
                    queue.push(*n);
                }
            }
            at += 1;
        }
        out
    };
    let farthest = |d: &BTreeMap<usize, usize>| d.iter().max_by_key(|(q, d)| (**d, **q)).map_or(quads[0], |(q, _)| *q);
    let one = farthest(&distances(quads[0]));
    let from_one = distances(one);
    let other = farthest(&from_one);
    let from_other = distances(other);
    let labels: Vec<u32> = (0..neighbours.len())
        .map(|q| match (from_one.get(&q), from_other.get(&q)) {
            (Some(a), Some(b)) => 1 + u32::from(b < a),
            _ => 0,
        })
        .collect();
    let inside: Vec<Vec<usize>> =
        components(neighbours, &labels).into_iter().filter(|piece| labels[piece[0]] > 0).collect();
    inside
}

/// Scales every chart to its area on the body and packs the boxes on shelves in the largest scale that fits.
fn pack(topology: &Topology, positions: &[Vec3], flats: &[Flat]) -> UvAtlas {
    let areas = face_normals(positions, &topology.faces);
    let boxes: Vec<(DVec2, DVec2, f64)> = flats
        .iter()
        .map(|f| {
            let (low, high) = f.bounds();
            let body: f64 = f.faces.iter().map(|t| 0.5 * f64::from(areas[*t].length())).sum();
            (low, high - low, (body / f.area(topology)).sqrt())
        })
        .collect();
    let mut order: Vec<usize> = (0..flats.len()).collect();
    order.sort_by(|a, b| (boxes[*b].1.y * boxes[*b].2).total_cmp(&(boxes[*a].1.y * boxes[*a].2)).then(a.cmp(b)));
    let (mut small, mut large) = (0.0, 10.0);
    for _ in 0..50 {
        let middle = 0.5 * (small + large);
        if shelves(&boxes, &order, middle).is_some() { small = middle } else { large = middle }
    }
    let corners = shelves(&boxes, &order, small).unwrap_or_default();
    let mut atlas = UvAtlas { coordinates: Vec::new(), faces: vec![[0; 3]; topology.faces.len()] };
    for ((flat, corner), (low, _, size)) in flats.iter().zip(corners).zip(&boxes) {
        let mut index = BTreeMap::new();
        for (vertex, uv) in &flat.uv {
            index.insert(*vertex, atlas.coordinates.len() as u32);
            let at = corner + (*uv - *low) * (*size * small);
            atlas.coordinates.push(Vec2::new(at.x as f32, at.y as f32).clamp(Vec2::ZERO, Vec2::ONE));
        }
        for &t in &flat.faces {
            atlas.faces[t] = topology.faces[t].map(|v| index[&v]);
        }
    }
    atlas
}

/// Lower left corners at this scale, or none if the charts do not fit the unit square.
fn shelves(boxes: &[(DVec2, DVec2, f64)], order: &[usize], scale: f64) -> Option<Vec<DVec2>> {
    let mut corners = vec![DVec2::ZERO; boxes.len()];
    let (mut at, mut shelf) = (DVec2::splat(MARGIN), 0.0f64);
    for &i in order {
        let size = boxes[i].1 * (boxes[i].2 * scale);
        if at.x + size.x + MARGIN > 1.0 {
            at = DVec2::new(MARGIN, at.y + shelf + MARGIN);
            shelf = 0.0;
        }
        if at.x + size.x + MARGIN > 1.0 || at.y + size.y + MARGIN > 1.0 {
            return None;
        }
        corners[i] = at;
        at.x += size.x + MARGIN;
        shelf = shelf.max(size.y);
    }
    Some(corners)
}
