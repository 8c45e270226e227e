//! The networks of Casas and Otaduy (2018), one person's: an autoencoder of deltas, and a regressor of deltas that is
//! fed back through its encoder. All numbers in and out are standardised.

use crate::{Dropout, Standardisation, layer, plain};
use burn::module::Module;
use burn::nn::Linear;
use burn::tensor::{Device, Tensor, activation};
use softtissue_random::Draws;

/// Linear, rectified, linear: one half of the autoencoder (sec. 3.3).
#[derive(Module, Debug)]
pub struct ThreeLayers {
    first: Linear,
    second: Linear,
    third: Linear,
}

/// The autoencoder (sec. 3.3, fig. 4): `[V * 3] -> a -> b -> [L] -> b -> a -> [V * 3]`, the second layer of either
/// half rectified. The paper gives the kinds of layers and `L = 100`; the widths `a` and `b` are ours.
#[derive(Module, Debug)]
pub struct DeltaAutoencoder {
    /// Deltas to latents.
    pub encoder: ThreeLayers,
    /// Latents to deltas.
    pub decoder: ThreeLayers,
}

/// The regressor (sec. 3.4): one hidden rectified layer from the latents of two frames and the poses of a few to
/// deltas.
#[derive(Module, Debug)]
pub struct FeedbackRegressor {
    hidden: Linear,
    output: Linear,
}

/// Principal components that an autoencoder may start from: those of the deltas as they are, in metres.
#[derive(Clone, Copy, Debug)]
pub struct PrincipalStart<'a> {
    /// Orthonormal, `[at least L, V * 3]`.
    pub directions: &'a [f32],
    /// Standard deviation of each coefficient, `[at least L]`, metres.
    pub spread: &'a [f32],
    /// Standard deviations that the deltas are divided by, `[V * 3]`, metres.
    pub deviation: &'a [f32],
}

impl ThreeLayers {
    fn new(widths: [usize; 4], draws: &mut Draws, device: &Device) -> Self {
        let mut layer = |i: usize| layer::uniform(widths[i], widths[i + 1], draws, device);
        Self { first: layer(0), second: layer(1), third: layer(2) }
    }

    /// `[B, inputs] -> [B, outputs]`.
    pub fn forward(&self, x: Tensor<2>) -> Tensor<2> {
        self.third.forward(activation::relu(self.second.forward(self.first.forward(x))))
    }

    /// Inputs.
    pub fn inputs(&self) -> usize {
        self.first.weight.dims()[0]
    }

    /// Outputs.
    pub fn outputs(&self) -> usize {
        self.third.weight.dims()[1]
    }

    /// As plain layers, on inputs that are not standardised yet.
    pub fn to_plain(&self, input: &Standardisation) -> plain::ThreeLayers {
        let [first, second, third] = self.layers();
        plain::ThreeLayers([input.before(first), second, third])
    }

    fn layers(&self) -> [plain::Linear; 3] {
        [&self.first, &self.second, &self.third].map(|l| layer::to_plain(l, 1.0, 1.0))
    }
}

impl DeltaAutoencoder {
    /// An untrained autoencoder of frames of `width` numbers; `widths` are those of the outer and the inner layer.
    pub fn new(width: usize, widths: [usize; 2], latents: usize, draws: &mut Draws, device: &Device) -> Self {
        let [outer, inner] = widths;
        Self {
            encoder: ThreeLayers::new([width, outer, inner, latents], draws, device),
            decoder: ThreeLayers::new([latents, inner, outer, width], draws, device),
        }
    }

    /// The same that starts as principal component analysis: a latent number is a coefficient over its spread, which
    /// passes a rectified layer as two units, `x = relu(x) - relu(-x)`; all other units keep their random weights but
    /// add nothing yet. Needs `widths[0] >= 2 L` and `widths[1] >= 2 L`.
    pub fn as_principal(self, start: PrincipalStart, latents: usize, device: &Device) -> Self {
        let PrincipalStart { directions, spread, deviation } = start;
        let width = deviation.len();
        let direction = |k: usize, i: usize| directions[k * width + i];
        // Entries of a weight `[inputs, outputs]`.
        let pass = |i: usize, o: usize| if i == o { 1.0 } else { 0.0 };
        let split = |i: usize, o: usize| match o < latents {
            true => pass(i, o),
            false => -pass(i, o - latents),
        };
        let joined = |i: usize, o: usize| split(o, i);
        let code = |i: usize, k: usize| direction(k, i) * deviation[i] / spread[k].max(f32::MIN_POSITIVE);
        let rebuilt = |u: usize, i: usize| {
            let (k, sign) = if u < latents { (u, 1.0) } else { (u - latents, -1.0) };
            sign * direction(k, i) * spread[k] / deviation[i]
        };
        let Self { encoder, decoder } = self;
        Self {
            encoder: ThreeLayers {
                first: set_columns(encoder.first, latents, code, device),
                second: set_columns(encoder.second, 2 * latents, split, device),
                third: set_rows(encoder.third, 2 * latents, joined, device),
            },
            decoder: ThreeLayers {
                first: set_columns(decoder.first, latents, pass, device),
                second: set_columns(decoder.second, 2 * latents, split, device),
                third: set_rows(decoder.third, 2 * latents, rebuilt, device),
            },
        }
    }

