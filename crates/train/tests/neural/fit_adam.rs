//! Adam through autodiff against the analytic fit: the same objective, the same minimum.

use super::figure::{figure, smooth_pose};
use burn::tensor::Device;
use glam::Vec3;
use softtissue_body::{BodyModel, Pose, ShapedBody};
use softtissue_clips::{ClipEntry, ClipId, FitSet, ScanClip, ScanSet, Split};
use softtissue_fit::{
    AdamFitConfig, FitConfig, FitError, FittedPeople, Objective, ObjectiveKind, PackedBody, Solver, WeightedBody,
    fit_motion, fit_set, fit_set_with,
};
use softtissue_geometry::Frames;
use softtissue_monitor::{Monitor, Silent};
use softtissue_train::{AdamPoseFit, AdamSolver};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

struct Case {
    body: BodyModel,
    shaped: ShapedBody,
    weights: Vec<f32>,
    rotations: Frames,
    translations: Vec<Vec3>,
    scans: Frames,
}

/// Four frames of a motion, each with a bump that no pose explains.
fn case() -> Case {
    let body = figure(4, 6);
    let shaped = body.shaped(&[0.5, -0.3, 0.2]);
    let v = body.vertex_count();
    let weights = (0..v).map(|i| 1.0 + 0.5 * (i as f32 * 0.7).sin()).collect();
    let (mut rotations, mut translations, mut scans) = (Frames::new(body.joint_count()), vec![], Frames::new(v));
    for t in 0..4 {
        let (turns, translation) = smooth_pose(3, t as f32 * 0.02, 0.3);
        let bump: Vec<Vec3> = (0..v).map(|i| 0.004 * Vec3::splat((i as f32 * 0.31 + t as f32).sin())).collect();
        scans.push(&body.posed(&shaped, Pose { rotations: &turns, translation }, Some(&bump)));
        rotations.push(&turns);
        translations.push(translation);
    }
    Case { body, shaped, weights, rotations, translations, scans }
}

impl Case {
    fn analytic(&self, kind: ObjectiveKind) -> Objective {
        let weighted = WeightedBody::new(Arc::new(PackedBody::new(&self.body)), &self.weights);
        Objective::new(weighted, kind, &self.shaped, None)
    }
    fn reference(&self, kind: ObjectiveKind) -> AdamPoseFit {
        AdamPoseFit::new(&self.body, &self.shaped, None, &self.weights, kind, &Device::flex())
    }
    /// The true poses, each angle off by up to `size`.
    fn displaced(&self, size: f32) -> Frames {
        let mut rotations = self.rotations.clone();
        let wave = |i: usize| Vec3::new((i as f32).sin(), (i as f32 * 1.7).cos(), (i as f32 * 0.6).sin());
        rotations.points_mut().iter_mut().enumerate().for_each(|(i, w)| *w += size * wave(i));
        rotations
    }
}

#[test]
fn the_objective_is_the_analytic_fits() {
    let case = case();
    for kind in [ObjectiveKind::Posed, ObjectiveKind::Unposed] {
        let (analytic, reference) = (case.analytic(kind), case.reference(kind));
        for size in [0.0, 0.1, 0.4] {
            let rotations = case.displaced(size);
            let found = reference.values(&rotations, &case.translations, &case.scans);
            for t in 0..case.scans.len() {
                let pose = Pose { rotations: rotations.frame(t), translation: case.translations[t] };
                let wanted = analytic.value(pose, case.scans.frame(t));
                assert!((found[t] - wanted).abs() < 1e-4 * wanted + 1e-9, "{kind:?} {size}: {} {wanted}", found[t]);
            }
        }
    }
    // A rest pose has angles of zero, where the formula for a rotation divides by them.
    let rest = Frames::zeros(case.body.joint_count(), case.scans.len());
    let values = case.reference(ObjectiveKind::Unposed).values(&rest, &case.translations, &case.scans);
    assert!(values.iter().all(|v| v.is_finite() && *v > 1e-4));
}

#[test]
fn it_ends_where_the_analytic_fit_ends() {
    let case = case();
    let scan = ScanClip { id: ClipId::new("s", "m", 0), fps: 60.0, vertices: case.scans.clone() };
    let kind = ObjectiveKind::Unposed;
    let config = FitConfig { tolerance: 1e-6, max_iterations: 100, ..FitConfig::default() };
    let analytic = fit_motion(&case.analytic(kind), &scan, 1, &config, &Silent).expect("a fit");
    let config = AdamFitConfig { iterations: 1000, final_share: 1.0, ..AdamFitConfig::default() };
    let start = case.displaced(0.1);
    let found =
        case.reference(kind).fit(&config, None, &start, &case.translations, &case.scans, &Silent).expect("a fit");
    // Adam jumps out of the minimum now and then; what it reached counts.
    let reached = |t: usize| found.values.iter().map(|each| each[t]).fold(f64::INFINITY, f64::min);
    for t in 0..case.scans.len() {
        let lowest = analytic.values[t];
        assert!(found.values[0][t] > 5.0 * lowest, "frame {t} had nothing to do: {} {lowest}", found.values[0][t]);
        let reached = reached(t);
        assert!((reached - lowest).abs() < 0.01 * lowest, "frame {t}: Adam {reached}, analytic {lowest}");
    }
    assert!(found.seconds.windows(2).all(|w| w[0] <= w[1]) && found.rotations.len() == 4);
}

