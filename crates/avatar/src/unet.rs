use crate::layer::{SLOPE, rectified_bound, uniform, zeros};
use burn::module::{Module, Param};
use burn::tensor::activation::{leaky_relu, tanh};
use burn::tensor::module::{conv_transpose2d, conv2d};
use burn::tensor::ops::{ConvOptions, ConvTransposeOptions};
use burn::tensor::{Device, Tensor};
use softtissue_random::Draws;

/// A 3 x 3 convolution with a bias of its own for every texel ("untied").
#[derive(Module, Debug)]
struct Convolution {
    /// `[out, in, 3, 3]`, or `[in, out, 3, 3]` of a transposed one.
    weight: Param<Tensor<4>>,
    /// `[out, side, side]`.
    bias: Param<Tensor<3>>,
}

impl Convolution {
    fn add_bias(&self, x: Tensor<4>) -> Tensor<4> {
        x + self.bias.val().unsqueeze()
    }

    /// `[1, in, S, S] -> [1, out, S / stride, S / stride]`.
    fn forward(&self, x: Tensor<4>, stride: usize) -> Tensor<4> {
        self.add_bias(conv2d(x, self.weight.val(), None, ConvOptions::new([stride; 2], [1; 2], [1; 2], 1)))
    }

    /// `[1, in, S, S] -> [1, out, 2 S, 2 S]`.
    fn transposed(&self, x: Tensor<4>) -> Tensor<4> {
        let options = ConvTransposeOptions::new([2; 2], [1; 2], [1; 2], [1; 2], 1);
        self.add_bias(conv_transpose2d(x, self.weight.val(), None, options))
    }
}

/// The UNet (sec. 3.4): kernels of 3, untied biases, no normalisation, LeakyReLU of slope 0.2, tanh at the end. The paper
/// leaves the rest to its code: each level halves the side by a stride of 2, transposed convolutions double it, skips are
/// added, and the last convolution starts as zero.
#[derive(Module, Debug)]
pub struct UNet {
    enter: Convolution,
    down: Vec<Convolution>,
    up: Vec<Convolution>,
    leave: Convolution,
}

impl UNet {
    /// From `inputs` to `outputs` channels over `side x side` texels; `channels` are those of the levels, finest first.
    pub fn new(
        inputs: usize,
        outputs: usize,
        channels: &[usize],
        side: usize,
        draws: &mut Draws,
        device: &Device,
    ) -> Self {
        // A transposed convolution of stride 2 sums a quarter of its kernel into each texel.
        let mut convolution = |shape: [usize; 2], fan_in: f64, out: usize, side: usize| Convolution {
            weight: uniform([shape[0], shape[1], 3, 3], rectified_bound(fan_in), draws, device),
            bias: zeros([out, side, side], device),
        };
        let nine = |n: usize| 9.0 * n as f64;
        let enter = convolution([channels[0], inputs], nine(inputs), channels[0], side);
        let steps = || channels.windows(2).enumerate();
        let down = steps().map(|(l, c)| convolution([c[1], c[0]], nine(c[0]), c[1], side >> (l + 1))).collect();
        let up = steps().map(|(l, c)| convolution([c[1], c[0]], nine(c[1]) / 4.0, c[0], side >> l)).collect();
        let leave = Convolution {
            weight: zeros([outputs, channels[0], 3, 3], device),
            bias: zeros([outputs, side, side], device),
        };
        Self { enter, down, up, leave }
    }

    /// `[1, inputs, S, S] -> [1, outputs, S, S]`.
    pub fn forward(&self, x: Tensor<4>) -> Tensor<4> {
        let mut x = leaky_relu(self.enter.forward(x, 1), SLOPE);
        let mut skips = Vec::with_capacity(self.down.len());
        for down in &self.down {
            skips.push(x.clone());
            x = leaky_relu(down.forward(x, 2), SLOPE);
        }
        for (up, skip) in self.up.iter().zip(skips).rev() {
            x = leaky_relu(up.transposed(x), SLOPE) + skip;
        }
        tanh(self.leave.forward(x, 1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use softtissue_model::host;
    use softtissue_train::{load_module, module_gradients, read_state};
    use std::path::Path;

    fn largest_difference(a: &[f32], b: &[f32]) -> f32 {
        assert_eq!(a.len(), b.len());
        a.iter().zip(b).fold(0.0, |m, (a, b)| m.max((a - b).abs()))
    }

    /// The fixture is PyTorch's, made by `tests/fixtures/unet.py`. Sums of at most 60 products in f32: 1e-5.
    #[test]
    fn values_and_gradients_are_pytorchs() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/unet.safetensors");
        let golden = read_state(&path).expect("the fixture");
        let device = Device::flex().autodiff();
        let net = UNet::new(3, 2, &[4, 5, 6], 8, &mut Draws::new(1, "unet", 0, 0), &device);
        let net = load_module(net, &golden).expect("weights of the same shape");
        let given =
            |name: &str| crate::layer::tensor(golden[name].data.clone(), [1, golden[name].shape[1], 8, 8], &device);
        let output = net.forward(given("input"));
        assert!(largest_difference(&host(output.clone()), &golden["output"].data) < 1e-5);
        let mut gradients = (output * given("weighting")).sum().backward();
        let found = module_gradients(&net, &mut gradients);
        assert_eq!(found.len(), 12);
        for (name, gradient) in found {
            let wanted = &golden[&format!("gradient.{name}")].data;
            let size = wanted.iter().fold(1.0f32, |m, x| m.max(x.abs()));
            let error = largest_difference(&gradient, wanted);
            assert!(error < 1e-5 * size, "{name}: {error} of {size}");
        }
    }

    #[test]
    fn an_untrained_unet_gives_zeros() {
        let device = Device::flex();
        let net = UNet::new(3, 2, &[4, 5], 8, &mut Draws::new(1, "unet", 0, 0), &device);
        let output = net.forward(Tensor::ones([1, 3, 8, 8], &device));
        assert_eq!(output.dims(), [1, 2, 8, 8]);
        assert!(host(output).iter().all(|x| *x == 0.0));
    }
}
