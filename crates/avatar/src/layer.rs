//! Making burn's layers; everything random comes from a counter.

use burn::module::Param;
use burn::nn::Linear;
use burn::tensor::{Device, Int, Tensor, TensorData};
use softtissue_random::Draws;

/// Slope of the leaky rectifier.
pub const SLOPE: f64 = 0.2;

/// `data` as a tensor.
pub fn tensor<const D: usize>(data: Vec<f32>, shape: [usize; D], device: &Device) -> Tensor<D> {
    Tensor::from_data(TensorData::new(data, shape), device)
}

/// Indices as a tensor.
pub fn indices(data: &[u32], device: &Device) -> Tensor<1, Int> {
    let data: Vec<i32> = data.iter().map(|i| *i as i32).collect();
    let count = data.len();
    Tensor::from_data(TensorData::new(data, [count]), device)
}

/// `data` as a parameter.
pub fn param<const D: usize>(data: Vec<f32>, shape: [usize; D], device: &Device) -> Param<Tensor<D>> {
    Param::from_data(TensorData::new(data, shape), device)
}

/// A parameter of zeros.
pub fn zeros<const D: usize>(shape: [usize; D], device: &Device) -> Param<Tensor<D>> {
    param(vec![0.0; shape.iter().product()], shape, device)
}

/// A parameter uniform in `+-bound`.
pub fn uniform<const D: usize>(shape: [usize; D], bound: f64, draws: &mut Draws, device: &Device) -> Param<Tensor<D>> {
    let data = (0..shape.iter().product()).map(|_| draws.range(-bound, bound) as f32).collect();
    param(data, shape, device)
}

/// A linear layer `[inputs] -> [outputs]`, weights and bias uniform in `+-1 / sqrt(inputs)`, PyTorch's default.
pub fn linear(inputs: usize, outputs: usize, draws: &mut Draws, device: &Device) -> Linear {
    let bound = 1.0 / (inputs as f64).sqrt();
    Linear {
        weight: uniform([inputs, outputs], bound, draws, device),
        bias: Some(uniform([outputs], bound, draws, device)),
    }
}

/// A linear layer of zeros.
pub fn zero_linear(inputs: usize, outputs: usize, device: &Device) -> Linear {
    Linear { weight: zeros([inputs, outputs], device), bias: Some(zeros([outputs], device)) }
}

/// Bound of uniform weights that keep the variance through a leaky rectifier (He et al. 2015), `fan_in` numbers into one.
pub fn rectified_bound(fan_in: f64) -> f64 {
    (6.0 / ((1.0 + SLOPE * SLOPE) * fan_in)).sqrt()
}
