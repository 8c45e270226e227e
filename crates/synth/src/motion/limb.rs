//! Limbs: two-link legs reaching for a foot, arms from angles.
use super::figure::{Figure, SIDE, joint::*};
use super::posture::{Arm, Leg};
use super::track::smooth;
use glam::{DMat3, DQuat, DVec3};

/// Fraction of the leg's length that it extends to; beyond it the heel rises.
pub(crate) const LONGEST_REACH: f64 = 0.99;
/// Heel raise range, radians. Negative values never show: they only start the rise smoothly. Much more than 0.85
/// puts the ankle over the ball, where raising lengthens nothing.
const HEEL: [f64; 2] = [-0.4, 0.85];
/// How far ahead of the ball joint the foot rolls when its heel rises, metres: the pad of the toes.
pub(crate) const ROLL: f64 = 0.04;
/// Share of the heel raise by which the toes of a bearing foot lean on the ground.
const TOE_LEAN: f64 = 0.15;
/// Clearance at which the toes may hang by the full heel raise, metres.
const TOE_CLEARANCE: f64 = 0.12;

/// World orientations of a leg's segments.
pub(crate) struct LegPose {
    pub thigh: DQuat,
    pub shank: DQuat,
    pub foot: DQuat,
    /// Toes relative to the foot.
    pub toes: DQuat,
    /// Heel raise that was used, radians.
    pub heel: f64,
    /// Metres that a planted leg falls short of its foot; 0 where the posture is within reach.
    pub shortfall: f64,
}

/// The two-link problem: knee from hip, ankle and the direction the knee points to.
pub(crate) fn solve_leg(figure: &Figure, side: usize, hip: DVec3, pelvis: DQuat, leg: &Leg) -> LegPose {
    let reach = LONGEST_REACH * figure.leg_length(side);
    let heading = DQuat::from_rotation_y(SIDE[side] * leg.toe_out);
    let ankle_rest = figure.joints[ANKLE[side]] - figure.joints[BALL[side]] - DVec3::Z * ROLL;
    let mut pad = leg.ball + DVec3::Y * figure.ball_height(side) + heading * DVec3::Z * ROLL;
    let ankle_at = |heel: f64, pad: DVec3| pad + heading * (DQuat::from_rotation_x(heel) * ankle_rest);
    let need = heel_for_reach(|heel| ankle_at(heel, pad).distance(hip) - reach);
    let heel = smooth_max(leg.heel, need, 0.2);
    let mut shortfall = (ankle_at(heel, pad).distance(hip) - reach).max(0.0);
    if !leg.planted {
        pad += (hip - ankle_at(heel, pad)).normalize() * shortfall;
        shortfall = 0.0;
    }
    let mut foot = heading * DQuat::from_rotation_x(heel);
    let mut ankle = ankle_at(heel, pad);
    let mut forward = heading * DVec3::Z + 0.5 * (pelvis * DVec3::Z);
    let clearance = pad.y - figure.ball_height(side);
    let mut toes = -heel * (1.0 - TOE_LEAN) * (1.0 - smooth(clearance / TOE_CLEARANCE));
    if leg.lifted > 0.0 {
        let out = pelvis * DQuat::from_rotation_z(SIDE[side] * leg.lift.out);
        let [thigh, shank] =
            [-leg.lift.hip, leg.lift.knee - leg.lift.hip].map(|pitch| out * DQuat::from_rotation_x(pitch));
        let lifted_ankle = hip - thigh * DVec3::Y * figure.thigh(side) - shank * DVec3::Y * figure.shank(side);
        ankle = ankle.lerp(lifted_ankle, leg.lifted);
        foot = foot.slerp(shank * DQuat::from_rotation_x(leg.lift.foot), leg.lifted);
        forward = forward.normalize().lerp(thigh * DVec3::Z, leg.lifted);
        toes *= 1.0 - leg.lifted;
    }
    let (thigh, shank) = two_links(figure, side, hip, ankle, forward, reach);
    LegPose { thigh, shank, foot, toes: DQuat::from_rotation_x(toes), heel, shortfall }
}

