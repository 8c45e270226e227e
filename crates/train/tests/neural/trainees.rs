//! The two trainees as the loop sees them.

use super::normals;
use burn::tensor::Device;
use softtissue_bundle as plain;
use softtissue_bundle::descriptor::{FeatureBlock, FeatureScaling};
use softtissue_model::{RegressorConfig, ShortcutStart};
use softtissue_train::{
    Clips, DeltaFrames, DeltaSurface, LossSpace, MotionSequence, RegressorTrainee, RegressorTraining, Stage, State,
    SubspaceTrainee, SubspaceTraining, Trainee,
};
use std::sync::Arc;

const K: usize = 8;
const L: usize = 3;

fn stage(name: &str) -> Stage {
    Stage { name: name.into(), seed: 5, device: Device::flex() }
}

/// Two triangles with `K` of their twelve coordinates as orthonormal directions.
fn surface() -> DeltaSurface {
    let rest = vec![0.0, 0.0, 0.0, 0.1, 0.0, 0.0, 0.1, 0.1, 0.0, 0.0, 0.1, 0.0];
    let directions = (0..K).flat_map(|k| (0..12).map(move |i| if i == k { 1.0 } else { 0.0 }));
    let faces = Arc::new(vec![[0, 1, 2], [0, 2, 3]]);
    DeltaSurface { rest: vec![rest], mean: vec![0.0; 12], directions: directions.collect(), faces }
}

/// Coefficients beyond the first `L` are functions of these, which a linear decoder cannot know.
fn curved(name: &str, count: usize) -> Vec<f32> {
    let rows = normals(name, count * L);
    let row = |x: &[f32]| -> Vec<f32> {
        (0..K).map(|k| if k < L { 0.01 * x[k] } else { 0.008 * x[k % L].abs() - 0.006 }).collect()
    };
    rows.chunks(L).flat_map(row).collect()
}

fn frames(name: &str, count: usize) -> DeltaFrames {
    DeltaFrames { coefficients: curved(name, count), subjects: vec![0; count] }
}

fn subspace(steps: u64) -> SubspaceTrainee {
    let config =
        SubspaceTraining { steps, batch: 32, normal_weight: 10.0, dropout: 0.0, ..SubspaceTraining::default() };
    let frames = Clips { train: frames("train", 400), validation: frames("validation", 100) };
    SubspaceTrainee::new(config, &stage("subspace"), L, surface(), frames).expect("a small training")
}

fn sequence(name: &str, frames: usize) -> MotionSequence {
    let target = curved(name, frames);
    let input: Vec<f32> =
        target.chunks(K).flat_map(|row| row[..L].iter().map(|c| 100.0 * c).collect::<Vec<_>>()).collect();
    MotionSequence { input, input_width: L, target, amplitude: 1.0 }
}

fn regressor(steps: u64, space: LossSpace, shortcut: ShortcutStart) -> RegressorTrainee {
    let network = RegressorConfig { width: 16 };
    let config = RegressorTraining { network, steps, batch: 3, space, learning_rate: 1e-2, ..Default::default() };
    let train = (0..5).map(|i| sequence(&format!("clip{i}"), 20 + 3 * i)).collect();
    let clips = Clips { train, validation: vec![sequence("other", 25), sequence("another", 12)] };
    let autoencoder = subspace(1).into_network();
    RegressorTrainee::new(config, &stage("regressor"), &autoencoder, &surface().directions, shortcut, clips)
        .expect("a small training")
}

fn shortcut_from_zero() -> ShortcutStart {
    ShortcutStart { weight: vec![0.0; L * L], bias: vec![0.0; L] }
}

/// Half of the truth, so that there is something left to learn.
fn half_the_truth() -> ShortcutStart {
    let weight = (0..L * L).map(|i| if i % (L + 1) == 0 { 0.005 } else { 0.0 });
    ShortcutStart { weight: weight.collect(), bias: vec![0.0; L] }
}

fn run(trainee: &mut dyn Trainee, steps: std::ops::Range<u64>) -> Vec<f64> {
    steps.map(|step| trainee.step(step).expect("a step").loss).collect()
}

