use crate::descriptor::{DescriptorConfig, DescriptorParts, FeatureKind, PoseEncoder};
use crate::detail::Part;
use crate::times::{StepPart, Watch};
use crate::{
    AutoregressiveModel, AutoregressiveState, DeltaBasis, FeedbackModel, FeedbackState, Linear, Regressor,
    RegressorState, Subspace, SubspaceScratch,
};
use std::borrow::Cow;
use std::sync::Arc;

/// What turns a motion's features into deltas: a variant for each family of methods.
#[derive(Clone, Debug, PartialEq)]
#[expect(clippy::large_enum_variant, reason = "there is one in a bundle, and its size is that of its arrays")]
pub enum Model {
    /// SoftSMPL (2020) and ours: a regressor of latent numbers and their decoder.
    Recurrent(RecurrentModel),
    /// Casas and Otaduy (2018): a regressor of the deltas, fed back through an encoder.
    Feedback(FeedbackModel),
    /// Dyna (2015) in vertex form: people's autoregressions, mixed by body mass index.
    Autoregressive(AutoregressiveModel),
}

/// What a [`Model`] remembers of the motion of one body, and its working memory.
#[derive(Clone, Debug)]
pub enum ModelState {
    /// Of a [`RecurrentModel`].
    Recurrent(RecurrentState),
    /// Of a [`FeedbackModel`].
    Feedback(FeedbackState),
    /// Of an [`AutoregressiveModel`].
    Autoregressive(AutoregressiveState),
}

/// From features to latent to deltas.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RecurrentModel {
    /// From features to latent. Its limits are those of the training data.
    pub regressor: Regressor,
    /// From latent to deltas. Modes that a descriptor projects on are the first rows of its basis.
    pub subspace: Subspace,
    /// What disentangled poses are encoded by, where the descriptor has such features.
    pub pose_encoder: Option<Arc<PoseEncoder>>,
}

/// What a [`RecurrentModel`] remembers.
#[derive(Clone, Debug)]
pub struct RecurrentState {
    regressor: RegressorState,
    scratch: SubspaceScratch,
}

/// Most latent numbers, components, hidden units and features of a bundle: far above what is useful, far below what
/// hurts.
pub(crate) const LARGEST_WIDTH: usize = 1 << 16;
/// Most shape terms, and their highest power.
const MOST_TERMS: (usize, u8) = (64, 4);

