use glam::Vec3;
use parry3d::bounding_volume::Aabb;
use parry3d::math::Vector;
use parry3d::partitioning::{Bvh, BvhBuildStrategy, BvhNode};

/// Triangles in a bounding-volume tree, for the closest place on their surface.
pub struct SurfaceTree<'a> {
    tree: Bvh,
    positions: &'a [Vec3],
    faces: &'a [[u32; 3]],
    /// Unit normals of the faces, zero for a degenerate one.
    normals: Vec<Vec3>,
}

/// A place on a surface, and how far it lies from the point that asked for it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// The triangle.
    pub face: u32,
    /// Of the triangle's corners; not negative, sum one.
    pub weights: [f32; 3],
    /// Metres.
    pub distance: f32,
}

/// Cosine of the angle between normals, at least: what looks the other way is another part of the body.
const LEAST_COSINE: f32 = 0.3;

impl<'a> SurfaceTree<'a> {
    /// A tree over the triangles `faces` of `positions`, metres.
    pub fn new(positions: &'a [Vec3], faces: &'a [[u32; 3]]) -> Self {
        let corners = |f: &[u32; 3]| f.map(|i| positions[i as usize]);
        let boxes: Vec<Aabb> = faces
            .iter()
            .map(|f| {
                let [a, b, c] = corners(f);
                Aabb::new(vector(a.min(b).min(c)), vector(a.max(b).max(c)))
            })
            .collect();
        let normals = faces
            .iter()
            .map(|f| {
                let [a, b, c] = corners(f);
                (b - a).cross(c - a).normalize_or_zero()
            })
            .collect();
        Self { tree: Bvh::from_leaves(BvhBuildStrategy::Binned, &boxes), positions, faces, normals }
    }

    /// The closest place within `reach`, metres, whose face looks the way `normal` does, if that is not zero.
    pub fn closest(&self, point: Vec3, normal: Vec3, reach: f32) -> Option<Place> {
        let squared = |node: &BvhNode, _: f32| {
            let (low, high) = (vec3(node.mins()), vec3(node.maxs()));
            (low - point).max(point - high).max(Vec3::ZERO).length_squared()
        };
        let facing = normal != Vec3::ZERO;
        let on_face = |face: u32, best: f32| {
            if facing && self.normals[face as usize].dot(normal) < LEAST_COSINE {
                return None;
            }
            let [a, b, c] = self.faces[face as usize].map(|i| self.positions[i as usize]);
            let distance = (closest_on_triangle(point, a, b, c).1 - point).length_squared();
            (distance < best).then_some(distance)
        };
        let (face, squared_distance) = self.tree.find_best(reach * reach, squared, on_face)?;
        let [a, b, c] = self.faces[face as usize].map(|i| self.positions[i as usize]);
        let (weights, _) = closest_on_triangle(point, a, b, c);
        Some(Place { face, weights, distance: squared_distance.sqrt() })
    }
}

fn vector(p: Vec3) -> Vector {
    Vector::from_array(p.to_array())
}

fn vec3(p: Vector) -> Vec3 {
    Vec3::from_array(p.to_array())
}

/// Weights of the corners at the closest point of a triangle, and that point: by the regions of its plane in which a
/// corner, an edge or the inside is closest (Ericson 2005, sec. 5.1.5). On an edge or a corner the other weights are
/// exactly zero.
pub fn closest_on_triangle(p: Vec3, a: Vec3, b: Vec3, c: Vec3) -> ([f32; 3], Vec3) {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    let at = |w: [f32; 3]| (w, a * w[0] + b * w[1] + c * w[2]);
    if d1 <= 0.0 && d2 <= 0.0 {
        return at([1.0, 0.0, 0.0]);
    }
    let bp = p - b;
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    if d3 >= 0.0 && d4 <= d3 {
        return at([0.0, 1.0, 0.0]);
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        let t = d1 / (d1 - d3);
        return at([1.0 - t, t, 0.0]);
    }
    let cp = p - c;
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    if d6 >= 0.0 && d5 <= d6 {
        return at([0.0, 0.0, 1.0]);
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        let t = d2 / (d2 - d6);
        return at([1.0 - t, 0.0, t]);
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 >= d3 && d5 >= d6 {
        let t = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        return at([0.0, 1.0 - t, t]);
    }
    let sum = va + vb + vc;
    if sum > 0.0 { at([va / sum, vb / sum, vc / sum]) } else { at([1.0, 0.0, 0.0]) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use softtissue_random::Draws;

    fn draw(draws: &mut Draws) -> Vec3 {
        Vec3::from_array(std::array::from_fn(|_| draws.range(-1.0, 1.0) as f32))
    }

    #[test]
    fn the_tree_finds_what_a_search_of_all_places_finds() {
        let mut draws = Draws::new(3, "tree", 0, 0);
        let positions: Vec<Vec3> = (0..60).map(|_| draw(&mut draws)).collect();
        let faces: Vec<[u32; 3]> = (0..40).map(|_| std::array::from_fn(|_| draws.range(0.0, 60.0) as u32)).collect();
        let tree = SurfaceTree::new(&positions, &faces);
        for _ in 0..200 {
            let p = draw(&mut draws);
            // a grid of weights comes no nearer than the closest point
            let mut least = f32::MAX;
            for f in &faces {
                let [a, b, c] = f.map(|i| positions[i as usize]);
                for i in 0..=20 {
                    for j in 0..=20 - i {
                        let (u, v) = (i as f32 / 20.0, j as f32 / 20.0);
                        least = least.min(p.distance(a * (1.0 - u - v) + b * u + c * v));
                    }
                }
            }
            let place = tree.closest(p, Vec3::ZERO, 10.0).unwrap();
            assert!(place.distance <= least + 1e-5 && place.distance > least - 0.1, "{} and {least}", place.distance);
            let [a, b, c] = faces[place.face as usize].map(|i| positions[i as usize]);
            let [u, v, w] = place.weights;
            assert!((p.distance(a * u + b * v + c * w) - place.distance).abs() < 1e-5);
            assert!(tree.closest(p, Vec3::ZERO, place.distance * 0.99).is_none());
        }
    }

    #[test]
    fn a_face_that_looks_away_is_passed_over() {
        let positions = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z * 0.5, Vec3::X + Vec3::Z * 0.5, Vec3::Y + Vec3::Z * 0.5];
        let tree = SurfaceTree::new(&positions, &[[0, 1, 2], [3, 5, 4]]);
        let p = Vec3::new(0.2, 0.2, 0.4);
        assert_eq!(tree.closest(p, Vec3::ZERO, 1.0).unwrap().face, 1);
        assert_eq!(tree.closest(p, Vec3::Z, 1.0).unwrap().face, 0);
    }
}
