//! What a cell of marching cubes (Lorensen and Cline 1987) holds for each of its 256 patterns of signs.
//!
//! The patterns are worked out, not listed. On each of the six faces the inside corners are cut off by segments; on a face
//! with two of them across from each other each gets its own (the rule looks at the face alone, so that the cells on both
//! sides agree). Segments join to loops round the cell, and a loop is cut into triangles by diagonals of which none has
//! both ends on one face of the cell: such a one could coincide with a line of the neighbour's. So every line of the mesh
//! lies in two triangles, and a closed surface gives a closed manifold.

use std::sync::OnceLock;

/// Corner `i` is at `x = i & 1`, `y = i >> 1 & 1`, `z = i >> 2 & 1`.
pub(crate) const CORNERS: usize = 8;
/// An edge of the cell: the corner at its lower end, and its axis.
pub(crate) const EDGES: [(usize, usize); 12] = [
    (0, 0),
    (2, 0),
    (4, 0),
    (6, 0), // along x
    (0, 1),
    (1, 1),
    (4, 1),
    (5, 1), // along y
    (0, 2),
    (1, 2),
    (2, 2),
    (3, 2), // along z
];

/// Triangles of a cell as edges, counter-clockwise seen from outside the surface.
pub(crate) type Triangles = Vec<[u8; 3]>;

/// Triangles by pattern: bit `i` of it is set where corner `i` is inside.
pub(crate) fn cases() -> &'static [Triangles; 256] {
    static CASES: OnceLock<Box<[Triangles; 256]>> = OnceLock::new();
    CASES.get_or_init(|| Box::new(std::array::from_fn(|pattern| triangles(pattern as u8))))
}

/// Corners of each face of the cell, counter-clockwise seen from outside the cell.
pub(crate) fn faces() -> [[usize; 4]; 6] {
    std::array::from_fn(|f| {
        let (axis, side) = (f / 2, f % 2);
        let (b, c) = (1 << ((axis + 1) % 3), 1 << ((axis + 2) % 3));
        let mut corners = [0, b, b | c, c].map(|i| i | (side << axis));
        if side == 0 {
            corners.reverse();
        }
        corners
    })
}

fn edge_between(a: usize, b: usize) -> usize {
    let (low, axis) = (a.min(b), (a ^ b).trailing_zeros() as usize);
    EDGES.iter().position(|e| *e == (low, axis)).unwrap_or_default()
}

fn triangles(pattern: u8) -> Triangles {
    loops(pattern).iter().flat_map(|l| cut(l)).collect()
}

/// Closed rings of edges of the cell that the surface crosses.
fn loops(pattern: u8) -> Vec<Vec<usize>> {
    let inside = |corner: usize| pattern >> corner & 1 == 1;
    // an edge is left by one segment and reached by one: its two faces pass it in opposite directions
    let mut next = [None; 12];
    for face in faces() {
        for at in 0..4 {
            let corner = |i: usize| face[(at + i) % 4];
            if inside(corner(0)) || !inside(corner(1)) {
                continue;
            }
            let last = (1..4).find(|i| !inside(corner(i + 1))).unwrap_or(1);
            next[edge_between(corner(0), corner(1))] = Some(edge_between(corner(last), corner(last + 1)));
        }
    }
    let mut rings = Vec::new();
    for start in 0..12 {
        let mut ring = Vec::new();
        let mut at = start;
        while let Some(to) = next[at].take() {
            ring.push(at);
            at = to;
        }
        if !ring.is_empty() {
            rings.push(ring);
        }
    }
    rings
}

/// Whether two edges lie on one face of the cell.
fn share_face(a: usize, b: usize) -> bool {
    let on = |e: usize| {
        let (corner, axis) = EDGES[e];
        [(axis + 1) % 3, (axis + 2) % 3].map(|other| (other, corner >> other & 1))
    };
    on(a).iter().any(|f| on(b).contains(f))
}

/// Cuts a ring into triangles with as few diagonals on faces as can be.
fn cut(ring: &[usize]) -> Triangles {
    let n = ring.len();
    let bad = |i: usize, j: usize| usize::from(j - i > 1 && !(i == 0 && j == n - 1) && share_face(ring[i], ring[j]));
    // fewest bad diagonals of the part from i to j, and the corner between that gives them
    let mut least = vec![vec![(0usize, 0usize); n]; n];
    for span in 2..n {
        for i in 0..n - span {
            let j = i + span;
            let cost = |m: usize| least[i][m].0 + least[m][j].0 + bad(i, m) + bad(m, j);
            let best = (i + 1..j).map(|m| (cost(m), m)).min().unwrap_or_default();
            least[i][j] = best;
        }
    }
    let mut out = Vec::with_capacity(n.saturating_sub(2));
    let mut parts = vec![(0, n - 1)];
    while let Some((i, j)) = parts.pop() {
        if j - i > 1 {
            let m = least[i][j].1;
            out.push([ring[i] as u8, ring[m] as u8, ring[j] as u8]);
            parts.extend([(i, m), (m, j)]);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    #[test]
    fn every_crossed_edge_is_used_and_no_diagonal_lies_on_a_face() {
        for (pattern, triangles) in cases().iter().enumerate() {
            let inside = |corner: usize| pattern >> corner & 1 == 1;
            let crossed: Vec<usize> =
                (0..12).filter(|e| inside(EDGES[*e].0) != inside(EDGES[*e].0 | 1 << EDGES[*e].1)).collect();
            let mut used: Vec<usize> = triangles.iter().flatten().map(|e| usize::from(*e)).collect();
            used.sort_unstable();
            used.dedup();
            assert_eq!(used, crossed, "pattern {pattern:08b}");
            let mut lines: BTreeMap<[u8; 2], usize> = BTreeMap::new();
            for t in triangles {
                (0..3)
                    .for_each(|i| *lines.entry([t[i].min(t[(i + 1) % 3]), t[i].max(t[(i + 1) % 3])]).or_default() += 1);
            }
            for ([a, b], count) in lines {
                let on_face = share_face(a.into(), b.into());
                assert_eq!(count, if on_face { 1 } else { 2 }, "line {a}-{b} of pattern {pattern:08b}");
            }
        }
        assert!(cases()[0].is_empty() && cases()[255].is_empty());
    }

    #[test]
    fn one_corner_gives_a_triangle_that_looks_away_from_it() {
        for corner in 0..CORNERS {
            let at = |i: usize| glam::Vec3::from_array(std::array::from_fn(|a| (i >> a & 1) as f32));
            let middle = |e: u8| {
                0.5 * (at(EDGES[usize::from(e)].0) + at(EDGES[usize::from(e)].0 | 1 << EDGES[usize::from(e)].1))
            };
            let [t] = cases()[1 << corner][..] else { panic!("corner {corner} has not one triangle") };
            let [a, b, c] = t.map(middle);
            assert!((b - a).cross(c - a).dot(a - at(corner)) > 0.0, "corner {corner}");
        }
    }
}
