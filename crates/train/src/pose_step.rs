use crate::subspace_step::tensor;
use crate::vertex_error::summed_distances;
use crate::{Adam, AdamConfig, Clips, NamedArray, Result, Stage, State, StepStats, TrainError, Trainee};
use crate::{cosine, load_module, module_gradients, module_state};
use burn::module::Module;
use burn::tensor::Tensor;
use serde::{Deserialize, Serialize};
use softtissue_model::{PoseAutoencoder, PoseAutoencoderConfig, PoseFrames, host};
use softtissue_random::Draws;

/// How the pose autoencoder is trained.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PoseTraining {
    /// The network.
    pub network: PoseAutoencoderConfig,
    /// Times that every pose is seen. Default 20, as published.
    pub epochs: u64,
    /// Poses in a batch. Default 256, as published.
    pub batch: usize,
    /// Learning rate at the start; falls to zero by a cosine. Default 1e-3, as in the paper, where it stays.
    pub learning_rate: f64,
    /// The optimiser's constants.
    pub adam: AdamConfig,
}

impl Default for PoseTraining {
    fn default() -> Self {
        Self {
            network: PoseAutoencoderConfig::default(),
            epochs: 20,
            batch: 256,
            learning_rate: 1e-3,
            adam: AdamConfig::default(),
        }
    }
}

/// Learns a [`PoseAutoencoder`] by both reconstructions of single poses (SoftSMPL eq. 13).
pub struct PoseTrainee {
    config: PoseTraining,
    stage: Stage,
    network: PoseAutoencoder,
    adam: Adam,
    /// `[K, V * 3]`, metres for a unit of the network's scale.
    directions: Tensor<2>,
    train: PoseFrames,
    validation: PoseFrames,
    /// The order of the poses in the epoch that was asked for last.
    order: Option<(u64, Vec<usize>)>,
}

/// Poses put through the network at a time in validation.
const VALIDATION_CHUNK: usize = 1024;

impl PoseTrainee {
    /// An untrained autoencoder. `directions [K, V * 3]` are the orthonormal ones that the coefficients belong to.
    pub fn new(config: PoseTraining, stage: &Stage, directions: &[f32], poses: Clips<PoseFrames>) -> Result<Self> {
        let Clips { train, validation } = poses;
        let refuse = |reason: &str| Err(TrainError::Config(format!("pose autoencoder: {reason}")));
        if config.batch == 0 || config.network.latents == 0 || config.network.width == 0 {
            return refuse("batch, network.latents and network.width are at least 1");
        }
        if train.count == 0 || validation.count == 0 {
            return refuse("at least one pose each is needed to train and to validate");
        }
        let (numbers, components) = (train.angles.len() / train.count, train.coefficients.len() / train.count);
        let fits = |p: &PoseFrames| [p.angles.len(), p.coefficients.len()] == [numbers * p.count, components * p.count];
        if components == 0 || !(fits(&train) && fits(&validation)) || !directions.len().is_multiple_of(3 * components) {
            return Err(TrainError::Numeric(format!(
                "pose autoencoder: poses of {numbers} angles and {components} coefficients do not fit each other or \
                 directions of {} numbers",
                directions.len()
            )));
        }
        let device = stage.device.clone().inner();
        let mut draws = Draws::new(stage.seed, &format!("{}/start", stage.name), 0, 0);
        let first = train.coefficients.iter().step_by(components);
        let typical = (first.map(|c| f64::from(*c).powi(2)).sum::<f64>() / train.count as f64).sqrt();
        let on = device.clone().autodiff();
        let network = PoseAutoencoder::new(&config.network, components, numbers, typical as f32, &mut draws, &on);
        let scaled = directions.iter().map(|d| d * network.scale).collect();
        let directions = tensor(scaled, [components, directions.len() / components], &device);
        let adam = Adam::new(config.adam.clone());
        let stage = Stage { device, ..stage.clone() };
        Ok(Self { config, stage, network, adam, directions, train, validation, order: None })
    }