/// Stops after `cut` of `steps` steps, restores into a fresh trainee, and compares with an unbroken run.
fn resumes(make: impl Fn() -> Box<dyn Trainee>, cut: u64, steps: u64) {
    let mut unbroken = make();
    let wanted = run(&mut *unbroken, 0..steps);
    let mut first = make();
    let mut found = run(&mut *first, 0..cut);
    let saved: State = first.state().into_iter().map(|a| (a.name.clone(), a)).collect();
    let mut second = make();
    second.load_state(&saved).expect("its own state");
    second.validate().expect("validation changes nothing");
    found.extend(run(&mut *second, cut..steps));
    assert_eq!(found, wanted);
    assert_eq!(second.state(), unbroken.state());
}

#[test]
fn both_resume_to_the_same_bits() {
    resumes(|| Box::new(subspace(9)), 4, 9);
    resumes(|| Box::new(regressor(9, LossSpace::Coefficients, half_the_truth())), 5, 9);
    resumes(|| Box::new(regressor(9, LossSpace::Latent, shortcut_from_zero())), 1, 9);
}

#[test]
fn the_autoencoder_starts_as_pca_and_ends_below_it() {
    let mut trainee = subspace(400);
    // What PCA leaves: the coefficients beyond the latent ones.
    let left = frames("validation", 100).coefficients;
    let distance: f64 = left
        .chunks(K)
        .flat_map(|row| {
            let mut vertices = [0.0f32; 12];
            vertices[L..K].copy_from_slice(&row[L..]);
            vertices.chunks(3).map(|d| d.iter().map(|x| f64::from(x * x)).sum::<f64>().sqrt()).collect::<Vec<_>>()
        })
        .sum();
    let pca_mm = 1000.0 * distance / 400.0;
    let start = trainee.validate().expect("validation");
    assert!((start - pca_mm).abs() < 1e-4 * pca_mm, "{start} {pca_mm}");
    assert_eq!(trainee.network().branch_rms(), 0.0);
    let losses = run(&mut trainee, 0..400);
    let end = trainee.validate().expect("validation");
    assert!(end < 0.5 * pca_mm, "{end} of {pca_mm}; losses {} to {}", losses[0], losses[399]);
    assert!(trainee.network().branch_rms() > 0.0);
}

#[test]
fn the_regressor_starts_as_its_shortcut_and_learns_the_rest() {
    let mut trainee = regressor(300, LossSpace::Coefficients, half_the_truth());
    let start = trainee.validate().expect("validation");
    run(&mut trainee, 0..300);
    let end = trainee.validate().expect("validation");
    assert!(end < 0.8 * start, "{end} of {start}");
    let mut trained = regressor(300, LossSpace::Latent, shortcut_from_zero());
    let before = trained.validate().expect("validation");
    run(&mut trained, 0..300);
    let after = trained.validate().expect("validation");
    assert!(before > start && after < 0.8 * before, "{after} of {before}");
}

#[test]
fn data_that_do_not_fit_are_refused() {
    let clips = Clips { train: frames("train", 10), validation: DeltaFrames::default() };
    let config = SubspaceTraining::default();
    let refused = SubspaceTrainee::new(config.clone(), &stage("s"), L, surface(), clips).map(|_| ()).unwrap_err();
    assert!(refused.to_string().contains("validation"), "{refused}");
    let clips = Clips { train: frames("train", 10), validation: frames("validation", 3) };
    let refused = SubspaceTrainee::new(config, &stage("s"), K + 1, surface(), clips).map(|_| ()).unwrap_err();
    assert!(refused.to_string().contains("9 latent numbers of 8 components"), "{refused}");
    let short = MotionSequence { target: vec![0.0; 5], ..sequence("short", 6) };
    let clips = Clips { train: vec![short], validation: vec![sequence("v", 4)] };
    let (network, basis) = (subspace(1).into_network(), surface().directions);
    let refused =
        RegressorTrainee::new(RegressorTraining::default(), &stage("r"), &network, &basis, half_the_truth(), clips)
            .map(|_| ())
            .unwrap_err();
    assert!(refused.to_string().contains("5 coefficients"), "{refused}");
}

