//! The triangle form: closed forms, optimality of both least squares, round trips, and its way into a fit set.

use crate::figure::figure;
use crate::scans::{CLEAN, Recipe, Truth, all_train};
use glam::{DMat3, DVec3, Vec3};
use softtissue_body::BodyModel;
use softtissue_body::procedural::{Levels, ProceduralConfig, generate_levels};
use softtissue_clips::ClipId;
use softtissue_fit::{DeltaForm, FitConfig, FitError, TriangleDeltas, TriangleForm, fit_set};
use softtissue_geometry::Topology;
use softtissue_monitor::Silent;
use softtissue_random::Draws;
use std::sync::OnceLock;

fn bodies() -> [&'static BodyModel; 2] {
    static LEVELS: OnceLock<Levels> = OnceLock::new();
    let levels = LEVELS.get_or_init(|| generate_levels(&ProceduralConfig::default()).expect("the default body"));
    [&levels.coarse.model, &levels.fine.model]
}

fn form(body: &BodyModel, smoothness: f64) -> TriangleForm {
    TriangleForm::new(&body.template, &body.topology, smoothness).expect("a body in one piece")
}

/// Flesh-like waves of 20 mm with white noise of 3 mm a coordinate: rougher than any delta.
fn random_deltas(body: &BodyModel, seed: u64) -> Vec<Vec3> {
    let mut draws = Draws::new(seed, "triangles", 0, 0);
    let waves: Vec<[f32; 4]> = (0..3).map(|_| [0; 4].map(|_| draws.range(-12.0, 12.0) as f32)).collect();
    body.template
        .iter()
        .map(|p| {
            let wave = |[x, y, z, phase]: [f32; 4]| 0.02 * (x * p.x + y * p.y + z * p.z + phase).sin();
            let white = Vec3::from_array([0; 3].map(|_| 0.003 * draws.normal() as f32));
            Vec3::new(wave(waves[0]), wave(waves[1]), wave(waves[2])) + white
        })
        .collect()
}

fn worst(a: &[Vec3], b: &[Vec3]) -> f32 {
    a.iter().zip(b).map(|(a, b)| a.distance(*b)).fold(0.0, f32::max)
}

#[test]
fn deltas_come_back_within_a_tenth_of_a_millimetre() {
    let smoothness = FitConfig::default().triangle_smoothness;
    for body in bodies() {
        let form = form(body, smoothness);
        for seed in 0..2 {
            let deltas = random_deltas(body, seed);
            let error = worst(&form.round_trip(&deltas), &deltas);
            assert!(error < 1e-4, "{} vertices: {error} m", body.vertex_count());
        }
    }
}

/// An affine change of space deforms every triangle by its matrix, normal included, whatever the smoothness.
#[test]
fn an_affine_field_has_one_deformation_everywhere() {
    let body = bodies()[0];
    let matrix = DMat3::from_cols_array(&[0.02, 0.01, -0.03, 0.015, -0.02, 0.005, 0.0, 0.03, 0.01]);
    let shift = DVec3::new(0.004, -0.01, 0.02);
    let deltas: Vec<Vec3> = body.template.iter().map(|p| (matrix * p.as_dvec3() + shift).as_vec3()).collect();
    for smoothness in [1e-8, 1e-3] {
        let form = form(body, smoothness);
        let found = form.gradients(&deltas);
        let off =
            found.gradients.iter().map(|g| (*g - matrix).to_cols_array().iter().fold(0.0, |m: f64, x| m.max(x.abs())));
        let off = off.fold(0.0, f64::max);
        // Rounding of the deltas to f32 over the shortest edges.
        assert!(off < 2e-4, "smoothness {smoothness}: {off}");
        assert!(worst(&form.stitch(&found), &deltas) < 1e-6);
    }
}

/// Eq. 12 for one frame: squared errors of edges, and of neighbours' differences with the smoothness.
fn energy(body: &BodyModel, smoothness: f64, deltas: &[Vec3], gradients: &[DMat3]) -> f64 {
    let faces = &body.topology.faces;
    let at = |v: u32| body.template[v as usize].as_dvec3();
    let moved = |v: u32| deltas[v as usize].as_dvec3();
    let mut sum = 0.0;
    for (f, g) in faces.iter().zip(gradients) {
        for end in &f[1..] {
            sum += (*g * (at(*end) - at(f[0])) - (moved(*end) - moved(f[0]))).length_squared();
        }
    }
    let shared = |a: &[u32; 3], b: &[u32; 3]| a.iter().filter(|v| b.contains(v)).count() == 2;
    for (i, f) in faces.iter().enumerate() {
        for (j, g) in faces.iter().enumerate().skip(i + 1) {
            if shared(f, g) {
                let columns = (gradients[i] - gradients[j]).to_cols_array();
                sum += smoothness * columns.iter().map(|x| x * x).sum::<f64>();
            }
        }
    }
    sum
}

