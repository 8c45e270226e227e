use crate::NetworkConfig;
use crate::config::Conditioning;
use crate::decoder::{Decoder, FieldValues};
use crate::features::{QUATERNION, ROOT};
use crate::layer::{SLOPE, linear, tensor, uniform, zero_linear, zeros};
use crate::queries::{Encoding, Queries};
use crate::rows::WeightedRows;
use crate::unet::UNet;
use burn::module::{Module, Param};
use burn::nn::Linear;
use burn::tensor::activation::leaky_relu;
use burn::tensor::{Device, Tensor};
use softtissue_implicit::Interpolation;
use softtissue_random::Draws;

/// Centimetres of a metre.
const CENTIMETRES: f64 = 100.0;

/// What one prediction sees, on the host.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FrameInput {
    /// Height features `[M, history]`; empty where the network sees none.
    pub heights: Vec<f32>,
    /// The part of the newest heights that the next surface starts from, `[M]`, metres; empty where it is none.
    pub carried: Vec<f32>,
    /// Quaternions of the joints below the root, `[J - 1, frames, 4]`.
    pub poses: Vec<f32>,
    /// Their differences, `[J - 1, history, 4]`, and the root's, `[history, 7]`; empty where the network sees none.
    pub differences: (Vec<f32>, Vec<f32>),
}

/// The tables that networks of one body share; `M` observer points.
#[derive(Clone, Debug)]
pub struct Ground {
    /// How much each joint means to each observer, `[M, J - 1]`.
    pub localisation: Tensor<2>,
    /// From observers to texels, `[side^2]` rows, row after row of the atlas.
    pub scatter: WeightedRows,
    /// From texels to observers, `[M]` rows.
    pub gather: WeightedRows,
    /// Each observer's value by those of the others near it, `[M]` rows.
    pub means: Interpolation,
}

/// A weight matrix for each joint: joined with the localisation it is the 1 x 1 convolution of localised poses
/// (sec. 3.4), `sum_j s_ij (p_j W_j)`, without a localised pose for every observer. As both are linear, it stands before the
/// atlas and not behind it.
#[derive(Module, Debug)]
struct JointLayer {
    /// `[J - 1, inputs, outputs]`.
    weight: Param<Tensor<3>>,
    /// `[outputs]`.
    bias: Param<Tensor<1>>,
}

impl JointLayer {
    fn new(joints: usize, inputs: usize, outputs: usize, draws: &mut Draws, device: &Device) -> Self {
        // a vertex listens to its own joint and the two or three next to it
        let bound = 1.0 / (4.0 * inputs as f64).sqrt();
        Self { weight: uniform([joints, inputs, outputs], bound, draws, device), bias: zeros([outputs], device) }
    }

    /// `[J - 1, rows, inputs]` to `[M, rows * outputs]`.
    fn forward(&self, joints: &[f32], rows: usize, localisation: &Tensor<2>) -> Tensor<2> {
        let [count, inputs, outputs] = self.weight.dims();
        let joints = tensor(joints.to_vec(), [count, rows, inputs], &localisation.device());
        let joints = joints.matmul(self.weight.val()).reshape([count, rows * outputs]);
        let bias = self.bias.val().repeat_dim(0, rows).unsqueeze();
        localisation.clone().matmul(joints) + bias
    }
}

/// How far each observer's plane is moved along its normal, beside what is carried over: at rest, and by its dynamic
/// features and its own heights.
#[derive(Module, Debug)]
struct Offsets {
    /// `[M, 1]`, centimetres.
    rest: Param<Tensor<2>>,
    first: Linear,
    last: Linear,
}

impl Offsets {
    /// `[M, inputs]` to `[M, 1]`, metres.
    fn forward(&self, x: Tensor<2>) -> Tensor<2> {
        let moved = self.last.forward(leaky_relu(self.first.forward(x), SLOPE));
        (moved + self.rest.val()).div_scalar(CENTIMETRES)
    }
}

/// From the history of poses and heights to dynamic features, and from these to signed distances (figs. 2 and 3).
#[derive(Module, Debug)]
pub struct AvatarNetwork {
    pose: JointLayer,
    differences: Option<JointLayer>,
    root: Option<Linear>,
    /// The temporal network's layers, each of two frames into one, as the newest output of a dilated convolution sees
    /// them.
    temporal: Vec<Linear>,
    unet: UNet,
    offsets: Option<Offsets>,
    decoder: Decoder,
}

