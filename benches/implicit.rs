//! A surface from a field, and heights from it: the exact field of the body itself, posed. Beside them a mesh from cells
//! that are all opened, and heights by a walk of millimetre steps.

use crate::{body, pose, swing};
use divan::{Bencher, black_box};
use glam::Vec3;
use softtissue_geometry::Mesh;
use softtissue_implicit::{HeightConfig, MarchingCubes, MeshField, ObserverFrame, Observers, SignedDistance, heights};

/// The posed body, and a thousand observer points a centimetre under its skin.
fn scene() -> (Mesh, ObserverFrame) {
    let body = body(1);
    let posed = body.posed(&body.shaped(&[0.5, -0.5]), pose(&swing(body.joint_count(), 7)), None);
    let mut at = Observers::spread(&body.template, 1000).expect("enough vertices").frame(&posed, &body.topology);
    at.positions.iter_mut().zip(&at.normals).for_each(|(p, n)| *p -= *n * 0.01);
    (Mesh::new(posed, body.topology.clone()), at)
}

#[divan::bench(args = [64, 128], sample_count = 10)]
fn marching_cubes(bencher: Bencher, resolution: usize) {
    let (mesh, _) = scene();
    let field = MeshField::new(&mesh);
    let cubes = MarchingCubes { resolution, ..Default::default() };
    bencher.bench_local(|| cubes.surface_near(&field, black_box(&mesh.positions), 0.1).expect("a surface"));
}

#[divan::bench(args = [64, 128], sample_count = 2)]
fn marching_cubes_everywhere(bencher: Bencher, resolution: usize) {
    let (mesh, _) = scene();
    let field = MeshField::new(&mesh);
    let cubes = MarchingCubes { resolution, slack: f32::MAX };
    bencher.bench_local(|| cubes.surface_near(&field, black_box(&mesh.positions), 0.1).expect("a surface"));
}

#[divan::bench(sample_count = 50)]
fn thousand_heights(bencher: Bencher) {
    let (mesh, at) = scene();
    let field = MeshField::new(&mesh);
    let config = HeightConfig::default();
    let off = |(a, b): (&f32, &f32)| (a - b).abs() > 1e-3;
    let ours = heights(&field, &at.positions, &at.normals, &config);
    // a wall thinner than a sample is passed over
    let differ = ours.iter().zip(&walked(&field, &at, &config)).filter(|pair| off(*pair)).count();
    assert!(differ < 50, "{differ} of 1000 heights differ by more than a millimetre");
    bencher.bench_local(|| heights(&field, black_box(&at.positions), &at.normals, &config));
}

#[divan::bench(sample_count = 10)]
fn thousand_heights_walked(bencher: Bencher) {
    let (mesh, at) = scene();
    let field = MeshField::new(&mesh);
    bencher.bench_local(|| walked(&field, black_box(&at), &HeightConfig::default()));
}

/// The first crossing outwards by steps of a millimetre, one point after the other.
fn walked(field: &MeshField, at: &ObserverFrame, config: &HeightConfig) -> Vec<f32> {
    let steps = ((config.highest - config.lowest) * 1000.0).round() as usize;
    let height = |i: usize| config.lowest + i as f32 * 0.001;
    let walk = |(p, n): (&Vec3, &Vec3)| {
        let places: Vec<Vec3> = (0..=steps).map(|i| *p + *n * height(i)).collect();
        let mut values = vec![0.0; places.len()];
        field.values(&places, &mut values);
        match values.iter().position(|f| *f >= 0.0) {
            Some(i) if i > 0 => height(i - 1) + 0.001 * values[i - 1] / (values[i - 1] - values[i]),
            _ => config.lowest,
        }
    };
    at.positions.iter().zip(&at.normals).map(walk).collect()
}
