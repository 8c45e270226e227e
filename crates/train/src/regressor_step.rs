use crate::losses::{TrajectoryLoss, TrajectoryWeights, surrogate};
use crate::subspace_step::tensor;
use crate::vertex_error::summed_distances;
use crate::{Adam, AdamConfig, Clips, GruTrace, NamedArray, Result, Stage, State, StepStats, TrainError, Trainee};
use crate::{cosine, load_module, module_gradients, module_state};
use burn::module::Module;
use burn::tensor::{Device, Tensor};
use serde::{Deserialize, Serialize};
use softtissue_model::{Autoencoder, Decoder, Regressor, RegressorConfig, ShortcutStart, host};
use softtissue_random::Draws;

/// In which numbers the regressor's error is measured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LossSpace {
    /// Latents decoded to principal coefficients, whose distances are those of the vertices.
    #[default]
    Coefficients,
    /// The latents themselves, as published.
    Latent,
}

/// How the regressor is trained.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RegressorTraining {
    /// The network.
    pub network: RegressorConfig,
    /// Steps of a whole training, which the learning rate falls over. Default 1000.
    pub steps: u64,
    /// Clips in a batch, each whole and from a zero state. Default 16; the paper's is 10.
    pub batch: usize,
    /// Learning rate at the start; falls to zero by a cosine. Default 1e-3, as in the paper, where it stays.
    pub learning_rate: f64,
    /// Factors of the position, velocity and acceleration terms.
    pub terms: TrajectoryWeights,
    /// Where the error is measured: `coefficients` (default) or `latent`.
    pub space: LossSpace,
    /// The optimiser's constants.
    pub adam: AdamConfig,
}

impl Default for RegressorTraining {
    fn default() -> Self {
        Self {
            network: RegressorConfig::default(),
            steps: 1000,
            batch: 16,
            learning_rate: 1e-3,
            terms: TrajectoryWeights::default(),
            space: LossSpace::default(),
            adam: AdamConfig::default(),
        }
    }
}

/// A clip as the regressor sees it: `T` frames.
#[derive(Clone, Debug)]
pub struct MotionSequence {
    /// Scaled features and shape, `[T, I]`.
    pub input: Vec<f32>,
    /// Numbers in a row of `input`, `I`.
    pub input_width: usize,
    /// Wanted coefficients, `[T, K]`, metres for a body whose amplitude is one.
    pub target: Vec<f32>,
    /// What the body's coefficients are to these: a distance is measured after it.
    pub amplitude: f32,
}

/// Learns a [`Regressor`] by rollouts over whole clips (SoftSMPL eq. 10), through a decoder that stays as it is.
pub struct RegressorTrainee {
    config: RegressorTraining,
    stage: Stage,
    network: Regressor,
    adam: Adam,
    decoder: Decoder,
    loss: TrajectoryLoss,
    /// `[K, V * 3]`, metres for one unit of the network.
    directions: Tensor<2>,
    train: Vec<Prepared>,
    validation: Vec<Prepared>,
}

/// A clip in the network's units.
struct Prepared {
    frames: usize,
    amplitude: f32,
    input: Vec<f32>,
    /// `[T, K]`.
    target: Vec<f32>,
    /// What the loss compares with: `target`, or its latents.
    goal: Vec<f32>,
}

/// Clips of one batch.
struct Batch<'a> {
    clips: Vec<&'a Prepared>,
    /// Frames of each clip; the tensors are padded with zeros to the longest.
    lengths: Vec<usize>,
    /// `[T, B, I]`, time-major.
    input: Tensor<3>,
    /// Of each row's clip, `[T B, 1]`.
    amplitude: Tensor<2>,
}

