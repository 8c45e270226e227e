use crate::descriptor::FeatureScaling;
use crate::matrix::dot;
use crate::model::{LARGEST_WIDTH, fits};
use crate::times::{StepPart, Watch};
use crate::{DeltaBasis, Matrix};
use softtissue_body::BodyBuild;

/// Linear autoregression of second order with exogenous input (Dyna, Pons-Moll et al. 2015, eq. 20): each coefficient
/// by itself, `c_t = a_1 c_{t-1} + a_2 c_{t-2} + w . x_t + b`. With both lags zero it has no memory (order 0).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Ar2 {
    /// `a_1, a_2` of each coefficient, `[K, 2]`.
    pub lags: Matrix,
    /// `w`, `[K, D]`, on scaled features.
    pub weight: Matrix,
    /// `b`, `[K]`.
    pub bias: Vec<f32>,
}

impl Ar2 {
    /// All zeros, for `K` coefficients and `D` features.
    pub fn zeros(coefficients: usize, features: usize) -> Self {
        Self {
            lags: Matrix::zeros(coefficients, 2),
            weight: Matrix::zeros(coefficients, features),
            bias: vec![0.0; coefficients],
        }
    }

    /// One frame: scaled features `[D]` and the two frames before, `[K]` each, to the new frame, which takes the
    /// place of the older one.
    pub fn step(&self, scaled: &[f32], last: &[f32], before: &mut [f32]) {
        for (k, c) in before.iter_mut().enumerate() {
            let a = self.lags.row(k);
            *c = a[0] * last[k] + a[1] * *c + dot(self.weight.row(k), scaled) + self.bias[k];
        }
    }

    /// Free rollout over scaled features `[T, D]` from `rest`, to coefficients `[T, K]`.
    pub fn rollout(&self, scaled: &[f32], rest: &[f32]) -> Vec<f32> {
        let mut out = Vec::with_capacity(scaled.len() / self.weight.cols().max(1) * rest.len());
        let (mut last, mut before) = (rest.to_vec(), rest.to_vec());
        for x in scaled.chunks_exact(self.weight.cols().max(1)) {
            self.step(x, &last, &mut before);
            std::mem::swap(&mut last, &mut before);
            out.extend_from_slice(&last);
        }
        out
    }

    /// Adds another one's numbers, each times `factor`.
    fn add(&mut self, factor: f32, other: &Self) {
        let pairs = [
            (self.lags.data_mut(), other.lags.data()),
            (self.weight.data_mut(), other.weight.data()),
            (&mut self.bias[..], &other.bias[..]),
        ];
        for (own, other) in pairs {
            own.iter_mut().zip(other).for_each(|(a, b)| *a += factor * b);
        }
    }
}

/// Most people of a mixture: each has three arrays in a bundle.
const MOST_PEOPLE: usize = 256;

/// One person that training knew.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PersonDynamics {
    /// Name in the training data.
    pub name: String,
    /// Body mass index by the model's [`BodyBuild`], kg/m^2.
    pub bmi: f32,
    /// How this person's flesh moves.
    pub dynamics: Ar2,
}

/// Dyna in vertex form (as in DMPL): autoregressions of several people on the principal components of the deltas, mixed
/// by how near their body mass index is to that of the body that moves (eqs. 21-22). Everybody shares one shape space
/// and one set of components: sex is not modelled, where the paper learns women and men apart.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AutoregressiveModel {
    /// From the descriptor's features.
    pub input: FeatureScaling,
    /// `K` components of the deltas.
    pub basis: DeltaBasis,
    /// Weight and height from the shape.
    pub build: BodyBuild,
    /// Kernel width `tau`, kg/m^2: small follows the nearest person, large is everybody's mean.
    pub tau: f32,
    /// The people, at least one.
    pub people: Vec<PersonDynamics>,
}

/// What an [`AutoregressiveModel`] remembers between frames of one body, and its working memory. The mixture of linear
/// models with one history is one linear model: it is mixed once, so that a step costs as much as one person's. Its
/// poles lie as far inside as theirs, since the lags that keep poles within a radius form a convex set.
#[derive(Clone, Debug)]
pub struct AutoregressiveState {
    dynamics: Ar2,
    /// Coefficients of a zero delta.
    rest: Vec<f32>,
    scaled: Vec<f32>,
    last: Vec<f32>,
    before: Vec<f32>,
    /// Coefficients with the basis's mean.
    decoded: Vec<f32>,
}

impl AutoregressiveModel {
    /// Vertices `V` that it moves.
    pub fn vertex_count(&self) -> usize {
        self.basis.mean.len() / 3
    }
    /// Components `K`.
    pub fn components(&self) -> usize {
        self.basis.directions.rows()
    }

    /// Weight of each person for a body mass index, `exp(-|a_j - a| / tau)` over their sum. Outside the range of the
    /// people the weights are those at its nearer end: all distances grow alike.
    pub fn weights(&self, bmi: f32) -> Vec<f32> {
        let distances: Vec<f32> = self.people.iter().map(|p| (p.bmi - bmi).abs()).collect();
        let nearest = distances.iter().copied().fold(f32::INFINITY, f32::min);
        let kernel: Vec<f32> = distances.iter().map(|d| ((nearest - d) / self.tau).exp()).collect();
        let sum: f32 = kernel.iter().sum();
        kernel.iter().map(|k| k / sum).collect()
    }

