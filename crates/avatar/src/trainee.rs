use crate::avatar::{AvatarBody, AvatarField, Playback};
use crate::clip::AvatarClip;
use crate::config::Conditioning;
use crate::layer::tensor;
use crate::loss::{BatchShape, FieldLoss, field_loss};
use crate::network::AvatarNetwork;
use crate::{LossWeights, StageConfig};
use burn::module::Module;
use burn::tensor::Tensor;
use glam::Vec3;
use softtissue_implicit::{PointTree, Samples};
use softtissue_model::host;
use softtissue_random::Draws;
use softtissue_train::{
    Adam, AdamConfig, Clips, GradientMap, NamedArray, Stage, State, StepStats, TrainError, Trainee, cosine,
    load_module, module_gradients, module_state,
};
use std::sync::Arc;

/// Frames that validation rolls out from true heights, and windows that it looks at.
const VALIDATION_ROLLOUT: usize = 4;
const VALIDATION_WINDOWS: usize = 6;
/// Scan points that validation looks at in a frame.
const VALIDATION_POINTS: usize = 400;
/// A gradient below this does not stretch a distance any more.
const LEAST_GRADIENT: f32 = 0.1;

/// Learns a network on single frames or short rollouts of one person's scans, batch 1 (sec. 3.4).
pub struct AvatarTrainee {
    config: StageConfig,
    loss: LossWeights,
    conditioning: Conditioning,
    stage: Stage,
    body: Arc<AvatarBody>,
    network: AvatarNetwork,
    adam: Adam,
    clips: Arc<Clips<Vec<AvatarClip>>>,
    /// Clip and first frame of every rollout that a step may draw.
    starts: Vec<(usize, usize)>,
    /// The same of validation.
    windows: Vec<(usize, usize)>,
}

impl AvatarTrainee {
    /// Trains `network`, which may be new or of the stage before.
    ///
    /// # Errors
    /// No clip that is long enough.
    pub fn new(
        config: &StageConfig,
        loss: &LossWeights,
        conditioning: Conditioning,
        stage: Stage,
        body: Arc<AvatarBody>,
        network: AvatarNetwork,
        clips: Arc<Clips<Vec<AvatarClip>>>,
    ) -> Result<Self, TrainError> {
        let history = body.config.history;
        let starts = starts(&clips.train, history, config.frames);
        let windows = starts_apart(starts_of_validation(&clips, history), VALIDATION_WINDOWS);
        if starts.is_empty() || windows.is_empty() {
            return Err(TrainError::Config(format!(
                "{}: no clip of this person has {} scans on end to train and to validate; leave fewer frames out",
                stage.name,
                history + config.frames.max(VALIDATION_ROLLOUT)
            )));
        }
        Ok(Self {
            config: config.clone(),
            loss: loss.clone(),
            conditioning,
            stage,
            body,
            network,
            adam: Adam::new(AdamConfig::default()),
            clips,
            starts,
            windows,
        })
    }

    /// The network with its training state.
    pub fn into_network(self) -> AvatarNetwork {
        self.network
    }

    /// The network of a stage that has yet to begin, on the stage's device with autodiff.
    pub fn untrained(body: &AvatarBody, conditioning: Conditioning, stage: &Stage) -> AvatarNetwork {
        let mut draws = Draws::new(stage.seed, &format!("{}/start", stage.name), 0, 0);
        let device = stage.device.clone().autodiff();
        AvatarNetwork::new(&body.config, conditioning, body.joints, body.observers.len(), &mut draws, &device)
    }

    /// The loss of one frame that was predicted by dynamic features.
    fn frame(&self, clip: &AvatarClip, t: usize, features: Tensor<2>, draws: &mut Draws) -> FieldLoss {
        let device = &self.stage.device;
        let scan = clip.scans[t].as_ref().expect("rollouts begin where all scans are there");
        let Samples { mut surface, normals, near, within } = Samples::draw(scan, &self.config.sampling, draws);
        let shape = BatchShape { surface: surface.len(), near: near.len(), within: within.len() };
        surface.extend(near);
        surface.extend(within);
        let observers = &clip.observers[t];
        let tree = PointTree::new(&observers.positions);
        let queries = self.body.queries(&surface, &tree, observers, true, device);
        let normals = normals.iter().flat_map(|n| n.to_array()).collect();
        let normals = tensor(normals, [shape.surface, 3], device);
        field_loss(self.network.field(features, &queries), shape, normals, &self.loss)
    }
}

