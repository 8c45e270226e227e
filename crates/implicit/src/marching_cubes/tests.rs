use super::*;
use crate::shapes::Shape;
use glam::Vec2;
use softtissue_geometry::{face_normals, signed_volume};
use softtissue_random::Draws;
use std::cell::Cell;
use std::f64::consts::PI;

fn area(mesh: &Mesh) -> f64 {
    face_normals(&mesh.positions, &mesh.topology.faces).iter().map(|n| 0.5 * f64::from(n.length())).sum()
}

fn at(resolution: usize) -> MarchingCubes {
    MarchingCubes { resolution, ..Default::default() }
}

/// Volume and area of a sphere are short by a share that goes with the square of a cell.
#[test]
fn a_spheres_volume_area_and_normals_converge() {
    let sphere = Shape::Sphere { centre: Vec3::new(0.013, -0.02, 0.007), radius: 0.4 };
    let (volume, whole) = (4.0 / 3.0 * PI * 0.4f64.powi(3), 4.0 * PI * 0.16);
    let mut errors = Vec::new();
    for resolution in [16, 32, 64] {
        let found = at(resolution).surface(&sphere, Vec3::splat(-0.5), Vec3::splat(0.5)).unwrap();
        assert_eq!(found.mesh.topology.check_closed_manifold(), Ok(0));
        let of_volume = 1.0 - signed_volume(&found.mesh.positions, &found.mesh.topology.faces) / volume;
        errors.push([of_volume, 1.0 - area(&found.mesh) / whole]);
        for (p, n) in found.mesh.positions.iter().zip(&found.normals) {
            let outward = (*p - Vec3::new(0.013, -0.02, 0.007)).normalize();
            assert!(n.distance(outward) < 1e-3, "{n} and {outward}");
        }
    }
    for pair in errors.windows(2) {
        for i in 0..2 {
            let ratio = pair[0][i] / pair[1][i];
            assert!(pair[0][i] > 0.0 && (3.4..4.6).contains(&ratio), "{errors:?}");
        }
    }
    // a chord of a cell's diagonal is off by its square over eight radii
    let h = 1.0 / 64.0;
    assert!(errors[2][0] < 3.0 * 3.0 * h * h / (8.0 * 0.4 * 0.4), "{errors:?}");
}

#[test]
fn a_torus_has_a_hole() {
    let torus = Shape::Torus { ring: 0.3, tube: 0.08 };
    let found = at(40).surface(&torus, Vec3::splat(-0.5), Vec3::splat(0.5)).unwrap();
    assert_eq!(found.mesh.topology.check_closed_manifold(), Ok(1));
    let volume = 2.0 * PI * PI * 0.3 * 0.08 * 0.08;
    let error = signed_volume(&found.mesh.positions, &found.mesh.topology.faces) / volume - 1.0;
    assert!(error.abs() < 0.02, "{error}");
}

/// Whatever the signs of neighbouring corners, every edge lies in two triangles of opposite direction.
#[test]
fn noise_gives_a_closed_manifold() {
    struct Noise(u64);
    impl SignedDistance for Noise {
        fn values(&self, points: &[Vec3], out: &mut [f32]) {
            for (p, out) in points.iter().zip(out) {
                let cell = (*p * 1000.0).round().as_ivec3();
                let key = (cell.x as u64) << 42 ^ (cell.y as u64) << 21 ^ cell.z as u64;
                *out = Draws::new(self.0, "noise", key, 0).range(-1.0, 1.0) as f32;
            }
        }
    }
    for seed in 0..4 {
        // a slack beyond all values opens every cell
        let found = MarchingCubes { resolution: 12, slack: 1e6 }
            .surface(&Noise(seed), Vec3::ZERO, Vec3::new(1.2, 0.7, 0.5))
            .unwrap();
        found.mesh.topology.check_closed_manifold().unwrap();
        assert!(found.mesh.topology.faces.len() > 500);
        assert!(face_normals(&found.mesh.positions, &found.mesh.topology.faces).iter().all(|n| n.length() > 0.0));
    }
}

#[test]
fn a_surface_that_leaves_the_box_is_closed_at_its_border() {
    let plane = Shape::Plane { normal: Vec3::Y, offset: 0.1 };
    let found = at(16).surface(&plane, Vec3::splat(-0.5), Vec3::splat(0.5)).unwrap();
    assert_eq!(found.mesh.topology.check_closed_manifold(), Ok(0));
    let volume = signed_volume(&found.mesh.positions, &found.mesh.topology.faces);
    assert!((volume - 0.6).abs() < 0.16, "{volume}");
}

