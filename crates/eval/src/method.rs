use crate::{MethodError, Result};
use glam::Vec3;
use softtissue_clips::MotionClip;
use softtissue_geometry::Frames;

/// How long one frame of an animation took.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FrameTime {
    /// Seconds of the parts that the method has, in the order in which a frame runs through them.
    pub parts: Vec<(&'static str, f64)>,
    /// Seconds of the whole.
    pub whole_s: f64,
}

/// Anything that predicts soft tissue from a motion: a learned model, a baseline, a player of bundles.
/// Evaluation knows it by this trait alone.
pub trait Method: Sync {
    /// Name in `metrics.json`, e.g. `softtissue` or `ar2-subject`; a variant follows a slash.
    fn name(&self) -> &str;
    /// Whether only the main source of pose is of interest: nothing would be learned from others.
    fn main_channel_only(&self) -> bool {
        false
    }
    /// Free rollout from zero state: deltas `[T, V, 3]` in metres, one frame for every frame of `motion`.
    /// `subject` names the person for methods that were fitted to one, `beta` is the shape.
    fn rollout(&self, subject: &str, beta: &[f32], motion: &MotionClip) -> Result<Frames, MethodError>;
    /// The same, frame by frame into `sink`, for rollouts too long to keep. The default keeps the whole rollout:
    /// 12 bytes a vertex and frame.
    fn rollout_each(
        &self,
        subject: &str,
        beta: &[f32],
        motion: &MotionClip,
        sink: &mut dyn FnMut(&[Vec3]),
    ) -> Result<(), MethodError> {
        self.rollout(subject, beta, motion)?.iter().for_each(sink);
        Ok(())
    }
    /// The wall-clock time of each of `frames` frames of an animation, the motion played over and over from its start, on
    /// the thread that asks. Empty for a method that is no player.
    fn frame_times(
        &self,
        _subject: &str,
        _beta: &[f32],
        _motion: &MotionClip,
        _frames: usize,
    ) -> Result<Vec<FrameTime>, MethodError> {
        Ok(vec![])
    }
}

/// The zero baseline: the body model alone, `D = 0`.
pub struct BodyAlone {
    /// Vertices `V`.
    pub vertex_count: usize,
}

impl Method for BodyAlone {
    fn name(&self) -> &str {
        "body"
    }
    fn main_channel_only(&self) -> bool {
        true
    }
    fn rollout(&self, _: &str, _: &[f32], motion: &MotionClip) -> Result<Frames, MethodError> {
        Ok(Frames::zeros(self.vertex_count, motion.len()))
    }
}

/// Something that reconstructs deltas from a few numbers a frame: PCA or an autoencoder at one latent size.
pub trait Codec: Sync {
    /// Encodes and decodes every frame of `[T, V, 3]` deltas in metres. `subject` names the person for codecs that were
    /// learned from one.
    fn reconstruct(&self, subject: &str, deltas: &Frames) -> Result<Frames, MethodError>;
}
