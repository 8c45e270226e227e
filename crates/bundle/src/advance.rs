use crate::{Bundle, Player, StepReport};
use glam::{Quat, Vec3};
use softtissue_body::Pose;
use std::ops::Deref;

/// Longer gaps than this, seconds, begin a new motion: what moved before has come to rest or is unknown.
const LONGEST_GAP: f32 = 0.5;

/// Where a player's clock stands between two of the bundle's frames.
#[derive(Clone, Debug)]
pub(crate) struct Clock {
    /// Frames since the last one played, in `[0, 1)`.
    phase: f64,
    /// The newest usable pose.
    rotations: Vec<Vec3>,
    translation: Vec3,
    blend: Vec<Vec3>,
    running: bool,
}

impl Clock {
    pub(crate) fn new(joints: usize) -> Self {
        let still = vec![Vec3::ZERO; joints];
        Self { phase: 0.0, rotations: still.clone(), translation: Vec3::ZERO, blend: still, running: false }
    }
    pub(crate) fn stop(&mut self) {
        (self.phase, self.running) = (0.0, false);
    }
}

impl<B: Deref<Target = Bundle>> Player<B> {
    /// Plays on by `dt` seconds to `pose`, at any frame rate: the bundle's own frames in between see poses blended from the
    /// last one to this one, and [`Player::vertices`] shows this pose with the newest deltas.
    ///
    /// A `dt` that is no positive number changes nothing; one above half a second begins a new motion.
    pub fn advance(&mut self, pose: Pose, dt: f32) -> StepReport {
        let mut sum = StepReport::default();
        if !self.usable(pose) {
            sum.pose_held = true;
            return sum;
        }
        if dt.is_nan() || dt <= 0.0 {
            sum.time_ignored = true;
            return sum;
        }
        if dt > LONGEST_GAP {
            self.reset_motion();
            sum.restarted = true;
        }
        if !self.clock.running {
            sum.add(self.step(pose));
            self.clock.phase = 0.0;
        } else {
            self.play_between(pose, dt, &mut sum);
            self.show_now(pose);
        }
        self.clock.rotations.copy_from_slice(pose.rotations);
        (self.clock.translation, self.clock.running) = (pose.translation, true);
        sum
    }

    /// The bundle's frames between the clock's pose and this one.
    fn play_between(&mut self, pose: Pose, dt: f32, sum: &mut StepReport) {
        let length = f64::from(dt) * f64::from(self.bundle().descriptor.fps);
        let end = self.clock.phase + length;
        let jumped = self.is_teleport(pose.translation - self.clock.translation, length as f32);
        let mut blend = std::mem::take(&mut self.clock.blend);
        for frame in 1..=end as u64 {
            let part = ((frame as f64 - self.clock.phase) / length) as f32;
            for (b, (from, to)) in blend.iter_mut().zip(self.clock.rotations.iter().zip(pose.rotations)) {
                *b = Quat::from_scaled_axis(*from).slerp(Quat::from_scaled_axis(*to), part).to_scaled_axis();
            }
            let translation =
                if jumped { pose.translation } else { self.clock.translation.lerp(pose.translation, part) };
            sum.add(self.step(Pose { rotations: &blend, translation }));
        }
        self.clock.blend = blend;
        self.clock.phase = end.fract();
    }
}

impl StepReport {
    /// Both, as one.
    fn add(&mut self, other: Self) {
        self.pose_held |= other.pose_held;
        self.teleported |= other.teleported;
        self.features_clipped = self.features_clipped.max(other.features_clipped);
        self.restarted |= other.restarted;
        self.time_ignored |= other.time_ignored;
        self.waiting = other.waiting;
    }
}
