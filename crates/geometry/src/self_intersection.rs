use glam::Vec3;
use rayon::prelude::*;

/// Faces of a leaf of the tree.
const LEAF: usize = 4;
/// Faces that are compared at a time.
const CHUNK: usize = 256;
/// Pairs of faces that are looked at, at most: a body has half a million, a heap of faces at one place any number.
const COMPARISONS: usize = 50_000_000;

/// Faces that cut through another face with which they share no vertex, ascending. An edge cuts a face where it goes
/// through it and both of its ends are farther than `tolerance` metres from the face's plane, so that surfaces which
/// touch do not count. Faces with vertices that are not finite are passed over; indices must be within the vertices.
/// `None` where faces crowd so much that it would take too long.
pub fn self_intersections(positions: &[Vec3], faces: &[[u32; 3]], tolerance: f32) -> Option<Vec<u32>> {
    let corners = |f: u32| faces[f as usize].map(|i| positions[i as usize]);
    let members: Vec<u32> = (0..faces.len() as u32).filter(|f| corners(*f).iter().all(|p| p.is_finite())).collect();
    let boxes: Vec<Bounds> = (0..faces.len() as u32).map(|f| Bounds::of(&corners(f))).collect();
    let tree = Tree::new(members, &boxes);
    let (mut cut, mut compared) = (Vec::new(), 0);
    for part in tree.members.chunks(CHUNK) {
        let found: Vec<(usize, Vec<u32>)> = part
            .par_iter()
            .map(|&f| {
                let (own, mut count, mut found) = (faces[f as usize], 0, Vec::new());
                tree.visit(&boxes, &boxes[f as usize], |g| {
                    count += 1;
                    let apart = g > f && faces[g as usize].iter().all(|i| !own.contains(i));
                    if apart && cross(corners(f), corners(g), tolerance) {
                        found.extend([f, g]);
                    }
                });
                (count, found)
            })
            .collect();
        compared += found.iter().map(|f| f.0).sum::<usize>();
        if compared > COMPARISONS {
            return None;
        }
        cut.extend(found.into_iter().flat_map(|f| f.1));
        cut.sort_unstable();
        cut.dedup();
    }
    Some(cut)
}

fn cross(a: [Vec3; 3], b: [Vec3; 3], tolerance: f32) -> bool {
    let pierced = |by: [Vec3; 3], face: [Vec3; 3]| {
        let normal = (face[1] - face[0]).cross(face[2] - face[0]).normalize_or_zero();
        normal != Vec3::ZERO && (0..3).any(|k| pierces(by[k], by[(k + 1) % 3], face, normal, tolerance))
    };
    pierced(a, b) || pierced(b, a)
}

/// Whether the way from `p` to `q` goes through a face with this unit normal.
fn pierces(p: Vec3, q: Vec3, face: [Vec3; 3], normal: Vec3, tolerance: f32) -> bool {
    let (above, below) = (normal.dot(p - face[0]), normal.dot(q - face[0]));
    if above * below >= 0.0 || above.abs().min(below.abs()) <= tolerance {
        return false;
    }
    let at = p + (q - p) * (above / (above - below));
    (0..3).all(|k| {
        let (from, to) = (face[k], face[(k + 1) % 3]);
        normal.dot((to - from).cross(at - from)) >= 0.0
    })
}

#[derive(Clone, Copy)]
struct Bounds {
    low: Vec3,
    high: Vec3,
}

impl Bounds {
    fn of(points: &[Vec3]) -> Self {
        let start = Self { low: Vec3::INFINITY, high: Vec3::NEG_INFINITY };
        points.iter().fold(start, |b, p| Self { low: b.low.min(*p), high: b.high.max(*p) })
    }
    fn around(a: Self, b: &Self) -> Self {
        Self { low: a.low.min(b.low), high: a.high.max(b.high) }
    }
    fn meets(&self, other: &Self) -> bool {
        self.low.cmple(other.high).all() && self.high.cmpge(other.low).all()
    }
    fn middle(&self) -> Vec3 {
        self.low + self.high
    }
}

/// Faces in a tree of boxes, split at the median.
struct Tree {
    /// Faces in the order of the leaves.
    members: Vec<u32>,
    nodes: Vec<Node>,
}

struct Node {
    bounds: Bounds,
    /// Part of `members` below this node.
    first: usize,
    end: usize,
    /// The second child; the first follows its parent. 0 for a leaf.
    second: usize,
}

impl Tree {
    fn new(members: Vec<u32>, boxes: &[Bounds]) -> Self {
        let mut tree = Self { members, nodes: vec![] };
        if !tree.members.is_empty() {
            tree.split(0, tree.members.len(), boxes);
        }
        tree
    }

