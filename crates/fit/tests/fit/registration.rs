//! Raw scans of the generated body: points in no order, with noise, holes, webs and outliers.

use crate::figure::{jiggle, smooth_pose};
use crate::scans::FPS;
use glam::Vec3;
use softtissue_body::procedural::{ProceduralConfig, generate};
use softtissue_body::{BodyModel, Pose, Region};
use softtissue_clips::{ClipEntry, ClipId, RawFrame, RawScans, ScanSet};
use softtissue_fit::{FitError, RegistrationConfig, register_set};
use softtissue_geometry::Frames;
use softtissue_monitor::Silent;
use softtissue_synth::scanner::RawScanner;
use std::path::Path;
use std::sync::OnceLock;

const FRAMES: usize = 6;
/// Frames at the start in which the person stands still.
const STILL: usize = 3;

fn body() -> &'static BodyModel {
    static BODY: OnceLock<BodyModel> = OnceLock::new();
    BODY.get_or_init(|| generate(&ProceduralConfig::default()).unwrap().model)
}

/// A person outside the mean shape that begins to move, its flesh with it, and what a raw scanner sees of it.
struct Scanner {
    clean: Frames,
    missing: Option<usize>,
    points: usize,
    /// Changes what was seen.
    spoil: fn(&mut RawFrame),
}

impl Scanner {
    fn new() -> Self {
        let body = body();
        let shaped = body.shaped(&[0.8, -1.0, 0.5]);
        let bump = |p: &Vec3| 0.003 * Vec3::new((25.0 * p.y).sin(), (30.0 * p.x).sin(), (20.0 * p.y + 1.0).sin());
        let detail: Vec<Vec3> = body.template.iter().map(bump).collect();
        let mut clean = Frames::new(body.vertex_count());
        for t in 0..FRAMES {
            let time = t.saturating_sub(STILL) as f32 / FPS;
            let (rotations, translation) = smooth_pose(7, time, 0.25);
            let flesh = jiggle(body, time, if t < STILL { 0.0 } else { 0.012 });
            let rest: Vec<Vec3> = detail.iter().zip(flesh).map(|(d, f)| *d + f).collect();
            clean.push(&body.posed(&shaped, Pose { rotations: &rotations, translation }, Some(&rest)));
        }
        Self { clean, missing: None, points: 8000, spoil: |_| {} }
    }
}

impl RawScans for Scanner {
    fn clips(&self) -> Vec<ClipEntry> {
        vec![ClipEntry { id: ClipId::new("anna", "hips", 0), frames: FRAMES, fps: FPS }]
    }

    fn frame(&self, _: &ClipId, t: usize) -> softtissue_clips::Result<Option<RawFrame>> {
        if self.missing == Some(t) {
            return Ok(None);
        }
        let mut frame = RawScanner::new(body(), self.points, "anna/hips.0", 1).scan(t, self.clean.frame(t));
        (self.spoil)(&mut frame);
        Ok(Some(frame))
    }

    fn provenance(&self) -> serde_json::Value {
        serde_json::json!({"source": "a test"})
    }
}

fn register(scanner: &Scanner, out: &Path) -> Result<(ScanSet, serde_json::Value), FitError> {
    let config = RegistrationConfig { subject_frames: 3, ..RegistrationConfig::default() };
    let set = register_set(scanner, body(), &config, out, &Silent)?;
    let quality = std::fs::read(out.join("registration.json")).unwrap();
    Ok((set, serde_json::from_slice::<serde_json::Value>(&quality).unwrap()[0].clone()))
}

#[test]
fn raw_scans_are_registered_through_noise_holes_and_outliers() {
    let scanner = Scanner::new();
    let dir = tempfile::tempdir().unwrap();
    let (set, quality) = register(&scanner, dir.path()).unwrap();
    let found = set.scan(&set.ids()[0]).unwrap().vertices;
    assert_eq!((found.len(), found.points_per_frame()), (FRAMES, body().vertex_count()));
    assert!(quality["median_mm"].as_f64().unwrap() < 1.0, "{quality}");
    assert!(quality["p95_mm"].as_f64().unwrap() < 4.0, "{quality}");
    assert_eq!(quality["restarts"], 0, "{quality}");
    let kept = |v: &usize| !matches!(body().regions.0[*v], Region::Hands | Region::Feet | Region::Head);
    let judged: Vec<usize> = (0..body().vertex_count()).filter(kept).collect();
    for t in 0..FRAMES {
        // skin may slide along itself, of which the points tell nothing
        let off = judged.iter().map(|v| found.frame(t)[*v].distance(scanner.clean.frame(t)[*v]));
        let mean = off.sum::<f32>() / judged.len() as f32;
        assert!(mean < 0.01, "frame {t}: vertices are {mean} m from their true places in the mean");
    }
}

