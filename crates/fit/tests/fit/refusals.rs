use crate::figure::figure;
use crate::scans::{CLEAN, FPS, Recipe, Truth, all_train};
use glam::Vec3;
use softtissue_body::{Pose, SkinWeights};
use softtissue_clips::{ClipId, FitSet, ScanClip, ScanSet};
use softtissue_fit::{
    AdamFitConfig, FitConfig, FitError, Objective, ObjectiveKind, PackedBody, WeightedBody, fit_motion, fit_set,
};
use softtissue_geometry::Frames;
use softtissue_monitor::{Monitor, Silent};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

const SHORT: Recipe = Recipe { frames: 4, ..CLEAN };

fn id() -> ClipId {
    ClipId::new("a", "walk", 0)
}

fn objective(truth: &Truth) -> Objective {
    let weights = vec![1.0; truth.body.vertex_count()];
    let weighted = WeightedBody::new(Arc::new(PackedBody::new(&truth.body)), &weights);
    Objective::new(weighted, ObjectiveKind::Unposed, &truth.body.shaped(&truth.beta), None)
}

#[test]
fn a_scan_with_nan_is_refused_by_clip_frame_and_vertex() {
    let truth = Truth::new(&SHORT);
    let mut scan = truth.scan(&id(), &SHORT);
    scan.vertices.frame_mut(2)[17].y = f32::NAN;
    let error = fit_motion(&objective(&truth), &scan, 1, &FitConfig::default(), &Silent).unwrap_err();
    assert!(matches!(error, FitError::NotFinite { frame: 2, vertex: 17, .. }), "{error}");
    assert!(error.to_string().contains("a/walk.0"), "{error}");
    // on disk the same is caught while reading, and nothing is finished
    let dir = tempfile::tempdir().unwrap();
    let scans = truth.write(&dir.path().join("scans"), &[id()], &SHORT);
    scan.write(&ScanSet::scan_path(&dir.path().join("scans"), &id())).unwrap();
    let out = dir.path().join("fit");
    let error = fit_set(&scans, &all_train(&[id()]), &truth.body, &FitConfig::default(), &out, &Silent).unwrap_err();
    assert!(matches!(error, FitError::Clip(_)) && error.to_string().contains("frame 2"), "{error}");
    assert!(FitSet::open(&out).is_err());
}

#[test]
fn one_frame_is_enough_for_poses_and_deltas() {
    let recipe = Recipe { frames: 1, ..CLEAN };
    let truth = Truth::new(&recipe);
    let dir = tempfile::tempdir().unwrap();
    let scans = truth.write(&dir.path().join("scans"), &[id()], &recipe);
    let out = dir.path().join("fit");
    let fit = fit_set(&scans, &all_train(&[id()]), &truth.body, &FitConfig::default(), &out, &Silent).unwrap();
    assert_eq!(fit.motion(&id()).unwrap().len(), 1);
    // without a second frame there is no motion to weigh by
    assert!(fit.subject("a").unwrap().rigidity_weight.iter().all(|w| *w == 1.0));
}

#[test]
fn a_clip_without_frames_is_refused() {
    let truth = Truth::new(&SHORT);
    let scan = ScanClip { id: id(), fps: FPS, vertices: Frames::new(truth.body.vertex_count()) };
    let error = fit_motion(&objective(&truth), &scan, 1, &FitConfig::default(), &Silent).unwrap_err();
    assert!(matches!(error, FitError::Empty(_)), "{error}");
}

#[test]
fn other_vertex_counts_and_other_connectivity_are_refused() {
    let truth = Truth::new(&SHORT);
    let dir = tempfile::tempdir().unwrap();
    let scans = truth.write(&dir.path().join("scans"), &[id()], &SHORT);
    let fit =
        |body| fit_set(&scans, &all_train(&[id()]), body, &FitConfig::default(), &dir.path().join("fit"), &Silent);
    let smaller = figure(6, 8);
    let error = fit(&smaller).unwrap_err();
    assert!(matches!(error, FitError::VertexCount { .. }), "{error}");
    let mut other = truth.body.clone();
    Arc::make_mut(&mut other.topology).faces.swap(0, 1);
    let error = fit(&other).unwrap_err();
    assert!(matches!(error, FitError::Topology { .. }), "{error}");
}

#[test]
fn a_training_clip_in_millimetres_is_refused_with_a_hint() {
    let truth = Truth::new(&SHORT);
    let dir = tempfile::tempdir().unwrap();
    let root = dir.path().join("scans");
    let scans = truth.write(&root, &[id()], &SHORT);
    let mut scan = truth.scan(&id(), &SHORT);
    scan.vertices.points_mut().iter_mut().for_each(|p| *p *= 1000.0);
    scan.write(&ScanSet::scan_path(&root, &id())).unwrap();
    let out = dir.path().join("fit");
    let error = fit_set(&scans, &all_train(&[id()]), &truth.body, &FitConfig::default(), &out, &Silent).unwrap_err();
    assert!(matches!(error, FitError::NotThisBody { .. }) && error.to_string().contains("metres"), "{error}");
}

