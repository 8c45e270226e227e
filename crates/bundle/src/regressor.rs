use crate::descriptor::FeatureScaling;
use crate::{Acquaintance, Gru, Linear, MassLaw, Matrix, Precision, ResonatorBank};

/// What predicts the latent from the motion, frame by frame: a shortcut that is linear in the inputs (or in a bank
/// of damped resonators driven by them) and, around it, a recurrent network (SoftSMPL sec. 5).
///
/// ```text
/// x = input(features)                                            [D]
/// b = shape(beta)                                                [B]
/// a = x                          without a bank                  [A]
///     bank(x)                    with a bank
///     [bank(x), x]               with a bank and `direct`
/// z = g (shortcut([phi_0(b) a, phi_1(b) a, ..., b]) + readout(h))    [L]
/// h = gru([x, b], h before), zero at the start
/// ```
///
/// With an [`Acquaintance`], whose share of the body is `s`, the network stands beside the shortcut with a linear layer of its
/// own:
///
/// ```text
/// z = g ((1 - s) shortcut(...) + s (around([x, b]) + readout(h)))    [L]
/// ```
///
/// `phi_k(b)` is the product of `b_i` to the power `shape_terms[k][i]`; `g` and the frequencies of the bank are those of the
/// body's mass by [`MassLaw`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Regressor {
    /// From the descriptor's features to `x`.
    pub input: FeatureScaling,
    /// From `beta` to `b`; a missing coefficient counts as zero.
    pub shape: FeatureScaling,
    /// Exponents of each shape term, `[K]` rows of at most `B`; the constant term is an empty row.
    pub shape_terms: Vec<Vec<u8>>,
    /// What a body's mass does to amplitude and frequencies.
    pub mass: MassLaw,
    /// Linear memory in front of the shortcut.
    pub bank: Option<ResonatorBank>,
    /// Whether the shortcut sees `x` beside the bank's outputs. Always so without a bank.
    pub direct: bool,
    /// `[K A + B] -> [L]`.
    pub shortcut: Linear,
    /// The recurrent network; without it the regressor is linear in time.
    pub recurrent: Option<Recurrent>,
    /// How the network and the shortcut are mixed; without it they are summed.
    pub acquaintance: Option<Acquaintance>,
}

/// A GRU and the layer that reads its state.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Recurrent {
    /// `[D + B] -> [H]`.
    pub gru: Gru,
    /// `[H] -> [L]`.
    pub readout: Linear,
}

/// A [`Regressor`] of one body: the shape terms are folded into the shortcut once, so that a step costs the same with them
/// as without.
#[derive(Clone, Debug)]
pub struct BodyRegressor {
    /// `b [B]`.
    pub shape: Vec<f32>,
    /// `g`, or `g s`: factor on the readout of the recurrent network, which is kept as it is. `shortcut` has its own in it.
    pub readout_gain: f32,
    /// With the body's frequencies.
    pub bank: Option<ResonatorBank>,
    /// `[A] -> [L]`.
    pub shortcut: Linear,
}

/// What a [`Regressor`] remembers between frames of one body, and its working memory.
#[derive(Clone, Debug)]
pub struct RegressorState {
    body: BodyRegressor,
    /// `[x, b]`.
    input: Vec<f32>,
    /// `a`: the bank's state, then `x` where the shortcut sees it.
    memory: Vec<f32>,
    /// The bank's drive.
    drive: f32,
    hidden: Vec<f32>,
    scratch: Vec<f32>,
    latent: Vec<f32>,
    readout: Vec<f32>,
}

impl Regressor {
    /// Scaled features `D`.
    pub fn feature_count(&self) -> usize {
        self.input.len()
    }
    /// Shape inputs `B`.
    pub fn shape_count(&self) -> usize {
        self.shape.len()
    }
    /// Latent numbers `L`.
    pub fn latent_count(&self) -> usize {
        self.shortcut.outputs()
    }
    /// Length `A` of what the shape terms multiply.
    pub fn memory_count(&self) -> usize {
        let bank = self.bank.as_ref().map_or(0, ResonatorBank::outputs);
        bank + if self.sees_features() { self.feature_count() } else { 0 }
    }
    /// Whether `a` ends with `x`.
    pub fn sees_features(&self) -> bool {
        self.direct || self.bank.is_none()
    }
    /// Scaled shape `b [B]`. Missing coefficients count as zero, surplus ones are ignored.
    pub fn scaled_shape(&self, beta: &[f32]) -> Vec<f32> {
        let mut padded = beta.to_vec();
        padded.resize(self.shape.input_size, 0.0);
        let mut b = vec![0.0; self.shape_count()];
        self.shape.apply(&padded, &mut b);
        b
    }
    /// Shape terms `phi [K]` of a scaled shape.
    pub fn shape_factors(&self, b: &[f32]) -> Vec<f32> {
        self.shape_terms
            .iter()
            .map(|powers| powers.iter().zip(b).map(|(p, b)| b.powi(i32::from(*p))).product())
            .collect()
    }

    /// The bank with the frequencies of a body.
    pub fn bank_of(&self, beta: &[f32]) -> Option<ResonatorBank> {
        self.bank.as_ref().map(|bank| bank.scaled(self.mass.frequency(beta), 1.0))
    }

