//! Motions with both feet on the ground.
use super::figure::joint::{ANKLE, BALL};
use super::limb::ROLL;
use super::posture::{Arm, Posture};
use super::stage::{AHEAD, Stage};
use super::track::{GRAVITY, hump, smooth};
use glam::{DQuat, DVec2, DVec3};
use std::f64::consts::TAU;

/// Stance width (in hip widths) of a planted motion; `None` for motions of another kind.
pub(crate) fn stance_width(name: &str) -> Option<f64> {
    Some(match name {
        "hips" | "shake_hips" => 1.5,
        "punching" => 1.6,
        "chicken_wings" | "shake_arms" | "shake_shoulders" => 1.2,
        "jiggle_on_toes" => 1.0,
        _ => return None,
    })
}

/// The motion's posture at `t`, before it is blended with the A-pose.
pub(crate) fn posture(name: &str, stage: &Stage, places: [DVec2; 2], t: f64) -> Posture {
    let mut p = stage.easy(places, t);
    match name {
        "chicken_wings" => chicken_wings(stage, &mut p, t),
        "hips" => hips(stage, &mut p, t),
        "shake_hips" => shake_hips(stage, &mut p, t),
        "shake_shoulders" => shake_shoulders(stage, &mut p, t),
        "shake_arms" => shake_arms(stage, &mut p, t),
        "punching" => punching(stage, &mut p, t),
        "jiggle_on_toes" => jiggle_on_toes(stage, &mut p, t),
        _ => unreachable!("stance_width names the planted motions"),
    }
    p
}

/// Hands before the armpits, elbows beating.
fn chicken_wings(stage: &Stage, p: &mut Posture, t: f64) {
    let phase = stage.phase(1.7, t);
    for side in 0..2 {
        let beat = 0.5 * stage.size_of(side) * phase.sin();
        let arm = &mut p.arms[side];
        arm.elevation = 0.95 + beat;
        arm.azimuth = 0.15;
        arm.bend = DVec3::new(-0.2, -0.3, 0.9);
        arm.elbow = 2.3;
        arm.collar.z = 0.25 * beat;
    }
    p.pelvis.y -= 0.02 + 0.012 * stage.size() * (phase + 0.6).sin();
    p.bend_trunk(DVec3::X * 0.04 * phase.cos());
}

/// The pelvis circles; the trunk leans against it. Hands at the waist.
fn hips(stage: &Stage, p: &mut Posture, t: f64) {
    let phase = stage.phase(0.9, t);
    let size = stage.size();
    let (x, z) = (0.075 * size * phase.sin(), 0.05 * size * phase.cos());
    p.mass_rules = DVec3::new(0.25, 0.0, 0.25);
    p.pelvis += DVec3::new(x, -0.025, z);
    p.turn = DQuat::from_rotation_y(0.12 * size * (phase + 0.8).sin())
        * DQuat::from_rotation_z(0.9 * x)
        * DQuat::from_rotation_x(-1.2 * z);
    p.bend_trunk(DVec3::new(-1.2 * z, -0.1 * size * (phase + 0.8).sin(), 1.3 * x));
    for arm in &mut p.arms {
        *arm = Arm { elevation: 0.75, azimuth: -0.25, elbow: 1.5, bend: DVec3::new(-0.9, -0.1, 0.5), ..*arm };
    }
}

/// A fast shake of the pelvis, sideways and turning.
fn shake_hips(stage: &Stage, p: &mut Posture, t: f64) {
    let phase = stage.phase(2.7, t);
    let size = stage.size() * (1.0 + 0.25 * stage.wander(3, t).clamp(-1.0, 1.0));
    p.mass_rules = DVec3::new(0.3, 0.0, 0.6);
    p.pelvis += DVec3::new(0.028 * size * phase.sin(), -0.018, 0.0);
    let (roll, yaw) = (0.09 * size * (phase - 0.4).sin(), 0.13 * size * (phase + 0.5).sin());
    p.turn = DQuat::from_rotation_y(yaw) * DQuat::from_rotation_z(roll);
    p.bend_trunk(DVec3::new(0.05, -0.85 * yaw, -0.8 * roll));
    for (side, arm) in p.arms.iter_mut().enumerate() {
        let flop = if side == 0 { phase.sin() } else { -phase.sin() };
        arm.elevation += 0.3 + 0.05 * size * flop;
        arm.elbow += 0.7;
    }
}

