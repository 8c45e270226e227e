//! Legs that reach for a place: the two-link problem.

use super::figure::{Figure, joint::*};
use glam::{DQuat, DVec3};

/// Longest reach, as a share of the leg.
const LONGEST: f64 = 0.998;
/// Weight of the knee's own axis beside the bend that is there: a straight leg has no bend to tell it.
const OWN_AXIS: f64 = 0.02;

/// Moves an ankle by bending the knee and swinging the leg; the foot keeps its orientation. `thigh` and `shank` are
/// `world_from_rest`; returns how far the ankle stays off, metres.
pub(super) fn reach(
    figure: &Figure,
    side: usize,
    hip: DVec3,
    target: DVec3,
    thigh: &mut DQuat,
    shank: &mut DQuat,
) -> f64 {
    let upper = *thigh * figure.bone(HIP[side], KNEE[side]);
    let lower = *shank * figure.bone(KNEE[side], ANKLE[side]);
    let (a, b) = (upper.length(), lower.length());
    let wanted = target - hip;
    let distance = wanted.length().max((a - b).abs() + 0.02).min((a + b) * LONGEST);
    let bend_of = |d: f64| ((d * d - a * a - b * b) / (2.0 * a * b)).clamp(-1.0, 1.0).acos();
    // knees bend about the x axis of our rest pose
    let axis = (upper.cross(lower) / (a * b) + *thigh * DVec3::X * OWN_AXIS).normalize_or(DVec3::X);
    let bend = bend_of(distance) - bend_of((upper + lower).length());
    let bent = DQuat::from_axis_angle(axis, bend);
    let now = upper + bent * lower;
    let swing = DQuat::from_rotation_arc(now.normalize(), wanted.normalize_or(DVec3::NEG_Y));
    *thigh = (swing * *thigh).normalize();
    *shank = (swing * bent * *shank).normalize();
    let reached = hip + *thigh * figure.bone(HIP[side], KNEE[side]) + *shank * figure.bone(KNEE[side], ANKLE[side]);
    reached.distance(target)
}
