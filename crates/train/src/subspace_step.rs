use crate::losses::{NormalLoss, surface_loss, surrogate};
use crate::vertex_error::summed_distances;
use crate::{Adam, AdamConfig, Clips, NamedArray, Result, Stage, State, StepStats, TrainError, Trainee};
use crate::{cosine, load_module, module_gradients, module_state};
use burn::module::Module;
use burn::tensor::{Device, Tensor, TensorData};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use softtissue_model::{Autoencoder, AutoencoderConfig, Dropout, host};
use softtissue_random::Draws;
use std::sync::Arc;

/// How the autoencoder is trained.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SubspaceTraining {
    /// The network.
    pub network: AutoencoderConfig,
    /// Steps of a whole training, which the learning rate falls over. Default 1200.
    pub steps: u64,
    /// Frames in a batch, drawn anew for each step. Default 64; the paper's is 256.
    pub batch: usize,
    /// Learning rate at the start; falls to zero by a cosine. Default 5e-4; the paper's is 1e-4.
    pub learning_rate: f64,
    /// Probability of zeroing an inner activation. Default 0.5; the paper's 0.1 overfits forty clips.
    pub dropout: f64,
    /// Standard deviation of the noise on each coefficient that the encoder sees, as a part of its own rms in training.
    /// Default 0.05; much more and the encoder learns to shrink what it sees.
    pub input_noise: f64,
    /// Factor of the normal term, `mean_f (1 - cos)`, beside the surface term in mm^2. Default 20. The paper's 1000 stands
    /// beside a surface term without a unit; in mm^2 it outweighs the surface and raised its validation error by 5 % at
    /// 25 numbers. 0 leaves the term and its cost out.
    pub normal_weight: f64,
    /// The optimiser's constants.
    pub adam: AdamConfig,
}

impl Default for SubspaceTraining {
    fn default() -> Self {
        Self {
            network: AutoencoderConfig::default(),
            steps: 1200,
            batch: 64,
            learning_rate: 5e-4,
            dropout: 0.5,
            input_noise: 0.05,
            normal_weight: 20.0,
            adam: AdamConfig::default(),
        }
    }
}

/// The surface that coefficients stand for: `rest + mean + directions^T c`.
#[derive(Clone, Debug)]
pub struct DeltaSurface {
    /// Rest vertices of each subject, `[S][V * 3]`, metres.
    pub rest: Vec<Vec<f32>>,
    /// Mean delta, `[V * 3]`, metres.
    pub mean: Vec<f32>,
    /// Orthonormal directions, `[K, V * 3]`, row-major.
    pub directions: Vec<f32>,
    /// Triangles `[F, 3]`.
    pub faces: Arc<Vec<[u32; 3]>>,
}

/// Frames of deltas as coefficients.
#[derive(Clone, Debug, Default)]
pub struct DeltaFrames {
    /// `[N, K]`, metres.
    pub coefficients: Vec<f32>,
    /// Whose they are: indices into [`DeltaSurface::rest`], `[N]`.
    pub subjects: Vec<u32>,
}

/// Learns an [`Autoencoder`] by batches of single frames (SoftSMPL eq. 6).
pub struct SubspaceTrainee {
    config: SubspaceTraining,
    stage: Stage,
    network: Autoencoder,
    adam: Adam,
    surface: DeltaSurface,
    normals: NormalLoss,
    /// `[K, V * 3]`, metres for a unit of the network's scale.
    directions: Tensor<2>,
    /// Rms of each coefficient in training, `[K]`, in the network's units.
    spread: Vec<f32>,
    train: DeltaFrames,
    validation: DeltaFrames,
}

/// Frames put through the network at a time in validation.
const VALIDATION_CHUNK: usize = 1024;