/// Shoulders alternate forward and up, arms hang loosely.
fn shake_shoulders(stage: &Stage, p: &mut Posture, t: f64) {
    let phase = stage.phase(2.9, t);
    for side in 0..2 {
        let beat = if side == 0 { 1.0 } else { -1.0 } * stage.size_of(side) * phase.sin();
        let arm = &mut p.arms[side];
        // y turns the left collar's outer end back for positive angles
        arm.collar = DVec3::new(0.0, -0.2 * beat, 0.12 * beat);
        arm.elevation += 0.35 + 0.08 * (phase - 0.8).sin() * beat.signum().abs();
        arm.azimuth = 0.5;
        arm.elbow += 0.6;
    }
    let twist = -0.13 * stage.size() * phase.sin();
    p.turn = DQuat::from_rotation_y(-0.35 * twist);
    p.spine[2].y += 0.6 * twist;
    p.spine[1].y += 0.6 * twist;
    p.head.y -= 0.8 * twist;
    p.pelvis.y -= 0.01;
}

/// Arms held half forward and shaken loosely.
fn shake_arms(stage: &Stage, p: &mut Posture, t: f64) {
    let phase = stage.phase(3.3, t);
    for side in 0..2 {
        let size = stage.size_of(side) * (1.0 + 0.2 * stage.wander(5 + side, t).clamp(-1.0, 1.0));
        let lag = if side == 0 { 0.0 } else { 0.5 };
        let arm = &mut p.arms[side];
        arm.elevation = 0.9 + 0.27 * size * (phase - lag).sin();
        arm.azimuth = 0.75 + 0.12 * size * (0.5 * phase).sin();
        arm.bend = DVec3::new(-0.5, 0.3, 0.8);
        arm.elbow = 0.7 + 0.38 * size * (phase - lag - 0.9).sin();
        arm.wrist += DVec3::new(0.15, 0.25, 0.35) * size * (phase - lag - 1.7).sin();
        arm.collar.z = 0.05 * size * (phase - lag).sin();
    }
    p.pelvis.y -= 0.012 + 0.004 * stage.size() * (phase + 0.3).sin();
}

/// Straight punches, left and right in turn, from a guard.
fn punching(stage: &Stage, p: &mut Posture, t: f64) {
    let turns = stage.phase(1.15, t) / TAU;
    let mut twist = 0.0;
    for side in 0..2 {
        let u = (turns + 0.5 * side as f64).rem_euclid(1.0);
        let reach = hump(u, 0.05, 0.6).powf(0.8) * stage.size_of(side).clamp(0.6, 1.1) / 1.1;
        let guard = Arm { elevation: 0.5, azimuth: 0.9, elbow: 2.2, bend: DVec3::new(-0.3, 0.6, 0.8), ..p.arms[side] };
        let punch = Arm {
            elevation: 1.5,
            azimuth: AHEAD - 0.12,
            elbow: 0.2,
            bend: DVec3::new(-0.75, 0.5, 0.1),
            collar: DVec3::new(0.0, -0.3, 0.0),
            ..guard
        };
        p.arms[side] = guard.blend(&punch, reach);
        twist += if side == 0 { -1.0 } else { 1.0 } * reach;
    }
    p.turn = DQuat::from_rotation_y(0.22 * twist);
    p.bend_trunk(DVec3::new(0.08, 0.35 * twist, 0.0));
    p.head.y -= 0.45 * twist;
    p.pelvis.y -= 0.035 - 0.012 * (2.0 * TAU * turns).sin();
}

/// Bouncing on the balls of the feet without leaving the ground.
fn jiggle_on_toes(stage: &Stage, p: &mut Posture, t: f64) {
    const HEEL: f64 = 0.42;
    let hertz = stage.hertz(3.1);
    let on_toes = stage.envelope(t);
    // feet cannot pull: the force is 1 +- `swing` body weights
    let swing = (0.75 * stage.size()).clamp(0.5, 0.9) * (1.0 - 0.06 * (1.0 + stage.wander(4, t)).clamp(0.0, 2.0));
    let height = swing * GRAVITY / (TAU * hertz).powi(2);
    let phase = stage.phase(3.1, t);
    let mass = stage.standing_mass(p).y;
    let joints = &stage.figure.joints;
    let foot = joints[BALL[0]] - joints[ANKLE[0]] + DVec3::Z * ROLL;
    let rise = HEEL.sin() * foot.z - (1.0 - HEEL.cos()) * foot.y.abs();
    p.mass.y = mass + (rise - height) + height * phase.sin() * smooth((t - 0.5) / 0.5);
    p.mass.z += 0.35 * foot.z;
    p.mass_rules.y = 1.0;
    for (side, arm) in p.arms.iter_mut().enumerate() {
        let lag = if side == 0 { 0.9 } else { 1.1 };
        arm.elevation += 0.1 + 0.05 * stage.size_of(side) * (phase - lag).sin();
        arm.elbow += 0.15 + 0.12 * stage.size_of(side) * (phase - lag - 0.8).sin();
        p.legs[side].heel = 0.3 * on_toes;
    }
}
