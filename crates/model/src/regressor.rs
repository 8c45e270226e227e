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
/// `z = shortcut(s) + readout(h)`. What the shortcut sees is the caller's: the input itself (the published form),
/// or the outputs of a linear memory. A shortcut that is not trained lives outside: its latents are then an input.
///
/// Latents are in the units of the autoencoder that they belong to.
#[derive(Module, Debug)]
pub struct Regressor {
    /// The recurrent unit.
    pub gru: Gru,
    /// `[H] -> [L]`; starts at zero, so that the untrained regressor is its shortcut.
    pub readout: Linear,
    /// `[Q] -> [L]`, if it is trained.
    pub shortcut: Option<Linear>,
}

/// A shortcut's starting weights: `weight [Q, L]` and `bias [L]`.
#[derive(Clone, Debug, PartialEq)]
pub struct ShortcutStart {
    /// `[Q, L]`, row-major.
    pub weight: Vec<f32>,
    /// `[L]`.
    pub bias: Vec<f32>,
}

impl ShortcutStart {
    /// For latents in metres, to latents in units of `scale` metres.
    pub fn in_units_of(mut self, scale: f32) -> Self {
        self.weight.iter_mut().chain(&mut self.bias).for_each(|w| *w /= scale);
        self
    }
}

impl Regressor {
    /// A regressor with `inputs` inputs and `latents` outputs; with `shortcut` a trained one, without it one whose
    /// shortcut is added outside.
    pub fn new(
        config: &RegressorConfig,
        inputs: usize,
        latents: usize,
        shortcut: Option<ShortcutStart>,
        draws: &mut Draws,
        device: &Device,
    ) -> Self {
        let shortcut = shortcut.map(|start| {
            assert_eq!(start.bias.len(), latents, "outputs of a shortcut");
            layer::linear(start.weight, start.bias, device)
        });
        Self {
            gru: Gru::new(inputs, config.width, draws, device),
            readout: layer::zeros(config.width, latents, device),
            shortcut,
        }
    }

    /// Latents `[N, L]` of states `[N, H]` and of what the shortcut sees: `[N, Q]` if it is trained, its latents
    /// `[N, L]` if not.
    pub fn latents(&self, states: Tensor<2>, shortcut: Tensor<2>) -> Tensor<2> {
        let shortcut = match &self.shortcut {
            Some(layer) => layer.forward(shortcut),
            None => shortcut,
        };
        shortcut + self.readout.forward(states)
    }

    /// The recurrent part as plain arrays, for latents in metres; `scale` is the autoencoder's.
    pub fn to_recurrent(&self, scale: f32) -> plain::Recurrent {
        plain::Recurrent { gru: self.gru.to_plain(), readout: layer::to_plain(&self.readout, scale, scale) }
    }

    /// The trained shortcut as a plain layer, for latents in metres.
    pub fn to_shortcut(&self, scale: f32) -> Option<plain::Linear> {
        self.shortcut.as_ref().map(|layer| layer::to_plain(layer, scale, scale))
    }
}