impl RegressorTrainee {
    /// A regressor whose recurrent part adds nothing yet. `autoencoder` is the trained subspace, `directions`
    /// `[K, V * 3]` its orthonormal basis in metres, `shortcut` where the linear layer around the recurrent unit starts, for
    /// latents in metres.
    pub fn new(
        config: RegressorTraining,
        stage: &Stage,
        autoencoder: &Autoencoder,
        directions: &[f32],
        shortcut: ShortcutStart,
        clips: Clips<Vec<MotionSequence>>,
    ) -> Result<Self> {
        let device = stage.device.clone().inner();
        let autoencoder = autoencoder.valid().to_device(&device);
        let (decoder, scale) = (autoencoder.decoder.clone(), autoencoder.scale);
        let (components, latents) = (decoder.components(), decoder.latent_count());
        assert_eq!(shortcut.bias.len(), latents, "outputs of a shortcut");
        let inputs = shortcut.inputs();
        if config.batch == 0 || clips.train.is_empty() || clips.validation.is_empty() {
            return Err(TrainError::Config(
                "regressor: training needs a batch of at least 1 and at least one clip each to train and to validate"
                    .into(),
            ));
        }
        for clip in clips.train.iter().chain(&clips.validation) {
            clip.check(inputs, components)?;
        }
        let prepare = |clips: Vec<MotionSequence>| -> Vec<Prepared> {
            clips.into_iter().map(|clip| Prepared::new(clip, &autoencoder, config.space, &device)).collect()
        };
        let (train, validation) = (prepare(clips.train), prepare(clips.validation));
        let start = shortcut.in_units_of(scale);
        let mut draws = Draws::new(stage.seed, &format!("{}/start", stage.name), 0, 0);
        let network = Regressor::new(&config.network, start, &mut draws, &device.clone().autodiff());
        let vertex_count = directions.len() / components / 3;
        let loss = TrajectoryLoss { weights: config.terms.clone(), vertex_count, scale };
        let directions = directions.iter().map(|d| d * scale).collect();
        let directions = tensor(directions, [components, vertex_count * 3], &device);
        let (stage, adam) = (Stage { device, ..stage.clone() }, Adam::new(config.adam.clone()));
        Ok(Self { config, stage, network, adam, decoder, loss, directions, train, validation })
    }

    /// The network as it stands; its latents are in the autoencoder's units.
    pub fn network(&self) -> &Regressor {
        &self.network
    }

    /// The network without autodiff, for use after training.
    pub fn into_network(self) -> Regressor {
        self.network.valid()
    }

    /// What the loss compares, `[T B, K]` coefficients or `[T B, L]` latents, of latents `[T B, L]`.
    fn compared(&self, latents: Tensor<2>, amplitude: &Tensor<2>) -> Tensor<2> {
        match self.config.space {
            LossSpace::Coefficients => self.decoded(latents, amplitude),
            LossSpace::Latent => latents,
        }
    }

    /// Coefficients of a body whose amplitude is one, decoded where the body's own latents are: a decoder is not linear.
    fn decoded(&self, latents: Tensor<2>, amplitude: &Tensor<2>) -> Tensor<2> {
        self.decoder.forward(latents * amplitude.clone(), None) / amplitude.clone()
    }
}

impl Trainee for RegressorTrainee {
    fn step(&mut self, step: u64) -> Result<StepStats> {
        let mut order = Draws::new(self.stage.seed, &self.stage.name, 0, step).permutation(self.train.len());
        order.truncate(self.config.batch);
        let batch = Batch::new(order.iter().map(|&i| &self.train[i]).collect(), &self.stage.device);

        let trace = GruTrace::new(&self.network.gru, batch.input.clone());
        let leaf = trace.states().autodiff().require_grad();
        let latents = self.network.latents(leaf.clone(), batch.rows());
        let output = self.compared(latents, &batch.amplitude);
        let error = batch.error(&host(output.clone()), |clip| &clip.goal);
        let (loss, terms, gradient) = self.loss.value_and_gradient(&error, &batch.lengths);

        let mut gradients = surrogate(output, gradient).backward();
        let mut found = module_gradients(&self.network, &mut gradients);
        let states_gradient = leaf.grad_remove(&mut gradients).expect("the states are part of the loss");
        found.extend(trace.backward(states_gradient, "gru."));
        let learning_rate = cosine(self.config.learning_rate, step, self.config.steps, 0);
        self.network = self.adam.step(self.network.clone(), &found, learning_rate);
        let terms = vec![
            ("position_mm2", terms.position),
            ("velocity_mm2", terms.velocity),
            ("acceleration_mm2", terms.acceleration),
        ];
        Ok(StepStats { loss, terms, learning_rate })
    }

    /// Mean distance between predicted and wanted vertices over all frames of whole rollouts, mm.
    fn validate(&mut self) -> Result<f64> {
        let network = self.network.valid();
        let (mut sum, mut frames) = (0.0, 0);
        for clips in self.validation.chunks(self.config.batch) {
            let batch = Batch::new(clips.iter().collect(), &self.stage.device);
            let states = network.gru.forward(batch.input.clone());
            let [length, count, width] = states.dims();
            let latents = network.latents(states.reshape([length * count, width]), batch.rows());
            let output = host(self.decoded(latents, &batch.amplitude));
            // Padding has no error, so it adds nothing.
            let mut error = batch.error(&output, |clip| &clip.target);
            batch.grow(&mut error);
            let error = tensor(error, [length * count, self.decoder.components()], &self.stage.device);
            sum += summed_distances(error, &self.directions);
            frames += batch.lengths.iter().sum::<usize>();
        }
        Ok(1000.0 * sum / (frames * self.loss.vertex_count).max(1) as f64)
    }

