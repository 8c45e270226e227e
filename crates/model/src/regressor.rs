use crate::{Gru, layer, plain};
use burn::module::Module;
use burn::nn::Linear;
use burn::tensor::{Device, Tensor};
use serde::{Deserialize, Serialize};
use softtissue_random::Draws;

/// The regressor's size.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RegressorConfig {
    /// Width of the recurrent state. Default 256: 128 learns less.
    pub width: usize,
}

impl Default for RegressorConfig {
    fn default() -> Self {
        Self { width: 256 }
    }
}

/// The recurrent regressor of SoftSMPL (2020) sec. 5: a gated recurrent unit with a residual shortcut around it,
/// `z = shortcut(x) + readout(h)`: both see the input.
///
/// Latents are in the units of the autoencoder that they belong to.
#[derive(Module, Debug)]
pub struct Regressor {
    /// The recurrent unit.
    pub gru: Gru,
    /// `[H] -> [L]`; starts at zero, so that the untrained regressor is its shortcut.
    pub readout: Linear,
    /// `[I] -> [L]`.
    pub shortcut: Linear,
}

/// A shortcut's starting weights: `weight [I, L]` and `bias [L]`.
#[derive(Clone, Debug, PartialEq)]
pub struct ShortcutStart {
    /// `[I, L]`, row-major.
    pub weight: Vec<f32>,
    /// `[L]`.
    pub bias: Vec<f32>,
}

impl ShortcutStart {
    /// Rows of the weight, `I`.
    pub fn inputs(&self) -> usize {
        self.weight.len() / self.bias.len().max(1)
    }

    /// For latents in metres, to latents in units of `scale` metres.
    pub fn in_units_of(mut self, scale: f32) -> Self {
        self.weight.iter_mut().chain(&mut self.bias).for_each(|w| *w /= scale);
        self
    }
}

impl Regressor {
    /// A regressor with as many inputs and outputs as its shortcut.
    pub fn new(config: &RegressorConfig, shortcut: ShortcutStart, draws: &mut Draws, device: &Device) -> Self {
        let latents = shortcut.bias.len();
        let inputs = shortcut.inputs();
        Self {
            gru: Gru::new(inputs, config.width, draws, device),
            readout: layer::zeros(config.width, latents, device),
            shortcut: layer::linear(shortcut.weight, shortcut.bias, device),
        }
    }

    /// Latents `[N, L]` of states `[N, H]` and inputs `[N, I]`.
    pub fn latents(&self, states: Tensor<2>, input: Tensor<2>) -> Tensor<2> {
        self.shortcut.forward(input) + self.readout.forward(states)
    }

    /// The recurrent part as plain arrays, for latents in metres; `scale` is the autoencoder's.
    pub fn to_recurrent(&self, scale: f32) -> plain::Recurrent {
        plain::Recurrent { gru: self.gru.to_plain(), readout: layer::to_plain(&self.readout, scale, scale) }
    }

    /// The shortcut as a plain layer, for latents in metres.
    pub fn to_shortcut(&self, scale: f32) -> plain::Linear {
        layer::to_plain(&self.shortcut, scale, scale)
    }
}
