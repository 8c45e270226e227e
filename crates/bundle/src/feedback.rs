use crate::model::{LARGEST_WIDTH, check_linear, fits};
use crate::times::{StepPart, Watch};
use crate::{Limits, Linear, ThreeLayers};

/// Casas and Otaduy (2018): one person's whole delta is regressed from the poses and from what was regressed before,
/// which reaches the next frame through an encoder. Several people stand side by side, each with networks of their
/// own; a body is moved by those of the nearest shape.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FeedbackModel {
    /// The people, at least one. All have networks of the same sizes.
    pub people: Vec<FeedbackPerson>,
}

/// The networks of one person (sec. 3.3 and 3.4), with all standardisation folded into their layers.
///
/// ```text
/// x   = [z_{t-1}, z_{t-2}, p_t, p_{t-1}, ...]     p: features, clipped to their range in training
/// D_t = output(relu(hidden(x)))                   [V * 3], metres
/// z_t = encoder(D_t)                              [L], clipped to its range in training where there are limits
/// ```
///
/// Before the first frame `z` is the code of no delta at all, and the first pose is taken to have stood still.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FeedbackPerson {
    /// Who.
    pub name: String,
    /// Their shape.
    pub beta: Vec<f32>,
    /// `[V * 3] -> [L]`.
    pub encoder: ThreeLayers,
    /// `[2 L + h P] -> [H]` with `h` poses; rectified.
    pub hidden: Linear,
    /// `[H] -> [V * 3]`, metres.
    pub output: Linear,
    /// Range of each feature in training, `[P]`.
    pub pose_limits: Limits,
    /// Range of each latent number in training, `[L]`; without it the feedback is free, as published.
    pub latent_limits: Option<Limits>,
}

/// What a [`FeedbackModel`] remembers of one body, and its working memory.
#[derive(Clone, Debug)]
pub struct FeedbackState {
    /// Whose networks.
    person: usize,
    /// Code of no delta, `[L]`.
    rest: Vec<f32>,
    /// `[z_{t-1}, z_{t-2}, p_t, p_{t-1}, ...]`.
    input: Vec<f32>,
    /// Of a pose.
    features: usize,
    started: bool,
    hidden: Vec<f32>,
    /// Between the encoder's layers.
    coded: [Vec<f32>; 2],
    latent: Vec<f32>,
}

/// Most people of a bundle.
const MOST_PEOPLE: usize = 64;

impl FeedbackModel {
    /// Features a frame, `P`.
    pub fn feature_count(&self) -> usize {
        self.people.first().map_or(0, |p| p.pose_limits.len())
    }
    /// Vertices `V`.
    pub fn vertex_count(&self) -> usize {
        self.people.first().map_or(0, |p| p.output.outputs() / 3)
    }
    /// The person whose shape is nearest. The coefficients are in standard deviations of the shape space as they are;
    /// missing ones count as zero.
    pub fn nearest(&self, beta: &[f32]) -> usize {
        let distance = |person: &FeedbackPerson| -> f32 {
            let count = person.beta.len().max(beta.len());
            let at = |b: &[f32], i: usize| b.get(i).copied().unwrap_or(0.0);
            (0..count).map(|i| (at(&person.beta, i) - at(beta, i)).powi(2)).sum()
        };
        let ranked = self.people.iter().map(distance).enumerate();
        ranked.min_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(i, _)| i)
    }
    /// Index, least and greatest value among the people of each shape coefficient.
    pub(crate) fn shape_limits(&self) -> Vec<(u32, f32, f32)> {
        let count = self.people.iter().map(|p| p.beta.len()).min().unwrap_or(0);
        let mut limits = Limits::nothing(count);
        self.people.iter().for_each(|p| limits.widen(&p.beta[..count]));
        (0..count).map(|i| (i as u32, limits.lower[i], limits.upper[i])).collect()
    }

    /// The state before the first frame, for a body of shape `beta`. The model must have people in it.
    pub fn start(&self, beta: &[f32]) -> FeedbackState {
        let person = self.nearest(beta);
        let networks = &self.people[person];
        let mut state = FeedbackState {
            person,
            rest: vec![0.0; networks.latent_count()],
            input: vec![0.0; networks.hidden.inputs()],
            features: networks.pose_limits.len(),
            started: false,
            hidden: vec![0.0; networks.hidden.outputs()],
            coded: networks.encoder.scratch(),
            latent: vec![0.0; networks.latent_count()],
        };
        networks.encode(&vec![0.0; networks.output.outputs()], &mut state);
        state.rest.copy_from_slice(&state.latent);
        state.reset();
        state
    }

    /// One frame: `features [P]` in, `deltas [V * 3]` (metres) out. Returns how many features were clipped to their
    /// range in training. Allocates nothing.
    pub fn step(&self, features: &[f32], state: &mut FeedbackState, deltas: &mut [f32]) -> usize {
        self.watched_step(features, state, deltas, &mut ())
    }

    pub(crate) fn watched_step(
        &self,
        features: &[f32],
        state: &mut FeedbackState,
        deltas: &mut [f32],
        watch: &mut impl Watch,
    ) -> usize {
        let person = &self.people[state.person];
        let clipped = state.accept(features, &person.pose_limits);
        person.hidden.apply(&state.input, &mut state.hidden);
        state.hidden.iter_mut().for_each(|h| *h = h.max(0.0));
        person.output.apply(&state.hidden, deltas);
        watch.lap(StepPart::Regressor);
        person.encode(deltas, state);
        let latents = state.latent.len();
        state.input.copy_within(..latents, latents);
        state.input[..latents].copy_from_slice(&state.latent);
        watch.lap(StepPart::Feedback);
        clipped
    }

    /// Whether all sizes fit together; the sentence says what does not.
    pub(crate) fn check(&self) -> Result<(), String> {
        let Some(first) = self.people.first().filter(|_| self.people.len() <= MOST_PEOPLE) else {
            return Err(format!("it has {} people, expected 1 to {MOST_PEOPLE}; export it again", self.people.len()));
        };
        self.people.iter().try_for_each(|person| person.check(first))
    }
}

