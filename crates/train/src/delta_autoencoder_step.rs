use crate::losses::{WeightedDistance, surrogate};
use crate::subspace_step::tensor;
use crate::{Adam, AdamConfig, Clips, NamedArray, Result, Stage, State, StepStats, TrainError, Trainee};
use crate::{cosine, load_module, module_gradients, module_state};
use burn::module::Module;
use serde::{Deserialize, Serialize};
use softtissue_model::{DeltaAutoencoder, PrincipalStart, Standardisation, host};
use softtissue_random::Draws;

/// Where the autoencoder of Casas and Otaduy starts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum AutoencoderStart {
    /// As principal component analysis, with as many numbers.
    Principal,
    /// From random weights, as published.
    Random,
}

/// In which numbers a reconstruction is compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum DeltaMetric {
    /// Distances between vertices.
    Vertices,
    /// The standardised numbers that go in.
    Standardised,
}

/// How the autoencoder of Casas and Otaduy is trained.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct DeltaAutoencoderTraining {
    /// Widths of its outer and its inner layer. Default 512 and 256; the paper has them in a figure only.
    pub widths: [usize; 2],
    /// `principal` (default) or `random`, as published. The first needs widths of twice the latent numbers.
    pub start: AutoencoderStart,
    /// What the loss compares: `vertices` (default) or `standardised`; the paper does not say.
    pub metric: DeltaMetric,
    /// Steps of a whole training. Default 200.
    pub steps: u64,
    /// Frames in a batch, drawn anew for each step. Default 64; the paper gives none.
    pub batch: usize,
    /// Learning rate at the start. Default 1e-4; the paper's is 1e-5, from random weights.
    pub learning_rate: f64,
    /// Whether the learning rate falls to zero by a cosine. Default true; the paper's stays.
    pub decay: bool,
}

impl Default for DeltaAutoencoderTraining {
    fn default() -> Self {
        Self {
            widths: [512, 256],
            start: AutoencoderStart::Principal,
            metric: DeltaMetric::Vertices,
            steps: 200,
            batch: 64,
            learning_rate: 1e-4,
            decay: true,
        }
    }
}

/// Learns a [`DeltaAutoencoder`] of one person by batches of single frames (sec. 3.3).
pub struct DeltaAutoencoderTrainee {
    config: DeltaAutoencoderTraining,
    stage: Stage,
    network: DeltaAutoencoder,
    adam: Adam,
    distance: WeightedDistance,
    /// Standardised, `[N, V * 3]`.
    train: Vec<f32>,
    validation: Vec<f32>,
    width: usize,
}

/// Frames put through the network at a time in validation.
const CHUNK: usize = 512;

impl DeltaAutoencoderTrainee {
    /// An autoencoder of `latents` numbers of the frames `[N, V * 3]` (metres), divided by what `standard` says.
    /// `principal` are the training frames' orthonormal directions and the standard deviations of their coefficients
    /// in metres, at least `latents` of each; a random start does without.
    pub fn new(
        config: DeltaAutoencoderTraining,
        stage: &Stage,
        latents: usize,
        standard: &Standardisation,
        principal: Option<(&[f32], &[f32])>,
        frames: Clips<Vec<f32>>,
    ) -> Result<Self> {
        let width = standard.len();
        let [outer, inner] = config.widths;
        let Clips { train, validation } = frames;
        for (role, frames) in [("training", &train), ("validation", &validation)] {
            if frames.is_empty() || width == 0 || !frames.len().is_multiple_of(width) {
                return Err(TrainError::Numeric(format!(
                    "autoencoder: {} {role} numbers are no frames of {width}: at least one frame is needed",
                    frames.len()
                )));
            }
        }
        if latents == 0 || outer == 0 || inner == 0 || config.batch == 0 {
            return Err(TrainError::Config(format!(
                "autoencoder: widths {outer} and {inner}, {latents} latent numbers and batches of {}: each is at least 1",
                config.batch
            )));
        }
        let device = stage.device.clone().inner();
        let training = device.clone().autodiff();
        let mut draws = Draws::new(stage.seed, &format!("{}/start", stage.name), 0, 0);
        let mut network = DeltaAutoencoder::new(width, config.widths, latents, &mut draws, &training);
        if config.start == AutoencoderStart::Principal {
            let enough = |(directions, spread): &(&[f32], &[f32])| {
                directions.len() >= latents * width && spread.len() >= latents && outer.min(inner) >= 2 * latents
            };
            let Some((directions, spread)) = principal.filter(enough) else {
                return Err(TrainError::Config(format!(
                    "autoencoder: a start as {latents} principal components needs as many and layers of twice the width; \
                     take wider layers, fewer latent numbers or start = \"random\""
                )));
            };
            let start = PrincipalStart { directions, spread, deviation: &standard.deviation };
            network = network.as_principal(start, latents, &training);
        }
        let distance = match config.metric {
            DeltaMetric::Vertices => WeightedDistance::of_vertices(&standard.deviation, &vec![1.0; width / 3]),
            DeltaMetric::Standardised => WeightedDistance::of_standardised(&standard.deviation),
        };
        let (adam, stage) = (Adam::new(AdamConfig::default()), Stage { device, ..stage.clone() });
        let (train, validation) = (standard.apply(&train), standard.apply(&validation));
        Ok(Self { config, stage, network, adam, distance, train, validation, width })
    }

    /// The network without autodiff, for use after training.
    pub fn into_network(self) -> DeltaAutoencoder {
        self.network.valid()
    }
}

/// The learning rate of a step: constant, or falling to zero by a cosine.
pub(crate) fn rate(start: f64, decay: bool, step: u64, steps: u64) -> f64 {
    if decay { cosine(start, step, steps, 0) } else { start }
}

impl Trainee for DeltaAutoencoderTrainee {
    fn step(&mut self, step: u64) -> Result<StepStats> {
        let mut draws = Draws::new(self.stage.seed, &self.stage.name, 0, step);
        let (width, batch) = (self.width, self.config.batch);
        let count = self.train.len() / width;
        let mut wanted = Vec::with_capacity(batch * width);
        for _ in 0..batch {
            let n = draws.below(count);
            wanted.extend_from_slice(&self.train[n * width..(n + 1) * width]);
        }
        let input = tensor(wanted.clone(), [batch, width], &self.stage.device.clone().autodiff());
        let output = self.network.forward(input);
        let (loss, gradient) = self.distance.value_and_gradient(&host(output.clone()), &wanted);
        let mut gradients = surrogate(output, gradient).backward();
        let gradients = module_gradients(&self.network, &mut gradients);
        let learning_rate = rate(self.config.learning_rate, self.config.decay, step, self.config.steps);
        self.network = self.adam.step(self.network.clone(), &gradients, learning_rate);
        Ok(StepStats { loss, terms: vec![("distance", loss)], learning_rate })
    }

    /// Mean distance between the vertices of a frame and of its reconstruction, mm.
    fn validate(&mut self) -> Result<f64> {
        let network = self.network.valid();
        let mut sum = 0.0;
        for chunk in self.validation.chunks(CHUNK * self.width) {
            let frames = tensor(chunk.to_vec(), [chunk.len() / self.width, self.width], &self.stage.device);
            sum += self.distance.summed(&host(network.forward(frames)), chunk);
        }
        Ok(3000.0 * sum / self.validation.len() as f64)
    }

    fn state(&self) -> Vec<NamedArray> {
        [module_state(&self.network), self.adam.state()].concat()
    }

    fn load_state(&mut self, state: &State) -> Result<()> {
        self.network = load_module(self.network.clone(), state)?;
        self.adam.load_state(state)
    }
}