/// At the minimum of a quadratic, steps to both sides of it cost the same, and something.
#[test]
fn extraction_minimises_its_objective_and_stitching_its_own() {
    let body = bodies()[0];
    let (smoothness, mut draws) = (1e-4, Draws::new(4, "descent", 0, 0));
    let form = form(body, smoothness);
    let deltas = random_deltas(body, 9);
    let found = form.gradients(&deltas);
    let lowest = energy(body, smoothness, &deltas, &found.gradients);
    let step: Vec<DMat3> =
        found.gradients.iter().map(|_| DMat3::from_cols_array(&[0; 9].map(|_| 0.1 * draws.normal()))).collect();
    let [above, below] = [1.0, -1.0].map(|sign| {
        let moved: Vec<DMat3> = found.gradients.iter().zip(&step).map(|(g, s)| *g + *s * sign).collect();
        energy(body, smoothness, &deltas, &moved) - lowest
    });
    assert!(above > 0.0 && (above - below).abs() < 1e-6 * above, "{above} {below}");

    // Deformations that fit no mesh: at every vertex the edges' errors balance.
    let torn = TriangleDeltas { gradients: step, place: DVec3::new(0.1, 0.2, 0.3) };
    let stitched = form.stitch(&torn);
    let mut balance = vec![DVec3::ZERO; body.vertex_count()];
    for (f, g) in body.topology.faces.iter().zip(&torn.gradients) {
        for end in &f[1..] {
            let [a, b] = [f[0], *end].map(|v| v as usize);
            let edge = body.template[b].as_dvec3() - body.template[a].as_dvec3();
            let error = stitched[b].as_dvec3() - stitched[a].as_dvec3() - *g * edge;
            balance[b] += error;
            balance[a] -= error;
        }
    }
    let off = balance.iter().map(|b| b.length()).fold(0.0, f64::max);
    assert!(off < 1e-6, "{off}");
    let mean = stitched.iter().map(|d| d.as_dvec3()).sum::<DVec3>() / stitched.len() as f64;
    assert!((mean - torn.place).length() < 1e-6);
}

#[test]
fn a_smoother_form_takes_noise_away_and_keeps_broad_waves() {
    let body = bodies()[0];
    let form = form(body, 1e-3);
    let mut draws = Draws::new(6, "noise", 0, 0);
    let broad: Vec<Vec3> = body.template.iter().map(|p| Vec3::Y * 0.02 * (4.0 * p.y).sin()).collect();
    let noisy: Vec<Vec3> =
        broad.iter().map(|d| *d + Vec3::from_array([0; 3].map(|_| 0.002 * draws.normal() as f32))).collect();
    let rms = |a: &[Vec3]| {
        let squares = a.iter().zip(&broad).map(|(a, b)| f64::from(a.distance_squared(*b)));
        (squares.sum::<f64>() / a.len() as f64).sqrt()
    };
    let (before, after, bias) = (rms(&noisy), rms(&form.round_trip(&noisy)), rms(&form.round_trip(&broad)));
    assert!(after < 0.7 * before && bias < 0.1 * before, "noise {before}, left {after}, bias {bias}");
}

#[test]
fn a_mesh_in_two_pieces_and_a_smoothness_of_zero_are_refused() {
    let body = bodies()[0];
    for smoothness in [0.0, -1.0, f64::NAN] {
        let error = TriangleForm::new(&body.template, &body.topology, smoothness).err().expect("no smoothness");
        assert!(matches!(error, FitError::Config { field: "triangle_smoothness", .. }), "{error}");
    }
    let loose = Topology { vertex_count: 8, faces: vec![[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]], quads: vec![] };
    let points: Vec<Vec3> = (0..8).map(|i| Vec3::new(i as f32, (i * i) as f32, (i % 3) as f32)).collect();
    let error = TriangleForm::new(&points, &loose, 1e-6).err().expect("vertices without a triangle");
    assert!(matches!(error, FitError::Mesh { .. }) && error.to_string().contains("one piece"), "{error}");
    let tubes = figure(5, 6);
    assert!(TriangleForm::new(&tubes.template, &tubes.topology, 1e-6).is_err());
}

/// `fit.delta_form = "triangles"` changes the deltas by little and nothing else.
#[test]
fn a_fit_set_through_the_triangle_form() {
    let recipe = Recipe { frames: 6, flesh: 0.01, noise: 0.001, ..CLEAN };
    let body = bodies()[0].clone();
    let truth = Truth { beta: vec![0.5, -1.0], detail: vec![Vec3::ZERO; body.vertex_count()], body };
    let id = ClipId::new("a", "walk", 0);
    let dir = tempfile::tempdir().unwrap();
    let scans = truth.write(&dir.path().join("scans"), std::slice::from_ref(&id), &recipe);
    let fitted = |name: &str, config: FitConfig| {
        fit_set(&scans, &all_train(std::slice::from_ref(&id)), &truth.body, &config, &dir.path().join(name), &Silent)
            .unwrap()
    };
    let plain = fitted("vertices", FitConfig::default());
    let triangles = |smoothness| FitConfig {
        delta_form: DeltaForm::Triangles,
        triangle_smoothness: smoothness,
        ..FitConfig::default()
    };
    let (same, smooth) = (fitted("same", triangles(1e-8)), fitted("smooth", triangles(1e-3)));
    let deltas = |set: &softtissue_clips::FitSet| set.deltas(&id).unwrap().deltas;
    let apart = |set| worst(deltas(set).points(), deltas(&plain).points());
    assert!((1e-9..1e-4).contains(&apart(&same)), "{}", apart(&same));
    assert!(apart(&smooth) > 1e-3, "{}", apart(&smooth));
    assert!(plain.motion(&id).unwrap() == smooth.motion(&id).unwrap(), "poses");
    let known = |set: &softtissue_clips::FitSet| {
        let subject = set.subject("a").unwrap();
        (subject.beta, subject.template, subject.fit_weight)
    };
    assert!(known(&plain) == known(&smooth), "shape, template and fit weights");
}
