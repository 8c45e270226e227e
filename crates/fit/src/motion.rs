use crate::objective::{Objective, check_frame};
use crate::pose_state::PoseState;
use crate::solve::{Solution, Stop, Workspace};
use crate::{FitConfig, FitError, Result};
use softtissue_clips::{ClipId, MotionClip, ScanClip};
use softtissue_geometry::Frames;
use softtissue_monitor::Monitor;

/// A frame whose objective exceeds this many times the last frame's is started again from nothing.
const SUSPICIOUS: f64 = 4.0;

/// Poses of a clip's frames.
#[derive(Clone, Debug)]
pub struct FittedMotion {
    pub(crate) states: Vec<PoseState>,
    /// Objective of each frame, m^2.
    pub values: Vec<f64>,
    /// Trips over the vertices that each frame took by itself.
    pub evaluations: Vec<usize>,
}

impl FittedMotion {
    /// The motion as a clip; axis angles in `[0, pi]`.
    pub fn clip(&self, id: ClipId, fps: f32) -> MotionClip {
        let joints = self.states.first().map_or(0, |s| s.rotations.len());
        let mut rotations = Frames::new(joints);
        self.states.iter().for_each(|s| rotations.push(&s.axis_angles()));
        MotionClip { id, fps, rotations, translations: self.states.iter().map(|s| s.translation).collect() }
    }

    /// Median over frames of the weighted rms distance, metres.
    pub fn median_distance(&self) -> f64 {
        let mut values = self.values.clone();
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).copied().unwrap_or(0.0).sqrt()
    }
}

/// Fits every `stride`-th frame of a clip: the first from nothing, the others from where the motion so far leads.
/// A clip may start anywhere in a motion.
pub fn fit_motion(
    objective: &Objective,
    scan: &ScanClip,
    stride: usize,
    config: &FitConfig,
    monitor: &dyn Monitor,
) -> Result<FittedMotion> {
    if scan.vertices.is_empty() {
        return Err(FitError::Empty(scan.id.clone()));
    }
    let packed = &objective.body.packed;
    let stop = Stop::of(config);
    let mut work = Workspace::new(objective);
    let frames = scan.vertices.len().div_ceil(stride);
    let mut fitted = FittedMotion { states: Vec::with_capacity(frames), values: vec![], evaluations: vec![] };
    let name = scan.id.to_string();
    for t in (0..scan.vertices.len()).step_by(stride) {
        if monitor.should_stop() {
            return Err(FitError::Stopped);
        }
        let frame = scan.vertices.frame(t);
        check_frame(&name, t, frame, packed.vertex_count())?;
        let frame = packed.sorted(frame);
        let solution = next_frame(objective, &fitted, &frame, stop, &mut work);
        fitted.states.push(solution.state);
        fitted.values.push(solution.value);
        fitted.evaluations.push(solution.evaluations);
        monitor.advance(1, &name);
    }
    Ok(fitted)
}

fn next_frame(
    objective: &Objective,
    so_far: &FittedMotion,
    frame: &[glam::Vec3],
    stop: Stop,
    work: &mut Workspace,
) -> Solution {
    let from_nothing =
        |work: &mut Workspace, before| objective.solve(objective.start(frame), before, frame, stop, work);
    let Some(before) = so_far.states.last() else {
        return from_nothing(work, None);
    };
    let start = match so_far.states.len().checked_sub(2) {
        Some(i) => before.extrapolated(&so_far.states[i]),
        None => before.clone(),
    };
    let warm = objective.solve(start, Some(before), frame, stop, work);
    let usual = so_far.values.last().copied().unwrap_or(0.0).max(1e-8);
    if warm.value <= SUSPICIOUS * usual {
        return warm;
    }
    let fresh = from_nothing(work, Some(before));
    let evaluations = warm.evaluations + fresh.evaluations;
    let better = if fresh.value < warm.value { fresh } else { warm };
    Solution { evaluations, ..better }
}
