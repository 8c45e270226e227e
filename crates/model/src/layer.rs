//! Making and reading burn's linear layers; everything random comes from a counter.

use crate::plain;
use burn::module::Param;
use burn::nn::Linear;
use burn::tensor::{Device, Tensor, TensorData};
use softtissue_random::Draws;

/// The data of a tensor on the host, row-major.
pub fn host<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    tensor.inner().into_data().try_into_vec().expect("tensors of this project are f32")
}

/// `data [rows, cols]` as a trainable matrix.
pub(crate) fn matrix(data: Vec<f32>, shape: [usize; 2], device: &Device) -> Param<Tensor<2>> {
    Param::from_data(TensorData::new(data, shape), device)
}

/// `data` as a trainable vector.
pub(crate) fn vector(data: Vec<f32>, device: &Device) -> Param<Tensor<1>> {
    let count = data.len();
    Param::from_data(TensorData::new(data, [count]), device)
}

/// Weights `[inputs, outputs]` and bias `[outputs]`.
pub(crate) fn linear(weight: Vec<f32>, bias: Vec<f32>, device: &Device) -> Linear {
    let outputs = bias.len();
    assert!(outputs > 0 && weight.len().is_multiple_of(outputs), "weights of a layer with {outputs} outputs");
    let inputs = weight.len() / outputs;
    Linear { weight: matrix(weight, [inputs, outputs], device), bias: Some(vector(bias, device)) }
}

/// Uniform in `+-1 / sqrt(inputs)`, PyTorch's default.
pub(crate) fn uniform(inputs: usize, outputs: usize, draws: &mut Draws, device: &Device) -> Linear {
    let bound = 1.0 / (inputs as f64).sqrt();
    let mut draw = |n: usize| (0..n).map(|_| draws.range(-bound, bound) as f32).collect();
    linear(draw(inputs * outputs), draw(outputs), device)
}

/// All zeros.
pub(crate) fn zeros(inputs: usize, outputs: usize, device: &Device) -> Linear {
    linear(vec![0.0; inputs * outputs], vec![0.0; outputs], device)
}

/// Ones on the diagonal: passes on the first numbers, pads the rest with zeros.
pub(crate) fn identity(inputs: usize, outputs: usize, device: &Device) -> Linear {
    let mut weight = vec![0.0; inputs * outputs];
    (0..inputs.min(outputs)).for_each(|i| weight[i * outputs + i] = 1.0);
    linear(weight, vec![0.0; outputs], device)
}

/// The layer as plain arrays, weights and bias multiplied by a factor each.
pub(crate) fn to_plain(layer: &Linear, weight_factor: f32, bias_factor: f32) -> plain::Linear {
    let [inputs, outputs] = layer.weight.dims();
    let transposed = layer.weight.val().inner().transpose().mul_scalar(weight_factor);
    let weight = plain::Matrix::new(outputs, inputs, host(transposed));
    let bias = match &layer.bias {
        Some(bias) => host(bias.val().inner().mul_scalar(bias_factor)),
        None => vec![0.0; outputs],
    };
    plain::Linear { weight, bias }
}