    /// The regressor of one body.
    pub fn of_body(&self, beta: &[f32]) -> BodyRegressor {
        let (a, l) = (self.memory_count(), self.latent_count());
        let b = self.scaled_shape(beta);
        let factors = self.shape_factors(&b);
        let share = self.acquaintance.as_ref().map(|known| known.share_of(beta));
        let mut weight = Matrix::zeros(l, a);
        let mut bias = self.shortcut.bias.clone();
        for row in 0..l {
            let weights = self.shortcut.weight.numbers_of_row(row);
            let (terms, rest) = weights.split_at(factors.len() * a);
            for (factor, weights) in factors.iter().zip(terms.chunks_exact(a.max(1))) {
                weight.row_mut(row).iter_mut().zip(weights).for_each(|(s, w)| *s += factor * w);
            }
            bias[row] += rest.iter().zip(&b).map(|(w, b)| w * b).sum::<f32>();
        }
        if let (Some(known), Some(share)) = (&self.acquaintance, share) {
            weight.data_mut().iter_mut().chain(&mut bias).for_each(|w| *w *= 1.0 - share);
            self.add_around(&known.around, share, &b, &mut weight, &mut bias);
        }
        let amplitude = self.mass.amplitude(beta);
        weight.data_mut().iter_mut().chain(&mut bias).for_each(|w| *w *= amplitude);
        if self.shortcut.weight.precision() != Precision::F32 {
            weight = weight.halved();
        }
        let readout_gain = amplitude * share.unwrap_or(1.0);
        BodyRegressor { shape: b, readout_gain, bank: self.bank_of(beta), shortcut: Linear { weight, bias } }
    }

    /// Adds the network's own linear layer to that of a body of scaled shape `b`, which sees the features last.
    fn add_around(&self, around: &Linear, share: f32, b: &[f32], weight: &mut Matrix, bias: &mut [f32]) {
        let d = self.feature_count();
        let first = self.memory_count() - d;
        for row in 0..self.latent_count() {
            let weights = around.weight.numbers_of_row(row);
            let (features, shape) = weights.split_at(d);
            weight.row_mut(row)[first..].iter_mut().zip(features).for_each(|(s, w)| *s += share * w);
            let constant = around.bias[row] + shape.iter().zip(b).map(|(w, b)| w * b).sum::<f32>();
            bias[row] += share * constant;
        }
    }

    /// The state before the first frame, for one body.
    pub fn start(&self, beta: &[f32]) -> RegressorState {
        let body = self.of_body(beta);
        let width = self.recurrent.as_ref().map_or(0, |r| r.gru.width());
        let mut input = vec![0.0; self.feature_count()];
        input.extend(&body.shape);
        let l = self.latent_count();
        RegressorState {
            input,
            memory: vec![0.0; self.memory_count()],
            drive: 0.0,
            hidden: vec![0.0; width],
            scratch: vec![0.0; 6 * width],
            latent: vec![0.0; l],
            readout: vec![0.0; l],
            body,
        }
    }

    /// One frame: the descriptor's `features` in, [`RegressorState::latent`] out. Returns how many features were
    /// clipped.
    pub fn step(&self, features: &[f32], state: &mut RegressorState) -> usize {
        let d = self.feature_count();
        self.input.apply(features, &mut state.input[..d]);
        let x = &state.input[..d];
        let bank = state.body.bank.as_ref().map_or(0, ResonatorBank::outputs);
        let (bank_state, direct) = state.memory.split_at_mut(bank);
        if let Some(bank) = &state.body.bank {
            bank.step(x, bank_state, &mut state.drive);
        }
        if self.sees_features() {
            direct.copy_from_slice(x);
        }
        state.body.shortcut.apply(&state.memory, &mut state.latent);
        if let Some(Recurrent { gru, readout }) = &self.recurrent {
            gru.step(&state.input, &mut state.hidden, &mut state.scratch);
            readout.apply(&state.hidden, &mut state.readout);
            state.latent.iter_mut().zip(&state.readout).for_each(|(z, r)| *z += state.body.readout_gain * r);
        }
        self.input.outside(features)
    }
}

impl RegressorState {
    /// The latent of the newest frame, `[L]`.
    pub fn latent(&self) -> &[f32] {
        &self.latent
    }
    /// Bytes of the shortcut's matrix.
    pub(crate) fn shortcut_bytes(&self) -> usize {
        self.body.shortcut.weight.bytes()
    }
    /// Forgets the motion, not the body.
    pub fn reset(&mut self) {
        self.memory.fill(0.0);
        self.drive = 0.0;
        self.hidden.fill(0.0);
        self.latent.fill(0.0);
    }
    /// Takes over what another state of the same body remembers.
    pub(crate) fn remember(&mut self, other: &Self) {
        self.memory.copy_from_slice(&other.memory);
        self.drive = other.drive;
        self.hidden.copy_from_slice(&other.hidden);
    }
    /// Whether memory and output are finite.
    pub fn is_finite(&self) -> bool {
        self.memory.iter().chain([&self.drive]).chain(&self.hidden).chain(&self.latent).all(|x| x.is_finite())
    }
}
