use crate::held_pose::{axis_angle, turn};
use crate::{Bundle, Player, StepReport};
use glam::{Quat, Vec3};
use softtissue_body::Pose;
use std::ops::Deref;

/// Longer gaps than this, seconds, begin a new motion: what moved before has come to rest or is unknown.
const LONGEST_GAP: f64 = 0.5;
/// A pose that comes within this part of a frame of one of the bundle's frames is that frame's.
const SAME_TIME: f64 = 1e-3;
/// Poses that a motion between two of them is read from.
const KEPT: usize = 4;
/// A pose helps to read the motion between later ones if no time step is this many times another.
const UNEVEN: f64 = 4.0;

/// Where a player's clock stands between two of the bundle's frames, and the poses that it was given.
#[derive(Clone, Debug)]
pub(crate) struct Clock {
    /// Frames since the last one played, in `[-SAME_TIME, 1)`.
    phase: f64,
    /// Rotations of the newest usable poses, newest first, `[KEPT][J]`.
    rotations: [Vec<Quat>; KEPT],
    /// Their translations, as if the root had always been where its last teleport left it.
    translations: [Vec3; KEPT],
    /// Frames from the pose before to each.
    gaps: [f64; KEPT],
    /// Poses known, 0 before the first.
    count: usize,
    /// Seconds that unusable poses were for.
    missed: f64,
    /// Whether the root has jumped since the last frame.
    jumped: bool,
    blend: Vec<Vec3>,
}

impl Clock {
    pub(crate) fn new(joints: usize) -> Self {
        Self {
            phase: 0.0,
            rotations: std::array::from_fn(|_| vec![Quat::IDENTITY; joints]),
            translations: [Vec3::ZERO; KEPT],
            gaps: [0.0; KEPT],
            count: 0,
            missed: 0.0,
            jumped: false,
            blend: vec![Vec3::ZERO; joints],
        }
    }
    pub(crate) fn stop(&mut self) {
        (self.phase, self.count, self.missed, self.jumped) = (0.0, 0, 0.0, false);
    }

    fn push(&mut self, pose: Pose, gap: f64) {
        self.rotations.rotate_right(1);
        self.translations.rotate_right(1);
        self.gaps.rotate_right(1);
        for (q, w) in self.rotations[0].iter_mut().zip(pose.rotations) {
            *q = Quat::from_scaled_axis(*w);
        }
        (self.translations[0], self.gaps[0]) = (pose.translation, gap);
        self.count = (self.count + 1).min(KEPT);
    }

    /// Takes a jump of the root out of what was before it: the root goes on as it moved. Returns the jump.
    fn jump(&mut self, to: Vec3, gap: f64) -> Vec3 {
        let velocity = match self.count {
            0 | 1 => Vec3::ZERO,
            _ => (self.translations[0] - self.translations[1]) / self.gaps[0] as f32,
        };
        let shift = to - (self.translations[0] + gap as f32 * velocity);
        self.translations.iter_mut().for_each(|t| *t += shift);
        shift
    }

    /// The motion `at` frames after the second newest pose as weights of the newest pose, of the third and of the fourth newest:
    /// the polynomial through as many of them as time steps are alike, so that velocities hardly jump where a pose comes in.
    fn weights(&self, at: f64) -> [f32; KEPT - 1] {
        let [last, before, third, _] = self.gaps;
        let alike = |gap: f64| (last / UNEVEN..=last * UNEVEN).contains(&gap);
        let known = match self.count {
            KEPT if alike(before) && alike(third) => 3,
            3.. if alike(before) => 2,
            _ => 1,
        };
        let times = [last, -before, -before - third];
        let mut weights = [0.0; KEPT - 1];
        for (j, weight) in weights.iter_mut().enumerate().take(known) {
            let others = times[..known].iter().enumerate().filter(|(m, _)| *m != j).map(|(_, t)| *t);
            let factor = |t: f64| (at - t) / (times[j] - t);
            *weight = others.chain([0.0]).map(factor).product::<f64>() as f32;
        }
        weights
    }

