use crate::ModelError;
use glam::Vec3;
use softtissue_body::BodyModel;
use softtissue_geometry::Frames;

/// Anything that predicts deltas from a motion and a shape. It starts from rest and sees no scan.
pub trait Predictor: Sync {
    /// Name in tables and files.
    fn name(&self) -> &str;
    /// Deltas `[T, V, 3]` (metres, rest frame) of a whole motion: rotations `[T, J]`, translations `[T]`. `subject` picks
    /// what a method knows of that person, if it knows anything; `beta` is the person's shape.
    fn rollout(
        &self,
        subject: &str,
        beta: &[f32],
        body: &BodyModel,
        rotations: &Frames,
        translations: &[Vec3],
    ) -> Result<Frames, ModelError>;
}