impl SubspaceTrainee {
    /// An autoencoder of `latents` numbers that starts as principal component analysis.
    pub fn new(
        config: SubspaceTraining,
        stage: &Stage,
        latents: usize,
        surface: DeltaSurface,
        frames: Clips<DeltaFrames>,
    ) -> Result<Self> {
        let components = surface.components();
        if latents > components || config.batch == 0 {
            return Err(TrainError::Config(format!(
                "subspace: {latents} latent numbers of {components} components in batches of {}: take fewer latent \
                 numbers than components and a batch of at least 1",
                config.batch
            )));
        }
        if !(0.0..1.0).contains(&config.dropout) {
            return Err(TrainError::Config(format!("subspace: dropout {} is not in [0, 1)", config.dropout)));
        }
        let Clips { train, validation } = frames;
        if !(0.0..=10.0).contains(&config.input_noise) {
            return Err(TrainError::Config(format!("subspace: input_noise {} is not in [0, 10]", config.input_noise)));
        }
        train.check("training", &surface)?;
        validation.check("validation", &surface)?;
        let device = stage.device.clone().inner();
        let mut draws = Draws::new(stage.seed, &format!("{}/start", stage.name), 0, 0);
        let rms = train.rms(components);
        let network =
            Autoencoder::new(&config.network, components, latents, rms[0], &mut draws, &device.clone().autodiff());
        let spread = rms.iter().map(|r| r / network.scale).collect();
        let scaled = surface.directions.iter().map(|d| d * network.scale).collect();
        let directions = tensor(scaled, [components, surface.mean.len()], &device);
        let normals = NormalLoss { faces: surface.faces.clone(), weight: config.normal_weight };
        let adam = Adam::new(config.adam.clone());
        let stage = Stage { device, ..stage.clone() };
        Ok(Self { config, stage, network, adam, surface, normals, directions, spread, train, validation })
    }

    /// The network as it stands.
    pub fn network(&self) -> &Autoencoder {
        &self.network
    }

    /// The network without autodiff, for use after training.
    pub fn into_network(self) -> Autoencoder {
        self.network.valid()
    }

    /// Frames `rows` of `frames` in the network's units, `[B, K]`.
    fn scaled(&self, frames: &DeltaFrames, rows: &[usize]) -> Vec<f32> {
        let k = self.surface.components();
        let unit = 1.0 / self.network.scale;
        rows.iter().flat_map(|&n| frames.coefficients[n * k..(n + 1) * k].iter().map(move |c| c * unit)).collect()
    }

    /// What the encoder sees of coefficients `[B, K]`: each with noise in proportion to its spread.
    fn with_noise(&self, wanted: &[f32], step: u64) -> Vec<f32> {
        let mut draws = Draws::new(self.stage.seed, &format!("{}/noise", self.stage.name), 0, step);
        let part = self.config.input_noise as f32;
        if part == 0.0 {
            return wanted.to_vec();
        }
        wanted.iter().zip(self.spread.iter().cycle()).map(|(c, s)| c + part * s * draws.normal() as f32).collect()
    }

    /// Rest vertices with the deltas of coefficients in the network's units, `[B, V * 3]`; row `b` is subject
    /// `subjects[b mod B']` where `B'` is their number.
    fn decoded(&self, coefficients: Vec<f32>, subjects: &[u32]) -> Vec<f32> {
        let k = self.surface.components();
        let batch = coefficients.len() / k;
        let offsets = tensor(coefficients, [batch, k], &self.stage.device).matmul(self.directions.clone());
        let mut vertices = host(offsets);
        vertices.par_chunks_mut(self.surface.mean.len()).enumerate().for_each(|(b, row)| {
            let rest = &self.surface.rest[subjects[b % subjects.len()] as usize];
            row.iter_mut().zip(rest).zip(&self.surface.mean).for_each(|((x, rest), mean)| *x += rest + mean);
        });
        vertices
    }

    /// The normal term and its gradient with respect to the reconstructed coefficients, added to `gradient [B, K]`.
    fn add_normal_term(&self, wanted: &[f32], found: &[f32], subjects: &[u32], gradient: &mut [f32]) -> f64 {
        let batch = subjects.len();
        let vertices = self.decoded([wanted, found].concat(), subjects);
        let (target, output) = vertices.split_at(vertices.len() / 2);
        let (value, slope) = self.normals.value_and_gradient(target, output, batch);
        let slope = tensor(slope, [batch, self.surface.mean.len()], &self.stage.device);
        let slope = host(slope.matmul(self.directions.clone().transpose()));
        gradient.iter_mut().zip(slope).for_each(|(g, s)| *g += s);
        value
    }
}