impl FeedbackPerson {
    /// Latent numbers `L`.
    pub fn latent_count(&self) -> usize {
        self.encoder.outputs()
    }
    /// Poses that the regressor sees, this frame's and those before.
    pub fn pose_history(&self) -> usize {
        self.hidden.inputs().saturating_sub(2 * self.latent_count()) / self.pose_limits.len().max(1)
    }

    /// `state.latent` from `deltas [V * 3]`.
    fn encode(&self, deltas: &[f32], state: &mut FeedbackState) {
        self.encoder.apply(deltas, &mut state.coded, &mut state.latent);
        if let Some(limits) = &self.latent_limits {
            limits.clip(&mut state.latent);
        }
    }

    /// Sizes within the person, and those of another person.
    fn check(&self, other: &Self) -> Result<(), String> {
        let (width, latents, poses) = (other.output.outputs(), self.latent_count(), self.pose_limits.len());
        let ThreeLayers([first, second, last]) = &self.encoder;
        for (what, count) in [
            ("latent numbers", latents),
            ("features", poses),
            ("hidden units", self.hidden.outputs()),
            ("encoder units", first.outputs().max(second.outputs())),
            ("poses", self.pose_history()),
        ] {
            if !(1..=LARGEST_WIDTH).contains(&count) {
                return Err(format!(
                    "{} has {count} {what}, expected 1 to {LARGEST_WIDTH}; export it again",
                    self.name
                ));
            }
        }
        let sizes = |p: &Self| {
            let clipped = usize::from(p.latent_limits.is_some());
            [p.latent_count(), p.pose_limits.len(), p.hidden.outputs(), p.hidden.inputs(), clipped]
        };
        fits(&format!("person {}", self.name), &sizes(self), &sizes(other))?;
        fits("output, vertices", &[width % 3], &[0])?;
        check_linear("encoder.0", first, width, first.outputs())?;
        check_linear("encoder.1", second, first.outputs(), second.outputs())?;
        check_linear("encoder.2", last, second.outputs(), latents)?;
        check_linear("hidden", &self.hidden, 2 * latents + self.pose_history() * poses, self.hidden.outputs())?;
        check_linear("output", &self.output, self.hidden.outputs(), width)?;
        self.pose_limits.check("pose limits", poses)?;
        self.latent_limits.as_ref().map_or(Ok(()), |limits| limits.check("latent limits", latents))
    }
}

