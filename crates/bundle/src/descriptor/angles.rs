use super::FeatureBlock;
use super::filter::{LowPass, VelocityTrack};
use glam::Vec3;
use softtissue_body::Pose;
use softtissue_geometry::rotation_from_axis_angle;
use std::f32::consts::{PI, TAU};

/// The pose as Casas and Otaduy (2018) feed it to their regressor: the axis angles of all joints, the root's among
/// them, and the root's translation: 75 numbers for 24 joints.
///
/// The translation stands as velocity, in the root's frame: a person who faces another way moves alike. Of the axis
/// angles that mean the same rotation, the one nearest the frame before is taken, so that an angle passing half a turn
/// does not jump; none is longer than a full turn.
#[derive(Clone, Debug)]
pub(super) struct AngleFeatures {
    joints: usize,
    root_position: bool,
    low_pass: LowPass,
    fps: f32,
}

/// Memory of [`AngleFeatures`].
#[derive(Clone, Debug)]
pub(super) struct AngleState {
    previous: Vec<Vec3>,
    translation: Vec3,
    root: VelocityTrack<Vec3>,
    started: bool,
}

impl AngleFeatures {
    pub(super) fn new(joints: usize, root_position: bool, low_pass: LowPass, fps: f32) -> Self {
        Self { joints, root_position, low_pass, fps }
    }
    pub(super) fn blocks(&self) -> Vec<FeatureBlock> {
        let root = if self.root_position { "root-position" } else { "root-velocity" };
        FeatureBlock::in_a_row(&[("angles", 3 * self.joints), (root, 3)])
    }
    pub(super) fn state(&self) -> AngleState {
        AngleState {
            previous: vec![Vec3::ZERO; self.joints],
            translation: Vec3::ZERO,
            root: VelocityTrack::default(),
            started: false,
        }
    }
    pub(super) fn step(&self, state: &mut AngleState, pose: Pose, out: &mut [f32]) {
        let (angles, root) = out.split_at_mut(3 * self.joints);
        for ((w, previous), out) in pose.rotations.iter().zip(&mut state.previous).zip(angles.as_chunks_mut::<3>().0) {
            *previous = nearest(*w, *previous);
            *out = previous.to_array();
        }
        let value = if self.root_position {
            pose.translation
        } else if state.started {
            let velocity = (pose.translation - state.translation) * self.fps;
            let velocity = self.low_pass.step(&mut state.root, velocity, self.fps).0;
            rotation_from_axis_angle(pose.rotations[0]).transpose() * velocity
        } else {
            Vec3::ZERO
        };
        value.write_to_slice(root);
        (state.translation, state.started) = (pose.translation, true);
    }
}

/// The axis angle of the same rotation as `w` that is nearest to `previous`, at most a full turn long.
fn nearest(w: Vec3, previous: Vec3) -> Vec3 {
    let length = w.length();
    // Of no turn at all every axis is one.
    if length < 1e-6 {
        return w;
    }
    let axis = w / length;
    // In [-pi, pi), then the turn more or less that lies nearest.
    let angle = (length + PI).rem_euclid(TAU) - PI;
    let along = previous.dot(axis);
    let candidates = [angle, if angle > 0.0 { angle - TAU } else { angle + TAU }];
    let [a, b] = candidates.map(|c| (c - along).abs());
    axis * candidates[usize::from(b < a)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_pass_half_a_turn_without_a_jump_and_never_exceed_a_turn() {
        let axis = Vec3::new(0.6, 0.0, 0.8);
        let mut previous = Vec3::ZERO;
        // Three turns, given as the shortest axis angle, which flips at half a turn.
        for t in 0..=300 {
            let angle = 3.0 * TAU * t as f32 / 300.0;
            let short = (angle + PI).rem_euclid(TAU) - PI;
            let now = nearest(axis * short, previous);
            let same = rotation_from_axis_angle(now).to_cols_array();
            let wanted = rotation_from_axis_angle(axis * angle).to_cols_array();
            assert!(same.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-4), "{t}");
            assert!(now.length() <= TAU + 1e-4);
            // The only jump is the one that a limit of a turn leaves.
            let jump = now.distance(previous);
            assert!(jump < 0.07 || previous.length() > 6.1 || now.length() < 0.07, "{t}: {previous} {now}");
            previous = now;
        }
        let short = Vec3::new(0.0, 0.3, 0.0);
        assert!(nearest(short, Vec3::ZERO).distance(short) < 1e-6);
        assert_eq!(nearest(Vec3::ZERO, axis), Vec3::ZERO);
    }

    #[test]
    fn an_axis_angle_far_beyond_a_turn_is_the_same_rotation() {
        let w = Vec3::new(3.0, -8.0, 2.0);
        let found = nearest(w, Vec3::new(0.1, 0.2, 0.0));
        let (a, b) = (rotation_from_axis_angle(w), rotation_from_axis_angle(found));
        assert!((a - b).to_cols_array().iter().all(|x| x.abs() < 1e-4) && found.length() <= TAU);
    }
}
