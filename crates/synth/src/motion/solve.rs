use super::figure::{Figure, JOINTS, joint::*};
use super::limb::{solve_arm, solve_leg};
use super::posture::Posture;
use glam::{DQuat, DVec3};

/// A posture made into joints.
#[derive(Clone, Debug)]
pub(crate) struct Solved {
    /// Rotations relative to the parents.
    pub local: [DQuat; JOINTS],
    /// SMPL's `trans`.
    pub translation: DVec3,
    /// World centre of mass.
    pub mass: DVec3,
    /// Heel raise of each foot.
    pub heel: [f64; 2],
    /// Metres by which planted legs miss their feet, the larger of the two.
    pub shortfall: f64,
}

/// Finds the root that satisfies the posture's pelvis and centre of mass, with the feet where they belong.
///
/// Fixed-point iteration on the pelvis: moving it moves the centre of mass by 0.7-1 of the step while the feet
/// stay, so the error shrinks by at least three each time.
pub(crate) fn solve(figure: &Figure, posture: &Posture) -> Solved {
    let mut local = upper_body(figure, posture);
    let mut pelvis = posture.pelvis;
    let mut solved = with_pelvis(figure, posture, &mut local, pelvis);
    for _ in 0..40 {
        let rules = posture.mass_rules;
        let step = rules * (posture.mass - solved.mass) + (DVec3::ONE - rules) * (posture.pelvis - pelvis);
        // second differences at 60 fps multiply what is left by 1.4e4
        if step.length() < 1e-8 {
            break;
        }
        pelvis += step;
        solved = with_pelvis(figure, posture, &mut local, pelvis);
    }
    solved
}

fn upper_body(figure: &Figure, posture: &Posture) -> [DQuat; JOINTS] {
    let mut local = [DQuat::IDENTITY; JOINTS];
    local[PELVIS] = posture.turn;
    for (j, w) in SPINE.iter().zip(posture.spine) {
        local[*j] = DQuat::from_scaled_axis(w);
    }
    local[NECK] = DQuat::from_scaled_axis(posture.neck);
    local[HEAD] = DQuat::from_scaled_axis(posture.head);
    for side in 0..2 {
        let arm = solve_arm(figure, side, &posture.arms[side]);
        local[COLLAR[side]] = arm.collar;
        local[SHOULDER[side]] = arm.shoulder;
        local[ELBOW[side]] = arm.elbow;
        local[WRIST[side]] = arm.wrist;
        local[HAND[side]] = DQuat::IDENTITY;
    }
    local
}

fn with_pelvis(figure: &Figure, posture: &Posture, local: &mut [DQuat; JOINTS], pelvis: DVec3) -> Solved {
    let mut heel = [0.0; 2];
    let mut shortfall = 0.0f64;
    for side in 0..2 {
        let hip = pelvis + posture.turn * (figure.joints[HIP[side]] - figure.joints[PELVIS]);
        let leg = solve_leg(figure, side, hip, posture.turn, &posture.legs[side]);
        local[HIP[side]] = posture.turn.inverse() * leg.thigh;
        local[KNEE[side]] = leg.thigh.inverse() * leg.shank;
        local[ANKLE[side]] = leg.shank.inverse() * leg.foot;
        local[BALL[side]] = leg.toes;
        heel[side] = leg.heel;
        shortfall = shortfall.max(leg.shortfall);
    }
    let translation = pelvis - figure.joints[PELVIS];
    let (positions, _) = figure.forward(local, translation);
    let mass = figure.centre_of_mass(&positions);
    Solved { local: *local, translation, mass, heel, shortfall }
}