    /// Encoder and decoder as plain layers, of deltas in metres.
    pub fn to_plain(&self, deltas: &Standardisation) -> [plain::ThreeLayers; 2] {
        let [first, second, third] = self.decoder.layers();
        [self.encoder.to_plain(deltas), plain::ThreeLayers([first, second, deltas.after(third)])]
    }

    /// Reconstruction `[B, V * 3]` of deltas `[B, V * 3]`.
    pub fn forward(&self, deltas: Tensor<2>) -> Tensor<2> {
        self.decoder.forward(self.encoder.forward(deltas))
    }
}

impl FeedbackRegressor {
    /// An untrained regressor.
    pub fn new(inputs: usize, width: usize, outputs: usize, draws: &mut Draws, device: &Device) -> Self {
        Self {
            hidden: layer::uniform(inputs, width, draws, device),
            output: layer::uniform(width, outputs, draws, device),
        }
    }

    /// Hidden units that the paper gives a regressor of so many inputs and outputs: the root of their product (Masters
    /// 1993), rounded down: 2689 of 350 inputs and 20670 outputs. (Its text has 11670 outputs, a misprint: the root
    /// would be 2021.)
    pub fn published_width(inputs: usize, outputs: usize) -> usize {
        (inputs * outputs).isqrt().max(1)
    }

    /// Deltas `[B, V * 3]` of `[B, inputs]`; `dropout` falls on the hidden units.
    pub fn forward(&self, input: Tensor<2>, dropout: Option<&mut Dropout>) -> Tensor<2> {
        let hidden = activation::relu(self.hidden.forward(input));
        self.output.forward(match dropout {
            Some(dropout) => hidden.clone() * dropout.mask(hidden.dims()),
            None => hidden,
        })
    }

    /// Hidden and output layer as plain ones, on inputs that are not standardised yet, with outputs in metres.
    pub fn to_plain(&self, input: &Standardisation, deltas: &Standardisation) -> [plain::Linear; 2] {
        let [hidden, output] = [&self.hidden, &self.output].map(|l| layer::to_plain(l, 1.0, 1.0));
        [input.before(hidden), deltas.after(output)]
    }
}

/// A layer whose first `count` outputs are `entry(input, output)` without bias.
fn set_columns(old: Linear, count: usize, entry: impl Fn(usize, usize) -> f32, device: &Device) -> Linear {
    let (mut weight, mut bias) = parts(&old);
    let outputs = bias.len();
    for (i, row) in weight.chunks_exact_mut(outputs).enumerate() {
        row[..count].iter_mut().enumerate().for_each(|(o, w)| *w = entry(i, o));
    }
    bias[..count].fill(0.0);
    layer::linear(weight, bias, device)
}

/// A layer without bias that sees its first `count` inputs only, through `entry(input, output)`.
fn set_rows(old: Linear, count: usize, entry: impl Fn(usize, usize) -> f32, device: &Device) -> Linear {
    let (mut weight, mut bias) = parts(&old);
    let outputs = bias.len();
    weight.fill(0.0);
    for (i, row) in weight.chunks_exact_mut(outputs).take(count).enumerate() {
        row.iter_mut().enumerate().for_each(|(o, w)| *w = entry(i, o));
    }
    bias.fill(0.0);
    layer::linear(weight, bias, device)
}

fn parts(linear: &Linear) -> (Vec<f32>, Vec<f32>) {
    let bias = linear.bias.as_ref().expect("layers of this project have a bias");
    (layer::host(linear.weight.val()), layer::host(bias.val()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_papers_hidden_layer_has_2689_units() {
        assert_eq!(FeedbackRegressor::published_width(350, 20670), 2689);
        assert_eq!(FeedbackRegressor::published_width(0, 5), 1);
    }
}
