use crate::detail::Part;
use crate::{Linear, Matrix, ResidualUnit, matrix::dot};
use std::ops::Range;

/// Principal components of deltas: `D = mean + directions^T (c + coefficient_mean)`. `D` is `[V * 3]`, vertex after
/// vertex, metres; the directions are orthonormal, so that a distance between coefficients is one between vertices.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DeltaBasis {
    /// Mean delta, `[V * 3]`, metres.
    pub mean: Vec<f32>,
    /// Orthonormal directions, `[K, V * 3]`.
    pub directions: Matrix,
    /// Mean of the coefficients that the networks see, `[K]`, metres; zero where the mean delta takes it all.
    pub coefficient_mean: Vec<f32>,
}

impl DeltaBasis {
    /// Coefficients of a zero delta, where every rollout of coefficients starts, `[K]`.
    pub fn rest_coefficients(&self) -> Vec<f32> {
        let mut rest = vec![0.0; self.directions.rows()];
        self.directions.times(&self.mean, &mut rest);
        rest.iter().zip(&self.coefficient_mean).map(|(r, m)| -r - m).collect()
    }

    /// `delta [V * 3]` (metres) of coefficients `[K]`, to which their mean is added in place.
    pub fn decode(&self, coefficients: &mut [f32], delta: &mut [f32]) {
        self.add_mean(coefficients);
        self.sum(coefficients, delta, None);
    }

    /// Coefficients `[K]` to those that the directions are multiplied by.
    pub(crate) fn add_mean(&self, coefficients: &mut [f32]) {
        coefficients.iter_mut().zip(&self.coefficient_mean).for_each(|(c, m)| *c += m);
    }

    /// `delta [V * 3]` of coefficients `[K]` that hold their mean already, or the part of it that is wanted.
    pub(crate) fn sum(&self, coefficients: &[f32], delta: &mut [f32], part: Option<&Part>) {
        self.begin_sum(delta, part);
        self.add_blocks(coefficients, delta, part, 0..self.directions.blocks());
    }

    /// What the sum begins with.
    pub(crate) fn begin_sum(&self, delta: &mut [f32], part: Option<&Part>) {
        delta.copy_from_slice(part.map_or(&self.mean, |part| &part.mean));
    }

    /// The rest of the sum in some blocks of columns.
    pub(crate) fn add_blocks(
        &self,
        coefficients: &[f32],
        delta: &mut [f32],
        part: Option<&Part>,
        blocks: Range<usize>,
    ) {
        let Some(part) = part else { return self.directions.add_transposed_blocks(coefficients, delta, blocks) };
        for wanted in &part.blocks {
            let both = wanted.start.max(blocks.start)..wanted.end.min(blocks.end);
            if !both.is_empty() {
                self.directions.add_transposed_blocks(&coefficients[..part.components], delta, both);
            }
        }
    }
}

/// From centred coefficients to the latent: residual units, then one linear layer.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Encoder {
    /// Residual units on `[K]`, in order.
    pub units: Vec<ResidualUnit>,
    /// `[K] -> [L]`.
    pub project: Linear,
}

/// From the latent to centred coefficients: one linear layer, then residual units.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Decoder {
    /// `[L] -> [K]`.
    pub lift: Linear,
    /// Residual units on `[K]`, in order.
    pub units: Vec<ResidualUnit>,
}

/// The autoencoder of deltas (SoftSMPL sec. 4, in the residual form that starts as PCA): `V` vertices,
/// `K` components, `L` latent numbers. Without residual units it is PCA.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Subspace {
    /// The outermost linear layers of both sides.
    pub basis: DeltaBasis,
    /// Deltas to latent; the player does not need it, evaluation does.
    pub encoder: Encoder,
    /// Latent to deltas.
    pub decoder: Decoder,
}

/// Working memory of a [`Subspace`], so that a step allocates nothing.
#[derive(Clone, Debug)]
pub struct SubspaceScratch {
    coefficients: Vec<f32>,
    unit: Vec<f32>,
}

impl SubspaceScratch {
    /// What [`Subspace::lift`] left, `[K]`.
    pub(crate) fn coefficients(&self) -> &[f32] {
        &self.coefficients
    }
}

impl Subspace {
    /// Vertices `V`.
    pub fn vertex_count(&self) -> usize {
        self.basis.mean.len() / 3
    }
    /// Components `K`.
    pub fn components(&self) -> usize {
        self.basis.directions.rows()
    }
    /// Latent numbers `L`.
    pub fn latent_count(&self) -> usize {
        self.decoder.lift.inputs()
    }
    /// Working memory that fits.
    pub fn scratch(&self) -> SubspaceScratch {
        let units = self.encoder.units.iter().chain(&self.decoder.units);
        let inner = units.map(ResidualUnit::inner_width).max().unwrap_or(0);
        let k = self.components();
        SubspaceScratch { coefficients: vec![0.0; k], unit: vec![0.0; 2 * k + inner] }
    }

    /// `delta [V * 3]` (metres) of a latent `[L]`.
    pub fn decode(&self, latent: &[f32], delta: &mut [f32], scratch: &mut SubspaceScratch) {
        let SubspaceScratch { coefficients, unit } = scratch;
        self.decode_coefficients_into(latent, coefficients, unit);
        self.basis.decode(coefficients, delta);
    }

    /// Coefficients of a latent `[L]`, with their mean, into [`SubspaceScratch::coefficients`].
    pub(crate) fn lift(&self, latent: &[f32], SubspaceScratch { coefficients, unit }: &mut SubspaceScratch) {
        self.decode_coefficients_into(latent, coefficients, unit);
        self.basis.add_mean(coefficients);
    }

    /// Centred coefficients `[K]` of a latent `[L]`.
    pub fn decode_coefficients(&self, latent: &[f32], coefficients: &mut [f32], scratch: &mut SubspaceScratch) {
        self.decode_coefficients_into(latent, coefficients, &mut scratch.unit);
    }

    /// Latent `[L]` of a `delta [V * 3]` (metres).
    pub fn encode(&self, delta: &[f32], latent: &mut [f32], scratch: &mut SubspaceScratch) {
        let SubspaceScratch { coefficients, unit } = scratch;
        let basis = &self.basis;
        for (k, c) in coefficients.iter_mut().enumerate() {
            let row = basis.directions.numbers_of_row(k);
            *c = dot(&row, delta) - dot(&row, &basis.mean) - basis.coefficient_mean[k];
        }
        self.encoder.units.iter().for_each(|u| u.apply(coefficients, unit));
        self.encoder.project.apply(coefficients, latent);
    }

    /// Latent `[L]` of centred coefficients `[K]` (metres).
    pub fn encode_coefficients(&self, centred: &[f32], latent: &mut [f32], scratch: &mut SubspaceScratch) {
        let SubspaceScratch { coefficients, unit } = scratch;
        coefficients.copy_from_slice(centred);
        self.encoder.units.iter().for_each(|u| u.apply(coefficients, unit));
        self.encoder.project.apply(coefficients, latent);
    }

    fn decode_coefficients_into(&self, latent: &[f32], coefficients: &mut [f32], unit: &mut [f32]) {
        self.decoder.lift.apply(latent, coefficients);
        self.decoder.units.iter().for_each(|u| u.apply(coefficients, unit));
    }
}
