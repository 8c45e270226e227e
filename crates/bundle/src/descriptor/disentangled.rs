use super::FeatureBlock;
use super::encoder::{EncoderScratch, PoseEncoder};
use super::filter::{LowPass, VelocityTrack};
use super::root::{RootFeatures, RootState};
use crate::times::{StepPart, Watch};
use softtissue_body::Pose;
use std::sync::Arc;

/// SoftSMPL eq. 11: the learned pose `p`, its first and second backward difference, and the root's motion.
#[derive(Clone, Debug)]
pub(super) struct DisentangledFeatures {
    encoder: Arc<PoseEncoder>,
    root: RootFeatures,
    low_pass: LowPass,
    fps: f32,
}

/// Memory and scratch of [`DisentangledFeatures`].
#[derive(Clone, Debug)]
pub(super) struct DisentangledState {
    previous: Vec<f32>,
    tracks: Vec<VelocityTrack<f32>>,
    root: RootState,
    scratch: EncoderScratch,
    started: bool,
}

impl DisentangledFeatures {
    pub(super) fn new(encoder: Arc<PoseEncoder>, root: RootFeatures, low_pass: LowPass, fps: f32) -> Self {
        Self { encoder, root, low_pass, fps }
    }
    pub(super) fn blocks(&self) -> Vec<FeatureBlock> {
        let n = self.encoder.latent_count();
        let mut sizes = vec![("pose", n), ("pose-velocity", n), ("pose-acceleration", n)];
        sizes.extend(self.root.sizes());
        FeatureBlock::in_a_row(&sizes)
    }
    pub(super) fn state(&self) -> DisentangledState {
        let n = self.encoder.latent_count();
        DisentangledState {
            previous: vec![0.0; n],
            tracks: vec![VelocityTrack::default(); n],
            root: RootState::default(),
            scratch: self.encoder.scratch(),
            started: false,
        }
    }
    pub(super) fn step(&self, state: &mut DisentangledState, pose: Pose, out: &mut [f32], watch: &mut impl Watch) {
        let n = self.encoder.latent_count();
        let (p, rest) = out.split_at_mut(n);
        self.encoder.apply(pose.rotations, &mut state.scratch, p);
        watch.lap(StepPart::PoseEncoder);
        for (k, track) in state.tracks.iter_mut().enumerate() {
            let (velocity, acceleration) = match state.started {
                true => self.low_pass.step(track, (p[k] - state.previous[k]) * self.fps, self.fps),
                false => (0.0, 0.0),
            };
            (rest[k], rest[n + k]) = (velocity, acceleration);
        }
        state.previous.copy_from_slice(p);
        state.started = true;
        self.root.step(&mut state.root, pose, &mut rest[2 * n..]);
    }
}
