use super::FeatureBlock;
use super::filter::{LowPass, VelocityTrack};
use super::root::{RootFeatures, RootState};
use glam::{Mat3, Vec3};
use softtissue_body::Pose;
use softtissue_geometry::{axis_angle_from_rotation, rotation_from_axis_angle};

/// Rotations of the joints below the root, their backward differences, and the root's motion in its own frame.
#[derive(Clone, Debug)]
pub(super) struct PoseFeatures {
    joints: usize,
    root: RootFeatures,
    low_pass: LowPass,
    fps: f32,
}

/// Memory of [`PoseFeatures`].
#[derive(Clone, Debug)]
pub(super) struct PoseState {
    /// Of the joints below the root.
    previous: Vec<Mat3>,
    tracks: Vec<VelocityTrack<Vec3>>,
    root: RootState,
    started: bool,
}

impl PoseFeatures {
    pub(super) fn new(joints: usize, root: RootFeatures, low_pass: LowPass, fps: f32) -> Self {
        Self { joints, root, low_pass, fps }
    }
    pub(super) fn blocks(&self) -> Vec<FeatureBlock> {
        let n = 3 * (self.joints - 1);
        let mut sizes = vec![("rotations", n), ("angular-velocities", n), ("angular-accelerations", n)];
        sizes.extend(self.root.sizes());
        FeatureBlock::in_a_row(&sizes)
    }
    pub(super) fn state(&self) -> PoseState {
        PoseState {
            previous: vec![Mat3::IDENTITY; self.joints - 1],
            tracks: vec![VelocityTrack::default(); self.joints - 1],
            root: RootState::default(),
            started: false,
        }
    }
    pub(super) fn step(&self, state: &mut PoseState, pose: Pose, out: &mut [f32]) {
        let n = 3 * (self.joints - 1);
        for (j, w) in pose.rotations[1..].iter().enumerate() {
            let rotation = rotation_from_axis_angle(*w);
            // Angular velocity from the relative rotation: no jump where an axis angle wraps.
            let (velocity, acceleration) = if state.started {
                let turn = axis_angle_from_rotation(state.previous[j].transpose() * rotation);
                self.low_pass.step(&mut state.tracks[j], turn * self.fps, self.fps)
            } else {
                (Vec3::ZERO, Vec3::ZERO)
            };
            state.previous[j] = rotation;
            axis_angle_from_rotation(rotation).write_to_slice(&mut out[3 * j..]);
            velocity.write_to_slice(&mut out[n + 3 * j..]);
            acceleration.write_to_slice(&mut out[2 * n + 3 * j..]);
        }
        state.started = true;
        self.root.step(&mut state.root, pose, &mut out[3 * n..]);
    }
}
