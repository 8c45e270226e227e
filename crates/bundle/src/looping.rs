use crate::held_pose::turn;
use crate::{Bundle, Player, Result, RolloutReport};
use glam::{Quat, Vec3};
use softtissue_body::Pose;
use softtissue_geometry::Frames;
use std::ops::Deref;

/// What it took to close a loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoopReport {
    /// Frames of a round. A last pose that repeats the first one is left out.
    pub frames: usize,
    /// Rounds played before the one that is shown.
    pub rounds: usize,
    /// Largest change of a vertex's delta from the round before the shown one to it, metres: by so much does the last frame
    /// run into another first frame than the shown one.
    pub mismatch_m: f32,
    /// Largest turn of a joint from the last pose to the first, and the largest of any other frame, radians: where the first is
    /// much larger, the motion itself is no loop.
    pub seam: f32,
    /// See `seam`.
    pub largest_turn: f32,
    /// Of the round that is shown.
    pub rollout: RolloutReport,
}

/// Mismatch that a loop is played for, metres.
pub const LOOP_MISMATCH_M: f32 = 1e-4;
/// Longest run-in, seconds, and fewest rounds of it.
const LONGEST_RUN_IN: f32 = 60.0;
const FEWEST_ROUNDS: usize = 2;
/// A last pose nearer to the first than this part of the turns beside it repeats it.
const REPEATED: f32 = 0.25;
/// A step from the last place of the root to the first that is longer than this times any other is none: the motion travels.
const TRAVELS: f32 = 1.5;
/// A turn from the last pose to the first beyond this times any other, and beyond a degree, is no motion's.
const OPEN: f32 = 1.5;

impl LoopReport {
    /// Whether the motion ends where it begins.
    pub fn is_cyclic(&self) -> bool {
        self.seam <= (OPEN * self.largest_turn).max(1f32.to_radians())
    }
    /// Whether the deltas do.
    pub fn is_closed(&self) -> bool {
        self.mismatch_m <= LOOP_MISMATCH_M
    }
}

impl<B: Deref<Target = Bundle>> Player<B> {
    /// Plays a motion, rotations `[T, J]` and translations `[T]`, round and round until each round is like the one before
    /// (within [`LOOP_MISMATCH_M`], or for a minute), and shows the round after that, frame by frame: its last frame runs
    /// into its first one. A motion that travels starts each round where the last one ended. An error of `show` ends the play.
    pub fn play_loop(
        &mut self,
        rotations: &Frames,
        translations: &[Vec3],
        mut show: impl FnMut(usize, &mut Self) -> Result<()>,
    ) -> Result<LoopReport> {
        self.check_motion(rotations, translations)?;
        self.reset();
        let seam = Seam::of(rotations, translations);
        let (frames, delay) = (seam.frames, self.delay_frames());
        let mut report = LoopReport {
            frames,
            rounds: 0,
            mismatch_m: f32::INFINITY,
            seam: seam.turn,
            largest_turn: seam.largest_turn,
            rollout: RolloutReport { frames, ..Default::default() },
        };
        if frames == 0 {
            return Ok(LoopReport { mismatch_m: 0.0, ..report });
        }
        let most = (LONGEST_RUN_IN * self.bundle().descriptor.fps) as usize / frames;
        let most = most.max(FEWEST_ROUNDS);
        let mut round = Frames::zeros(self.deltas().len(), frames);
        // Deltas come `delay` steps after their poses.
        let mut step = 0;
        let mut next = |player: &mut Self, play: &mut dyn FnMut(usize, &mut Self, &crate::StepReport) -> Result<()>| loop {
            let t = step % frames;
            if step > 0 && t == 0 {
                player.relocate(translations[0] - translations[frames - 1] - seam.step);
            }
            let said = player.step(Pose { rotations: rotations.frame(t), translation: translations[t] });
            step += 1;
            if !said.waiting {
                return play((step - 1 - delay) % frames, player, &said);
            }
        };
        for rounds in 1..=most {
            let mut mismatch = 0.0f32;
            for _ in 0..frames {
                next(self, &mut |t, player, _| {
                    mismatch = mismatch.max(renew(round.frame_mut(t), player.deltas()));
                    Ok(())
                })?;
            }
            (report.rounds, report.mismatch_m) = (rounds, mismatch);
            if rounds >= FEWEST_ROUNDS && report.is_closed() {
                break;
            }
        }
        report.mismatch_m = 0.0;
        for _ in 0..frames {
            next(self, &mut |t, player, said| {
                report.mismatch_m = report.mismatch_m.max(renew(round.frame_mut(t), player.deltas()));
                report.rollout.add(t, said);
                show(t, player)
            })?;
        }
        Ok(report)
    }
}

/// Replaces deltas by newer ones; the largest change.
fn renew(kept: &mut [Vec3], deltas: &[Vec3]) -> f32 {
    let change = kept.iter().zip(deltas).map(|(a, b)| a.distance(*b)).fold(0.0, f32::max);
    kept.copy_from_slice(deltas);
    change
}

/// Where a motion's end meets its start.
struct Seam {
    frames: usize,
    /// From the last place of the root to the first of the next round, metres.
    step: Vec3,
    turn: f32,
    largest_turn: f32,
}

impl Seam {
    fn of(rotations: &Frames, translations: &[Vec3]) -> Self {
        let count = translations.len();
        let largest = |a: usize, b: usize| {
            let joints = rotations.frame(a).iter().zip(rotations.frame(b));
            let angle = |(a, b): (&Vec3, &Vec3)| turn(Quat::from_scaled_axis(*a), Quat::from_scaled_axis(*b)).length();
            joints.map(angle).fold(0.0, f32::max)
        };
        if count < 3 {
            let turn = if count == 2 { largest(1, 0) } else { 0.0 };
            return Self { frames: count, step: Vec3::ZERO, turn, largest_turn: 0.0 };
        }
        let beside = largest(0, 1).min(largest(count - 2, count - 1));
        let repeated = largest(count - 1, 0) < REPEATED * beside;
        let frames = count - usize::from(repeated);
        let moves = |t: usize| translations[t + 1] - translations[t];
        let longest = (0..frames - 1).map(|t| moves(t).length()).fold(0.0, f32::max);
        let mut step = translations[0] - translations[frames - 1];
        if step.length() > TRAVELS * longest {
            // Up and down it comes back, along the ground it goes on as it went.
            let mean = 0.5 * (moves(0) + moves(frames - 2));
            step = Vec3::new(mean.x, step.y, mean.z);
        }
        let largest_turn = (0..frames - 1).map(|t| largest(t, t + 1)).fold(0.0, f32::max);
        Self { frames, step, turn: largest(frames - 1, 0), largest_turn }
    }
}
