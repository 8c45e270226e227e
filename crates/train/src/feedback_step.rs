use crate::delta_autoencoder_step::rate;
use crate::losses::{WeightedDistance, surrogate};
use crate::subspace_step::tensor;
use crate::{Adam, AdamConfig, Clips, NamedArray, Result, Stage, State, StepStats, TrainError, Trainee};
use crate::{load_module, module_gradients, module_state};
use burn::module::Module;
use burn::tensor::Tensor;
use serde::{Deserialize, Serialize};
use softtissue_bundle::{FeedbackPerson, Limits};
use softtissue_model::{Dropout, FeedbackRegressor, Standardisation, ThreeLayers, host};
use softtissue_random::Draws;

/// How the regressor of Casas and Otaduy is trained.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct FeedbackTraining {
    /// Hidden units. Default 0: the root of the product of inputs and outputs, rounded down, as published.
    pub width: usize,
    /// Poses that it sees, this frame's and those before. Default 3, which the paper's text lists; its count of inputs
    /// says 2.
    pub pose_history: usize,
    /// Whether vertices weigh by how much their deltas' velocity changes in training (eq. 7). Default true.
    pub weighted: bool,
    /// Steps of a whole training. Default 600.
    pub steps: u64,
    /// Frames in a batch, drawn anew for each step. Default 64; the paper gives none.
    pub batch: usize,
    /// Learning rate at the start. Default 5e-4; the paper gives none but the autoencoder's.
    pub learning_rate: f64,
    /// Whether the learning rate falls to zero by a cosine. Default true.
    pub decay: bool,
    /// Probability of zeroing a hidden unit. Default 0.5; 0 as published.
    pub dropout: f64,
    /// Standard deviation of the noise on each fed back latent number, in its own standard deviations. Default 0, as
    /// published.
    pub latent_noise: f64,
    /// Standard deviation of a noise that all poses of the history share, in each feature's own standard deviations: what
    /// a pose is becomes vague, how it changes stays exact. Default 1.5; 0 as published.
    pub pose_noise: f64,
    /// Part of the fed back latents that come from the regressor's own rollouts in the place of the scans (scheduled
    /// sampling, Bengio et al. 2015); reached half way through. Default 1;
    /// 0 as published.
    pub own_latents: f64,
    /// Steps between rollouts of the training clips for `own_latents`. Default 100.
    pub rollout_every: u64,
    /// Whether fed back latents are clipped to their range in training, which bounds every rollout. Default true; false
    /// as published.
    pub clip_latents: bool,
}

impl Default for FeedbackTraining {
    fn default() -> Self {
        Self {
            width: 0,
            pose_history: 3,
            weighted: true,
            steps: 600,
            batch: 64,
            learning_rate: 5e-4,
            decay: true,
            dropout: 0.5,
            latent_noise: 0.0,
            pose_noise: 1.5,
            own_latents: 1.0,
            rollout_every: 100,
            clip_latents: true,
        }
    }
}

/// A clip of one person: `T` frames.
#[derive(Clone, Debug, Default)]
pub struct FeedbackClip {
    /// Features, `[T, P]`.
    pub poses: Vec<f32>,
    /// Deltas, `[T, V * 3]`, metres.
    pub deltas: Vec<f32>,
}

/// What a regressor stands on, one person's.
#[derive(Clone, Debug)]
pub struct FeedbackGround {
    /// The trained encoder, on standardised deltas.
    pub encoder: ThreeLayers,
    /// Of the deltas, `[V * 3]`: the encoder's own, and of what the regressor gives.
    pub deltas: Standardisation,
    /// Of the features, `[P]`.
    pub poses: Standardisation,
    /// Rigidity weights (eq. 7), `[V]`, mean 1.
    pub rigidity: Vec<f32>,
}

/// Learns a [`FeedbackRegressor`] by single frames, and selects it by free rollouts (sec. 3.4).
pub struct FeedbackTrainee {
    config: FeedbackTraining,
    stage: Stage,
    network: FeedbackRegressor,
    adam: Adam,
    ground: FeedbackGround,
    /// Of the latents, `[L]`.
    latents: Standardisation,
    pose_limits: Limits,
    /// Of standardised latents.
    latent_limits: Option<Limits>,
    /// Standardised code of no delta, `[L]`.
    rest: Vec<f32>,
    distance: WeightedDistance,
    train: Vec<Prepared>,
    validation: Vec<Prepared>,
    /// Standardised latents of the newest rollouts over the training clips, one clip after the other, `[N, L]`; empty
    /// before the first.
    own: Vec<f32>,
}