impl AvatarNetwork {
    /// An untrained network for a body of `joints` joints with `observers` observers.
    pub(crate) fn new(
        config: &NetworkConfig,
        conditioning: Conditioning,
        joints: usize,
        observers: usize,
        draws: &mut Draws,
        device: &Device,
    ) -> Self {
        let (channels, history) = (config.compressed, config.history);
        let pose = JointLayer::new(joints - 1, QUATERNION, channels, draws, device);
        let sees_differences = conditioning.sees_differences();
        let differences =
            sees_differences.then(|| JointLayer::new(joints - 1, history * QUATERNION, channels, draws, device));
        let root = sees_differences.then(|| linear(history * ROOT, channels, draws, device));
        let halvings = if conditioning == Conditioning::PoseTcn { config.tcn_frames.ilog2() } else { 0 };
        let temporal = (0..halvings).map(|_| linear(2 * channels, channels, draws, device)).collect();
        let heights = if conditioning.sees_heights() { history } else { 0 };
        let inputs = channels + if sees_differences { channels } else { 0 } + heights;
        let offsets = (config.offsets > 0).then(|| Offsets {
            rest: zeros([observers, 1], device),
            first: linear(config.latents + heights, config.offsets, draws, device),
            last: zero_linear(config.offsets, 1, device),
        });
        let encoding = config.encoding();
        Self {
            pose,
            differences,
            root,
            temporal,
            unet: UNet::new(inputs, config.latents, &config.channels, config.atlas, draws, device),
            offsets,
            decoder: Decoder::new(config.latents, config.decoder, encoding, draws, device),
        }
    }

    /// Dynamic features of the frame that `input` leads to, and how far each observer's plane is moved outwards, metres:
    /// `[M, latents + 1]`.
    pub(crate) fn features(&self, input: &FrameInput, ground: &Ground) -> Tensor<2> {
        let device = ground.localisation.device();
        let [observers, _] = ground.localisation.dims();
        let mut parts = vec![self.poses(&input.poses, ground)];
        if let (Some(layer), Some(root)) = (&self.differences, &self.root) {
            let (joint_rates, root_rates) = &input.differences;
            let root_rates = tensor(root_rates.clone(), [1, root_rates.len()], &device);
            parts.push(layer.forward(joint_rates, 1, &ground.localisation) + root.forward(root_rates));
        }
        let own = (!input.heights.is_empty()).then(|| {
            let width = input.heights.len() / observers;
            tensor(input.heights.clone(), [observers, width], &device)
        });
        parts.extend(own.clone());
        let texels = ground.scatter.apply(Tensor::cat(parts, 1));
        let [count, channels] = texels.dims();
        let side = count.isqrt();
        let atlas = self.unet.forward(texels.swap_dims(0, 1).reshape([1, channels, side, side]));
        let outputs = atlas.dims()[1];
        let latents = ground.gather.apply(atlas.reshape([outputs, count]).swap_dims(0, 1));
        let mut offsets = match input.carried.is_empty() {
            true => Tensor::zeros([observers, 1], &device),
            false => tensor(input.carried.clone(), [observers, 1], &device),
        };
        if let Some(layer) = &self.offsets {
            let seen = [latents.clone()].into_iter().chain(own).collect();
            offsets = offsets + layer.forward(Tensor::cat(seen, 1));
        }
        Tensor::cat(vec![latents, offsets], 1)
    }

    fn poses(&self, poses: &[f32], ground: &Ground) -> Tensor<2> {
        let [joints, _, channels] = self.pose.weight.dims();
        let frames = poses.len() / (joints * QUATERNION);
        let mut x = self.pose.forward(poses, frames, &ground.localisation);
        for layer in &self.temporal {
            let [vertices, width] = x.dims();
            let pairs = width / (2 * channels);
            let x2 = leaky_relu(x, SLOPE).reshape([vertices * pairs, 2 * channels]);
            x = layer.forward(x2).reshape([vertices, pairs * channels]);
        }
        x
    }

    /// The field of dynamic features at query points.
    pub(crate) fn field(&self, features: Tensor<2>, queries: &Queries) -> FieldValues {
        self.decoder.forward(features, queries)
    }
}