#[test]
fn settings_out_of_range_are_refused() {
    let refused = |config: FitConfig| config.check().unwrap_err().to_string();
    assert!(refused(FitConfig { shape_frames: 0, ..Default::default() }).contains("shape_frames"));
    assert!(refused(FitConfig { tolerance: f64::NAN, ..Default::default() }).contains("tolerance"));
    assert!(refused(FitConfig { smoothness: -1.0, ..Default::default() }).contains("smoothness"));
    assert!(refused(FitConfig { template_share: 1.5, ..Default::default() }).contains("template_share"));
    let adam = |adam: AdamFitConfig| FitConfig { adam, ..Default::default() };
    assert!(refused(adam(AdamFitConfig { learning_rate: 0.0, ..Default::default() })).contains("adam.learning_rate"));
    assert!(refused(adam(AdamFitConfig { final_share: 1.5, ..Default::default() })).contains("adam.final_share"));
    assert!(refused(adam(AdamFitConfig { batch: 0, ..Default::default() })).contains("adam.batch"));
    assert!(serde_json::from_str::<FitConfig>(r#"{"solver": "adam"}"#).unwrap().check().is_ok());
    assert!(serde_json::from_str::<FitConfig>(r#"{"tolerence": 1e-3}"#).is_err());
    let read: FitConfig = serde_json::from_str(r#"{"objective": "posed"}"#).unwrap();
    assert_eq!(read, FitConfig { objective: ObjectiveKind::Posed, ..Default::default() });
}

/// A vertex between two bones that fold onto each other has no unposed position: its neighbours' delta stands in.
#[test]
fn a_folded_vertex_gets_its_neighbours_delta_and_is_counted() {
    let mut truth = Truth::new(&SHORT);
    let elbow = 18 * 7 * 8 + 3;
    truth.body.skin[elbow] = SkinWeights { joints: [18, 16, 0, 0], weights: [0.5, 0.5, 0.0, 0.0] };
    truth.body.pose_directions.iter_mut().for_each(|d| *d = Vec3::ZERO);
    let mut rotations = vec![Vec3::ZERO; 24];
    rotations[18] = Vec3::Y * 165f32.to_radians();
    let pose = Pose { rotations: &rotations, translation: Vec3::ZERO };
    let mut vertices = Frames::new(truth.body.vertex_count());
    vertices.push(&truth.body.posed(&truth.body.shaped(&[]), pose, None));
    let scan = ScanClip { id: id(), fps: FPS, vertices };
    let dir = tempfile::tempdir().unwrap();
    let root = dir.path().join("scans");
    truth.write(&root, &[id()], &Recipe { frames: 1, ..CLEAN });
    scan.write(&ScanSet::scan_path(&root, &id())).unwrap();
    let scans = ScanSet::open(&root).unwrap();
    let out = dir.path().join("fit");
    let config = FitConfig { subject_template: false, ..Default::default() };
    let fit = fit_set(&scans, &all_train(&[id()]), &truth.body, &config, &out, &Silent).unwrap();
    let deltas = fit.deltas(&id()).unwrap().deltas;
    assert!(deltas.frame(0)[elbow].length() < 0.02, "{}", deltas.frame(0)[elbow]);
    let quality = std::fs::read_to_string(out.join("quality.json")).unwrap();
    let quality: serde_json::Value = serde_json::from_str(&quality).unwrap();
    assert!(quality[0]["folded"].as_u64().unwrap() >= 1, "{quality}");
}

struct StopAfter(AtomicUsize);

impl Monitor for StopAfter {
    fn begin(&self, _: &str, _: u64, _: &'static str) {}
    fn advance(&self, units: u64, _: &str) {
        self.0.fetch_sub((units as usize).min(self.0.load(Ordering::Relaxed)), Ordering::Relaxed);
    }
    fn end(&self) {}
    fn say(&self, _: &str) {}
    fn should_stop(&self) -> bool {
        self.0.load(Ordering::Relaxed) == 0
    }
}

#[test]
fn a_stop_leaves_no_finished_set() {
    let recipe = Recipe { frames: 12, ..CLEAN };
    let truth = Truth::new(&recipe);
    let dir = tempfile::tempdir().unwrap();
    let scans = truth.write(&dir.path().join("scans"), &[id()], &recipe);
    let out = dir.path().join("fit");
    let stop = StopAfter(AtomicUsize::new(5));
    let error = fit_set(&scans, &all_train(&[id()]), &truth.body, &FitConfig::default(), &out, &stop).unwrap_err();
    assert!(matches!(error, FitError::Stopped), "{error}");
    assert!(FitSet::open(&out).is_err());
}