/// A clip, standardised.
struct Prepared {
    frames: usize,
    /// `[T, P]`.
    poses: Vec<f32>,
    /// Codes of the scans' deltas, `[T, L]`.
    latents: Vec<f32>,
    /// `[T, V * 3]`.
    target: Vec<f32>,
}

/// Frames encoded at a time.
const CHUNK: usize = 512;

impl FeedbackTrainee {
    /// An untrained regressor of a person's clips.
    pub fn new(
        config: FeedbackTraining,
        stage: &Stage,
        ground: FeedbackGround,
        clips: Clips<Vec<FeedbackClip>>,
    ) -> Result<Self> {
        check(&config, &ground, &clips)?;
        let device = stage.device.clone().inner();
        let stage = Stage { device: device.clone(), ..stage.clone() };
        let encode = |frames: &[f32]| encode(&ground.encoder, &ground.deltas.apply(frames), &stage);
        let codes: Vec<Vec<f32>> = clips.train.iter().map(|clip| encode(&clip.deltas)).collect();
        let latent_count = ground.encoder.outputs();
        let latents = Standardisation::fit(codes.iter().map(Vec::as_slice), &[latent_count]);
        let rest = latents.apply(&encode(&vec![0.0; ground.deltas.len()]));
        let mut limits = Limits::nothing(latent_count);
        limits.widen(&rest);
        codes.iter().for_each(|codes| latents.apply(codes).chunks_exact(latent_count).for_each(|z| limits.widen(z)));
        let mut pose_limits = Limits::nothing(ground.poses.len());
        let poses = clips.train.iter().flat_map(|clip| clip.poses.chunks_exact(ground.poses.len()));
        poses.for_each(|pose| pose_limits.widen(pose));
        let prepare = |clip: &FeedbackClip| {
            let mut poses = clip.poses.clone();
            poses.chunks_exact_mut(ground.poses.len()).for_each(|pose| {
                pose_limits.clip(pose);
            });
            Prepared {
                frames: clip.poses.len() / ground.poses.len(),
                poses: ground.poses.apply(&poses),
                latents: latents.apply(&encode(&clip.deltas)),
                target: ground.deltas.apply(&clip.deltas),
            }
        };
        let (train, validation) =
            (clips.train.iter().map(prepare).collect(), clips.validation.iter().map(prepare).collect());
        let (inputs, outputs) = (2 * latent_count + config.pose_history * ground.poses.len(), ground.deltas.len());
        let width = if config.width > 0 { config.width } else { FeedbackRegressor::published_width(inputs, outputs) };
        let mut draws = Draws::new(stage.seed, &format!("{}/start", stage.name), 0, 0);
        let network = FeedbackRegressor::new(inputs, width, outputs, &mut draws, &device.autodiff());
        let even = vec![1.0; ground.rigidity.len()];
        let weights = if config.weighted { &ground.rigidity } else { &even };
        let distance = WeightedDistance::of_vertices(&ground.deltas.deviation, weights);
        let (adam, own) = (Adam::new(AdamConfig::default()), Vec::new());
        let latent_limits = config.clip_latents.then_some(limits);
        Ok(Self {
            config,
            stage,
            network,
            adam,
            ground,
            latents,
            pose_limits,
            latent_limits,
            rest,
            distance,
            train,
            validation,
            own,
        })
    }

    /// The person as a bundle holds them.
    pub fn to_person(&self, name: &str, beta: &[f32]) -> FeedbackPerson {
        let FeedbackGround { encoder, deltas, poses, .. } = &self.ground;
        let mut parts = vec![&self.latents, &self.latents];
        parts.extend(std::iter::repeat_n(poses, self.config.pose_history));
        let [hidden, output] = self.network.valid().to_plain(&Standardisation::beside(&parts), deltas);
        let raw = |x: &[f32]| -> Vec<f32> {
            let scaled = x.iter().zip(&self.latents.mean).zip(&self.latents.deviation);
            scaled.map(|((x, m), s)| x * s + m).collect()
        };
        FeedbackPerson {
            name: name.to_owned(),
            beta: beta.to_vec(),
            encoder: encoder.to_plain(deltas),
            hidden,
            output,
            pose_limits: self.pose_limits.clone(),
            latent_limits: self.latent_limits.as_ref().map(|l| Limits { lower: raw(&l.lower), upper: raw(&l.upper) }),
        }
    }

    /// Appends the poses of frame `t` of a clip and of those before; the first pose is taken to have stood still.
    fn push_poses(&self, clip: &Prepared, t: usize, input: &mut Vec<f32>) {
        let size = self.ground.poses.len();
        for k in 0..self.config.pose_history {
            let at = t.saturating_sub(k) * size;
            input.extend_from_slice(&clip.poses[at..at + size]);
        }
    }