    fn state(&self) -> Vec<NamedArray> {
        [module_state(&self.network), self.adam.state()].concat()
    }

    fn load_state(&mut self, state: &State) -> Result<()> {
        self.network = load_module(self.network.clone(), state)?;
        self.adam.load_state(state)
    }
}

impl MotionSequence {
    /// Frames `T`.
    pub fn frames(&self) -> usize {
        self.input.len() / self.input_width.max(1)
    }

    fn check(&self, inputs: usize, components: usize) -> Result<()> {
        let frames = self.frames();
        let fits = frames > 0
            && self.input_width == inputs
            && self.input.len() == frames * inputs
            && self.target.len() == frames * components;
        match fits {
            true => Ok(()),
            false => Err(TrainError::Numeric(format!(
                "regressor: a clip with {} inputs of {} and {} coefficients does not fit {inputs} and {components} a frame",
                self.input.len(),
                self.input_width,
                self.target.len()
            ))),
        }
    }
}

impl Prepared {
    fn new(clip: MotionSequence, network: &Autoencoder, space: LossSpace, device: &Device) -> Self {
        let frames = clip.frames();
        let unit = 1.0 / network.scale;
        let target: Vec<f32> = clip.target.into_iter().map(|x| x * unit).collect();
        let goal = match space {
            LossSpace::Coefficients => target.clone(),
            LossSpace::Latent => {
                let target = tensor(target.clone(), [frames, target.len() / frames], device) * clip.amplitude;
                host(network.encoder.forward(target, None) / clip.amplitude)
            }
        };
        Self { frames, amplitude: clip.amplitude, input: clip.input, target, goal }
    }
}

impl<'a> Batch<'a> {
    fn new(clips: Vec<&'a Prepared>, device: &Device) -> Self {
        let lengths: Vec<usize> = clips.iter().map(|c| c.frames).collect();
        let frames = lengths.iter().copied().max().unwrap_or(0);
        let (count, first) = (clips.len(), clips[0]);
        let width = first.input.len() / first.frames;
        let mut input = vec![0.0f32; frames * count * width];
        for (b, clip) in clips.iter().enumerate() {
            for (t, row) in clip.input.chunks_exact(width).enumerate() {
                input[(t * count + b) * width..][..width].copy_from_slice(row);
            }
        }
        let input = tensor(input, [frames, count, width], device);
        let amplitudes = clips.iter().map(|clip| clip.amplitude).cycle().take(frames * count);
        let amplitude = tensor(amplitudes.collect(), [frames * count, 1], device);
        Self { clips, lengths, input, amplitude }
    }

    /// The inputs as `[T B, I]`.
    fn rows(&self) -> Tensor<2> {
        let [frames, count, width] = self.input.dims();
        self.input.clone().reshape([frames * count, width])
    }

    /// Multiplies numbers `[T B, W]` by their clips' amplitudes.
    fn grow(&self, numbers: &mut [f32]) {
        let frames = self.lengths.iter().copied().max().unwrap_or(0);
        let width = numbers.len() / (frames * self.clips.len()).max(1);
        let clips = self.clips.iter().cycle();
        for (row, clip) in numbers.chunks_exact_mut(width.max(1)).zip(clips) {
            row.iter_mut().for_each(|x| *x *= clip.amplitude);
        }
    }

    /// `output [T B, W]` less what is `wanted` of each clip; zero in the padding.
    fn error(&self, output: &[f32], wanted: impl Fn(&Prepared) -> &[f32]) -> Vec<f32> {
        let count = self.clips.len();
        let frames = self.lengths.iter().copied().max().unwrap_or(0);
        let width = output.len() / (frames * count);
        let mut error = vec![0.0f32; output.len()];
        for (b, clip) in self.clips.iter().enumerate() {
            for (t, wanted) in wanted(clip).chunks_exact(width).enumerate() {
                let at = (t * count + b) * width;
                let row = error[at..at + width].iter_mut().zip(&output[at..at + width]);
                row.zip(wanted).for_each(|((e, o), w)| *e = o - w);
            }
        }
        error
    }
}
