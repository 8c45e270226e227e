use super::filter::{LowPass, VelocityTrack};
use glam::{Mat3, Vec3};
use softtissue_body::Pose;
use softtissue_geometry::{axis_angle_from_rotation, rotation_from_axis_angle};

/// Velocity and acceleration of the root in its own frame and, where asked for, its angular velocity there: the last
/// terms of SoftSMPL eq. 11, which has them in the world's frame.
#[derive(Clone, Debug)]
pub(super) struct RootFeatures {
    angular_velocity: bool,
    low_pass: LowPass,
    fps: f32,
}

/// Memory of [`RootFeatures`].
#[derive(Clone, Debug, Default)]
pub(super) struct RootState {
    /// Rotation and translation of the frame before; nothing before the first.
    previous: Option<(Mat3, Vec3)>,
    turning: VelocityTrack<Vec3>,
    moving: VelocityTrack<Vec3>,
}

impl RootFeatures {
    pub(super) fn new(angular_velocity: bool, low_pass: LowPass, fps: f32) -> Self {
        Self { angular_velocity, low_pass, fps }
    }
    pub(super) fn sizes(&self) -> Vec<(&'static str, usize)> {
        let mut sizes = vec![("root-velocity", 3), ("root-acceleration", 3)];
        if self.angular_velocity {
            sizes.push(("root-angular-velocity", 3));
        }
        sizes
    }
    /// One frame; `out` is as long as the sum of [`sizes`](Self::sizes).
    pub(super) fn step(&self, state: &mut RootState, pose: Pose, out: &mut [f32]) {
        let rotation = rotation_from_axis_angle(pose.rotations[0]);
        let (mut turning, mut velocity, mut acceleration) = (Vec3::ZERO, Vec3::ZERO, Vec3::ZERO);
        if let Some((before, from)) = state.previous {
            let turn = axis_angle_from_rotation(before.transpose() * rotation);
            (turning, _) = self.low_pass.step(&mut state.turning, turn * self.fps, self.fps);
            let moved = (pose.translation - from) * self.fps;
            (velocity, acceleration) = self.low_pass.step(&mut state.moving, moved, self.fps);
        }
        state.previous = Some((rotation, pose.translation));
        let root_from_world = rotation.transpose();
        (root_from_world * velocity).write_to_slice(out);
        (root_from_world * acceleration).write_to_slice(&mut out[3..]);
        if self.angular_velocity {
            turning.write_to_slice(&mut out[6..]);
        }
    }
}