impl FeedbackState {
    /// The latent of the newest frame, `[L]`.
    pub fn latent(&self) -> &[f32] {
        &self.latent
    }
    /// Which of the people moves the body.
    pub fn person(&self) -> usize {
        self.person
    }
    /// Forgets the motion, not the body.
    pub fn reset(&mut self) {
        let latents = self.rest.len();
        self.input[..latents].copy_from_slice(&self.rest);
        self.input[latents..2 * latents].copy_from_slice(&self.rest);
        self.latent.copy_from_slice(&self.rest);
        self.started = false;
    }
    /// Takes over what another state of the same body remembers.
    pub(crate) fn remember(&mut self, other: &Self) {
        self.input.copy_from_slice(&other.input);
        self.latent.copy_from_slice(&other.latent);
        self.started = other.started;
    }
    /// Whether what it remembers is finite.
    pub fn is_finite(&self) -> bool {
        self.input.iter().chain(&self.latent).all(|x| x.is_finite())
    }

    /// Moves the poses on by one frame.
    fn accept(&mut self, features: &[f32], limits: &Limits) -> usize {
        let (count, poses) = (self.features, &mut self.input[2 * self.rest.len()..]);
        let older = poses.len() - count;
        poses.copy_within(..older, count);
        poses[..count].copy_from_slice(features);
        let clipped = limits.clip(&mut poses[..count]);
        if !self.started {
            (count..poses.len()).for_each(|i| poses[i] = poses[i - count]);
            self.started = true;
        }
        clipped
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Matrix;

    const LATENTS: usize = 2;
    const POSES: usize = 3;
    const WIDTH: usize = 6;

    /// Numbers between -1 and 1 that do not repeat soon.
    fn linear(inputs: usize, outputs: usize, seed: f32) -> Linear {
        let number = |i: usize| ((i as f32 + 1.0) * (1.7 + seed)).sin();
        let weight = Matrix::new(outputs, inputs, (0..inputs * outputs).map(number).collect());
        Linear { weight, bias: (0..outputs).map(|i| number(i + 7)).collect() }
    }

    fn limits(count: usize, size: f32) -> Limits {
        Limits { lower: vec![-size; count], upper: vec![size; count] }
    }

    fn person(name: &str, beta: Vec<f32>, history: usize, seed: f32) -> FeedbackPerson {
        FeedbackPerson {
            name: name.into(),
            beta,
            encoder: ThreeLayers([linear(WIDTH, 5, seed), linear(5, 4, seed + 0.1), linear(4, LATENTS, seed + 0.2)]),
            hidden: linear(2 * LATENTS + history * POSES, 7, seed + 0.3),
            output: linear(7, WIDTH, seed + 0.4),
            pose_limits: limits(POSES, 2.0),
            latent_limits: None,
        }
    }

    fn pose(t: usize) -> [f32; POSES] {
        [0, 1, 2].map(|i| (0.3 * t as f32 + i as f32).cos())
    }

    /// The formulas of the type's docs, in f64 over the whole history.
    fn reference(p: &FeedbackPerson, frames: usize) -> Vec<Vec<f64>> {
        let layer = |l: &Linear, x: &[f64]| -> Vec<f64> {
            (0..l.outputs())
                .map(|r| {
                    let row = l.weight.row(r).iter().zip(x).map(|(w, x)| f64::from(*w) * x).sum::<f64>();
                    row + f64::from(l.bias[r])
                })
                .collect()
        };
        let relu = |x: Vec<f64>| -> Vec<f64> { x.into_iter().map(|x| x.max(0.0)).collect() };
        let [first, second, third] = &p.encoder.0;
        let code = |d: &[f64]| layer(third, &relu(layer(second, &layer(first, d))));
        let rest = code(&[0.0; WIDTH]);
        let mut codes = vec![rest.clone(), rest];
        let mut deltas = vec![];
        for t in 0..frames {
            let mut x = [codes[codes.len() - 1].clone(), codes[codes.len() - 2].clone()].concat();
            for k in 0..p.pose_history() {
                x.extend(pose(t.saturating_sub(k)).map(f64::from));
            }
            deltas.push(layer(&p.output, &relu(layer(&p.hidden, &x))));
            codes.push(code(&deltas[t]));
        }
        deltas
    }

    #[test]
    fn a_rollout_is_the_papers_recursion_with_two_or_three_poses() {
        for history in [2, 3] {
            // A contraction, so that rounding does not grow.
            let mut one = person("one", vec![], history, 0.2);
            one.output.weight.data_mut().iter_mut().for_each(|w| *w *= 0.1);
            assert_eq!(one.pose_history(), history);
            let model = FeedbackModel { people: vec![one] };
            model.check().unwrap();
            let mut state = model.start(&[]);
            for round in 0..2 {
                for (t, wanted) in reference(&model.people[0], 9).iter().enumerate() {
                    let mut deltas = [0.0; WIDTH];
                    assert_eq!(model.step(&pose(t), &mut state, &mut deltas), 0);
                    for (d, w) in deltas.iter().zip(wanted) {
                        assert!((f64::from(*d) - w).abs() < 1e-5, "round {round}, frame {t}: {d} {w}");
                    }
                }
                state.reset();
            }
        }
    }

    #[test]
    fn poses_and_latents_are_clipped_to_their_range_in_training() {
        let mut one = person("one", vec![], 2, 0.5);
        // Weights without a sign: feedback that grows from frame to frame, were it free.
        let layers = one.encoder.0.iter_mut().chain([&mut one.hidden, &mut one.output]);
        layers.for_each(|layer| layer.weight.data_mut().iter_mut().for_each(|w| *w = w.abs()));
        let free = FeedbackModel { people: vec![one.clone()] };
        one.latent_limits = Some(limits(LATENTS, 0.5));
        let bound = FeedbackModel { people: vec![one] };
        let largest = |model: &FeedbackModel| {
            let mut state = model.start(&[]);
            let mut deltas = [0.0; WIDTH];
            (0..40).for_each(|t| {
                model.step(&pose(t), &mut state, &mut deltas);
            });
            (deltas.iter().fold(0.0f32, |m, d| m.max(d.abs())), state)
        };
        let wild = largest(&free).0;
        assert!(wild > 1e6 || wild.is_nan(), "{wild}");
        let (size, state) = largest(&bound);
        assert!(size < 1e3 && state.latent().iter().all(|z| z.abs() <= 0.5), "{size}");
        let mut state = bound.start(&[]);
        let (mut far, mut edge) = ([0.0; WIDTH], [0.0; WIDTH]);
        assert_eq!(bound.step(&[9.0, f32::NAN, 0.5], &mut state, &mut far), 2);
        bound.step(&[2.0, 0.0, 0.5], &mut bound.start(&[]), &mut edge);
        assert_eq!(far, edge);
    }

    #[test]
    fn a_body_is_moved_by_the_person_of_the_nearest_shape() {
        let people = vec![
            person("light", vec![0.0, 2.0], 2, 0.1),
            person("middle", vec![0.0, 0.2], 2, 0.2),
            person("heavy", vec![0.0, -2.0], 2, 0.3),
        ];
        let model = FeedbackModel { people };
        let chosen = |beta: &[f32]| model.people[model.start(beta).person()].name.as_str();
        assert_eq!(chosen(&[0.0, -2.0]), "heavy");
        assert_eq!(chosen(&[0.3, 1.4, 0.2]), "light");
        assert_eq!(chosen(&[]), "middle");
        assert_eq!(model.shape_limits(), [(0, 0.0, 0.0), (1, -2.0, 2.0)]);
    }

    #[test]
    fn parts_that_do_not_fit_are_named() {
        let clipped = |person: FeedbackPerson| FeedbackPerson { latent_limits: Some(limits(LATENTS, 1.0)), ..person };
        let people = [person("a", vec![0.1], 2, 0.1), person("b", vec![0.2], 2, 0.2)].map(clipped);
        let fine = FeedbackModel { people: people.to_vec() };
        fine.check().unwrap();
        let refused = |change: fn(&mut FeedbackPerson), word: &str| {
            let mut model = fine.clone();
            change(&mut model.people[1]);
            let reason = model.check().unwrap_err();
            assert!(reason.contains(word), "{word}: {reason}");
        };
        refused(|p| p.encoder.0[1].bias.truncate(2), "encoder.1");
        refused(|p| p.hidden = linear(2 * LATENTS + 2 * POSES + 1, 7, 0.1), "person b");
        refused(|p| p.output = linear(7, WIDTH + 3, 0.1), "output has size");
        refused(|p| p.pose_limits.lower[1] = 3.0, "pose limits");
        refused(|p| p.latent_limits = Some(limits(LATENTS + 1, 1.0)), "latent limits");
        assert!(FeedbackModel::default().check().unwrap_err().contains("0 people"));
    }
}