#[test]
fn unequal_counts_are_refused() {
    let case = case();
    let fit = |scans: &Frames| {
        let (start, none) = (case.displaced(0.0), AdamFitConfig::default());
        case.reference(ObjectiveKind::Posed).fit(&none, None, &start, &case.translations, scans, &Silent).map(|_| ())
    };
    let refused = fit(&case.scans.slice(0..3)).unwrap_err().to_string();
    assert!(refused.contains("4 poses for 3 scans"), "{refused}");
}

#[test]
fn the_priors_are_the_analytic_fits() {
    let case = case();
    let kind = ObjectiveKind::Unposed;
    let scan = ScanClip { id: ClipId::new("s", "m", 0), fps: 60.0, vertices: case.scans.clone() };
    let config = FitConfig { tolerance: 1e-7, least_gain: 0.0, max_iterations: 100, ..FitConfig::default() };
    let values = |pose_prior: f64, smoothness: f64| {
        let analytic = case.analytic(kind).with_priors(pose_prior, smoothness);
        let fitted = fit_motion(&analytic, &scan, 1, &config, &Silent).expect("a fit");
        let motion = fitted.clip(scan.id.clone(), scan.fps);
        let reference = case.reference(kind).with_priors(analytic.pose_prior(), smoothness);
        let found = reference.values(&motion.rotations, &motion.translations, &case.scans);
        (fitted.values, found)
    };
    let (plain, _) = values(0.0, 0.0);
    // Weights at which each prior is a good part of the objective, so that its share is seen.
    for (pose_prior, smoothness) in [(1e-4, 0.0), (0.0, 1e-3), (1e-4, 1e-3)] {
        let (wanted, found) = values(pose_prior, smoothness);
        assert!(wanted[3] > 1.02 * plain[3], "{wanted:?} {plain:?}");
        for (w, f) in wanted.iter().zip(&found) {
            assert!((f - w).abs() < 1e-3 * w, "{pose_prior} {smoothness}: {f} {w}");
        }
    }
}

#[test]
fn the_frame_before_a_batch_counts() {
    let case = case();
    let fit = case.reference(ObjectiveKind::Unposed).with_priors(&[], 1e-3);
    let once = AdamFitConfig { iterations: 1, ..AdamFitConfig::default() };
    let first = |before: Option<&[Vec3]>| {
        fit.fit(&once, before, &case.rotations, &case.translations, &case.scans, &Silent).expect("a fit").values[0]
            .clone()
    };
    // A tenth further about the same axes.
    let start = case.rotations.frame(0);
    let before: Vec<Vec3> = start.iter().map(|w| *w * 1.1).collect();
    let turned: f32 = start.iter().map(|w| 0.01 * w.length_squared()).sum();
    let (with, without) = (first(Some(&before)), first(None));
    let (found, wanted) = (with[0] - without[0], 1e-3 * f64::from(turned));
    assert!(wanted > 1e-6 && (found - wanted).abs() < 0.01 * wanted, "{found} {wanted}");
    assert_eq!(with[1..], without[1..], "the others follow frames of the batch");
}

/// The case's scans as a set of one clip.
fn scan_set(case: &Case, root: &Path) -> (ScanSet, Split) {
    let id = ClipId::new("s", "m", 0);
    let scan = ScanClip { id: id.clone(), fps: 60.0, vertices: case.scans.clone() };
    scan.write(&ScanSet::scan_path(root, &id)).expect("a scan");
    let entry = ClipEntry { id: id.clone(), frames: scan.vertices.len(), fps: scan.fps };
    let (count, topology) = (case.body.vertex_count(), case.body.topology.hash());
    let set = ScanSet::finish(root, count, &topology, serde_json::json!({}), vec![entry]).expect("a set");
    (set, Split { train: vec![id], validation: vec![], test: vec![] })
}

/// Counts progress; asks to stop once `stop_after` questions were answered.
struct Counted {
    done: AtomicU64,
    asked: AtomicU64,
    stop_after: u64,
}

impl Counted {
    fn new(stop_after: u64) -> Self {
        Self { done: AtomicU64::new(0), asked: AtomicU64::new(0), stop_after }
    }
}

