//! Adam through autodiff against the analytic fit: the same objective, the same minimum.

use super::figure::{figure, smooth_pose};
use burn::tensor::Device;
use glam::Vec3;
use softtissue_body::{BodyModel, Pose, ShapedBody};
use softtissue_clips::{ClipId, ScanClip};
use softtissue_fit::{FitConfig, Objective, ObjectiveKind, PackedBody, WeightedBody, fit_motion};
use softtissue_geometry::Frames;
use softtissue_monitor::Silent;
use softtissue_train::{AdamFitConfig, AdamPoseFit};
use std::sync::Arc;

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
    let config = AdamFitConfig { learning_rate: 0.02, iterations: 1000 };
    let start = case.displaced(0.1);
    let found = case.reference(kind).fit(&config, &start, &case.translations, &case.scans, &Silent).expect("a fit");
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
        case.reference(ObjectiveKind::Posed).fit(&none, &start, &case.translations, scans, &Silent).map(|_| ())
    };
    let refused = fit(&case.scans.slice(0..3)).unwrap_err().to_string();
    assert!(refused.contains("4 poses for 3 scans"), "{refused}");
}
