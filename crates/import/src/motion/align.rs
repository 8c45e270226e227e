//! How our rest pose stands beside the source's: `source_from_ours` rotations that make our skeleton look like the
//! source's in its reference pose.

use super::figure::{Figure, JOINTS, joint::*};
use super::foreign::ForeignPose;
use super::person::Person;
use super::read::ReadMotion;
use glam::{DMat3, DQuat, DVec3};

/// How far from standing a pose may be to serve as reference: thighs from straight down, upper arms from ours,
/// forearms from the upper arms, radians.
const FARTHEST: [f64; 3] = [0.87, 1.4, 0.8];
/// The trunk of a rest pose stands along an axis of the file, within this, radians.
const OFF_AXIS: f64 = 0.45;
/// Collar bones, hands and feet that lie within this of ours are meant as ours are, radians.
const SAME: f64 = 1.0;
/// Cosine of the angle to straight ahead up to which a limb can be told front from back.
const ACROSS: f64 = 0.8;
/// Frames that are looked at where the rest pose does not serve.
const LOOKED_AT: usize = 400;

/// The reference pose of the source and our bones in it.
pub(super) struct Alignment {
    /// Source rotations in the reference pose, `[J]`.
    pub reference: Vec<DQuat>,
    /// `[24]` `world_from_rest` of our skeleton in the reference pose.
    pub ours: [DQuat; JOINTS],
    /// The frame that serves as reference, where it is not the rest pose.
    pub frame: Option<usize>,
}

impl Alignment {
    /// # Errors
    /// Says that no pose can serve.
    pub fn find(source: &ReadMotion, figure: &Figure) -> Result<Self, String> {
        let person = &source.person;
        let rest = source.motion.skeleton.rest();
        if let Some(trunk) = rest_trunk(person, &rest)
            && misfit(person, figure, &rest, trunk) <= 1.0
        {
            return Ok(Self::new(source, figure, &rest, trunk, None));
        }
        let step = source.motion.len().div_ceil(LOOKED_AT).max(1);
        let best = (0..source.motion.len()).step_by(step).map(|t| {
            let pose = source.motion.pose(t);
            let trunk = standing_trunk(person, &pose);
            (misfit(person, figure, &pose, trunk), t)
        });
        match best.min_by(|a, b| a.0.total_cmp(&b.0)) {
            Some((misfit, t)) if misfit <= 1.0 => {
                let pose = source.motion.pose(t);
                let trunk = standing_trunk(person, &pose);
                Ok(Self::new(source, figure, &pose, trunk, Some(t)))
            }
            _ => Err("neither its rest pose nor any of its frames is a standing person; put a T-pose in front".into()),
        }
    }

    fn new(source: &ReadMotion, figure: &Figure, pose: &ForeignPose, trunk: DQuat, frame: Option<usize>) -> Self {
        let person = &source.person;
        let at = |j: usize| pose.positions[j];
        let mut ours = [trunk; JOINTS];
        let near = |parent: DQuat, ours: DVec3, theirs: DVec3| {
            let same = (parent * ours).angle_between(theirs) < SAME;
            if same { parent } else { limb(trunk, ours, theirs) }
        };
        for side in 0..2 {
            let (leg, arm) = (&person.legs[side], &person.arms[side]);
            let bone = |from: usize, to: usize| figure.bone(from, to);
            ours[HIP[side]] = limb(trunk, bone(HIP[side], KNEE[side]), at(leg.knee) - at(leg.hip));
            ours[KNEE[side]] = limb(trunk, bone(KNEE[side], ANKLE[side]), at(leg.ankle) - at(leg.knee));
            if let Some(toe) = leg.toe.filter(|t| at(*t).distance(at(leg.ankle)) > 1e-6) {
                ours[ANKLE[side]] = foot(trunk, bone(ANKLE[side], BALL[side]), at(toe) - at(leg.ankle));
            }
            ours[BALL[side]] = ours[ANKLE[side]];
            if let Some(collar) = arm.collar.filter(|c| at(*c).distance(at(arm.shoulder)) > 1e-6) {
                ours[COLLAR[side]] = near(trunk, bone(COLLAR[side], SHOULDER[side]), at(arm.shoulder) - at(collar));
            }
            ours[SHOULDER[side]] = limb(trunk, bone(SHOULDER[side], ELBOW[side]), at(arm.elbow) - at(arm.shoulder));
            ours[ELBOW[side]] = ours[SHOULDER[side]];
            ours[WRIST[side]] = ours[SHOULDER[side]];
            if let Some(wrist) = arm.wrist {
                let forearm = at(wrist) - at(arm.elbow);
                ours[ELBOW[side]] = limb(trunk, bone(ELBOW[side], WRIST[side]), forearm);
                ours[WRIST[side]] = ours[ELBOW[side]];
                if let Some(tip) = person.tip(&source.motion.skeleton, wrist) {
                    let tip = pose.rotations[wrist] * tip;
                    ours[WRIST[side]] = near(ours[ELBOW[side]], bone(WRIST[side], HAND[side]), tip);
                }
            }
            ours[HAND[side]] = ours[WRIST[side]];
        }
        Self { reference: pose.rotations.clone(), ours, frame }
    }
}

