//! A start from nothing: the body is set up in many ways and the one that ends nearest the scan is kept.

use super::model::Registrar;
use crate::pose_state::PoseState;
use crate::solve::pull;
use glam::{Quat, Vec3};
use softtissue_body::ShapedBody;
use softtissue_clips::RawFrame;

/// Facings that are tried.
const YAWS: usize = 8;
/// Angles by which arms are lowered from the rest pose, radians.
const LOWERED: [f32; 3] = [0.0, 0.6, 1.2];
/// First round: all candidates, few points, far reach.
const COARSE: Round = Round { points: 500, steps: 6, reach: 0.6, outlier: 0.15 };
/// Second round: the best few.
const FINE: Round = Round { points: 1500, steps: 14, reach: 0.25, outlier: 0.05 };
/// Weight of a joint's squared turn from how it was set up, m^2/rad^2: a foot must not be laid onto the scan heel first.
const SET_UP: f64 = 3e-5;
/// Candidates in the second round.
const KEPT: usize = 3;

struct Round {
    points: usize,
    steps: usize,
    reach: f32,
    outlier: f32,
}

impl Registrar<'_> {
    /// The pose of a frame that nothing is known of. With `like` its joint angles are tried at every facing, otherwise
    /// rest poses with arms at several heights.
    pub fn start(&self, shaped: &ShapedBody, detail: &[Vec3], scan: &RawFrame, like: Option<&PoseState>) -> PoseState {
        let shapes: Vec<PoseState> = match like {
            Some(like) => vec![like.clone()],
            None => LOWERED.iter().map(|angle| self.with_arms_lowered(*angle)).collect(),
        };
        let mut candidates = Vec::new();
        for shape in &shapes {
            for yaw in 0..YAWS {
                let turn = Quat::from_rotation_y(yaw as f32 * std::f32::consts::TAU / YAWS as f32);
                let mut state = shape.clone();
                state.rotations[0] = turn * state.rotations[0];
                self.stand_on(shaped, scan, &mut state);
                candidates.push(self.approach(shaped, detail, scan, state, &COARSE));
            }
        }
        candidates.sort_by(|a, b| a.1.total_cmp(&b.1));
        let fine =
            candidates.into_iter().take(KEPT).map(|(state, _)| self.approach(shaped, detail, scan, state, &FINE));
        let best = fine.min_by(|a, b| a.1.total_cmp(&b.1));
        best.expect("there are candidates").0
    }

    fn with_arms_lowered(&self, angle: f32) -> PoseState {
        let mut rotations = vec![Quat::IDENTITY; self.parents.len()];
        for (name, sign) in [("left_shoulder", -1.0), ("right_shoulder", 1.0)] {
            if let Some(j) = self.body.skeleton.index(name) {
                rotations[j] = Quat::from_rotation_z(sign * angle);
            }
        }
        PoseState { rotations, translation: Vec3::ZERO }
    }

    /// Moves the body so that its middle and its lowest part are the scan's; a hundredth of the points may stray.
    fn stand_on(&self, shaped: &ShapedBody, scan: &RawFrame, state: &mut PoseState) {
        let body = self.posed(shaped, state, &vec![Vec3::ZERO; shaped.vertices.len()]);
        let (theirs, ours) = (place(&scan.points), place(&body.vertices));
        state.translation += theirs - ours;
    }

    /// A few steps towards the scan, and how far from it the body then is: the mean over points of what outliers leave.
    fn approach(
        &self,
        shaped: &ShapedBody,
        detail: &[Vec3],
        scan: &RawFrame,
        mut state: PoseState,
        round: &Round,
    ) -> (PoseState, f32) {
        let stride = scan.points.len().div_ceil(round.points).max(1);
        let asked = scan.points.len().div_ceil(stride) as f32;
        let mut cost = f32::MAX;
        let set_up = state.clone();
        for step in 0..=round.steps {
            let posed = self.posed(shaped, &state, detail);
            let pairs = self.pairs(&posed, scan, stride, round.reach, round.outlier);
            cost = 1.0 - pairs.iter().map(|p| p.weight).sum::<f32>() / asked;
            if step < round.steps {
                let mut normal = self.normal(&posed, &pairs, None);
                pull(&mut normal, &posed.kinematics, &state.turn_since(&set_up), |_| SET_UP, 1);
                state = self.step(&normal, &posed, &state).0;
            }
        }
        (state, cost)
    }
}

/// Middle in x and z, low end in y, a hundredth of the points cut off at each end.
fn place(points: &[Vec3]) -> Vec3 {
    let at = |axis: usize, share: f32| {
        let mut values: Vec<f32> = points.iter().map(|p| p[axis]).collect();
        let i = ((values.len() - 1) as f32 * share) as usize;
        *values.select_nth_unstable_by(i, f32::total_cmp).1
    };
    let middle = |axis: usize| 0.5 * (at(axis, 0.01) + at(axis, 0.99));
    Vec3::new(middle(0), at(1, 0.01), middle(2))
}