    fn split(&mut self, first: usize, end: usize, boxes: &[Bounds]) {
        let part = &mut self.members[first..end];
        let empty = Bounds { low: Vec3::INFINITY, high: Vec3::NEG_INFINITY };
        let bounds = part.iter().fold(empty, |b, f| Bounds::around(b, &boxes[*f as usize]));
        let node = self.nodes.len();
        self.nodes.push(Node { bounds, first, end, second: 0 });
        if end - first <= LEAF {
            return;
        }
        let axis = (bounds.high - bounds.low).max_position();
        let along = |f: &u32| boxes[*f as usize].middle()[axis];
        let half = part.len() / 2;
        part.select_nth_unstable_by(half, |a, b| along(a).total_cmp(&along(b)).then(a.cmp(b)));
        self.split(first, first + half, boxes);
        self.nodes[node].second = self.nodes.len();
        self.split(first + half, end, boxes);
    }

    /// Calls `found` with every face whose box meets `wanted`.
    fn visit(&self, boxes: &[Bounds], wanted: &Bounds, mut found: impl FnMut(u32)) {
        let mut waiting = vec![0];
        while let Some(at) = waiting.pop() {
            let node = &self.nodes[at];
            if !node.bounds.meets(wanted) {
                continue;
            }
            if node.second > 0 {
                waiting.extend([node.second, at + 1]);
                continue;
            }
            for f in &self.members[node.first..node.end] {
                if boxes[*f as usize].meets(wanted) {
                    found(*f);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A sheet of `n` by `n` squares in the plane `z = 0`, lifted by `lift`.
    fn sheet(n: u32, lift: impl Fn(f32, f32) -> Vec3) -> (Vec<Vec3>, Vec<[u32; 3]>) {
        let side = n + 1;
        let positions = (0..side * side).map(|i| lift((i % side) as f32, (i / side) as f32)).collect();
        let quad = |i: u32| {
            let a = i / n * side + i % n;
            [[a, a + 1, a + side + 1], [a, a + side + 1, a + side]]
        };
        (positions, (0..n * n).flat_map(quad).collect())
    }

    #[test]
    fn a_bent_sheet_does_not_cut_itself() {
        let (p, f) = sheet(12, |x, y| Vec3::new(x, y, 0.3 * (0.7 * x).sin()));
        assert_eq!(self_intersections(&p, &f, 1e-4), Some(vec![]));
        assert_eq!(self_intersections(&[], &[], 1e-4), Some(vec![]));
    }

    #[test]
    fn a_spike_through_a_sheet_is_found_and_a_touch_is_not() {
        let (mut p, mut f) = sheet(8, |x, y| Vec3::new(x, y, 0.0));
        let base = p.len() as u32;
        p.extend([Vec3::new(3.3, 3.6, -0.5), Vec3::new(3.4, 3.6, -0.5), Vec3::new(3.35, 3.65, 0.5)]);
        f.push([base, base + 1, base + 2]);
        let spike = f.len() as u32 - 1;
        let cut = self_intersections(&p, &f, 1e-4).unwrap();
        // the square (3, 3), whose upper triangle holds the point
        assert_eq!(cut, [2 * (3 * 8 + 3) + 1, spike]);
        p[base as usize + 2].z = 5e-5;
        assert_eq!(self_intersections(&p, &f, 1e-4), Some(vec![]));
        assert_eq!(self_intersections(&p, &f, 1e-6).unwrap().len(), 2);
        p[base as usize].x = f32::NAN;
        assert_eq!(self_intersections(&p, &f, 1e-6), Some(vec![]));
    }

    #[test]
    fn a_heap_of_faces_is_given_up_soon() {
        let corners = [Vec3::ZERO, Vec3::X, Vec3::Y];
        let points: Vec<Vec3> = (0..300_000).map(|i| corners[i % 3]).collect();
        let faces: Vec<[u32; 3]> = (0..100_000).map(|f| [3 * f, 3 * f + 1, 3 * f + 2]).collect();
        assert_eq!(self_intersections(&points, &faces, 1e-4), None);
    }

    #[test]
    fn the_tree_finds_what_all_pairs_find() {
        // two sheets that wave through each other
        let (mut p, mut f) = sheet(9, |x, y| Vec3::new(x, y, (0.9 * x).sin()));
        let (q, g) = sheet(9, |x, y| Vec3::new(x + 0.13, y + 0.21, (0.8 * y).cos()));
        let base = p.len() as u32;
        p.extend(q);
        f.extend(g.iter().map(|c| c.map(|i| i + base)));
        let corners = |i: usize| f[i].map(|v| p[v as usize]);
        let mut all: Vec<u32> = (0..f.len())
            .flat_map(|i| (i + 1..f.len()).map(move |j| (i, j)))
            .filter(|(i, j)| f[*i].iter().all(|v| !f[*j].contains(v)) && cross(corners(*i), corners(*j), 1e-4))
            .flat_map(|(i, j)| [i as u32, j as u32])
            .collect();
        all.sort_unstable();
        all.dedup();
        assert!(all.len() > 40);
        assert_eq!(self_intersections(&p, &f, 1e-4), Some(all));
    }
}
