use glam::Vec3;
use rayon::prelude::*;
use softtissue_geometry::{Mesh, SurfaceTree};

/// Farther away nothing is sought, metres.
const REACH: f32 = 1e4;
/// Points of one sum: the mean is the same whatever the number of threads.
const POINTS_A_SUM: usize = 256;

/// Scan-to-prediction distance (AutoAvatar, sec. 4.1): the mean distance of points, metres, from the closest place on a
/// mesh, metres. None without points or triangles.
pub fn mean_distance(points: &[Vec3], mesh: &Mesh) -> Option<f64> {
    if points.is_empty() || mesh.topology.faces.is_empty() {
        return None;
    }
    let tree = SurfaceTree::new(&mesh.positions, &mesh.topology.faces);
    let distance = |p: &Vec3| f64::from(tree.closest(*p, Vec3::ZERO, REACH).map_or(REACH, |place| place.distance));
    let sums: Vec<f64> = points.par_chunks(POINTS_A_SUM).map(|part| part.iter().map(distance).sum()).collect();
    Some(sums.iter().sum::<f64>() / points.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::MarchingCubes;
    use crate::shapes::{Shape, cuboid, draw};
    use softtissue_random::Draws;

    #[test]
    fn distances_from_a_cuboid_and_a_sphere() {
        let mesh = cuboid(Vec3::new(0.5, 0.4, 0.3));
        // inside, on a face, off a face, off an edge, off a corner
        let points = [
            Vec3::new(0.0, 0.0, 0.2),
            Vec3::new(0.5, 0.1, 0.1),
            Vec3::new(0.1, 0.9, 0.0),
            Vec3::new(0.8, 0.8, 0.0),
            Vec3::new(0.6, 0.6, 0.5),
        ];
        let wanted = (0.1 + 0.0 + 0.5 + 0.5 + 0.3) / 5.0;
        assert!((mean_distance(&points, &mesh).unwrap() - wanted).abs() < 1e-6);
        assert_eq!(mean_distance(&[], &mesh), None);

        let sphere = |radius: f32| {
            let field = Shape::Sphere { centre: Vec3::ZERO, radius };
            MarchingCubes { resolution: 64, ..Default::default() }
                .surface(&field, Vec3::splat(-0.5), Vec3::splat(0.5))
                .unwrap()
                .mesh
        };
        let mut draws = Draws::new(4, "distance", 0, 0);
        let shell: Vec<Vec3> = (0..500).map(|_| draw(&mut draws, 1.0).normalize() * 0.31).collect();
        // the mesh is a tenth of a millimetre short of the sphere
        assert!((mean_distance(&shell, &sphere(0.3)).unwrap() - 0.01).abs() < 2e-4);
    }
}
