//! Backends held against flex: the steps of a tiny avatar.

use crate::checks::{ball, breathing};
use crate::trainee::AvatarTrainee;
use crate::{AvatarConfig, Conditioning, LossWeights, StageConfig};
use burn::tensor::Device;
use softtissue_implicit::SampleConfig;
use softtissue_train::{Clips, Stage, Trainee};
use std::sync::Arc;

/// Losses and their terms of six steps of rollouts of two frames, then the validation.
fn six_steps(device: &Device) -> Vec<f64> {
    let [_, rollout] = AvatarConfig::default().stages();
    let sampling = SampleConfig { surface: 60, near: 40, within: 20, ..rollout.sampling };
    let config = StageConfig { steps: 6, learning_rate: 3e-3, sampling, ..rollout };
    let body = Arc::new(ball(device));
    let clips = Arc::new(Clips { train: vec![breathing(30, 0.0)], validation: vec![breathing(30, 1.7)] });
    let stage = Stage { name: "autoavatar/parity".into(), seed: 1, device: device.clone() };
    let conditioning = Conditioning::Autoregressive;
    let network = AvatarTrainee::untrained(&body, conditioning, &stage);
    let mut trainee = AvatarTrainee::new(&config, &LossWeights::default(), conditioning, stage, body, network, clips)
        .expect("clips that are long enough");
    let mut record = Vec::new();
    for step in 0..6 {
        let stats = trainee.step(step).expect("a step");
        record.push(stats.loss);
        record.extend(stats.terms.iter().map(|(_, x)| *x));
    }
    record.push(trainee.validate().expect("a validation"));
    record
}

#[test]
fn six_steps_repeat_to_the_bit_and_learn() {
    let record = six_steps(&Device::flex());
    assert_eq!(record, six_steps(&Device::flex()));
    assert!(record.iter().all(|x| x.is_finite()) && record[5] != record[0], "{record:?}");
}

#[cfg(any(feature = "ndarray", feature = "wgpu"))]
fn agrees_with_flex(name: &str) {
    let device = softtissue_train::device::parse(name).expect("compiled in");
    let (wanted, found) = (six_steps(&Device::flex()), six_steps(&device));
    assert_eq!(found.len(), wanted.len());
    for (i, (f, w)) in found.iter().zip(&wanted).enumerate() {
        // Adam divides by a gradient's own size: where that is rounding noise a weight that hardly counts moves as it likes
        assert!((f - w).abs() <= 1e-3 * w.abs(), "number {i}: {f} on {name}, {w} on flex");
    }
}

#[cfg(feature = "ndarray")]
#[test]
fn ndarray_agrees_with_flex() {
    agrees_with_flex("ndarray");
}

#[cfg(feature = "wgpu")]
#[test]
fn wgpu_agrees_with_flex() {
    agrees_with_flex("wgpu");
}
