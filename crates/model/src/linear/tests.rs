use super::*;
use crate::{Pca, PcaConfig, Predictor, TrainingClip, coefficients_of};
use glam::Vec3;
use softtissue_body::{BodyModel, Mirror, RegionMap, UvAtlas};
use softtissue_body::{JointRegressor, Region, Skeleton, SkinWeights};
use softtissue_bundle::DeltaBasis;
use softtissue_bundle::descriptor::{Descriptor, DescriptorConfig};
use softtissue_clips::ClipId;
use softtissue_geometry::{Frames, Topology};
use softtissue_monitor::Silent;
use softtissue_random::Draws;
use std::f32::consts::TAU;
use std::sync::Arc;

const VERTICES: usize = 8;

/// Two joints, eight soft vertices, two shape coefficients. Faces play no part here.
fn body() -> BodyModel {
    let template: Vec<Vec3> = (0..VERTICES).map(|v| Vec3::new((v % 2) as f32 * 0.2, 0.1 * v as f32, 0.1)).collect();
    let weights = |v: usize| [1.0 - v as f32 / 10.0, v as f32 / 10.0, 0.0, 0.0];
    BodyModel {
        topology: Arc::new(Topology { vertex_count: VERTICES, ..Default::default() }),
        shape_directions: vec![Vec3::splat(0.01); 2 * VERTICES],
        pose_directions: vec![Vec3::ZERO; 9 * VERTICES],
        joint_regressor: JointRegressor { rows: vec![vec![(0, 1.0)], vec![(4, 1.0)]] },
        skin: (0..VERTICES).map(|v| SkinWeights { joints: [0, 1, 0, 0], weights: weights(v) }).collect(),
        skeleton: Skeleton { names: vec!["root".into(), "top".into()], parents: vec![None, Some(0)] },
        uv: UvAtlas::default(),
        mirror: Mirror { vertices: (0..VERTICES as u32).collect(), joints: vec![0, 1] },
        regions: RegionMap(vec![Region::Belly; VERTICES]),
        template,
    }
}

struct Case {
    id: ClipId,
    beta: Vec<f32>,
    rotations: Frames,
    translations: Vec<Vec3>,
    deltas: Frames,
}

/// Motions of three subjects whose flesh is one damped oscillator a vertex, driven by the root's acceleration; the heavier
/// (lower `beta[1]`) the slower and the farther.
fn cases(motions: std::ops::Range<u32>) -> Vec<Case> {
    cases_on_springs(motions, 0.0)
}

/// The same on springs that are `1 + cubic x^2` times as stiff at `x` metres (Duffing's), driven gently and hard.
fn cases_on_springs(motions: std::ops::Range<u32>, cubic: f32) -> Vec<Case> {
    let mut cases = vec![];
    for (s, b1) in [-1.0f32, 0.2, 1.3].into_iter().enumerate() {
        for motion in motions.clone() {
            let mut draws = Draws::new(2, "motion", s as u64, u64::from(motion));
            let waves: Vec<(f32, f32, f32)> = (0..4)
                .map(|_| (draws.range(0.5, 4.0) as f32, draws.range(0.0, 6.0) as f32, draws.range(0.02, 0.08) as f32))
                .collect();
            let at = |t: f32| waves.iter().map(|(hz, phase, size)| size * (TAU * hz * t + phase).sin()).sum::<f32>();
            let mut case = Case {
                id: ClipId::new(format!("s{s}"), format!("m{motion}"), 0),
                beta: vec![0.0, b1],
                rotations: Frames::new(2),
                translations: vec![],
                deltas: Frames::new(VERTICES),
            };
            let (mut x, mut v) = (0.0f32, 0.0f32);
            for t in 0..150 {
                let time = t as f32 / 60.0;
                case.rotations.push(&[Vec3::ZERO, Vec3::new(0.3 * at(time + 1.0), 0.0, 0.0)]);
                case.translations.push(Vec3::new(0.0, at(time), 0.0));
                let drive =
                    if t < 2 { 0.0 } else { (at(time) - 2.0 * at(time - 1.0 / 60.0) + at(time - 2.0 / 60.0)) * 3600.0 };
                // 3 Hz at no mass, damping ratio 0.2, in small steps.
                for _ in 0..16 {
                    let w = TAU * 3.0 * (0.25 * b1).exp();
                    v += (-(w * w) * (1.0 + cubic * x * x) * x - 0.4 * w * v - drive * (1.0 - 0.2 * b1)) / 960.0;
                    x += v / 960.0;
                }
                let frame: Vec<Vec3> = (0..VERTICES).map(|i| Vec3::new(0.0, x * (0.5 + 0.1 * i as f32), 0.0)).collect();
                case.deltas.push(&frame);
            }
            cases.push(case);
        }
    }
    cases
}