    /// Free rollouts over clips side by side. `see(t, deltas [B, V * 3], latents [B, L])` gets every frame, standardised;
    /// clips that have ended stay at their last pose.
    fn roll_out(&self, clips: &[Prepared], mut see: impl FnMut(usize, &[f32], &[f32])) {
        let network = self.network.valid();
        let (count, latents) = (clips.len(), self.rest.len());
        let mut before = [self.rest.repeat(count), self.rest.repeat(count)];
        for t in 0..clips.iter().map(|c| c.frames).max().unwrap_or(0) {
            let mut input = Vec::new();
            for (b, clip) in clips.iter().enumerate() {
                before.iter().for_each(|z| input.extend_from_slice(&z[b * latents..(b + 1) * latents]));
                self.push_poses(clip, t.min(clip.frames - 1), &mut input);
            }
            let width = input.len() / count;
            let output = network.forward(tensor(input, [count, width], &self.stage.device), None);
            let mut codes = self.latents.apply(&host(self.ground.encoder.forward(output.clone())));
            if let Some(limits) = &self.latent_limits {
                codes.chunks_exact_mut(latents).for_each(|z| {
                    limits.clip(z);
                });
            }
            see(t, &host(output), &codes);
            let [newest, older] = &mut before;
            std::mem::swap(newest, older);
            *newest = codes;
        }
    }

    /// Rolls out over the training clips and keeps the latents.
    fn renew_own(&mut self) {
        let latents = self.rest.len();
        let starts = starts(&self.train);
        let mut own = vec![0.0; self.train.iter().map(|c| c.frames).sum::<usize>() * latents];
        self.roll_out(&self.train, |t, _, codes| {
            for (b, _) in self.train.iter().enumerate().filter(|(_, clip)| t < clip.frames) {
                own[(starts[b] + t) * latents..][..latents].copy_from_slice(&codes[b * latents..(b + 1) * latents]);
            }
        });
        self.own = own;
    }

    /// Inputs `[B, I]` and wanted deltas `[B, V * 3]` of the frames that `step` draws.
    fn batch(&self, step: u64) -> (Vec<f32>, Vec<f32>) {
        let config = &self.config;
        let (latents, width) = (self.rest.len(), self.ground.deltas.len());
        let starts = starts(&self.train);
        let count = self.train.iter().map(|c| c.frames).sum();
        let mut draws = Draws::new(self.stage.seed, &self.stage.name, 0, step);
        let mut noise = Draws::new(self.stage.seed, &format!("{}/noise", self.stage.name), 0, step);
        let own = config.own_latents * (2.0 * step as f64 / config.steps.max(1) as f64).min(1.0);
        let (mut input, mut wanted) = (Vec::new(), Vec::with_capacity(config.batch * width));
        for _ in 0..config.batch {
            let n = draws.below(count);
            let c = starts.partition_point(|start| *start <= n) - 1;
            let (clip, t) = (&self.train[c], n - starts[c]);
            let from_own = draws.uniform() < own && !self.own.is_empty();
            for k in 1..=2 {
                let code = match t.checked_sub(k) {
                    None => &self.rest[..],
                    Some(t) if from_own => &self.own[(starts[c] + t) * latents..][..latents],
                    Some(t) => &clip.latents[t * latents..][..latents],
                };
                match config.latent_noise > 0.0 {
                    true => input.extend(code.iter().map(|z| z + (config.latent_noise * noise.normal()) as f32)),
                    false => input.extend_from_slice(code),
                }
            }
            let poses = input.len();
            self.push_poses(clip, t, &mut input);
            if config.pose_noise > 0.0 {
                let shared: Vec<f32> =
                    (0..self.ground.poses.len()).map(|_| (config.pose_noise * noise.normal()) as f32).collect();
                input[poses..].iter_mut().zip(shared.iter().cycle()).for_each(|(x, n)| *x += n);
            }
            wanted.extend_from_slice(&clip.target[t * width..(t + 1) * width]);
        }
        (input, wanted)
    }
}

