use super::FeatureBlock;
use super::filter::{LowPass, VelocityTrack};
use glam::{Mat3, Vec3};
use softtissue_body::Pose;
use softtissue_geometry::{axis_angle_from_rotation, rotation_from_axis_angle};

/// Rotations of the joints below the root, their backward differences, and the root's motion in its own frame.
#[derive(Clone, Debug)]
pub(super) struct PoseFeatures {
    joints: usize,
    root_angular_velocity: bool,
    low_pass: LowPass,
    fps: f32,
}

/// Memory of [`PoseFeatures`].
#[derive(Clone, Debug)]
pub(super) struct PoseState {
    previous: Vec<Mat3>,
    tracks: Vec<VelocityTrack>,
    previous_translation: Vec3,
    root: VelocityTrack,
    started: bool,
}

impl PoseFeatures {
    pub(super) fn new(joints: usize, root_angular_velocity: bool, low_pass: LowPass, fps: f32) -> Self {
        Self { joints, root_angular_velocity, low_pass, fps }
    }
    pub(super) fn blocks(&self) -> Vec<FeatureBlock> {
        let n = 3 * (self.joints - 1);
        let mut sizes = vec![
            ("rotations", n),
            ("angular-velocities", n),
            ("angular-accelerations", n),
            ("root-velocity", 3),
            ("root-acceleration", 3),
        ];
        if self.root_angular_velocity {
            sizes.push(("root-angular-velocity", 3));
        }
        FeatureBlock::in_a_row(&sizes)
    }
    pub(super) fn state(&self) -> PoseState {
        PoseState {
            previous: vec![Mat3::IDENTITY; self.joints],
            tracks: vec![VelocityTrack::default(); self.joints],
            previous_translation: Vec3::ZERO,
            root: VelocityTrack::default(),
            started: false,
        }
    }
    pub(super) fn step(&self, state: &mut PoseState, pose: Pose, out: &mut [f32]) {
        let n = 3 * (self.joints - 1);
        let mut root_turning = Vec3::ZERO;
        for j in 0..self.joints {
            let rotation = rotation_from_axis_angle(pose.rotations[j]);
            // Angular velocity from the relative rotation: no jump where an axis angle wraps.
            let (velocity, acceleration) = if state.started {
                let turn = axis_angle_from_rotation(state.previous[j].transpose() * rotation);
                self.low_pass.step(&mut state.tracks[j], turn * self.fps, self.fps)
            } else {
                (Vec3::ZERO, Vec3::ZERO)
            };
            state.previous[j] = rotation;
            if j == 0 {
                root_turning = velocity;
                continue;
            }
            let at = 3 * (j - 1);
            axis_angle_from_rotation(rotation).write_to_slice(&mut out[at..]);
            velocity.write_to_slice(&mut out[n + at..]);
            acceleration.write_to_slice(&mut out[2 * n + at..]);
        }
        let (velocity, acceleration) = if state.started {
            let velocity = (pose.translation - state.previous_translation) * self.fps;
            self.low_pass.step(&mut state.root, velocity, self.fps)
        } else {
            (Vec3::ZERO, Vec3::ZERO)
        };
        state.previous_translation = pose.translation;
        state.started = true;
        let root_from_world = state.previous[0].transpose();
        (root_from_world * velocity).write_to_slice(&mut out[3 * n..]);
        (root_from_world * acceleration).write_to_slice(&mut out[3 * n + 3..]);
        if self.root_angular_velocity {
            root_turning.write_to_slice(&mut out[3 * n + 6..]);
        }
    }
}