/// Coarse to fine gives the mesh of asking everywhere, at a small part of the cost.
#[test]
fn coarse_cells_lose_nothing_and_spare_most_values() {
    struct Counted(Shape, Cell<usize>);
    impl SignedDistance for Counted {
        fn values(&self, points: &[Vec3], out: &mut [f32]) {
            self.1.set(self.1.get() + points.len());
            self.0.values(points, out);
        }
    }
    let capsule = Shape::Capsule { a: Vec3::new(-0.3, -0.2, 0.0), b: Vec3::new(0.3, 0.25, 0.1), radius: 0.03 };
    let (low, high) = (Vec3::splat(-0.5), Vec3::new(0.5, 0.4, 0.3));
    let run = |slack: f32| {
        let field = Counted(capsule, Cell::new(0));
        let found = MarchingCubes { resolution: 64, slack }.surface(&field, low, high).unwrap();
        (found.mesh, field.1.get())
    };
    let (everywhere, all) = run(1e6);
    let (sparse, few) = run(1.0);
    assert_eq!(everywhere.positions, sparse.positions);
    assert_eq!(everywhere.topology, sparse.topology);
    assert!(few * 8 < all, "{few} of {all}");
}

/// A rod that no coarse cell is found to hold but at one end is followed to the other.
#[test]
fn a_part_that_is_found_is_found_whole() {
    struct Rod;
    impl SignedDistance for Rod {
        fn values(&self, points: &[Vec3], out: &mut [f32]) {
            for (p, out) in points.iter().zip(out) {
                let rod = Shape::Capsule { a: Vec3::X * -0.4, b: Vec3::X * 0.4, radius: 0.02 }.at(*p);
                // far too steep away from the left end: cells there look empty
                *out = if p.x < -0.3 { rod } else { 20.0 * rod };
            }
        }
    }
    let found = at(64).surface(&Rod, Vec3::splat(-0.5), Vec3::splat(0.5)).unwrap();
    assert_eq!(found.mesh.topology.check_closed_manifold(), Ok(0));
    let right = found.mesh.positions.iter().map(|p| p.x).fold(f32::MIN, f32::max);
    assert!((right - 0.42).abs() < 0.002, "{right}");
}

#[test]
fn only_what_is_near_is_looked_for() {
    struct Pair;
    impl SignedDistance for Pair {
        fn values(&self, points: &[Vec3], out: &mut [f32]) {
            let ball = |x: f32| Shape::Sphere { centre: Vec3::X * x, radius: 0.1 };
            points.iter().zip(out).for_each(|(p, out)| *out = ball(0.0).at(*p).min(ball(0.5).at(*p)));
        }
    }
    let points: Vec<Vec3> = (0..40)
        .map(|i| Vec2::from_angle(i as f32 * 0.157))
        .flat_map(|d| [Vec3::new(d.x, d.y, 0.0), Vec3::new(d.x, 0.0, d.y), Vec3::new(0.0, d.x, d.y)])
        .map(|d| d * 0.09)
        .collect();
    let found = at(32).surface_near(&Pair, &points, 0.05).unwrap();
    let volume = signed_volume(&found.mesh.positions, &found.mesh.topology.faces);
    assert!((volume / (4.0 / 3.0 * PI * 0.001) - 1.0).abs() < 0.02, "{volume}");
    let both = at(64).surface(&Pair, Vec3::splat(-0.2), Vec3::new(0.7, 0.2, 0.2)).unwrap();
    // Euler's formula over two spheres
    assert_eq!(both.mesh.topology.check_closed_manifold(), Ok(-1));
}

#[test]
fn nothing_is_found_where_there_is_nothing_and_odd_boxes_are_refused() {
    let far = Shape::Sphere { centre: Vec3::splat(9.0), radius: 0.4 };
    let found = at(16).surface(&far, Vec3::ZERO, Vec3::ONE).unwrap();
    assert!(found.mesh.positions.is_empty() && found.mesh.topology.faces.is_empty());
    assert!(at(16).surface(&far, Vec3::ONE, Vec3::ZERO).is_err());
    assert!(at(16).surface(&far, Vec3::ZERO, Vec3::splat(f32::NAN)).is_err());
    assert!(at(2000).surface(&far, Vec3::ZERO, Vec3::ONE).is_err());
    assert!(at(1024).surface(&far, Vec3::ZERO, Vec3::ONE).is_err(), "a thousand million corners");
    assert!(at(16).surface_near(&far, &[], 0.1).is_err());
}
