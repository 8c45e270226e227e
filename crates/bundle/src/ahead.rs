use crate::detail::Part;
use crate::{Model, ModelState};
use glam::Vec3;

/// A look at the model's next frame, so that what is shown between two frames lies between their deltas and comes no later
/// than on a frame. The features are taken to change on as they did: what they are is settled by poses that are still to come,
/// but flesh answers within a frame little to what happens in it.
#[derive(Clone, Debug)]
pub(crate) struct Ahead {
    /// Features of the frame before the newest, `[D]`.
    before: Vec<f32>,
    /// Of the next one.
    features: Vec<f32>,
    state: ModelState,
    /// Of the next one, `[V]`.
    deltas: Vec<Vec3>,
    /// Whether the next one has been looked at.
    known: bool,
}

impl Ahead {
    pub(crate) fn new(model: &Model, state: &ModelState) -> Self {
        let (d, v) = (model.feature_count(), model.vertex_count());
        let (before, features) = (vec![0.0; d], vec![0.0; d]);
        Self { before, features, state: state.clone(), deltas: vec![Vec3::ZERO; v], known: false }
    }
    /// A new frame begins: `features` are those of the one before it.
    pub(crate) fn begin(&mut self, features: &[f32]) {
        self.before.copy_from_slice(features);
        self.known = false;
    }
    /// The features to come, unless they have been asked for in this frame already.
    pub(crate) fn features(&mut self, newest: &[f32]) -> Option<&[f32]> {
        if std::mem::replace(&mut self.known, true) {
            return None;
        }
        let change = self.before.iter().zip(newest);
        self.features.iter_mut().zip(change).for_each(|(next, (before, now))| *next = 2.0 * now - before);
        Some(&self.features)
    }
    /// Runs the model once more on what it remembers. Without a finite result the newest deltas last.
    pub(crate) fn look(&mut self, model: &Model, state: &ModelState, newest: &[Vec3], detail: Option<&Part>) {
        self.state.remember(state);
        model.step_part(&self.features, &mut self.state, bytemuck::cast_slice_mut(&mut self.deltas), detail);
        if let Some(part) = detail {
            part.hold(&mut self.deltas);
        }
        if !self.deltas.iter().all(|d| d.is_finite()) {
            self.deltas.copy_from_slice(newest);
        }
    }
    /// What was seen.
    pub(crate) fn deltas(&self) -> &[Vec3] {
        &self.deltas
    }
}
