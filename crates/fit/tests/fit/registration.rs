//! Raw scans of the tube figure, made of its true vertices: points in no order, with noise, holes and outliers.

use crate::scans::{FPS, Recipe, Truth};
use glam::Vec3;
use softtissue_body::{BodyModel, Region};
use softtissue_clips::{ClipEntry, ClipId, RawFrame, RawScans, ScanClip, ScanSet};
use softtissue_fit::{FitError, RegistrationConfig, register_set};
use softtissue_geometry::vertex_normals;
use softtissue_monitor::Silent;
use softtissue_random::Draws;
use std::path::Path;

const RECIPE: Recipe = Recipe { frames: 6, pose_size: 0.2, flesh: 0.012, detail: 0.003, noise: 0.0, still: 3 };
const POINTS: usize = 6000;

/// The person that the body of the tests is.
struct Scanner {
    truth: Truth,
    clean: ScanClip,
    missing: Option<usize>,
    /// Part of the points in a frame that are anywhere.
    stray: f64,
    points: usize,
}

impl Scanner {
    fn new() -> Self {
        let truth = Truth::new(&RECIPE);
        let clean = truth.scan(&ClipId::new("anna", "hips", 0), &RECIPE);
        Self { truth, clean, missing: None, stray: 0.002, points: POINTS }
    }

    /// Where the scan of a frame has its hole: a ball of 8 cm about a vertex of the belly's side.
    fn hole(&self, t: usize) -> Vec3 {
        let belly = self.truth.body.regions.vertices(Region::Belly);
        self.clean.vertices.frame(t)[belly[0] as usize]
    }
}

impl RawScans for Scanner {
    fn clips(&self) -> Vec<ClipEntry> {
        vec![ClipEntry { id: self.clean.id.clone(), frames: RECIPE.frames, fps: FPS }]
    }

    fn frame(&self, _: &ClipId, t: usize) -> softtissue_clips::Result<Option<RawFrame>> {
        if self.missing == Some(t) {
            return Ok(None);
        }
        let (vertices, faces) = (self.clean.vertices.frame(t), &self.truth.body.topology.faces);
        let normals = vertex_normals(vertices, faces);
        let mut draws = Draws::new(5, "raw", 0, t as u64);
        let mut frame = RawFrame::default();
        let hole = self.hole(t);
        while frame.points.len() < self.points {
            let face = faces[draws.below(faces.len())];
            let (u, v) = (draws.uniform() as f32, draws.uniform() as f32);
            let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
            let mix = |field: &[Vec3]| -> Vec3 {
                face.iter().zip([1.0 - u - v, u, v]).map(|(i, w)| field[*i as usize] * w).sum()
            };
            let (mut point, normal) = (mix(vertices), mix(&normals).normalize_or(Vec3::Y));
            point += normal * (0.0007 * draws.normal()) as f32;
            if draws.uniform() < self.stray {
                point += Vec3::from_array(std::array::from_fn(|_| draws.range(-0.4, 0.4) as f32));
            }
            if point.distance(hole) > 0.08 {
                frame.points.push(point);
                frame.normals.push(normal);
            }
        }
        Ok(Some(frame))
    }

    fn provenance(&self) -> serde_json::Value {
        serde_json::json!({"source": "a test"})
    }
}

fn register(scanner: &Scanner, out: &Path) -> Result<(ScanSet, serde_json::Value), FitError> {
    let set = register_set(scanner, &scanner.truth.body, &RegistrationConfig::default(), out, &Silent)?;
    let quality = std::fs::read(out.join("registration.json")).unwrap();
    Ok((set, serde_json::from_slice::<serde_json::Value>(&quality).unwrap()[0].clone()))
}

fn judged(body: &BodyModel) -> Vec<usize> {
    let kept = |v: &usize| !matches!(body.regions.0[*v], Region::Hands | Region::Feet | Region::Head);
    (0..body.vertex_count()).filter(kept).collect()
}

#[test]
fn raw_scans_are_registered_through_noise_holes_and_outliers() {
    let scanner = Scanner::new();
    let dir = tempfile::tempdir().unwrap();
    let (set, quality) = register(&scanner, dir.path()).unwrap();
    let found = set.scan(&scanner.clean.id).unwrap().vertices;
    assert_eq!((found.len(), found.points_per_frame()), (RECIPE.frames, scanner.truth.body.vertex_count()));
    assert!(quality["median_mm"].as_f64().unwrap() < 1.0, "{quality}");
    assert!(quality["p95_mm"].as_f64().unwrap() < 4.0, "{quality}");
    assert_eq!(quality["restarts"], 0, "{quality}");
    for t in 0..RECIPE.frames {
        let off = |v: usize| found.frame(t)[v].distance(scanner.clean.vertices.frame(t)[v]);
        let all = judged(&scanner.truth.body);
        let mean = all.iter().map(|v| off(*v)).sum::<f32>() / all.len() as f32;
        assert!(mean < 0.008, "frame {t}: vertices are {mean} m from their true places in the mean");
        // no point fell into the hole, yet the surface goes on there
        let inside: Vec<usize> =
            all.into_iter().filter(|v| scanner.clean.vertices.frame(t)[*v].distance(scanner.hole(t)) < 0.05).collect();
        assert!(!inside.is_empty());
        let worst = inside.iter().map(|v| off(*v)).fold(0.0, f32::max);
        assert!(worst < 0.025, "frame {t}: a vertex in the hole is {worst} m off");
    }
}

#[test]
fn the_same_scans_give_the_same_bytes_whatever_the_threads() {
    let scanner = Scanner { points: 1500, ..Scanner::new() };
    let run = |threads: usize| {
        let dir = tempfile::tempdir().unwrap();
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| register(&scanner, dir.path())).unwrap().0.scan(&scanner.clean.id).unwrap().vertices
    };
    assert_eq!(run(1), run(3));
}

#[test]
fn a_missing_frame_lies_between_its_neighbours() {
    let scanner = Scanner { missing: Some(4), points: 1500, ..Scanner::new() };
    let dir = tempfile::tempdir().unwrap();
    let (set, quality) = register(&scanner, dir.path()).unwrap();
    let found = set.scan(&scanner.clean.id).unwrap().vertices;
    assert_eq!(quality["interpolated"], serde_json::json!([4]));
    for v in 0..found.points_per_frame() {
        let middle = found.frame(3)[v].midpoint(found.frame(5)[v]);
        assert!(found.frame(4)[v].distance(middle) < 1e-6);
    }
}

#[test]
fn what_is_no_body_is_refused_by_clip_and_frame() {
    let refuse = |scanner: &Scanner, words: &[&str]| {
        let dir = tempfile::tempdir().unwrap();
        let message = register(scanner, dir.path()).unwrap_err().to_string();
        words.iter().for_each(|w| assert!(message.contains(w), "{w:?} is missing in: {message}"));
        assert!(!dir.path().join("index.json").exists(), "nothing looks finished");
    };
    refuse(&Scanner { stray: 1.0, points: 1500, ..Scanner::new() }, &["anna/hips.0", "frame 0", "units"]);
    refuse(&Scanner { points: 20, ..Scanner::new() }, &["anna/hips.0", "frame 0", "20 points"]);
    let mut bad = Scanner { points: 1500, ..Scanner::new() };
    bad.clean.vertices.frame_mut(0)[0].x = f32::NAN;
    refuse(&bad, &["anna/hips.0", "not finite"]);
}
