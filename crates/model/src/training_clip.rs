use softtissue_clips::ClipId;

/// A clip as the regressors see it: what the motion is and what the flesh did.
#[derive(Clone, Debug, PartialEq)]
pub struct TrainingClip {
    /// Who, what, which take.
    pub id: ClipId,
    /// Shape coefficients of the subject.
    pub beta: Vec<f32>,
    /// Descriptor features before scaling, `[T, D]`.
    pub features: Vec<f32>,
    /// Coefficients of the deltas in the basis, `[T, K]`, metres.
    pub coefficients: Vec<f32>,
    /// Frames `T`.
    pub frames: usize,
}

impl TrainingClip {
    /// Features a frame, `D`.
    pub fn feature_count(&self) -> usize {
        self.features.len() / self.frames.max(1)
    }
    /// Coefficients a frame, `K`.
    pub fn coefficient_count(&self) -> usize {
        self.coefficients.len() / self.frames.max(1)
    }
}