fn clips(cases: &[Case], basis: &DeltaBasis, descriptor: &Descriptor) -> Vec<TrainingClip> {
    let body = body();
    cases
        .iter()
        .map(|c| TrainingClip {
            id: c.id.clone(),
            beta: c.beta.clone(),
            features: descriptor.run(&body, &body.shaped(&c.beta), &c.rotations, &c.translations),
            coefficients: coefficients_of(basis, &c.deltas),
            frames: c.translations.len(),
        })
        .collect()
}

fn ladder() -> (Ladder, Vec<LadderScore>) {
    let body = body();
    let (train, validation) = (cases(0..6), cases(6..8));
    let deltas: Vec<Frames> = train.iter().map(|c| c.deltas.clone()).collect();
    let config = PcaConfig { components: 3, ..Default::default() };
    let pca = Pca::fit(deltas.as_slice(), &config, &mut Draws::new(1, "pca", 0, 0), &Silent).unwrap();
    let own = DescriptorConfig { modes: 1, cutoff_hz: 0.0, ..Default::default() };
    let dyna = dyna_descriptor(&own);
    let [own_features, dyna_features] =
        [&own, &dyna].map(|c| Descriptor::new(c, &body, Some(pca.basis.directions.data())).unwrap());
    let of = |cases: &[Case], d: &Descriptor| clips(cases, &pca.basis, d);
    let (own_train, own_validation) = (of(&train, &own_features), of(&validation, &own_features));
    let (dyna_train, dyna_validation) = (of(&train, &dyna_features), of(&validation, &dyna_features));
    let linear = ReadoutConfig { hardening: 0.0, ..Default::default() };
    Ladder::fit(
        &LadderConfig { resonators: linear, ..Default::default() },
        &pca.basis,
        &body,
        FeatureSet { descriptor: &own, blocks: own_features.blocks(), train: &own_train, validation: &own_validation },
        FeatureSet {
            descriptor: &dyna,
            blocks: dyna_features.blocks(),
            train: &dyna_train,
            validation: &dyna_validation,
        },
    )
    .unwrap()
}

#[test]
fn the_ladder_rises_and_its_file_gives_the_same_rollouts() {
    let (ladder, scores) = ladder();
    let ratio = |name: &str| scores.iter().find(|s| s.name == name).unwrap().score.ratio();
    assert!((ratio("body") - 1.0).abs() < 1e-3, "{}", ratio("body"));
    assert!(ratio("mean") > 0.9);
    // The flesh is a driven oscillator with a gain by shape: memory explains it, a frame does not.
    assert!(ratio("resonators") < 0.15 && ratio("resonators") < 0.3 * ratio("ridge"), "{}", ratio("resonators"));
    assert!(ratio("ar2-subject") < 0.2 && ratio("ar2-subject") < ratio("ar2-pooled"), "{}", ratio("ar2-subject"));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("ladder.safetensors");
    ladder.write(&path).unwrap();
    let read = Ladder::read(&path).unwrap();
    assert_eq!(read, ladder);
    let (body, case) = (body(), &cases(8..9)[1]);
    for (a, b) in ladder.predictors().iter().zip(read.predictors()) {
        let run =
            |p: &LadderPredictor| p.rollout("s1", &case.beta, &body, &case.rotations, &case.translations).unwrap();
        assert_eq!(run(a), run(&b), "{}", a.name());
    }
    // What the score says of coefficients holds for deltas in metres on a motion nobody has seen.
    let best = ladder.predictor("resonators").unwrap();
    let deltas = best.rollout("s1", &case.beta, &body, &case.rotations, &case.translations).unwrap();
    let sum = |f: &dyn Fn(usize) -> f32| (0..deltas.points().len()).map(f).sum::<f32>();
    let error = sum(&|i| deltas.points()[i].distance(case.deltas.points()[i]));
    let alone = sum(&|i| case.deltas.points()[i].length());
    assert!(error < 0.2 * alone, "{}", error / alone);
}

