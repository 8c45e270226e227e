use crate::TrainError;
use std::collections::BTreeMap;

/// What one step reports. The step only computes; the loop logs, saves and stops.
#[derive(Clone, Debug, PartialEq)]
pub struct StepStats {
    /// Loss of the batch.
    pub loss: f64,
    /// Its terms by name.
    pub terms: Vec<(&'static str, f64)>,
    /// Learning rate of the step.
    pub learning_rate: f64,
}

/// A named f32 array of a trainee's state.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedArray {
    /// Unique name, e.g. `decoder.lift.weight` or `adam.first.decoder.lift.weight`.
    pub name: String,
    /// Shape.
    pub shape: Vec<usize>,
    /// Row-major data.
    pub data: Vec<f32>,
}

/// Arrays by name.
pub type State = BTreeMap<String, NamedArray>;

/// Something that learns by steps.
pub trait Trainee {
    /// Computes step `step` (counted from 0): draws its batch from a counter, updates weights and optimiser.
    /// A function of the state and `step` alone.
    fn step(&mut self, step: u64) -> Result<StepStats, TrainError>;
    /// Error on validation clips, mm; lower is better. Does not change the state.
    fn validate(&mut self) -> Result<f64, TrainError>;
    /// Everything needed to continue to the same bytes: weights and optimiser moments.
    fn state(&self) -> Vec<NamedArray>;
    /// Takes a state back. A missing array or another shape is an error.
    fn load_state(&mut self, state: &State) -> Result<(), TrainError>;
}
