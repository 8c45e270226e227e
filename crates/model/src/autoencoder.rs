use crate::{layer, plain};
use burn::module::Module;
use burn::nn::Linear;
use burn::tensor::{Device, Tensor, TensorData, activation};
use serde::{Deserialize, Serialize};
use softtissue_random::Draws;

/// The autoencoder's size.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct AutoencoderConfig {
    /// Inner width of a residual unit. Default 256; wider learns finer curvature of the subspace, costs time in
    /// proportion.
    pub width: usize,
    /// Residual units on each side of the latent. Default 2; 0 makes the autoencoder a linear one.
    pub units: usize,
}

impl Default for AutoencoderConfig {
    fn default() -> Self {
        Self { width: 256, units: 2 }
    }
}

/// A pre-activation residual unit (He et al. 2016), `x + B relu(A relu(x) + a) + b`, with dropout after the inner
/// rectifier in training.
#[derive(Module, Debug)]
pub struct ResidualUnit {
    inner: Linear,
    outer: Linear,
}

/// Coefficients `[B, K]` to latents `[B, L]`: residual units, then one linear layer.
#[derive(Module, Debug)]
pub struct Encoder {
    units: Vec<ResidualUnit>,
    project: Linear,
}

/// Latents `[B, L]` to coefficients `[B, K]`: one linear layer, then residual units.
#[derive(Module, Debug)]
pub struct Decoder {
    lift: Linear,
    units: Vec<ResidualUnit>,
}

/// The autoencoder of SoftSMPL (2020) sec. 4 on principal components of the deltas, in a residual form of our own:
/// the encoder's linear layer starts by taking the first `L` coefficients, the decoder's by padding them with
/// zeros, and every residual branch ends in a layer of zeros, so that the untrained autoencoder **is** the
/// principal component analysis with `L` components.
///
/// Tensors are in units of `scale` metres; [`Autoencoder::to_encoder`] and [`Autoencoder::to_decoder`] give layers
/// in metres. The scale is a power of two, so that nothing is rounded by it.
#[derive(Module, Debug)]
pub struct Autoencoder {
    /// Coefficients to latents.
    pub encoder: Encoder,
    /// Latents to coefficients.
    pub decoder: Decoder,
    /// Metres in one unit of the tensors, a power of two.
    pub scale: f32,
}

/// Random zeroing of activations, drawn from a counter: the `i`-th mask asked for is a function of the stream and
/// `i` alone. Kept values are divided by the probability of being kept.
#[derive(Debug)]
pub struct Dropout {
    draws: Draws,
    rate: f64,
    device: Device,
}

impl Dropout {
    /// Masks with a probability `rate` of zero, on `device`.
    pub fn new(draws: Draws, rate: f64, device: &Device) -> Self {
        assert!((0.0..1.0).contains(&rate), "a dropout rate must lie in [0, 1), not {rate}");
        Self { draws, rate, device: device.clone() }
    }

    pub(crate) fn mask(&mut self, shape: [usize; 2]) -> Tensor<2> {
        let kept = (1.0 / (1.0 - self.rate)) as f32;
        // One draw of 64 bits serves four numbers of 16.
        let limit = (self.rate * 65536.0).round() as u64;
        let mut data = vec![0.0f32; shape[0] * shape[1]];
        for four in data.chunks_mut(4) {
            let bits = self.draws.bits();
            for (i, x) in four.iter_mut().enumerate() {
                *x = if (bits >> (16 * i)) & 0xffff < limit { 0.0 } else { kept };
            }
        }
        Tensor::from_data(TensorData::new(data, shape), &self.device)
    }
}

impl ResidualUnit {
    fn new(components: usize, width: usize, draws: &mut Draws, device: &Device) -> Self {
        Self { inner: layer::uniform(components, width, draws, device), outer: layer::zeros(width, components, device) }
    }

    fn forward(&self, x: Tensor<2>, dropout: Option<&mut Dropout>) -> Tensor<2> {
        let mut inner = activation::relu(self.inner.forward(activation::relu(x.clone())));
        if let Some(dropout) = dropout.filter(|d| d.rate > 0.0) {
            let mask = dropout.mask(inner.dims());
            inner = inner * mask;
        }
        x + self.outer.forward(inner)
    }

