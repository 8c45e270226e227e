//! Networks, losses and optimiser against other implementations of the same formulas.

mod adam;
mod autoencoder;
mod backends;
mod casas_otaduy;
#[path = "../../../fit/tests/fit/figure.rs"]
#[allow(dead_code, reason = "the pose fit's own tests use the rest of it")]
mod figure;
mod fit_adam;
mod gru;
mod normal_loss;
mod pose_autoencoder;
mod trainees;

use burn::tensor::{Device, Tensor, TensorData};
use softtissue_random::Draws;

/// Normal numbers from a named stream.
fn normals(name: &str, count: usize) -> Vec<f32> {
    let mut draws = Draws::new(99, name, 0, 0);
    (0..count).map(|_| draws.normal() as f32).collect()
}

fn tensor<const D: usize>(data: Vec<f32>, shape: [usize; D], device: &Device) -> Tensor<D> {
    Tensor::from_data(TensorData::new(data, shape), device)
}

/// Largest difference over the largest magnitude of `wanted`.
fn relative_difference(found: &[f32], wanted: &[f32]) -> f32 {
    assert_eq!(found.len(), wanted.len(), "numbers to compare");
    let largest = |x: &mut dyn Iterator<Item = f32>| x.fold(0.0f32, |a, b| a.max(b.abs()));
    let difference = largest(&mut found.iter().zip(wanted).map(|(f, w)| f - w));
    difference / largest(&mut wanted.iter().copied()).max(1e-12)
}
