//! What is minimised. Losses are computed on the host with their gradients written by hand; the gradient then
//! enters the autodiff graph through [`surrogate`].

mod normals;
mod surface;
mod trajectory;
mod weighted;

pub use normals::{NormalLoss, face_normal_loss};
pub use surface::surface_loss;
pub use trajectory::{TrajectoryLoss, TrajectoryTerms, TrajectoryWeights};
pub use weighted::WeightedDistance;

use burn::tensor::{Tensor, TensorData};

/// A scalar whose gradient with respect to `output` is `gradient` (row-major, as many numbers as `output`): calling
/// `backward` on it continues a gradient that was computed outside of autodiff.
pub fn surrogate<const D: usize>(output: Tensor<D>, gradient: Vec<f32>) -> Tensor<1> {
    let gradient = Tensor::<D>::from_data(TensorData::new(gradient, output.shape()), &output.device().inner());
    (output * gradient).sum()
}