    /// With `x = s x'`, `x' + B relu(A relu(x') + a) + b` becomes `x + s B relu(A/s relu(x) + a) + s b`.
    fn to_plain(&self, scale: f32) -> plain::ResidualUnit {
        plain::ResidualUnit {
            inner: layer::to_plain(&self.inner, 1.0 / scale, 1.0),
            outer: layer::to_plain(&self.outer, scale, scale),
        }
    }
}

impl Encoder {
    /// Latents `[B, L]` of coefficients `[B, K]`.
    pub fn forward(&self, coefficients: Tensor<2>, mut dropout: Option<&mut Dropout>) -> Tensor<2> {
        let units = self.units.iter();
        self.project.forward(units.fold(coefficients, |x, unit| unit.forward(x, dropout.as_deref_mut())))
    }
}

impl Decoder {
    /// Coefficients `[B, K]` of latents `[B, L]`.
    pub fn forward(&self, latents: Tensor<2>, mut dropout: Option<&mut Dropout>) -> Tensor<2> {
        let units = self.units.iter();
        units.fold(self.lift.forward(latents), |x, unit| unit.forward(x, dropout.as_deref_mut()))
    }

    /// Latent numbers `L`.
    pub fn latent_count(&self) -> usize {
        self.lift.weight.dims()[0]
    }

    /// Components `K`.
    pub fn components(&self) -> usize {
        self.lift.weight.dims()[1]
    }

    /// The decoder that pads `latents` numbers with zeros, `[components]`: principal component analysis.
    pub fn linear(components: usize, latents: usize, device: &Device) -> Self {
        Self { lift: layer::identity(latents, components, device), units: Vec::new() }
    }
}

impl Autoencoder {
    /// An untrained autoencoder of `components` coefficients with `latents` latent numbers: exactly the principal
    /// component analysis. `typical` (metres; e.g. the root mean square of the first coefficient) chooses the scale.
    ///
    /// Panics if there are more latents than components.
    pub fn new(
        config: &AutoencoderConfig,
        components: usize,
        latents: usize,
        typical: f32,
        draws: &mut Draws,
        device: &Device,
    ) -> Self {
        assert!(latents <= components, "{latents} latent numbers of {components} coefficients");
        let mut units =
            || (0..config.units).map(|_| ResidualUnit::new(components, config.width, draws, device)).collect();
        Self {
            encoder: Encoder { units: units(), project: layer::identity(components, latents, device) },
            decoder: Decoder { units: units(), lift: layer::identity(latents, components, device) },
            scale: power_of_two(typical),
        }
    }

    /// Reconstruction `[B, K]` of coefficients `[B, K]`, both in units of the scale.
    pub fn forward(&self, coefficients: Tensor<2>, mut dropout: Option<&mut Dropout>) -> Tensor<2> {
        let latents = self.encoder.forward(coefficients, dropout.as_deref_mut());
        self.decoder.forward(latents, dropout)
    }

    /// The encoder in metres.
    pub fn to_encoder(&self) -> plain::Encoder {
        plain::Encoder {
            units: self.encoder.units.iter().map(|u| u.to_plain(self.scale)).collect(),
            project: layer::to_plain(&self.encoder.project, 1.0, self.scale),
        }
    }

    /// The decoder in metres.
    pub fn to_decoder(&self) -> plain::Decoder {
        plain::Decoder {
            lift: layer::to_plain(&self.decoder.lift, 1.0, self.scale),
            units: self.decoder.units.iter().map(|u| u.to_plain(self.scale)).collect(),
        }
    }

    /// Root mean square over all weights of the residual branches' last layers: zero while the autoencoder is PCA.
    pub fn branch_rms(&self) -> f64 {
        let units = self.encoder.units.iter().chain(&self.decoder.units);
        let (mut sum, mut count) = (0.0, 0usize);
        for unit in units {
            let data = layer::host(unit.outer.weight.val());
            sum += data.iter().map(|w| f64::from(*w).powi(2)).sum::<f64>();
            count += data.len();
        }
        (sum / count.max(1) as f64).sqrt()
    }
}

/// The power of two nearest below `x`; 1 where `x` is no positive finite number.
pub fn power_of_two(x: f32) -> f32 {
    if x.is_finite() && x > 0.0 { x.log2().floor().clamp(-100.0, 100.0).exp2() } else { 1.0 }
}
