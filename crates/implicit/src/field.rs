use glam::Vec3;

/// A signed distance field: negative inside, positive outside, zero on the surface.
pub trait SignedDistance {
    /// Signed distances `out`, metres, of `points`, metres; both `[N]`.
    fn values(&self, points: &[Vec3], out: &mut [f32]);

    /// Unit gradients at `points`, `[N]`: on the surface its outward normals. Zero where the field is flat.
    ///
    /// Central differences over `step`, metres, to either side along each axis; a field that knows its gradient gives that
    /// instead.
    fn normals(&self, points: &[Vec3], step: f32) -> Vec<Vec3> {
        let around = |p: &Vec3| Vec3::AXES.map(|axis| [*p + axis * step, *p - axis * step]);
        let places: Vec<Vec3> = points.iter().flat_map(around).flatten().collect();
        let mut values = vec![0.0; places.len()];
        self.values(&places, &mut values);
        let gradient = |f: &[f32; 6]| Vec3::new(f[0] - f[1], f[2] - f[3], f[4] - f[5]).normalize_or_zero();
        values.as_chunks::<6>().0.iter().map(gradient).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes::{Shape, draw};
    use softtissue_random::Draws;

    #[test]
    fn differences_give_the_normals_of_a_sphere_and_a_plane() {
        let mut draws = Draws::new(1, "field", 0, 0);
        let points: Vec<Vec3> = (0..100).map(|_| draw(&mut draws, 1.0)).filter(|p| p.length() > 0.2).collect();
        let sphere = Shape::Sphere { centre: Vec3::ZERO, radius: 0.5 };
        for (n, p) in sphere.normals(&points, 1e-3).iter().zip(&points) {
            assert!(n.distance(p.normalize()) < 2e-4, "{n} at {p}");
        }
        let plane = Shape::Plane { normal: Vec3::new(0.6, 0.0, 0.8), offset: 0.3 };
        for n in plane.normals(&points, 1e-3) {
            assert!(n.distance(Vec3::new(0.6, 0.0, 0.8)) < 2e-4);
        }
        let flat = Shape::Plane { normal: Vec3::ZERO, offset: 0.3 };
        assert_eq!(flat.normals(&points[..1], 1e-3), [Vec3::ZERO]);
    }
}