impl Trainee for SubspaceTrainee {
    fn step(&mut self, step: u64) -> Result<StepStats> {
        let mut draws = Draws::new(self.stage.seed, &self.stage.name, 0, step);
        let count = self.train.subjects.len();
        let rows: Vec<usize> = (0..self.config.batch).map(|_| draws.below(count)).collect();
        let subjects: Vec<u32> = rows.iter().map(|&n| self.train.subjects[n]).collect();
        let (batch, k) = (rows.len(), self.surface.components());
        let wanted = self.scaled(&self.train, &rows);
        let masks = Draws::new(self.stage.seed, &format!("{}/dropout", self.stage.name), 0, step);
        let mut dropout = Dropout::new(masks, self.config.dropout, &self.stage.device);
        let input = tensor(self.with_noise(&wanted, step), [batch, k], &self.stage.device.clone().autodiff());
        let output = self.network.forward(input, Some(&mut dropout));

        let found = host(output.clone());
        let error: Vec<f32> = found.iter().zip(&wanted).map(|(f, w)| f - w).collect();
        let mut gradient = vec![0.0; error.len()];
        let vertices = self.surface.vertex_count();
        let surface = surface_loss(&error, batch, vertices, self.network.scale, &mut gradient);
        let normal = match self.config.normal_weight > 0.0 {
            true => self.add_normal_term(&wanted, &found, &subjects, &mut gradient),
            false => 0.0,
        };

        let loss = surface + normal;
        let learning_rate = cosine(self.config.learning_rate, step, self.config.steps, 0);
        let mut gradients = surrogate(output, gradient).backward();
        let gradients = module_gradients(&self.network, &mut gradients);
        self.network = self.adam.step(self.network.clone(), &gradients, learning_rate);
        Ok(StepStats { loss, terms: vec![("surface_mm2", surface), ("normal", normal)], learning_rate })
    }

    /// Mean distance between the vertices of a frame and of its reconstruction, mm.
    fn validate(&mut self) -> Result<f64> {
        let k = self.surface.components();
        let network = self.network.valid();
        let all: Vec<usize> = (0..self.validation.subjects.len()).collect();
        let mut sum = 0.0;
        for rows in all.chunks(VALIDATION_CHUNK) {
            let wanted = tensor(self.scaled(&self.validation, rows), [rows.len(), k], &self.stage.device);
            let error = network.forward(wanted.clone(), None) - wanted;
            sum += summed_distances(error, &self.directions);
        }
        Ok(1000.0 * sum / (all.len() * self.surface.vertex_count()).max(1) as f64)
    }

    fn state(&self) -> Vec<NamedArray> {
        [module_state(&self.network), self.adam.state()].concat()
    }

    fn load_state(&mut self, state: &State) -> Result<()> {
        self.network = load_module(self.network.clone(), state)?;
        self.adam.load_state(state)
    }
}

impl DeltaSurface {
    /// Components `K`.
    pub fn components(&self) -> usize {
        self.directions.len() / self.mean.len().max(1)
    }
    /// Vertices `V`.
    pub fn vertex_count(&self) -> usize {
        self.mean.len() / 3
    }
}

impl DeltaFrames {
    fn check(&self, role: &str, surface: &DeltaSurface) -> Result<()> {
        let fits = self.coefficients.len() == self.subjects.len() * surface.components()
            && self.subjects.iter().all(|s| (*s as usize) < surface.rest.len());
        match fits && !self.subjects.is_empty() {
            true => Ok(()),
            false => Err(TrainError::Numeric(format!(
                "subspace: {} {role} frames with {} coefficients do not fit {} components of {} subjects: at least one \
                 frame is needed",
                self.subjects.len(),
                self.coefficients.len(),
                surface.components(),
                surface.rest.len()
            ))),
        }
    }

    /// Root mean square of each coefficient, `[K]`, metres.
    fn rms(&self, components: usize) -> Vec<f32> {
        let mut sums = vec![0.0f64; components];
        for frame in self.coefficients.chunks_exact(components) {
            sums.iter_mut().zip(frame).for_each(|(s, c)| *s += f64::from(*c).powi(2));
        }
        sums.iter().map(|s| (s / self.subjects.len() as f64).sqrt() as f32).collect()
    }
}

/// `data` (row-major) on a device.
pub(crate) fn tensor<const D: usize>(data: Vec<f32>, shape: [usize; D], device: &Device) -> Tensor<D> {
    Tensor::from_data(TensorData::new(data, shape), device)
}