    /// Steps of the whole training: the epochs in batches, the last batch of an epoch the smaller one.
    pub fn steps(&self) -> u64 {
        self.config.epochs * self.steps_an_epoch()
    }

    /// The network without autodiff, for use after training.
    pub fn into_network(self) -> PoseAutoencoder {
        self.network.valid()
    }

    fn steps_an_epoch(&self) -> u64 {
        self.train.count.div_ceil(self.config.batch) as u64
    }

    /// Poses of a step.
    fn rows(&mut self, step: u64) -> Vec<usize> {
        let epoch = step / self.steps_an_epoch();
        if self.order.as_ref().is_none_or(|(of, _)| *of != epoch) {
            let order = Draws::new(self.stage.seed, &self.stage.name, epoch, 0).permutation(self.train.count);
            self.order = Some((epoch, order));
        }
        let order = &self.order.as_ref().expect("it was just made").1;
        let from = (step % self.steps_an_epoch()) as usize * self.config.batch;
        order[from..(from + self.config.batch).min(order.len())].to_vec()
    }

    /// Coefficients in the network's units `[B, K]` and joint angles `[B, 3 (J - 1)]` of some poses.
    fn batch(&self, poses: &PoseFrames, rows: &[usize]) -> [Tensor<2>; 2] {
        let gather = |numbers: &[f32], factor: f32| {
            let width = numbers.len() / poses.count;
            let picked = rows.iter().flat_map(|&n| numbers[n * width..][..width].iter().map(|x| x * factor));
            tensor(picked.collect(), [rows.len(), width], &self.stage.device)
        };
        [gather(&poses.coefficients, 1.0 / self.network.scale), gather(&poses.angles, 1.0)]
    }
}

impl Trainee for PoseTrainee {
    fn step(&mut self, step: u64) -> Result<StepStats> {
        let rows = self.rows(step);
        let [coefficients, angles] = self.batch(&self.train, &rows).map(Tensor::autodiff);
        let squares = self.network.forward(coefficients.clone(), angles).map(|found| {
            let error = found - coefficients.clone();
            (error.clone() * error).sum()
        });
        // Mean over poses and vertices, mm^2: coefficients are on orthonormal directions.
        let vertices = self.directions.dims()[1] / 3;
        let unit = (1000.0 * f64::from(self.network.scale)).powi(2) / (rows.len() * vertices) as f64;
        let [mesh, pose] = squares.clone().map(|s| unit * f64::from(host(s)[0]));
        let [mesh_squares, pose_squares] = squares;
        // The gradient in the network's units, so that the optimiser's epsilon does not depend on the body.
        let mut gradients = ((mesh_squares + pose_squares) / rows.len() as f32).backward();
        let gradients = module_gradients(&self.network, &mut gradients);
        let learning_rate = cosine(self.config.learning_rate, step, self.steps(), 0);
        self.network = self.adam.step(self.network.clone(), &gradients, learning_rate);
        Ok(StepStats { loss: mesh + pose, terms: vec![("mesh_mm2", mesh), ("pose_mm2", pose)], learning_rate })
    }

    /// Mean distance between the vertices of a pose and of what its rotations are decoded to, within the span of the
    /// components, mm.
    fn validate(&mut self) -> Result<f64> {
        let network = self.network.valid();
        let all: Vec<usize> = (0..self.validation.count).collect();
        let mut sum = 0.0;
        for rows in all.chunks(VALIDATION_CHUNK) {
            let [coefficients, angles] = self.batch(&self.validation, rows);
            let [_, found] = network.forward(coefficients.clone(), angles);
            sum += summed_distances(found - coefficients, &self.directions);
        }
        Ok(1000.0 * sum / (all.len() * self.directions.dims()[1] / 3).max(1) as f64)
    }

    fn state(&self) -> Vec<NamedArray> {
        [module_state(&self.network), self.adam.state()].concat()
    }

    fn load_state(&mut self, state: &State) -> Result<()> {
        self.network = load_module(self.network.clone(), state)?;
        self.adam.load_state(state)
    }
}
