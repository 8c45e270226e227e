use glam::{Mat3, Vec3};
use std::collections::BTreeMap;

/// Tetrahedra between the node layers of a shell. Node `layer * V + v` lies under skin vertex `v`.
#[derive(Clone, Debug, PartialEq)]
pub struct Tetrahedron {
    /// Node indices; positive volume.
    pub nodes: [u32; 4],
    /// Which layer of prisms, 0 under the skin.
    pub layer: usize,
    /// Part of the volume that this element stands for: 1, or 1/2 where it overlaps its mirror image.
    pub share: f32,
}

impl Tetrahedron {
    /// Volume that it stands for, m^3, with its nodes at `positions`.
    pub fn volume(&self, positions: &[Vec3]) -> f32 {
        edge_matrix(self.nodes, positions).determinant() / 6.0 * self.share
    }
}

/// Splits the prism under every triangle and layer into three tetrahedra and makes the result exactly mirror
/// symmetric: the mirror image of each is added at half weight, and what coincides is merged. (Diagonals follow a
/// mirror-symmetric order of the vertices, so that nearly all coincide; only elements that cross the middle
/// plane are doubled.)
pub fn split_prisms(
    faces: &[[u32; 3]],
    vertex_count: usize,
    layers: usize,
    mirror: &[u32],
    rank: &[u32],
) -> Vec<Tetrahedron> {
    let v = vertex_count as u32;
    let mut found: BTreeMap<[u32; 4], Tetrahedron> = BTreeMap::new();
    let reflect = |n: u32| n / v * v + mirror[(n % v) as usize];
    for layer in 0..layers {
        for face in faces {
            for nodes in split_prism(*face, rank, layer as u32 * v, v) {
                // a reflection turns the element inside out; swapping two nodes turns it back
                let [a, b, c, d] = nodes.map(reflect);
                for nodes in [nodes, [b, a, c, d]] {
                    let mut key = nodes;
                    key.sort_unstable();
                    found.entry(key).or_insert(Tetrahedron { nodes, layer, share: 0.0 }).share += 0.5;
                }
            }
        }
    }
    found.into_values().collect()
}

/// Three tetrahedra of the prism between `face` at `top` and the same face at `top + stride`; each of the side
/// walls is cut from the top of its lower-ranked vertex to the bottom of the other.
fn split_prism(face: [u32; 3], rank: &[u32], top: u32, stride: u32) -> [[u32; 4]; 3] {
    // rotate the lowest-ranked vertex to the front: its two walls are both cut from its top
    let lowest = (0..3).min_by_key(|&k| rank[face[k] as usize]).unwrap_or(0);
    let [a, b, c] = [0, 1, 2].map(|k| face[(lowest + k) % 3] + top);
    let [d, e, f] = [a, b, c].map(|x| x + stride);
    let b_first = rank[(b - top) as usize] < rank[(c - top) as usize];
    let [p, q] = if b_first { [[a, b, c, f], [a, b, f, e]] } else { [[a, b, c, e], [a, c, f, e]] };
    [[a, d, e, f], p, q].map(|t| [t[0], t[2], t[1], t[3]])
}

/// Edge vectors `[b - a, c - a, d - a]` as columns.
pub fn edge_matrix(nodes: [u32; 4], positions: &[Vec3]) -> Mat3 {
    let [a, b, c, d] = nodes.map(|n| positions[n as usize]);
    Mat3::from_cols(b - a, c - a, d - a)
}

/// Smallest altitude of a tetrahedron: `6 V` over twice its largest face area.
pub fn smallest_altitude(nodes: [u32; 4], positions: &[Vec3]) -> f32 {
    let [a, b, c, d] = nodes.map(|n| positions[n as usize]);
    let doubled = |p: Vec3, q: Vec3, r: Vec3| (q - p).cross(r - p).length();
    let largest = doubled(a, b, c).max(doubled(a, b, d)).max(doubled(a, c, d)).max(doubled(b, c, d));
    edge_matrix(nodes, positions).determinant().abs() / largest.max(1e-12)
}

/// An order of vertices for [`split_prisms`] in which a vertex and its mirror image stand side by side.
pub fn mirror_rank(mirror: &[u32]) -> Vec<u32> {
    mirror.iter().enumerate().map(|(v, &m)| 2 * m.min(v as u32) + u32::from(m < v as u32)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An octahedron whose apex pairs lie on x: vertices 0 and 1 are mirror images.
    fn octahedron() -> (Vec<Vec3>, Vec<[u32; 3]>, Vec<u32>) {
        let p = vec![Vec3::X, -Vec3::X, Vec3::Y, -Vec3::Y, Vec3::Z, -Vec3::Z];
        let f = vec![[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
        (p, f, vec![1, 0, 2, 3, 4, 5])
    }

    #[test]
    fn prisms_fill_the_shell_once_and_mirror_onto_themselves() {
        let (skin, faces, mirror) = octahedron();
        let mut nodes = skin.clone();
        nodes.extend(skin.iter().map(|p| *p * 0.7));
        nodes.extend(skin.iter().map(|p| *p * 0.3));
        let tetrahedra = split_prisms(&faces, 6, 2, &mirror, &mirror_rank(&mirror));
        let volume: f32 = tetrahedra
            .iter()
            .map(|t| {
                let six = edge_matrix(t.nodes, &nodes).determinant();
                assert!(six > 0.0, "{t:?}");
                six / 6.0 * t.share
            })
            .sum();
        assert!((volume - 4.0 / 3.0 * (1.0 - 0.027)).abs() < 1e-5, "{volume}");
        let keys: BTreeMap<[u32; 4], f32> = tetrahedra.iter().map(|t| (sorted(t.nodes), t.share)).collect();
        for (key, share) in &keys {
            let image = sorted(key.map(|n| n / 6 * 6 + mirror[(n % 6) as usize]));
            assert_eq!(keys.get(&image), Some(share));
        }
    }

    fn sorted(mut nodes: [u32; 4]) -> [u32; 4] {
        nodes.sort_unstable();
        nodes
    }

    #[test]
    fn altitude_of_the_unit_corner() {
        let p = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
        assert!((smallest_altitude([0, 1, 2, 3], &p) - 1.0 / 3f32.sqrt()).abs() < 1e-6);
    }
}