impl Model {
    /// Features a frame that it takes from the descriptor, `D`.
    pub fn feature_count(&self) -> usize {
        match self {
            Self::Recurrent(m) => m.regressor.input.input_size,
            Self::Feedback(m) => m.feature_count(),
            Self::Autoregressive(m) => m.input.input_size,
        }
    }
    /// Vertices `V` that it moves.
    pub fn vertex_count(&self) -> usize {
        match self {
            Self::Recurrent(m) => m.subspace.vertex_count(),
            Self::Feedback(m) => m.vertex_count(),
            Self::Autoregressive(m) => m.vertex_count(),
        }
    }
    /// Orthonormal delta modes `[K, V * 3]` that a descriptor may project forces on; `None` if the model has none.
    pub fn modes(&self) -> Option<Cow<'_, [f32]>> {
        self.basis().map(|basis| basis.directions.numbers())
    }
    /// The basis of its deltas; `None` if it makes them without one.
    pub fn basis(&self) -> Option<&DeltaBasis> {
        match self {
            Self::Recurrent(m) => Some(&m.subspace.basis),
            Self::Feedback(_) => None,
            Self::Autoregressive(m) => Some(&m.basis),
        }
    }
    /// What a descriptor of these settings needs of the model.
    pub fn descriptor_parts(&self, config: &DescriptorConfig) -> DescriptorParts<'_> {
        let wanted = config.features == FeatureKind::ModalForces;
        let encoder = self.recurrent().and_then(|m| m.pose_encoder.as_ref());
        DescriptorParts { modes: self.modes().filter(|_| wanted), encoder }
    }
    /// The recurrent model, where it is one.
    pub fn recurrent(&self) -> Option<&RecurrentModel> {
        match self {
            Self::Recurrent(m) => Some(m),
            Self::Feedback(_) => None,
            Self::Autoregressive(_) => None,
        }
    }
    /// The autoregressive model, where it is one.
    pub fn autoregressive(&self) -> Option<&AutoregressiveModel> {
        match self {
            Self::Autoregressive(m) => Some(m),
            Self::Recurrent(_) | Self::Feedback(_) => None,
        }
    }
    /// Index, least and greatest value in training of each shape coefficient that it looks at by itself.
    pub fn shape_limits(&self) -> Vec<(u32, f32, f32)> {
        match self {
            Self::Recurrent(m) => m.regressor.shape.limits(),
            Self::Feedback(m) => m.shape_limits(),
            Self::Autoregressive(_) => vec![],
        }
    }

    /// The state before the first frame, for a body of shape `beta`.
    pub fn start(&self, beta: &[f32]) -> ModelState {
        match self {
            Self::Recurrent(m) => ModelState::Recurrent(m.start(beta)),
            Self::Feedback(m) => ModelState::Feedback(m.start(beta)),
            Self::Autoregressive(m) => ModelState::Autoregressive(m.start(beta)),
        }
    }
    /// One frame: features `[D]` in, `deltas [V * 3]` (metres, rest frame) out. Returns how many features were clipped
    /// to their range in training. Allocates nothing. Panics if the state is another model's.
    pub fn step(&self, features: &[f32], state: &mut ModelState, deltas: &mut [f32]) -> usize {
        self.step_part(features, state, deltas, None)
    }

    /// The same of the part of the deltas that is wanted.
    pub(crate) fn step_part(
        &self,
        features: &[f32],
        state: &mut ModelState,
        deltas: &mut [f32],
        part: Option<&Part>,
    ) -> usize {
        let clipped = self.predict(features, state, deltas, &mut ());
        if let (Some(basis), Some(coefficients)) = (self.basis(), state.coefficients()) {
            basis.sum(coefficients, deltas, part);
        }
        clipped
    }

    /// One frame up to the coefficients of the basis, [`ModelState::coefficients`]; up to the deltas where there is none.
    pub(crate) fn predict(
        &self,
        features: &[f32],
        state: &mut ModelState,
        deltas: &mut [f32],
        watch: &mut impl Watch,
    ) -> usize {
        match (self, state) {
            (Self::Recurrent(m), ModelState::Recurrent(state)) => m.predict(features, state, watch),
            (Self::Feedback(m), ModelState::Feedback(state)) => m.watched_step(features, state, deltas, watch),
            (Self::Autoregressive(m), ModelState::Autoregressive(state)) => m.predict(features, state, watch),
            _ => panic!("the state belongs to another kind of model"),
        }
    }

    /// Whether its parts fit together and to the descriptor; the sentence says what does not.
    pub(crate) fn check(&self, descriptor: &DescriptorConfig) -> Result<(), String> {
        match self {
            Self::Recurrent(m) => m.check(descriptor),
            Self::Feedback(m) => m.check(),
            Self::Autoregressive(m) => m.check(),
        }
    }
}