impl NetworkConfig {
    /// How query points are encoded.
    pub(crate) fn encoding(&self) -> Encoding {
        Encoding { frequencies: self.frequencies, softening: self.softening }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::checks::{ball, check_gradients, shaken};
    use softtissue_model::host;

    #[test]
    fn the_joint_layer_is_a_convolution_of_localised_poses() {
        let device = Device::flex();
        let layer = shaken(JointLayer::new(2, 4, 3, &mut Draws::new(1, "layer", 0, 0), &device), 1.0, 2);
        let local = [[0.5f32, 0.25], [1.0, 0.0]];
        let poses: Vec<f32> = (0..8).map(|i| i as f32 / 8.0).collect();
        let found = host(layer.forward(&poses, 1, &tensor(local.concat(), [2, 2], &device)));
        let (weight, bias) = (host(layer.weight.val()), host(layer.bias.val()));
        for (v, local) in local.iter().enumerate() {
            for c in 0..3 {
                // the localised pose of a vertex is (s_j p_j) for every joint
                let sum: f32 = (0..8).map(|i| local[i / 4] * poses[i] * weight[i * 3 + c]).sum();
                assert!((found[v * 3 + c] - sum - bias[c]).abs() < 1e-5);
            }
        }
    }

    fn input(conditioning: Conditioning) -> FrameInput {
        let body = ball(&Device::flex());
        let clip = crate::checks::breathing(20, 0.0);
        let heights: Vec<&[f32]> = clip.history(18, 3).iter().map(Vec::as_slice).collect();
        body.input(conditioning, &clip.track, 18, &heights)
    }

    #[test]
    fn an_untrained_surface_starts_where_the_last_one_was() {
        let device = Device::flex();
        let body = ball(&device);
        let clip = crate::checks::breathing(4, 0.3);
        let started = |conditioning| {
            let mut draws = Draws::new(1, "network", 0, 0);
            let network = AvatarNetwork::new(&body.config, conditioning, 3, 64, &mut draws, &device);
            let mut play = crate::Playback::new(&body, &network, conditioning, &clip.heights[..3]).expect("a history");
            play.step(&clip.track, 3, &clip.observers[3]).heights().to_vec()
        };
        let last = clip.heights[2][0];
        assert!(last > 0.015 && (last - clip.heights[1][0]).abs() > 1e-3, "{last}");
        let close =
            |heights: Vec<f32>, wanted: f32| assert!(heights.iter().all(|h| (h - wanted).abs() < 2e-4), "{heights:?}");
        close(started(Conditioning::Autoregressive), last);
        close(started(Conditioning::PoseDifferences), 0.0);
    }

    #[test]
    fn every_conditioning_learns_with_every_parameter() {
        let device = Device::flex();
        let body = ball(&device);
        for conditioning in
            [Conditioning::Autoregressive, Conditioning::Pose, Conditioning::PoseTcn, Conditioning::PoseDifferences]
        {
            let mut draws = Draws::new(1, "network", 0, 0);
            let network = AvatarNetwork::new(&body.config, conditioning, 3, 64, &mut draws, &device.clone().autodiff());
            let network = shaken(network, 0.3, 9);
            let mut input = input(conditioning);
            // a body that stands still has no differences to learn from
            input.differences.0.iter_mut().enumerate().for_each(|(i, x)| *x = (i as f32).sin());
            input.differences.1.iter_mut().enumerate().for_each(|(i, x)| *x = (i as f32).cos());
            let clip = crate::checks::breathing(1, 0.0);
            let tree = softtissue_implicit::PointTree::new(&clip.observers[0].positions);
            let points: Vec<glam::Vec3> = crate::checks::directions(10).iter().map(|d| 0.23 * *d).collect();
            let queries = body.queries(&points, &tree, &clip.observers[0], true, &device);
            let loss = |network: &AvatarNetwork| {
                let field = network.field(body.features(network, &input, &mut None), &queries);
                // in centimetres, in which offsets are
                let distance = field.distance.mul_scalar(CENTIMETRES);
                distance.square().mean() + field.gradient.expect("asked for").square().mean()
            };
            check_gradients(&network, loss, 2e-3, 0.08);
        }
    }
}