/// Soft ratios on other cases of readouts that learn from the first.
fn soft_ratios<const N: usize>(train: &[Case], validation: &[Case], configs: [ReadoutConfig; N]) -> [f64; N] {
    let body = body();
    let deltas: Vec<Frames> = train.iter().map(|c| c.deltas.clone()).collect();
    let config = PcaConfig { components: 3, ..Default::default() };
    let pca = Pca::fit(deltas.as_slice(), &config, &mut Draws::new(1, "pca", 0, 0), &Silent).unwrap();
    let own = DescriptorConfig { modes: 1, cutoff_hz: 0.0, ..Default::default() };
    let descriptor = Descriptor::new(&own, &body, Some(pca.basis.directions.data())).unwrap();
    let [train, validation] = [train, validation].map(|cases| clips(cases, &pca.basis, &descriptor));
    let score = SoftScore::new(&pca.basis, &body);
    configs.map(|config| {
        fit_readout(&config, descriptor.blocks(), 60.0, &train, &validation, &score).unwrap().score.ratio()
    })
}

#[test]
fn hardening_resonators_follow_flesh_that_hardens() {
    let (train, validation) = (cases_on_springs(0..8, 400.0), cases_on_springs(8..12, 400.0));
    let of = |hardening: f32| ReadoutConfig { hardening, ..Default::default() };
    let [linear, hardening] = soft_ratios(&train, &validation, [of(0.0), of(0.3)]);
    assert!(hardening < 0.8 * linear, "{hardening} with hardening, {linear} without");
}

/// The lightest person is left out: laws of mass that the other two obey foretell the third, a line through two
/// people's weights does not.
#[test]
fn laws_of_mass_carry_over_to_a_person_left_out() {
    let (known, new): (Vec<Case>, Vec<Case>) = cases(0..8).into_iter().partition(|c| c.id.subject != "s2");
    let lawless = ReadoutConfig { frequency_by_mass: 0.0, amplitude_by_mass: false, ..Default::default() };
    let [with, without] = soft_ratios(&known, &new, [ReadoutConfig::default(), lawless]);
    assert!(with < 0.7 && with < 0.5 * without, "{with} with, {without} without");
}

#[test]
fn settings_that_make_no_readout_are_refused() {
    let clip = drifting(1, 0.0);
    let blocks = softtissue_bundle::descriptor::FeatureBlock::in_a_row(&[("x", 3)]);
    let score = SoftScore::new(&two_coefficients(), &body());
    for (wrong, says) in [
        (ReadoutConfig { shape_share: 0.0, ..Default::default() }, "shape_share"),
        (ReadoutConfig { frequency_by_mass: f32::NAN, ..Default::default() }, "frequency_by_mass"),
        (ReadoutConfig { hardening: 1.5, ..Default::default() }, "hardening"),
        (ReadoutConfig { hardening_seconds: f32::INFINITY, ..Default::default() }, "hardening_seconds"),
        (ReadoutConfig { own_strength: -1.0, ..Default::default() }, "own_strength"),
    ] {
        let fitted = fit_readout(&wrong, &blocks, 60.0, std::slice::from_ref(&clip), &[], &score);
        let message = fitted.expect_err(says).to_string();
        assert!(message.contains(says), "{message}");
    }
}

#[test]
fn a_damaged_ladder_is_refused() {
    let (mut ladder, _) = ladder();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("ladder.safetensors");
    for model in &mut ladder.models {
        if let Rule::Readout(regressor) = &mut model.rule {
            regressor.shape_terms.pop();
        }
    }
    ladder.write(&path).unwrap();
    let error = Ladder::read(&path).unwrap_err().to_string();
    assert!(error.contains("ladder.safetensors") && error.contains("fit it again"), "{error}");
}

#[test]
fn strengths_out_of_range_are_refused() {
    let readout = ReadoutConfig { strengths: vec![0.0], ..Default::default() };
    let clip = TrainingClip {
        id: ClipId::new("a", "m", 0),
        beta: vec![],
        features: vec![0.0, 1.0, 2.0],
        coefficients: vec![0.0, 1.0, 0.0],
        frames: 3,
    };
    let basis = DeltaBasis {
        mean: vec![0.0; 3 * VERTICES],
        directions: softtissue_bundle::Matrix::new(1, 3 * VERTICES, vec![0.2; 3 * VERTICES]),
        coefficient_mean: vec![0.0],
    };
    let blocks = softtissue_bundle::descriptor::FeatureBlock::in_a_row(&[("x", 1)]);
    let score = SoftScore::new(&basis, &body());
    let fit = |config: &ReadoutConfig| fit_readout(config, &blocks, 60.0, std::slice::from_ref(&clip), &[], &score);
    assert!(fit(&readout).is_err());
    assert!(fit(&ReadoutConfig { frequencies_hz: vec![40.0], ..Default::default() }).is_err());
    assert!(fit(&ReadoutConfig { strengths: vec![], ..Default::default() }).is_err());
}