/// Takes out the points of a disc of 20 cm on the front of the trunk.
fn cut_hole(frame: &mut RawFrame) {
    let middle = frame.points.iter().sum::<Vec3>() / frame.points.len() as f32;
    let hole = |p: &Vec3| p.z > middle.z && p.truncate().distance(middle.truncate()) < 0.1;
    let kept: Vec<usize> = (0..frame.points.len()).filter(|i| !hole(&frame.points[*i])).collect();
    frame.points = kept.iter().map(|i| frame.points[*i]).collect();
    frame.normals = kept.iter().map(|i| frame.normals[*i]).collect();
}

#[test]
fn the_surface_goes_on_where_the_scan_has_a_hole() {
    let whole = Scanner::new();
    let holed = Scanner { spoil: cut_hole, ..Scanner::new() };
    let count = |scanner: &Scanner| scanner.frame(&scanner.clips()[0].id, 5).unwrap().unwrap().points.len();
    assert!(count(&holed) + 50 < count(&whole), "there is something to cut out");
    let run = |scanner: &Scanner| {
        let dir = tempfile::tempdir().unwrap();
        register(scanner, dir.path()).unwrap().0.scan(&scanner.clips()[0].id).unwrap().vertices
    };
    let (whole, holed) = (run(&whole), run(&holed));
    let apart = |(t, v): (usize, usize)| whole.frame(t)[v].distance(holed.frame(t)[v]);
    let all = (0..FRAMES).flat_map(|t| (0..body().vertex_count()).map(move |v| (t, v)));
    let worst = all.max_by(|a, b| apart(*a).total_cmp(&apart(*b))).unwrap();
    let (off, region) = (apart(worst), body().regions.0[worst.1].name());
    assert!(
        off > 1e-4 && off < 0.03,
        "with the hole frame {} lies {off} m elsewhere at vertex {} of {region}",
        worst.0,
        worst.1
    );
}

#[test]
fn the_same_scans_give_the_same_bytes_whatever_the_threads() {
    let scanner = Scanner { points: 1500, ..Scanner::new() };
    let run = |threads: usize| {
        let dir = tempfile::tempdir().unwrap();
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| register(&scanner, dir.path())).unwrap().0.scan(&scanner.clips()[0].id).unwrap().vertices
    };
    assert_eq!(run(1), run(3));
}

#[test]
fn a_missing_frame_lies_between_its_neighbours() {
    let scanner = Scanner { missing: Some(4), points: 1500, ..Scanner::new() };
    let dir = tempfile::tempdir().unwrap();
    let (set, quality) = register(&scanner, dir.path()).unwrap();
    let found = set.scan(&set.ids()[0]).unwrap().vertices;
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
    let scattered = |frame: &mut RawFrame| {
        let scatter =
            |(i, p): (usize, &mut Vec3)| *p = Vec3::new((i % 10) as f32, (i / 10 % 12) as f32, (i / 120) as f32) * 0.15;
        frame.points.iter_mut().enumerate().for_each(scatter);
        frame.normals.clear();
    };
    refuse(&Scanner { spoil: scattered, points: 1500, ..Scanner::new() }, &["anna/hips.0", "frame 0", "units"]);
    refuse(&Scanner { points: 20, ..Scanner::new() }, &["anna/hips.0", "frame 0", "points"]);
    let not_finite = |frame: &mut RawFrame| frame.points[3].x = f32::NAN;
    refuse(
        &Scanner { spoil: not_finite, points: 1500, ..Scanner::new() },
        &["anna/hips.0", "frame 0, vertex 3", "not finite"],
    );
}