    /// Lowest and highest body mass index among the people.
    pub fn bmi_range(&self) -> (f32, f32) {
        let bmi = self.people.iter().map(|p| p.bmi);
        bmi.fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), b| (low.min(b), high.max(b)))
    }

    /// The mixture for one body as a single autoregression.
    pub fn mixed(&self, beta: &[f32]) -> Ar2 {
        let mut mixed = Ar2::zeros(self.components(), self.input.len());
        for (weight, person) in self.weights(self.build.bmi(beta)).into_iter().zip(&self.people) {
            mixed.add(weight, &person.dynamics);
        }
        mixed
    }

    /// The state before the first frame, for one body: no delta, and none before.
    pub fn start(&self, beta: &[f32]) -> AutoregressiveState {
        let rest = self.basis.rest_coefficients();
        AutoregressiveState {
            dynamics: self.mixed(beta),
            scaled: vec![0.0; self.input.len()],
            last: rest.clone(),
            before: rest.clone(),
            decoded: rest.clone(),
            rest,
        }
    }

    /// One frame: the descriptor's `features` to `deltas [V * 3]`, metres. Returns how many features were clipped to
    /// their range in training. Allocates nothing.
    pub fn step(&self, features: &[f32], state: &mut AutoregressiveState, deltas: &mut [f32]) -> usize {
        let clipped = self.predict(features, state, &mut ());
        self.basis.sum(&state.decoded, deltas, None);
        clipped
    }

    /// The same up to the coefficients, in [`AutoregressiveState::decoded`].
    pub(crate) fn predict(&self, features: &[f32], state: &mut AutoregressiveState, watch: &mut impl Watch) -> usize {
        let AutoregressiveState { dynamics, scaled, last, before, decoded, .. } = state;
        self.input.apply(features, scaled);
        dynamics.step(scaled, last, before);
        std::mem::swap(last, before);
        let clipped = self.input.outside(features);
        watch.lap(StepPart::Regressor);
        decoded.copy_from_slice(last);
        self.basis.add_mean(decoded);
        clipped
    }

    /// Whether all parts fit together; the sentence says what does not. Finite numbers are the reader's concern.
    pub(crate) fn check(&self) -> Result<(), String> {
        self.input.check()?;
        let (k, d) = (self.components(), self.input.len());
        let basis = &self.basis;
        if !(1..=LARGEST_WIDTH).contains(&k) || self.input.input_size > LARGEST_WIDTH {
            let features = self.input.input_size;
            return Err(format!(
                "it has {k} components and {features} features, expected 1 to {LARGEST_WIDTH}; export it again"
            ));
        }
        fits("basis directions", &[basis.directions.cols()], &[basis.mean.len()])?;
        fits("basis", &[basis.mean.len()], &[3 * self.vertex_count()])?;
        fits("coefficient mean", &[basis.coefficient_mean.len()], &[k])?;
        if !(1..=MOST_PEOPLE).contains(&self.people.len()) {
            let people = self.people.len();
            return Err(format!("its mixture is of {people} people, expected 1 to {MOST_PEOPLE}; export it again"));
        }
        if !(self.tau > 0.0 && self.tau.is_finite()) {
            return Err(format!("its kernel width is {}, expected a number above 0; export it again", self.tau));
        }
        if !self.build.is_sound() {
            return Err("its map from shape to weight and height has rows of unequal length; export it again".into());
        }
        for PersonDynamics { name, bmi, dynamics: Ar2 { lags, weight, bias } } in &self.people {
            let found = [lags.rows(), lags.cols(), weight.rows(), weight.cols(), bias.len()];
            fits(&format!("dynamics of {name:?}"), &found, &[k, 2, k, d, k])?;
            if !(*bmi > 0.0 && bmi.is_finite()) {
                return Err(format!("{name:?} has a body mass index of {bmi}; export it again"));
            }
        }
        Ok(())
    }
}

impl AutoregressiveState {
    /// Forgets the motion, not the body.
    pub fn reset(&mut self) {
        self.last.copy_from_slice(&self.rest);
        self.before.copy_from_slice(&self.rest);
    }
    /// Takes over what another state of the same body remembers.
    pub(crate) fn remember(&mut self, other: &Self) {
        self.last.copy_from_slice(&other.last);
        self.before.copy_from_slice(&other.before);
    }
    /// Coefficients of the newest frame, `[K]`, metres.
    pub fn coefficients(&self) -> &[f32] {
        &self.last
    }
    /// Bytes of the matrices.
    pub(crate) fn weight_bytes(&self) -> usize {
        self.dynamics.lags.bytes() + self.dynamics.weight.bytes()
    }
    /// The same with the basis's mean.
    pub(crate) fn decoded(&self) -> &[f32] {
        &self.decoded
    }
    /// Whether the memory is finite.
    pub fn is_finite(&self) -> bool {
        self.last.iter().chain(&self.before).all(|x| x.is_finite())
    }
}