/// Three features, two coefficients that are linear in them, and what drifts slowly on top, metres.
fn drifting(take: u32, drift: f32) -> TrainingClip {
    const FRAMES: usize = 120;
    let mut draws = Draws::new(5, "drift", 0, u64::from(take));
    let (mut features, mut coefficients, mut slow) = (vec![], vec![], [0.0f32; 2]);
    for t in 0..FRAMES {
        let wave = |hz: f32| (TAU * hz * t as f32 / 60.0 + take as f32).sin();
        // as slow as the drift, and faster than it
        let x: Vec<f32> = (0..3).map(|k| wave(0.3 + 0.2 * k as f32) + 0.7 * wave(4.0 + k as f32)).collect();
        slow.iter_mut().for_each(|s| *s = 0.98 * *s + drift * draws.normal() as f32);
        coefficients.extend([0.01 * x[0] - 0.02 * x[2] + slow[0], 0.02 * x[1] + 0.003 + slow[1]]);
        features.extend(x);
    }
    TrainingClip { id: ClipId::new("a", "m", take), beta: vec![], features, coefficients, frames: FRAMES }
}

fn two_coefficients() -> DeltaBasis {
    let directions =
        (0..2 * 3 * VERTICES).map(|i| if (i < 3 * VERTICES) == (i % 2 == 0) { 0.3 } else { 0.0 }).collect();
    DeltaBasis {
        mean: vec![0.0; 3 * VERTICES],
        directions: softtissue_bundle::Matrix::new(2, 3 * VERTICES, directions),
        coefficient_mean: vec![0.0; 2],
    }
}

#[test]
fn whitening_sees_through_drift_and_leaves_the_exact_exact() {
    let blocks = softtissue_bundle::descriptor::FeatureBlock::in_a_row(&[("x", 3)]);
    let score = SoftScore::new(&two_coefficients(), &body());
    let truth = [[0.01, 0.0, -0.02], [0.0, 0.02, 0.0]];
    // of the slopes: a constant is no clearer for being whitened
    let error = |drift: f32, whitening: f32| {
        let config = ReadoutConfig {
            shape_terms: vec![vec![]],
            strengths: vec![1e-9],
            whitening,
            ..ReadoutConfig::default().without_memory()
        };
        let clips: Vec<TrainingClip> = (0..8).map(|take| drifting(take, drift)).collect();
        let model = fit_readout(&config, &blocks, 60.0, &clips, &[], &score).unwrap().model;
        let slope = |o: usize, i: usize| model.shortcut.weight.row(o)[i] * model.input.scale[i];
        let squares =
            (0..2).flat_map(|o| (0..3).map(move |i| (o, i))).map(|(o, i)| (slope(o, i) - truth[o][i]).powi(2));
        squares.sum::<f32>().sqrt()
    };
    assert!(error(0.0, 0.0) < 1e-5 && error(0.0, 0.8) < 1e-5, "{} {}", error(0.0, 0.0), error(0.0, 0.8));
    let (plain, whitened) = (error(0.002, 0.0), error(0.002, 0.95));
    assert!(whitened < 0.5 * plain, "{whitened} of {plain}");
    let clean = [drifting(9, 0.0)];
    let config = ReadoutConfig { whitening: 1.0, ..ReadoutConfig::default().without_memory() };
    assert!(fit_readout(&config, &blocks, 60.0, &clean, &[], &score).is_err());
}

#[test]
fn the_strongest_ridge_that_is_as_good_as_the_best_is_chosen() {
    let score = |error: f64| vec![Score { error, body_alone: 1.0, ..Score::default() }];
    let errors = [(1e-4, 0.501), (1e-3, 0.5), (1e-2, 0.509), (1e-1, 0.52)];
    let strengths = errors.map(|(s, _)| s);
    let chosen = readout::select(&strengths, |s| {
        let error = errors.iter().find(|e| e.0 == s).unwrap().1;
        Ok((s, score(error)))
    });
    assert_eq!(chosen.unwrap().1, 1e-2);
    // without a clip to judge by, the first
    assert_eq!(readout::select(&strengths, |s| Ok((s, vec![]))).unwrap().1, 1e-4);
}
