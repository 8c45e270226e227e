//! The seam between a subject's pose objective and what minimises it over a clip.

use crate::motion::{FittedMotion, fit_motion};
use crate::objective::{Objective, check_frame};
use crate::pose_state::PoseState;
use crate::solve::{Stop, Workspace};
use crate::{FitConfig, FitError, ObjectiveKind, Result};
use glam::Vec3;
use softtissue_body::{BodyModel, Pose, ShapedBody};
use softtissue_clips::ScanClip;
use softtissue_geometry::Frames;
use softtissue_monitor::Monitor;

/// One subject's pose objective with everything that it was made of, for solvers with arithmetic of their own.
#[derive(Clone, Copy, Debug)]
pub struct PoseProblem<'a> {
    /// The body.
    pub body: &'a BodyModel,
    /// The subject's shape.
    pub shaped: &'a ShapedBody,
    /// Static detail on it, `[V]`, metres.
    pub template: &'a [Vec3],
    /// Weight of each vertex, `[V]`, not normalised.
    pub fit_weight: &'a [f32],
    /// The objective of the above, with its priors.
    pub objective: &'a Objective,
}

/// Poses to start from, one a frame.
#[derive(Clone, Debug)]
pub struct StartPoses {
    /// Axis angles, `[frames, J]`.
    pub rotations: Frames,
    /// Of the root, metres, `[frames]`.
    pub translations: Vec<Vec3>,
}

/// Finds the poses of a clip's frames once the subject is known: minimises over the frames the sum of the distances,
/// of the joints' turns from rest and of their turns since the frame before, each with its weight.
pub trait PoseSolver: Sync {
    /// The poses of all frames and the objective of each. Calls `advance` with the frames done, and ends in
    /// [`FitError::Stopped`] where the monitor asks to stop.
    fn solve_clip(&self, problem: &PoseProblem, scan: &ScanClip, monitor: &dyn Monitor) -> Result<FittedMotion>;
}

/// The built-in solver: [`fit_motion`], frame after frame, the frame before held.
#[derive(Clone, Copy, Debug)]
pub struct LevenbergMarquardt<'a>(pub &'a FitConfig);

impl PoseSolver for LevenbergMarquardt<'_> {
    fn solve_clip(&self, problem: &PoseProblem, scan: &ScanClip, monitor: &dyn Monitor) -> Result<FittedMotion> {
        fit_motion(problem.objective, scan, 1, self.0, monitor)
    }
}

impl Objective {
    /// In which frame distances are measured.
    pub fn kind(&self) -> ObjectiveKind {
        self.kind
    }

    /// Weight of each joint's squared turn from rest, m^2/rad^2, `[J]`; empty when there is none. The root's counts
    /// for nothing.
    pub fn pose_prior(&self) -> &[f64] {
        &self.pose_prior
    }

    /// Weight of each joint's squared turn since the frame before, m^2/rad^2.
    pub fn smoothness(&self) -> f64 {
        self.smoothness
    }

    /// A pose for every frame from that frame alone: bones, held rigid, laid onto the scan.
    pub fn start_poses(&self, scan: &ScanClip) -> Result<StartPoses> {
        if scan.vertices.is_empty() {
            return Err(FitError::Empty(scan.id.clone()));
        }
        let (packed, name) = (&self.body.packed, scan.id.to_string());
        let mut starts = StartPoses { rotations: Frames::new(packed.joint_count), translations: vec![] };
        for (t, frame) in scan.vertices.iter().enumerate() {
            check_frame(&name, t, frame, packed.vertex_count())?;
            let state = self.start(&packed.sorted(frame));
            starts.rotations.push(&state.axis_angles());
            starts.translations.push(state.translation);
        }
        Ok(starts)
    }

    /// Levenberg-Marquardt on each frame alone, from the pose given for it; nothing is known of the frame before.
    pub fn solve_each(
        &self,
        scan: &ScanClip,
        starts: &StartPoses,
        config: &FitConfig,
        monitor: &dyn Monitor,
    ) -> Result<FittedMotion> {
        let stop = Stop::of(config);
        let mut work = Workspace::new(self);
        let mut fitted = FittedMotion { states: vec![], values: vec![], evaluations: vec![] };
        let name = scan.id.to_string();
        for (t, (frame, translation)) in scan.vertices.iter().zip(&starts.translations).enumerate() {
            if monitor.should_stop() {
                return Err(FitError::Stopped);
            }
            check_frame(&name, t, frame, self.body.packed.vertex_count())?;
            let pose = Pose { rotations: starts.rotations.frame(t), translation: *translation };
            let frame = self.body.packed.sorted(frame);
            let solution = self.solve(PoseState::from_pose(pose), None, &frame, stop, &mut work);
            fitted.states.push(solution.state);
            fitted.values.push(solution.value);
            fitted.evaluations.push(solution.evaluations);
            monitor.advance(1, &name);
        }
        Ok(fitted)
    }
}

impl FittedMotion {
    /// What a solver found: axis angles `[frames, J]`, translations, objective and trips over the vertices of each
    /// frame.
    pub fn new(rotations: &Frames, translations: &[Vec3], values: Vec<f64>, evaluations: Vec<usize>) -> Self {
        let state = |(rotations, translation): (&[Vec3], &Vec3)| {
            PoseState::from_pose(Pose { rotations, translation: *translation })
        };
        Self { states: rotations.iter().zip(translations).map(state).collect(), values, evaluations }
    }
}