impl Monitor for Counted {
    fn begin(&self, _: &str, _: u64, _: &'static str) {
        self.done.store(0, Ordering::Relaxed);
    }
    fn advance(&self, units: u64, _: &str) {
        self.done.fetch_add(units, Ordering::Relaxed);
    }
    fn end(&self) {}
    fn say(&self, _: &str) {}
    fn should_stop(&self) -> bool {
        self.asked.fetch_add(1, Ordering::Relaxed) >= self.stop_after
    }
}

#[test]
fn as_the_second_solver_it_makes_the_same_fit() {
    let case = case();
    let dir = tempfile::tempdir().expect("a folder");
    let (scans, split) = scan_set(&case, &dir.path().join("scans"));
    let config = FitConfig { solver: Solver::Adam, first_pass_stride: 1, ..FitConfig::default() };
    config.check().expect("a solver that there is");
    let by_adam = |config: &FitConfig, name: &str, monitor: &dyn Monitor| {
        let solver = AdamSolver::new(config.adam.clone(), Device::flex());
        fit_set_with(&solver, &scans, &split, &case.body, config, &FittedPeople::new(), &dir.path().join(name), monitor)
    };
    let analytic = FitConfig { solver: Solver::LevenbergMarquardt, ..config.clone() };
    let analytic = fit_set(&scans, &split, &case.body, &analytic, &dir.path().join("lm"), &Silent).expect("a fit");
    // Three frames and then one, so that a batch begins behind another.
    let config = FitConfig { adam: AdamFitConfig { batch: 3, ..config.adam }, ..config };
    let progress = Counted::new(u64::MAX);
    let adam = by_adam(&config, "adam", &progress).expect("a fit");
    assert_eq!(progress.done.load(Ordering::Relaxed), 4, "frames of the last part");

    let distance = |fit: &FitSet| {
        let quality = std::fs::read(fit.root().join("quality.json")).expect("a file");
        let quality: serde_json::Value = serde_json::from_slice(&quality).expect("JSON");
        quality[0]["distance_mm"].as_f64().expect("a number")
    };
    let (wanted, found) = (distance(&analytic), distance(&adam));
    assert!((found - wanted).abs() < 0.02 * wanted, "Adam {found} mm, Levenberg-Marquardt {wanted} mm");
    let id = &split.train[0];
    assert_eq!(analytic.subject("s").expect("a subject").beta, adam.subject("s").expect("a subject").beta);

    // With nothing between the frames, and both at the end of what they can, the minimum is one and so are the deltas.
    let alone = FitConfig { smoothness: 0.0, tolerance: 1e-6, least_gain: 0.0, max_iterations: 100, ..config.clone() };
    let alone = FitConfig { adam: AdamFitConfig { iterations: 1000, ..AdamFitConfig::default() }, ..alone };
    let analytic = FitConfig { solver: Solver::LevenbergMarquardt, ..alone.clone() };
    let analytic =
        fit_set(&scans, &split, &case.body, &analytic, &dir.path().join("lm-alone"), &Silent).expect("a fit");
    let adam = by_adam(&alone, "adam-alone", &Silent).expect("a fit");
    let [a, b] = [&analytic, &adam].map(|fit| fit.deltas(id).expect("deltas").deltas);
    let apart = a.points().iter().zip(b.points()).map(|(x, y)| x.distance(*y)).sum::<f32>() / a.points().len() as f32;
    assert!(apart < 3e-4, "deltas {apart} m apart");

    // The built-in fit does not stand in for a solver that it has not got, and a stop ends the fit midway.
    let refused = fit_set(&scans, &split, &case.body, &config, &dir.path().join("no"), &Silent).unwrap_err();
    assert!(refused.to_string().contains("solver"), "{refused}");
    let stop = Counted::new(20);
    let stopped = by_adam(&config, "stopped", &stop).unwrap_err();
    assert!(matches!(stopped, FitError::Stopped), "{stopped}");
    assert!(stop.asked.load(Ordering::Relaxed) < 30 && FitSet::open(&dir.path().join("stopped")).is_err());
}

#[test]
fn a_rate_that_blows_up_is_an_error_with_its_frame() {
    let case = case();
    let dir = tempfile::tempdir().expect("a folder");
    let (scans, split) = scan_set(&case, &dir.path().join("scans"));
    let adam = AdamFitConfig { learning_rate: 1e30, iterations: 4, ..AdamFitConfig::default() };
    let config = FitConfig { solver: Solver::Adam, adam, ..FitConfig::default() };
    let solver = AdamSolver::new(config.adam.clone(), Device::flex());
    let (nobody, out) = (FittedPeople::new(), dir.path().join("fit"));
    let error = fit_set_with(&solver, &scans, &split, &case.body, &config, &nobody, &out, &Silent);
    let error = error.map(|_| ()).unwrap_err().to_string();
    assert!(error.contains("s/m") || error.contains("frame 0"), "{error}");
    assert!(error.contains("fit.adam.learning_rate"), "{error}");
}