impl Trainee for FeedbackTrainee {
    fn step(&mut self, step: u64) -> Result<StepStats> {
        let config = &self.config;
        let (rollout_every, batch) = (config.rollout_every.max(1), config.batch);
        let learning_rate = rate(config.learning_rate, config.decay, step, config.steps);
        if config.own_latents > 0.0 && step > 0 && step.is_multiple_of(rollout_every) {
            self.renew_own();
        }
        let (input, wanted) = self.batch(step);
        let width = input.len() / batch;
        let input: Tensor<2> = tensor(input, [batch, width], &self.stage.device.clone().autodiff());
        let masks = Draws::new(self.stage.seed, &format!("{}/dropout", self.stage.name), 0, step);
        let mut dropout = (self.config.dropout > 0.0)
            .then(|| Dropout::new(masks, self.config.dropout, &self.stage.device.clone().autodiff()));
        let output = self.network.forward(input, dropout.as_mut());
        let (loss, gradient) = self.distance.value_and_gradient(&host(output.clone()), &wanted);
        let mut gradients = surrogate(output, gradient).backward();
        let gradients = module_gradients(&self.network, &mut gradients);
        self.network = self.adam.step(self.network.clone(), &gradients, learning_rate);
        Ok(StepStats { loss, terms: vec![("distance_mm2", loss)], learning_rate })
    }

    /// Mean distance between predicted and wanted vertices over all frames of free rollouts, mm, weighted as the loss.
    fn validate(&mut self) -> Result<f64> {
        let width = self.ground.deltas.len();
        let mut sum = 0.0;
        self.roll_out(&self.validation, |t, deltas, _| {
            for (clip, found) in self.validation.iter().zip(deltas.chunks_exact(width)).filter(|(c, _)| t < c.frames) {
                sum += self.distance.summed(found, &clip.target[t * width..(t + 1) * width]);
            }
        });
        let frames: usize = self.validation.iter().map(|c| c.frames).sum();
        Ok(1000.0 * sum / (frames * self.distance.vertex_count()) as f64)
    }

    fn state(&self) -> Vec<NamedArray> {
        let mut arrays = [module_state(&self.network), self.adam.state()].concat();
        if !self.own.is_empty() {
            let latents = self.rest.len();
            let shape = vec![self.own.len() / latents, latents];
            arrays.push(NamedArray { name: "own_latents".into(), shape, data: self.own.clone() });
        }
        arrays
    }

    fn load_state(&mut self, state: &State) -> Result<()> {
        let frames = self.train.iter().map(|c| c.frames).sum::<usize>();
        let own = state.get("own_latents").map_or(&[][..], |array| &array.data);
        if !own.is_empty() && own.len() != frames * self.rest.len() {
            return Err(TrainError::Config(format!(
                "own_latents holds {} numbers, not those of {frames} frames: resume with the clips it was saved under",
                own.len()
            )));
        }
        self.network = load_module(self.network.clone(), state)?;
        self.own = own.to_vec();
        self.adam.load_state(state)
    }
}

/// Codes `[T, L]` of standardised deltas.
fn encode(encoder: &ThreeLayers, deltas: &[f32], stage: &Stage) -> Vec<f32> {
    let width = encoder.inputs();
    let chunks = deltas.chunks(CHUNK * width);
    let codes = chunks
        .flat_map(|chunk| host(encoder.forward(tensor(chunk.to_vec(), [chunk.len() / width, width], &stage.device))));
    codes.collect()
}

/// Number of the first frame of each clip among all.
fn starts(clips: &[Prepared]) -> Vec<usize> {
    let ends = clips.iter().scan(0, |end, clip| {
        *end += clip.frames;
        Some(*end)
    });
    std::iter::once(0).chain(ends).take(clips.len()).collect()
}

fn check(config: &FeedbackTraining, ground: &FeedbackGround, clips: &Clips<Vec<FeedbackClip>>) -> Result<()> {
    if !(0.0..1.0).contains(&config.dropout) {
        return Err(TrainError::Config(format!("regressor: dropout {} is not in [0, 1)", config.dropout)));
    }
    if config.batch == 0 || config.pose_history == 0 || clips.train.is_empty() || clips.validation.is_empty() {
        return Err(TrainError::Config(
            "regressor: training needs a batch and a pose history of at least 1 and at least one clip each to train and \
             to validate"
                .into(),
        ));
    }
    let (poses, width) = (ground.poses.len(), ground.deltas.len());
    let misfit = clips.train.iter().chain(&clips.validation).find(|clip| {
        let frames = clip.deltas.len() / width.max(1);
        frames == 0 || clip.deltas.len() != frames * width || clip.poses.len() != frames * poses
    });
    match misfit {
        None if width == 3 * ground.rigidity.len() && ground.encoder.inputs() == width => Ok(()),
        None => Err(TrainError::Numeric(format!(
            "regressor: {} rigidity weights and an encoder of {} numbers do not fit {width} numbers a frame",
            ground.rigidity.len(),
            ground.encoder.inputs()
        ))),
        Some(clip) => Err(TrainError::Numeric(format!(
            "regressor: a clip of {} features and {} deltas does not fit {poses} and {width} a frame",
            clip.poses.len(),
            clip.deltas.len()
        ))),
    }
}