impl ModelState {
    /// Forgets the motion, not the body.
    pub fn reset(&mut self) {
        match self {
            Self::Recurrent(s) => s.regressor.reset(),
            Self::Feedback(s) => s.reset(),
            Self::Autoregressive(s) => s.reset(),
        }
    }
    /// Takes over what another state of the same model and body remembers. Allocates nothing. Panics if it is another
    /// model's.
    pub(crate) fn remember(&mut self, other: &Self) {
        match (self, other) {
            (Self::Recurrent(s), Self::Recurrent(other)) => s.regressor.remember(&other.regressor),
            (Self::Feedback(s), Self::Feedback(other)) => s.remember(other),
            (Self::Autoregressive(s), Self::Autoregressive(other)) => s.remember(other),
            _ => panic!("the state belongs to another kind of model"),
        }
    }
    /// Whether what it remembers is finite.
    pub fn is_finite(&self) -> bool {
        match self {
            Self::Recurrent(s) => s.regressor.is_finite(),
            Self::Feedback(s) => s.is_finite(),
            Self::Autoregressive(s) => s.is_finite(),
        }
    }
    /// What the basis of the deltas is multiplied by, `[K]`.
    pub(crate) fn coefficients(&self) -> Option<&[f32]> {
        match self {
            Self::Recurrent(s) => Some(s.scratch.coefficients()),
            Self::Feedback(_) => None,
            Self::Autoregressive(s) => Some(s.decoded()),
        }
    }
    /// The few numbers behind the newest deltas.
    pub fn latent(&self) -> &[f32] {
        match self {
            Self::Recurrent(s) => s.regressor.latent(),
            Self::Feedback(s) => s.latent(),
            Self::Autoregressive(s) => s.coefficients(),
        }
    }
}

impl Model {
    /// Bytes of weights that a frame of this body reads.
    pub(crate) fn weight_bytes(&self, state: &ModelState) -> usize {
        let basis = self.basis().map_or(0, |b| size_of_val(&b.mean[..]) + b.directions.bytes_of_sums());
        let networks = match (self, state) {
            (Self::Recurrent(m), ModelState::Recurrent(s)) => {
                let units = m.subspace.decoder.units.iter().flat_map(|u| [&u.inner, &u.outer]);
                let layers = units.chain([&m.subspace.decoder.lift]).map(|l| l.weight.bytes());
                let recurrent = m.regressor.recurrent.as_ref();
                let gru = recurrent.map(|r| r.gru.w_ih.bytes() + r.gru.w_hh.bytes() + r.readout.weight.bytes());
                let encoder = m.pose_encoder.iter().flat_map(|e| &e.layers).map(|l| l.weight.bytes());
                layers.chain(gru).chain(encoder).sum::<usize>() + s.regressor.shortcut_bytes()
            }
            (Self::Feedback(m), ModelState::Feedback(s)) => {
                let person = &m.people[s.person()];
                let layers = person.encoder.0.iter().chain([&person.hidden, &person.output]);
                layers.map(|l| l.weight.bytes()).sum()
            }
            (Self::Autoregressive(_), ModelState::Autoregressive(s)) => s.weight_bytes(),
            _ => panic!("the state belongs to another kind of model"),
        };
        basis + networks
    }
}

impl RecurrentModel {
    fn start(&self, beta: &[f32]) -> RecurrentState {
        RecurrentState { regressor: self.regressor.start(beta), scratch: self.subspace.scratch() }
    }

    fn predict(&self, features: &[f32], state: &mut RecurrentState, watch: &mut impl Watch) -> usize {
        let clipped = self.regressor.step(features, &mut state.regressor);
        watch.lap(StepPart::Regressor);
        self.subspace.lift(state.regressor.latent(), &mut state.scratch);
        watch.lap(StepPart::Decoder);
        clipped
    }

    fn check(&self, descriptor: &DescriptorConfig) -> Result<(), String> {
        let Self { regressor, subspace, pose_encoder } = self;
        check_subspace(subspace)?;
        match (pose_encoder, descriptor.features == FeatureKind::DisentangledPose) {
            (Some(_), false) => {
                return Err("it has a pose encoder that its features do not use; export it again".into());
            }
            (None, true) => return Err("its pose encoder is missing; export it again".into()),
            _ => {}
        }
        check_regressor(regressor)?;
        fits("regressor and decoder, latent", &[regressor.latent_count()], &[subspace.latent_count()])?;
        let Some(bank) = &regressor.bank else { return Ok(()) };
        fits("resonator bank, channels", &[bank.channels().min(regressor.feature_count())], &[bank.channels()])?;
        if bank.fps() != descriptor.fps {
            return Err(format!(
                "its resonators are for {} frames a second, its features for {}; export it again",
                bank.fps(),
                descriptor.fps
            ));
        }
        Ok(())
    }
}

