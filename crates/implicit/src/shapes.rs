//! Fields with closed forms, for tests.

use crate::SignedDistance;
use glam::{Vec2, Vec3};
use softtissue_geometry::{Mesh, Topology};
use softtissue_random::Draws;
use std::sync::Arc;

#[derive(Clone, Copy, Debug)]
pub(crate) enum Shape {
    Sphere {
        centre: Vec3,
        radius: f32,
    },
    /// `normal . p = offset`.
    Plane {
        normal: Vec3,
        offset: f32,
    },
    Capsule {
        a: Vec3,
        b: Vec3,
        radius: f32,
    },
    /// Round the Y axis.
    Torus {
        ring: f32,
        tube: f32,
    },
}

impl Shape {
    pub fn at(&self, p: Vec3) -> f32 {
        match *self {
            Self::Sphere { centre, radius } => p.distance(centre) - radius,
            Self::Plane { normal, offset } => normal.dot(p) - offset,
            Self::Capsule { a, b, radius } => {
                let t = ((p - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
                p.distance(a.lerp(b, t)) - radius
            }
            Self::Torus { ring, tube } => Vec2::new(Vec2::new(p.x, p.z).length() - ring, p.y).length() - tube,
        }
    }
}

impl SignedDistance for Shape {
    fn values(&self, points: &[Vec3], out: &mut [f32]) {
        points.iter().zip(out).for_each(|(p, out)| *out = self.at(*p));
    }
}

/// Uniform in a cube of half side `reach`.
pub(crate) fn draw(draws: &mut Draws, reach: f64) -> Vec3 {
    Vec3::from_array(std::array::from_fn(|_| draws.range(-reach, reach) as f32))
}

/// A closed box round the origin, two triangles a side.
pub(crate) fn cuboid(half: Vec3) -> Mesh {
    let corner = |i: usize| half * Vec3::from_array(std::array::from_fn(|a| if i >> a & 1 == 1 { 1.0 } else { -1.0 }));
    let quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let faces: Vec<[u32; 3]> = quads.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).collect();
    let topology = Topology { vertex_count: 8, faces, quads: Vec::new() };
    assert_eq!(topology.check_closed_manifold(), Ok(0));
    Mesh::new((0..8).map(corner).collect(), Arc::new(topology))
}
