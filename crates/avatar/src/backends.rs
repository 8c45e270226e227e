//! Backends held against flex: the steps of a tiny avatar.

use crate::checks::{ball, short, trainee};
use crate::{AvatarConfig, Conditioning};
use burn::tensor::Device;
use softtissue_train::Trainee;
use std::sync::Arc;

/// Losses and their terms of six steps of short rollouts, then the validation.
fn six_steps(device: &Device) -> Vec<f64> {
    let [_, rollout] = AvatarConfig::default().stages();
    let body = Arc::new(ball(device));
    let mut trainee = trainee(&body, Conditioning::Autoregressive, &short(rollout, 6), None, device);
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
fn six_steps_repeat_to_the_bit_and_each_moves_the_loss() {
    let record = six_steps(&Device::flex());
    assert_eq!(record, six_steps(&Device::flex()));
    assert!(record.iter().all(|x| x.is_finite()), "{record:?}");
    let losses: Vec<f64> = record[..30].iter().copied().step_by(5).collect();
    assert!(losses.windows(2).all(|w| w[0] != w[1]), "{losses:?}");
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
