use burn::tensor::Device;

/// Where a stage of learning runs and what its random draws are named by.
#[derive(Clone, Debug)]
pub struct Stage {
    /// Names the stage's streams of draws, so that two stages of a run draw different batches.
    pub name: String,
    /// The run's seed.
    pub seed: u64,
    /// A device without autodiff.
    pub device: Device,
}

/// What a stage learns from and what it is judged by.
#[derive(Clone, Debug, Default)]
pub struct Clips<T> {
    /// To train.
    pub train: T,
    /// To choose the best state by.
    pub validation: T,
}
