use crate::body;
use glam::Vec3;
use softtissue_geometry::{Mesh, signed_volume, vertex_normals};
use softtissue_implicit::{
    HeightConfig, MarchingCubes, MeshField, Observers, RawSurface, RawSurfaceConfig, heights, mean_distance,
};
use softtissue_synth::scanner::RawScanner;

/// The body of a scan: half a centimetre fatter than the one that the observers stand on.
fn fatter() -> Vec<Vec3> {
    let (rest, faces) = (&body().template, &body().topology.faces);
    rest.iter().zip(vertex_normals(rest, faces)).map(|(p, n)| *p + n * 0.005).collect()
}

/// Heights read off a raw scan of a known surface are those read off the surface itself, where the scan has any.
#[test]
fn heights_of_a_raw_scan_are_those_of_the_true_surface() {
    let body = body();
    let truth = Mesh::new(fatter(), body.topology.clone());
    let scan = RawScanner::new(body, 20_000, "heights", 1).scan(0, &truth.positions);
    let surface = RawSurface::new(&scan, &RawSurfaceConfig::default()).unwrap();
    let at = Observers::spread(&body.template, 500).unwrap().frame(&body.template, &body.topology);
    let config = HeightConfig::default();
    let wanted = heights(&MeshField::new(&truth), &at.positions, &at.normals, &config);
    let found = surface.heights(&at, &config);
    let known: Vec<usize> = (0..wanted.len()).filter(|i| found.known[*i]).collect();
    let mut errors: Vec<f32> = known.iter().map(|i| (found.values[*i] - wanted[*i]).abs()).collect();
    errors.sort_by(f32::total_cmp);
    let (median, late) = (errors[errors.len() / 2], errors[errors.len() * 9 / 10]);
    println!("{} of {} known, errors: median {median} m, nine tenths {late} m", known.len(), wanted.len());
    // the scanner's noise is 0.7 mm and the error that neighbours share 1 mm
    assert!(known.len() > 380 && median < 0.0012 && late < 0.004, "{} {median} {late}", known.len());
}

/// The body by marching cubes is the body: closed, and what its volume lacks goes with the square of a cell.
#[test]
fn the_body_comes_back_from_its_field() {
    let body = body();
    let truth = Mesh::new(body.template.clone(), body.topology.clone());
    let field = MeshField::new(&truth);
    let volume = |mesh: &Mesh| signed_volume(&mesh.positions, &mesh.topology.faces);
    let lacks = [48, 96].map(|resolution| {
        let cubes = MarchingCubes { resolution, ..Default::default() };
        let found = cubes.surface_near(&field, &body.template, 0.1).unwrap();
        found.mesh.topology.check_closed_manifold().unwrap();
        let distance = mean_distance(&truth.positions, &found.mesh).unwrap();
        (1.0 - volume(&found.mesh) / volume(&truth), distance)
    });
    println!("volume that is lacking and mean distance at 48 and 96 cells: {lacks:?}");
    let ratio = lacks[0].0 / lacks[1].0;
    assert!((3.0..5.0).contains(&ratio) && lacks[1].0 < 0.03, "{lacks:?}");
    assert!(lacks[1].1 < 0.5 * lacks[0].1, "{lacks:?}");
}
