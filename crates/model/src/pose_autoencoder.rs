use crate::layer;
use burn::module::Module;
use burn::nn::Linear;
use burn::tensor::{Device, Tensor};
use serde::{Deserialize, Serialize};
use softtissue_bundle::descriptor::PoseEncoder;
use softtissue_random::Draws;

/// The pose autoencoder's size.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PoseAutoencoderConfig {
    /// Numbers of the learned pose. Default 10, as published: more keep finer articulation and more of the person.
    pub latents: usize,
    /// Width of the hidden layers. Default 128; the paper has it only in a figure.
    pub width: usize,
    /// Hidden layers of each of the three networks. Default 2; 0 makes them linear.
    pub hidden: usize,
}

impl Default for PoseAutoencoderConfig {
    fn default() -> Self {
        Self { latents: 10, width: 128, hidden: 2 }
    }
}

/// Fully connected layers with `tanh` between them and nothing after the last.
#[derive(Module, Debug)]
pub struct Perceptron {
    layers: Vec<Linear>,
}

/// The multi-modal pose autoencoder of SoftSMPL (2020) sec. 5.1, eq. 13: two encoders, of the posed mesh and of the joint
/// rotations, to one small latent, and one decoder of it to the posed mesh. What a joint rotation changes in the mesh
/// decides how much room it gets, so the encoder of rotations leaves out what moves few vertices.
///
/// The mesh is given by coefficients of principal components of posed vertices, in units of `scale` metres: the
/// directions are orthonormal, so distances are those of the vertices. `tanh` is ours (the paper gives no activation):
/// the descriptor's second differences need an encoder without kinks.
#[derive(Module, Debug)]
pub struct PoseAutoencoder {
    /// `Emesh`, `[B, K] -> [B, P]`.
    pub mesh_encoder: Perceptron,
    /// `Epose`, `[B, 3 (J - 1)] -> [B, P]`.
    pub pose_encoder: Perceptron,
    /// `Dmesh`, `[B, P] -> [B, K]`.
    pub decoder: Perceptron,
    /// Metres in one unit of a coefficient, a power of two.
    pub scale: f32,
}

impl Perceptron {
    fn new(sizes: &[usize], draws: &mut Draws, device: &Device) -> Self {
        Self { layers: sizes.windows(2).map(|s| layer::uniform(s[0], s[1], draws, device)).collect() }
    }

    /// `[B, inputs]` to `[B, outputs]`.
    pub fn forward(&self, x: Tensor<2>) -> Tensor<2> {
        let last = self.layers.len() - 1;
        self.layers.iter().enumerate().fold(x, |x, (i, layer)| {
            let y = layer.forward(x);
            if i < last { y.tanh() } else { y }
        })
    }
}

impl PoseAutoencoder {
    /// An untrained autoencoder of `components` coefficients and `numbers` joint angles. `typical` (metres; e.g. the root
    /// mean square of the first coefficient) chooses the scale.
    pub fn new(
        config: &PoseAutoencoderConfig,
        components: usize,
        numbers: usize,
        typical: f32,
        draws: &mut Draws,
        device: &Device,
    ) -> Self {
        let hidden = vec![config.width; config.hidden];
        let mut network = |inputs: usize, outputs: usize| {
            let sizes = [&[inputs], hidden.as_slice(), &[outputs]].concat();
            Perceptron::new(&sizes, draws, device)
        };
        Self {
            mesh_encoder: network(components, config.latents),
            pose_encoder: network(numbers, config.latents),
            decoder: network(config.latents, components),
            scale: crate::power_of_two(typical),
        }
    }

    /// Both reconstructions `[B, K]`: through the mesh's encoder from coefficients `[B, K]`, and through the rotations'
    /// from joint angles `[B, 3 (J - 1)]`. Coefficients are in units of the scale.
    pub fn forward(&self, coefficients: Tensor<2>, angles: Tensor<2>) -> [Tensor<2>; 2] {
        [self.mesh_encoder.forward(coefficients), self.pose_encoder.forward(angles)].map(|p| self.decoder.forward(p))
    }

    /// `Epose` as plain arrays.
    pub fn to_encoder(&self) -> PoseEncoder {
        PoseEncoder { layers: self.pose_encoder.layers.iter().map(|l| layer::to_plain(l, 1.0, 1.0)).collect() }
    }
}