    /// Makes `blend` the rotations `at` frames after the second newest pose; returns the root's translation.
    fn between(&mut self, at: f64) -> Vec3 {
        let weights = self.weights(at);
        let places = [0, 2, 3];
        for (j, w) in self.blend.iter_mut().enumerate() {
            let from = self.rotations[1][j];
            let parts = places.iter().zip(weights).filter(|(_, weight)| *weight != 0.0);
            let along: Vec3 = parts.map(|(k, weight)| weight * turn(from, self.rotations[*k][j])).sum();
            *w = axis_angle(from * Quat::from_scaled_axis(along));
        }
        let from = self.translations[1];
        places.iter().zip(weights).fold(from, |sum, (k, weight)| sum + weight * (self.translations[*k] - from))
    }
}

impl<B: Deref<Target = Bundle>> Player<B> {
    /// Plays on by `dt` seconds to `pose`, at any frame rate: the bundle's own frames in between see poses on a smooth curve
    /// through the last four, and [`Player::vertices`] shows this pose with the deltas of this time, for which the model looks
    /// ahead to its next frame where there is none. Nothing comes later than on a frame ([`Player::latency`]).
    ///
    /// An unusable pose counts as none: what is shown stays until the next one, which bridges the time. A `dt` that is no
    /// positive number changes nothing; more than half a second without a pose begins a new motion.
    pub fn advance(&mut self, pose: Pose, dt: f32) -> StepReport {
        let (time_ignored, pose_held) = (dt.is_nan() || dt <= 0.0, !self.usable(pose));
        let mut sum = StepReport { time_ignored, pose_held, ..Default::default() };
        if sum.pose_held {
            if !sum.time_ignored && self.clock.count > 0 {
                self.clock.missed += f64::from(dt);
            }
            sum.trust = 0.0;
            return sum;
        }
        if sum.time_ignored {
            sum.trust = self.trust();
            return sum;
        }
        let seconds = std::mem::take(&mut self.clock.missed) + f64::from(dt);
        if seconds > LONGEST_GAP {
            self.reset_motion();
            sum.restarted = true;
        }
        if self.clock.count == 0 {
            sum.add(self.step(pose));
            self.clock.push(pose, 0.0);
            return sum;
        }
        let gap = seconds * f64::from(self.bundle().descriptor.fps);
        if self.is_teleport(pose.translation - self.clock.translations[0], gap as f32) {
            let shift = self.clock.jump(pose.translation, gap);
            self.relocate(shift);
            (self.clock.jumped, sum.teleported, sum.trust) = (true, true, 0.0);
        }
        self.clock.push(pose, gap);
        self.play_between(pose, gap, &mut sum);
        sum
    }

    /// The bundle's frames between the clock's last two poses, and what is shown at the newest.
    fn play_between(&mut self, pose: Pose, gap: f64, sum: &mut StepReport) {
        let end = self.clock.phase + gap;
        let frames = (end + SAME_TIME) as u64;
        let mut on_frame = false;
        for frame in 1..=frames {
            let at = frame as f64 - self.clock.phase;
            on_frame = (gap - at).abs() < SAME_TIME;
            let jumped = std::mem::take(&mut self.clock.jumped);
            let mut report = if on_frame {
                self.step_after(pose, jumped)
            } else {
                let translation = self.clock.between(at);
                let blend = std::mem::take(&mut self.clock.blend);
                let report = self.step_after(Pose { rotations: &blend, translation }, jumped);
                self.clock.blend = blend;
                report
            };
            // Told when it came.
            report.teleported &= !jumped;
            sum.add(report);
        }
        self.clock.phase = end - frames as f64;
        sum.trust = sum.trust.min(self.trust());
        if !on_frame {
            self.show_between(pose, self.clock.phase as f32);
        }
    }

    /// Shows this pose with the deltas this part of a frame after the newest; where the model looks ahead, what the body was
    /// like as long ago.
    fn show_between(&mut self, pose: Pose, part: f32) {
        let delay = self.delay_frames();
        if self.frames > delay as u64 {
            self.answer_at(part);
        }
        if delay == 0 {
            self.shown.rotations.copy_from_slice(pose.rotations);
            (self.shown.translation, self.shown.teleported) = (pose.translation, self.teleported);
        } else if self.frames > delay as u64
            && let Some(next) = self.waiting.front()
        {
            self.shown.set_between(&self.framed, next, part);
        }
        self.posed = false;
    }
}