fn check_subspace(subspace: &Subspace) -> Result<(), String> {
    let (k, l) = (subspace.components(), subspace.latent_count());
    let basis = &subspace.basis;
    fits("basis", &[basis.mean.len()], &[3 * subspace.vertex_count()])?;
    for (what, width) in [("components", k), ("latent numbers", l)] {
        if !(1..=LARGEST_WIDTH).contains(&width) {
            return Err(format!("it has {width} {what}, expected 1 to {LARGEST_WIDTH}; export it again"));
        }
    }
    fits("basis directions", &[basis.directions.cols()], &[basis.mean.len()])?;
    fits("coefficient mean", &[basis.coefficient_mean.len()], &[k])?;
    check_linear("decoder.lift", &subspace.decoder.lift, l, k)?;
    check_linear("encoder.project", &subspace.encoder.project, k, l)?;
    for unit in subspace.encoder.units.iter().chain(&subspace.decoder.units) {
        check_linear("residual unit, inner", &unit.inner, k, unit.inner_width())?;
        check_linear("residual unit, outer", &unit.outer, unit.inner_width(), k)?;
    }
    Ok(())
}

fn check_regressor(regressor: &Regressor) -> Result<(), String> {
    regressor.input.check()?;
    regressor.shape.check()?;
    let (d, b, l) = (regressor.feature_count(), regressor.shape_count(), regressor.latent_count());
    let a = regressor.memory_count();
    let widest = [d, a, b, regressor.input.input_size, regressor.shape.input_size].into_iter().max().unwrap_or(0);
    if widest > LARGEST_WIDTH {
        return Err(format!("its regressor has {widest} inputs, expected at most {LARGEST_WIDTH}; export it again"));
    }
    let (terms, power) = MOST_TERMS;
    let rows = &regressor.shape_terms;
    if rows.len() > terms || rows.iter().any(|row| row.len() > b || row.iter().any(|p| *p > power)) {
        return Err(format!(
            "its shape terms are more than {terms}, name a shape input past {b} or a power above {power}; export it again"
        ));
    }
    regressor.mass.check()?;
    check_linear("shortcut", &regressor.shortcut, rows.len() * a + b, l)?;
    if let Some(recurrent) = &regressor.recurrent {
        let h = recurrent.gru.width();
        let gru = &recurrent.gru;
        fits("gru.w_ih", &[gru.w_ih.rows(), gru.w_ih.cols()], &[3 * h, d + b])?;
        fits("gru.w_hh", &[gru.w_hh.rows(), h], &[3 * h, h])?;
        fits("gru biases", &[gru.b_ih.len(), gru.b_hh.len()], &[3 * h, 3 * h])?;
        check_linear("readout", &recurrent.readout, h, l)?;
    }
    if let Some(known) = &regressor.acquaintance {
        if !regressor.sees_features() || regressor.recurrent.is_none() {
            return Err("it mixes a network that it does not have or see features for; export it again".into());
        }
        known.check(d + b, l, regressor.shape.input_size)?;
    }
    Ok(())
}

/// Whether a layer takes and gives as many numbers as it should.
pub(crate) fn check_linear(name: &str, linear: &Linear, inputs: usize, outputs: usize) -> Result<(), String> {
    fits(name, &[linear.outputs(), linear.inputs(), linear.bias.len()], &[outputs, inputs, outputs])
}

/// Whether sizes are those that others ask for.
pub(crate) fn fits(what: &str, found: &[usize], expected: &[usize]) -> Result<(), String> {
    if found == expected {
        return Ok(());
    }
    Err(format!("its {what} has size {found:?}, expected {expected:?}; export it again"))
}