/// A bone that points the same way, with the same side ahead: how it came there does not matter, so T-pose, A-pose and
/// hanging arms agree.
fn limb(trunk: DQuat, ours: DVec3, theirs: DVec3) -> DQuat {
    let ahead = trunk * DVec3::Z;
    let across = |v: DVec3, ahead: DVec3| v.normalize().dot(ahead).abs() < ACROSS;
    if across(theirs, ahead) && across(ours, DVec3::Z) {
        let side = |bone: DVec3, ahead: DVec3| frame(bone.cross(ahead).normalize(), bone.normalize());
        side(theirs, ahead) * side(ours, DVec3::Z).inverse()
    } else {
        DQuat::from_rotation_arc((trunk * ours).normalize(), theirs.normalize()) * trunk
    }
}

/// A foot that points ahead is as flat as ours: only its heading differs.
fn foot(trunk: DQuat, ours: DVec3, theirs: DVec3) -> DQuat {
    let up = trunk * DVec3::Y;
    let ours = trunk * ours;
    let flat = |v: DVec3| v - up * v.dot(up);
    if ours.angle_between(theirs) < SAME {
        DQuat::from_rotation_arc(flat(ours).normalize(), flat(theirs).normalize()) * trunk
    } else {
        DQuat::from_rotation_arc(ours.normalize(), theirs.normalize()) * trunk
    }
}

fn frame(left: DVec3, up: DVec3) -> DQuat {
    DQuat::from_mat3(&DMat3::from_cols(left, up, left.cross(up)))
}

/// Left and up of a trunk.
fn left_and_up(person: &Person, pose: &ForeignPose) -> (DVec3, DVec3) {
    let at = &pose.positions;
    let left = at[person.legs[0].hip] - at[person.legs[1].hip];
    let top = person.head.or(person.neck.last().copied()).or(person.spine.last().copied());
    (left, at[top.unwrap_or(person.pelvis)] - person.hips(pose))
}

/// The trunk of a rest pose, whose axes are those of the file: small bends of the spine are part of the pose.
fn rest_trunk(person: &Person, pose: &ForeignPose) -> Option<DQuat> {
    let snap = |v: DVec3| {
        let axis = DVec3::AXES.into_iter().max_by(|a, b| v.dot(*a).abs().total_cmp(&v.dot(*b).abs()))?;
        let axis = axis * v.dot(axis).signum();
        (v.length() > 1e-6 && v.angle_between(axis) < OFF_AXIS).then_some(axis)
    };
    let (left, up) = left_and_up(person, pose);
    let (left, up) = (snap(left)?, snap(up)?);
    (left.dot(up).abs() < 0.5).then(|| frame(left, up))
}

/// The trunk of somebody who stands upright, Y up.
fn standing_trunk(person: &Person, pose: &ForeignPose) -> DQuat {
    let (left, _) = left_and_up(person, pose);
    let left = (left - DVec3::Y * left.y).normalize_or(DVec3::X);
    frame(left, DVec3::Y)
}

/// How far a pose is from standing as at rest, relative to the farthest that serves.
fn misfit(person: &Person, figure: &Figure, pose: &ForeignPose, trunk: DQuat) -> f64 {
    let at = &pose.positions;
    let mut worst = left_and_up(person, pose).1.angle_between(trunk * DVec3::Y) / OFF_AXIS;
    for side in 0..2 {
        let (leg, arm) = (&person.legs[side], &person.arms[side]);
        let thigh = at[leg.knee] - at[leg.hip];
        let shank = at[leg.ankle] - at[leg.knee];
        let upper = at[arm.elbow] - at[arm.shoulder];
        let down = trunk * DVec3::NEG_Y;
        worst = worst.max(thigh.angle_between(down) / FARTHEST[0]).max(shank.angle_between(thigh) / FARTHEST[0]);
        worst = worst.max(upper.angle_between(trunk * figure.bone(SHOULDER[side], ELBOW[side])) / FARTHEST[1]);
        if let Some(wrist) = arm.wrist {
            worst = worst.max((at[wrist] - at[arm.elbow]).angle_between(upper) / FARTHEST[2]);
        }
    }
    worst
}
