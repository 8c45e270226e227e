//! The player's step and the subspace's decoding, plain arrays, against burn's forward of the same weights on its own
//! CPU backend, one frame at a time as an animation needs them. Burn is given the features; the player makes them.

use crate::{assert_close, body, pose, swing};
use burn::tensor::{Device, Tensor, TensorData};
use divan::{Bencher, black_box};
use glam::Vec3;
use softtissue_bundle::descriptor::{Descriptor, DescriptorConfig, FeatureScaling};
use softtissue_bundle::{Bundle, BundleInfo, DeltaBasis, Matrix, Player, RecurrentModel, SelfCheck, Subspace, Trust};
use softtissue_model::{Autoencoder, AutoencoderConfig, Regressor, RegressorConfig, ShortcutStart, host};
use softtissue_random::Draws;
use softtissue_train::device;

/// Sizes of the configuration `quick`.
const COMPONENTS: usize = 256;
const LATENTS: usize = 100;
const SHAPES: usize = 2;

/// One model in both forms.
struct Model {
    bundle: Bundle,
    autoencoder: Autoencoder,
    regressor: Regressor,
    directions: Tensor<2>,
    device: Device,
}

/// Small random numbers: time does not depend on them.
fn numbers(draws: &mut Draws, count: usize, size: f64) -> Vec<f32> {
    (0..count).map(|_| (size * draws.normal()) as f32).collect()
}

fn tensor<const D: usize>(data: Vec<f32>, shape: [usize; D], device: &Device) -> Tensor<D> {
    Tensor::from_data(TensorData::new(data, shape), device)
}

impl Model {
    fn new() -> Self {
        let device = device::parse("flex").expect("the CPU");
        let mut draws = Draws::new(1, "bench", 0, 0);
        let body = body(0).clone();
        let width = 3 * body.vertex_count();
        let directions = numbers(&mut draws, COMPONENTS * width, 0.01);
        let autoencoder =
            Autoencoder::new(&AutoencoderConfig::default(), COMPONENTS, LATENTS, 0.1, &mut draws, &device);
        let basis = DeltaBasis {
            mean: vec![0.0; width],
            directions: Matrix::new(COMPONENTS, width, directions.clone()),
            coefficient_mean: vec![0.0; COMPONENTS],
        };
        let subspace = Subspace { basis, encoder: autoencoder.to_encoder(), decoder: autoencoder.to_decoder() };
        let descriptor = DescriptorConfig::default();
        let features = Descriptor::new(&descriptor, &body, Some(subspace.basis.directions.data())).expect("one").len();
        let start = ShortcutStart {
            weight: numbers(&mut draws, (features + SHAPES) * LATENTS, 1e-4),
            bias: vec![0.0; LATENTS],
        };
        let start = start.in_units_of(autoencoder.scale);
        let regressor = Regressor::new(&RegressorConfig::default(), start, &mut draws, &device);
        let plain = softtissue_bundle::Regressor {
            input: unscaled(features),
            shape: unscaled(SHAPES),
            shape_terms: vec![vec![]],
            direct: true,
            shortcut: regressor.to_shortcut(autoencoder.scale),
            recurrent: Some(regressor.to_recurrent(autoencoder.scale)),
            ..Default::default()
        };
        let info = BundleInfo { largest_delta_m: 1.0, ..Default::default() };
        let plain = RecurrentModel { regressor: plain, subspace, pose_encoder: None };
        let plain = softtissue_bundle::Model::Recurrent(plain);
        let bundle = Bundle {
            info,
            body,
            descriptor,
            model: plain,
            trust: Trust::of_everything(features),
            self_check: SelfCheck::default(),
        };
        let directions = tensor(directions, [COMPONENTS, width], &device);
        Self { bundle, autoencoder, regressor, directions, device }
    }

    /// The same without burn.
    fn plain(&self) -> &RecurrentModel {
        self.bundle.model.recurrent().expect("a recurrent model")
    }

    /// Deltas of a latent `[1, L]`, in units of the scale.
    fn decode(&self, latents: Tensor<2>) -> Tensor<2> {
        self.autoencoder.decoder.forward(latents, None).matmul(self.directions.clone())
    }
}

/// A scaling that changes nothing.
fn unscaled(size: usize) -> FeatureScaling {
    FeatureScaling {
        input_size: size,
        kept: (0..size as u32).collect(),
        lower: vec![f32::MIN; size],
        upper: vec![f32::MAX; size],
        scale: vec![1.0; size],
    }
}

#[divan::bench]
fn player_step(bencher: Bencher) {
    let model = Model::new();
    let mut player = Player::new(&model.bundle, &[0.5, -0.5]).expect("a player");
    let motion: Vec<Vec<Vec3>> = (0..40).map(|t| swing(model.bundle.body.joint_count(), t)).collect();
    let mut t = 0;
    bencher.bench_local(|| {
        t = (t + 1) % motion.len();
        player.step(pose(black_box(&motion[t])))
    });
}

#[divan::bench]
fn player_step_in_burn(bencher: Bencher) {
    let model = Model::new();
    let inputs = model.plain().regressor.feature_count() + SHAPES;
    let mut draws = Draws::new(2, "bench input", 0, 0);
    let input = tensor(numbers(&mut draws, inputs, 1.0), [1, 1, inputs], &model.device);
    let mut state = Tensor::<2>::zeros([1, model.regressor.gru.width()], &model.device);
    bencher.bench_local(|| {
        let input = black_box(input.clone());
        state = model.regressor.gru.rollout(input.clone()).frame(0, state.clone()).hidden;
        model.decode(model.regressor.latents(state.clone(), input.reshape([1, inputs]))).into_data()
    });
}

/// A latent in metres and the deltas that the plain decoder makes of it.
fn decoded(model: &Model) -> (Vec<f32>, Vec<f32>) {
    let latent = numbers(&mut Draws::new(3, "bench latent", 0, 0), LATENTS, 0.01);
    let mut delta = vec![0.0; 3 * model.bundle.body.vertex_count()];
    model.plain().subspace.decode(&latent, &mut delta, &mut model.plain().subspace.scratch());
    (latent, delta)
}

#[divan::bench]
fn subspace_decode(bencher: Bencher) {
    let model = Model::new();
    let (latent, mut delta) = decoded(&model);
    let mut scratch = model.plain().subspace.scratch();
    bencher.bench_local(|| model.plain().subspace.decode(black_box(&latent), &mut delta, &mut scratch));
}

#[divan::bench]
fn subspace_decode_in_burn(bencher: Bencher) {
    let model = Model::new();
    let (latent, delta) = decoded(&model);
    let scale = model.autoencoder.scale;
    let latents = tensor(latent.iter().map(|z| z / scale).collect(), [1, LATENTS], &model.device);
    let points = |numbers: &[f32]| -> Vec<Vec3> { numbers.as_chunks::<3>().0.iter().map(|p| (*p).into()).collect() };
    let burned = host(model.decode(latents.clone()) * scale);
    assert_close(&points(&burned), &points(&delta), 1e-5);
    bencher.bench_local(|| model.decode(black_box(latents.clone())).into_data());
}