/// Thigh and shank orientations that put the ankle at `ankle` (or as near as `reach` allows).
fn two_links(figure: &Figure, side: usize, hip: DVec3, ankle: DVec3, forward: DVec3, reach: f64) -> (DQuat, DQuat) {
    let (a, b) = (figure.thigh(side), figure.shank(side));
    let line = ankle - hip;
    let d = line.length().clamp((a - b).abs() + 0.02, reach);
    let along = line.normalize();
    let front = (forward - along * forward.dot(along)).normalize();
    let x = (a * a - b * b + d * d) / (2.0 * d);
    let knee = hip + along * x + front * (a * a - x * x).max(0.0).sqrt();
    let hinge = along.cross(front);
    let [h, k, f] = [HIP, KNEE, ANKLE].map(|j| figure.joints[j[side]]);
    let rest_hinge = (f - h).normalize().cross(DVec3::Z);
    let turn = |rest: DVec3, posed: DVec3| frame(posed, hinge) * frame(rest, rest_hinge).inverse();
    (turn(k - h, knee - hip), turn(f - k, hip + along * d - knee))
}

/// The orientation whose x axis is `axis` and whose y axis is the part of `other` across it.
fn frame(axis: DVec3, other: DVec3) -> DQuat {
    let x = axis.normalize();
    let y = (other - x * other.dot(x)).normalize();
    DQuat::from_mat3(&DMat3::from_cols(x, y, x.cross(y)))
}

/// The heel raise at which `excess` (metres beyond reach, falling with the raise) vanishes, within [`HEEL`].
fn heel_for_reach(excess: impl Fn(f64) -> f64) -> f64 {
    let [mut low, mut high] = HEEL;
    if excess(low) <= 0.0 {
        return low;
    }
    if excess(high) >= 0.0 {
        return high;
    }
    for _ in 0..28 {
        let middle = 0.5 * (low + high);
        if excess(middle) > 0.0 { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

/// Maximum with a corner rounded over `width`; never below the true maximum.
pub(crate) fn smooth_max(a: f64, b: f64, width: f64) -> f64 {
    let h = (1.0 - (a - b).abs() / width).max(0.0);
    a.max(b) + 0.25 * width * h * h
}

/// Local rotations of an arm.
pub(crate) struct ArmPose {
    pub collar: DQuat,
    pub shoulder: DQuat,
    pub elbow: DQuat,
    pub wrist: DQuat,
}

/// Rotations of an arm relative to its parents; independent of where the chest is.
pub(crate) fn solve_arm(figure: &Figure, side: usize, arm: &Arm) -> ArmPose {
    let mirror = |v: DVec3| DVec3::new(SIDE[side] * v.x, v.y, v.z);
    let mirror_turn = |w: DVec3| DVec3::new(w.x, SIDE[side] * w.y, SIDE[side] * w.z);
    let [s, e] = [SHOULDER, ELBOW].map(|j| figure.joints[j[side]]);
    let rest = (e - s).normalize();
    let (sin, cos) = arm.elevation.sin_cos();
    let upper = mirror(DVec3::new(sin * arm.azimuth.cos(), -cos, sin * arm.azimuth.sin()));
    let from_chest = frame(upper, mirror(arm.bend)) * frame(rest, DVec3::Z).inverse();
    // a shoulder blade turns up with a raised arm (scapulo-humeral rhythm)
    let shrug = 0.3 * smooth_max(arm.elevation - 1.2, 0.0, 0.4);
    let collar = DQuat::from_scaled_axis(mirror_turn(arm.collar + DVec3::Z * shrug));
    let hinge = frame(rest, DVec3::Z) * DVec3::Z;
    ArmPose {
        collar,
        shoulder: collar.inverse() * from_chest,
        elbow: DQuat::from_axis_angle(hinge, arm.elbow),
        wrist: DQuat::from_scaled_axis(mirror_turn(arm.wrist)),
    }
}