fn starts(clips: &[AvatarClip], history: usize, length: usize) -> Vec<(usize, usize)> {
    let of = |(c, clip): (usize, &AvatarClip)| clip.starts(history, length).into_iter().map(move |t| (c, t));
    clips.iter().enumerate().flat_map(of).collect()
}

fn starts_of_validation(clips: &Clips<Vec<AvatarClip>>, history: usize) -> Vec<(usize, usize)> {
    starts(&clips.validation, history, VALIDATION_ROLLOUT)
}

/// At most `count` of them, evenly spread.
fn starts_apart(starts: Vec<(usize, usize)>, count: usize) -> Vec<(usize, usize)> {
    let count = count.min(starts.len());
    (0..count).map(|i| starts[(2 * i + 1) * starts.len() / (2 * count)]).collect()
}

/// Adds `from` to `into`.
fn add(into: &mut GradientMap, from: GradientMap) {
    for (name, gradient) in from {
        match into.get_mut(&name) {
            Some(sum) => sum.iter_mut().zip(gradient).for_each(|(a, b)| *a += b),
            None => {
                into.insert(name, gradient);
            }
        }
    }
}

fn number(x: &Tensor<1>) -> f64 {
    f64::from(host(x.clone())[0])
}

impl Trainee for AvatarTrainee {
    fn step(&mut self, step: u64) -> Result<StepStats, TrainError> {
        let learning_rate = cosine(self.config.learning_rate, step, self.config.steps, 0);
        let mut draws = Draws::new(self.stage.seed, &self.stage.name, 0, step);
        let (c, start) = self.starts[draws.below(self.starts.len())];
        let clip = &self.clips.train[c];
        let history = self.body.config.history;
        let mut heights: Vec<Vec<f32>> = clip.history(start, history).to_vec();
        let mut gradients = GradientMap::new();
        let mut terms = [("surface_mm", 0.0), ("normal", 0.0), ("eikonal", 0.0), ("off_surface", 0.0)];
        let (mut total, mut first) = (0.0, None);
        let frames = self.config.frames;
        for t in start..start + frames {
            let seen: Vec<&[f32]> = heights[heights.len() - history..].iter().map(Vec::as_slice).collect();
            let input = self.body.input(self.conditioning, &clip.track, t, &seen);
            let features = self.body.features(&self.network, &input, &mut first);
            let loss = self.frame(clip, t, features.clone(), &mut draws);
            total += number(&loss.total) / frames as f64;
            let parts = [&loss.surface, &loss.normal, &loss.eikonal, &loss.off_surface];
            for ((term, part), scale) in terms.iter_mut().zip(parts).zip([1000.0, 1.0, 1.0, 1.0]) {
                term.1 += scale * number(part) / frames as f64;
            }
            let mut found = loss.total.div_scalar(frames as f64).backward();
            add(&mut gradients, module_gradients(&self.network, &mut found));
            if t + 1 < start + frames {
                // what it would see when playing; no gradient passes from frame to frame
                let network = self.network.valid();
                let field = AvatarField::new(&self.body, &network, features.inner(), &clip.observers[t]);
                heights.push(field.heights().to_vec());
            }
        }
        self.network = self.adam.step(self.network.clone(), &gradients, learning_rate);
        Ok(StepStats { loss: total, terms: terms.to_vec(), learning_rate })
    }

    /// Mean distance of scan points from the field's surface over rollouts of four frames from true heights, mm: the
    /// field's value over the length of its gradient.
    fn validate(&mut self) -> Result<f64, TrainError> {
        let network = self.network.valid();
        let history = self.body.config.history;
        let (mut sum, mut count) = (0.0, 0usize);
        for &(c, start) in &self.windows {
            let clip = &self.clips.validation[c];
            let play = Playback::new(&self.body, &network, self.conditioning, clip.history(start, history));
            let mut play = play.map_err(|e| TrainError::Numeric(e.to_string()))?;
            for t in start..start + VALIDATION_ROLLOUT {
                let field = play.step(&clip.track, t, &clip.observers[t]);
                let scan = clip.scans[t].as_ref().expect("windows begin where all scans are there");
                let stride = scan.points().len().div_ceil(VALIDATION_POINTS);
                let points: Vec<Vec3> = scan.points().iter().copied().step_by(stride).collect();
                let (values, gradients) = field.with_gradients(&points);
                let distances =
                    values.iter().zip(&gradients).map(|(f, g)| f64::from(f.abs() / g.length().max(LEAST_GRADIENT)));
                sum += distances.sum::<f64>();
                count += points.len();
            }
        }
        Ok(1000.0 * sum / count as f64)
    }