/// What was trained, run frame by frame by the player, gives the training's own error.
#[test]
fn the_player_predicts_what_was_validated() {
    let identity = |count: usize| {
        let numbers: Vec<f32> = (0..2 * count).map(|i| if i < count { -9.0 } else { 9.0 }).collect();
        FeatureScaling::fit(&[&numbers], &FeatureBlock::in_a_row(&[("all", count)]))
    };
    let mut curved = subspace(200);
    run(&mut curved, 0..200);
    let subspace = curved.into_network();
    let decoder = subspace.to_decoder();
    for amplitude in [1.0f32, 1.5] {
        let sequence = |name: &str, frames: usize| MotionSequence { amplitude, ..sequence(name, frames) };
        let clip = sequence("played", 40);
        let mut whole = plain::Regressor {
            mass: plain::MassLaw { amplitude: amplitude.ln(), range: [1.0, 1.0], ..Default::default() },
            input: identity(L),
            shape_terms: vec![vec![]],
            direct: true,
            shortcut: plain::Linear { weight: plain::Matrix::new(L, L, vec![0.002; L * L]), bias: vec![0.001; L] },
            ..plain::Regressor::default()
        };
        let unit = whole.input.scale[0];
        let prepared = |clip: &MotionSequence| MotionSequence {
            input: clip.input.iter().map(|x| x * unit).collect(),
            ..clip.clone()
        };
        let train = vec![prepared(&sequence("a", 30)), prepared(&sequence("b", 25))];
        let clips = Clips { train, validation: vec![prepared(&clip)] };
        // The weights' matrix and its transpose are equal here.
        let shortcut = ShortcutStart { weight: vec![0.002; L * L], bias: vec![0.001; L] };
        let (network, basis) = (subspace.clone(), surface().directions);
        let config = RegressorTraining { network: RegressorConfig { width: 8 }, batch: 2, ..Default::default() };
        let mut trainee =
            RegressorTrainee::new(config, &stage("r"), &network, &basis, shortcut, clips).expect("it fits");
        run(&mut trainee, 0..30);
        let validated = trainee.validate().expect("validation");
        let learned = trainee.into_network();
        whole.recurrent = Some(learned.to_recurrent(network.scale));
        let shortcut = learned.to_shortcut(network.scale);
        assert_ne!(shortcut, whole.shortcut);
        whole.shortcut = shortcut;
        let played = played_mm(&whole, &decoder, &clip);
        assert!((played - validated).abs() < 1e-4 * validated, "{played} {validated}");
        if amplitude != 1.0 {
            // Else it would not matter where the decoder is asked.
            let elsewhere = plain::Regressor { mass: plain::MassLaw::default(), ..whole.clone() };
            let other = played_mm(&elsewhere, &decoder, &MotionSequence { amplitude: 1.0, ..clip.clone() });
            assert!((f64::from(amplitude) * other - validated).abs() > 1e-3 * validated, "{other} {validated}");
        }
    }
}

/// Mean vertex error of a rollout of a body with the clip's amplitude, mm.
fn played_mm(regressor: &plain::Regressor, decoder: &plain::Decoder, clip: &MotionSequence) -> f64 {
    let (mut state, mut scratch) = (regressor.start(&[]), vec![0.0; 2 * K + 256]);
    let mut sum = 0.0;
    for (features, wanted) in clip.input.chunks(L).zip(clip.target.chunks(K)) {
        regressor.step(features, &mut state);
        let mut found = [0.0; 12];
        decoder.lift.apply(state.latent(), &mut found[..K]);
        decoder.units.iter().for_each(|unit| unit.apply(&mut found[..K], &mut scratch));
        found.iter_mut().zip(wanted).for_each(|(f, w)| *f -= clip.amplitude * w);
        sum += found.chunks(3).map(|d| f64::from(d.iter().map(|x| x * x).sum::<f32>().sqrt())).sum::<f64>();
    }
    1000.0 * sum / (4 * clip.frames()) as f64
}