    fn state(&self) -> Vec<NamedArray> {
        [module_state(&self.network), self.adam.state()].concat()
    }

    fn load_state(&mut self, state: &State) -> Result<(), TrainError> {
        self.network = load_module(self.network.clone(), state)?;
        self.adam.load_state(state)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::AvatarConfig;
    use crate::checks::{self, ball, breathing, short};
    use burn::tensor::Device;

    fn stage(frames: usize, steps: u64) -> StageConfig {
        let [_, rollout] = AvatarConfig::default().stages();
        StageConfig { frames, ..short(rollout, steps) }
    }

    fn trainee(conditioning: Conditioning, config: &StageConfig) -> AvatarTrainee {
        let device = Device::flex();
        checks::trainee(&Arc::new(ball(&device)), conditioning, config, None, &device)
    }

    fn snapshot(trainee: &AvatarTrainee) -> State {
        trainee.state().into_iter().map(|a| (a.name.clone(), a)).collect()
    }

    #[test]
    fn a_resumed_stage_ends_in_the_same_bytes() {
        let config = stage(2, 6);
        let mut whole = trainee(Conditioning::Autoregressive, &config);
        (0..4).for_each(|step| assert!(whole.step(step).expect("a step").loss.is_finite()));
        let mut first = trainee(Conditioning::Autoregressive, &config);
        (0..2).for_each(|step| drop(first.step(step).expect("a step")));
        let mut second = trainee(Conditioning::Autoregressive, &config);
        second.load_state(&snapshot(&first)).expect("its own state");
        (2..4).for_each(|step| drop(second.step(step).expect("a step")));
        assert_eq!(snapshot(&whole), snapshot(&second));
    }

    #[test]
    fn heights_tell_what_a_pose_cannot() {
        let steps = 400;
        let [autoregressive, pose] = [Conditioning::Autoregressive, Conditioning::Pose].map(|conditioning| {
            let mut trainee = trainee(conditioning, &stage(1, steps));
            (0..steps).for_each(|step| drop(trainee.step(step).expect("a step")));
            trainee.validate().expect("a validation")
        });
        // the ball's radius swings by 10 mm, 6.4 in the mean, and its pose says nothing of when
        assert!(pose > 4.0 && autoregressive < 0.6 * pose, "{autoregressive} {pose}");
    }

    /// A stage of the method on one clip.
    fn on(clip: AvatarClip, config: &StageConfig) -> Result<AvatarTrainee, TrainError> {
        let device = Device::flex();
        let body = Arc::new(ball(&device));
        let clips = Arc::new(Clips { train: vec![clip], validation: vec![breathing(30, 0.0)] });
        let stage = Stage { name: "autoavatar/test".into(), seed: 1, device };
        let conditioning = Conditioning::Autoregressive;
        let network = AvatarTrainee::untrained(&body, conditioning, &stage);
        AvatarTrainee::new(config, &LossWeights::default(), conditioning, stage, body, network, clips)
    }

    #[test]
    fn too_short_clips_are_refused() {
        assert!(on(breathing(4, 0.0), &stage(2, 1)).err().is_some_and(|e| e.to_string().contains("scans on end")));
    }

    /// Of a clip whose second half is judged by, training sees nothing from there on.
    #[test]
    fn what_lies_behind_a_part_is_not_seen() {
        let mut clip = breathing(10, 0.0);
        clip.frames = 0..5;
        clip.scans[5..].fill(None);
        clip.heights[3..].iter_mut().for_each(|heights| heights.fill(f32::NAN));
        let mut trainee = on(clip, &stage(2, 3)).expect("one rollout of two frames");
        assert_eq!(trainee.starts, [(0, 3)]);
        for step in 0..3 {
            assert!(trainee.step(step).expect("a step").loss.is_finite());
        }
        let state = snapshot(&trainee);
        assert!(state.values().all(|array| array.data.iter().all(|x| x.is_finite())));
    }
}
