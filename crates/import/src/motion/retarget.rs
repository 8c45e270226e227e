use super::RetargetConfig;
use super::align::Alignment;
use super::contact::contacts;
use super::figure::{Figure, JOINTS, joint::*};
use super::foreign::ForeignPose;
use super::legs::reach;
use super::person::Person;
use super::read::ReadMotion;
use super::resample::axis_angle;
use crate::{ImportError, Result};
use glam::{DQuat, DVec3};
use rayon::prelude::*;
use softtissue_body::{ShapedBody, Skeleton};
use softtissue_clips::{ClipId, MotionClip};
use softtissue_geometry::Frames;
use std::path::Path;

/// Leg lengths of people over each other.
const LEG_RATIO: std::ops::RangeInclusive<f64> = 0.2..=5.0;

/// A motion on our skeleton, and what was done to it.
#[derive(Clone, Debug)]
pub struct Retargeted {
    /// The motion at the source's rate.
    pub clip: MotionClip,
    /// Our leg length over the source's: the root's path is scaled by it.
    pub scale: f64,
    /// Frames in which a foot bears, left and right.
    pub contact_frames: [usize; 2],
    /// Farthest that a bearing foot stays off where the source has it, metres.
    pub worst_contact_m: f64,
    /// What else is to be known.
    pub notes: Vec<String>,
}

/// Puts a motion onto our skeleton at one shape of a body.
///
/// Bones: the two skeletons are laid over each other in the source's rest pose (or, where that is no standing person, in
/// the frame that is most like one), and each of our joints then turns as the source's does. The spine's turn is shared
/// out over our three joints. Root: midway between the hip joints, scaled by leg length. Feet: where the source's foot
/// bears, ours moves as it does, on the floor `y = 0`, by bending the knee and swinging the leg.
///
/// # Errors
/// Another skeleton than SMPL's, a source without a usable reference pose, or numbers that leave the range; `path` is named.
pub fn retarget(
    path: &Path,
    source: &ReadMotion,
    id: ClipId,
    skeleton: &Skeleton,
    shaped: &ShapedBody,
    config: &RetargetConfig,
) -> Result<Retargeted> {
    let refuse = |reason: String| ImportError::file(path, reason);
    let figure = Figure::new(skeleton, shaped)
        .ok_or_else(|| refuse("the body to be moved has another skeleton than SMPL's 24 joints".into()))?;
    let alignment = Alignment::find(source, &figure).map_err(refuse)?;
    let mut notes = Vec::new();
    if let Some(t) = alignment.frame {
        notes.push(format!("its rest pose is no standing person; frame {t} stands in for it"));
    }
    let person = &source.person;
    let scale = figure.leg_length() / person.leg_length(&source.motion.skeleton.rest());
    if !LEG_RATIO.contains(&scale) {
        return Err(refuse(format!(
            "its legs would be {:.4} m long, which no person's are",
            figure.leg_length() / scale
        )));
    }
    let mut frames: Vec<Frame> = (0..source.motion.len())
        .into_par_iter()
        .map(|t| {
            let pose = source.motion.pose(t);
            Frame::new(&pose, person, &figure, &alignment, scale)
        })
        .collect();
    if !frames.iter().all(|f| f.pelvis.is_finite() && f.world.iter().all(|turn| turn.is_finite())) {
        return Err(refuse("it has a limb without length, which has no direction; mend the skeleton".into()));
    }
    share_forearm_twist(&mut frames, &figure, source, config);
    let (contact_frames, worst_contact_m) = plant(&mut frames, &figure, source.motion.fps, config, &mut notes);
    let mut rotations = Frames::new(JOINTS);
    for frame in &frames {
        rotations.push(&frame.local(&figure).map(|w| w.as_vec3()));
    }
    let translations: Vec<_> = frames.iter().map(|f| (f.pelvis - figure.rest[PELVIS]).as_vec3()).collect();
    let clip = MotionClip { id, fps: source.motion.fps as f32, rotations, translations };
    Ok(Retargeted { clip, scale, contact_frames, worst_contact_m, notes })
}

/// Our skeleton in one frame, and what of the source's feet is needed.
struct Frame {
    /// `world_from_rest`.
    world: [DQuat; JOINTS],
    pelvis: DVec3,
    /// The source's ball joints (or ankles), scaled to our size.
    balls: [DVec3; 2],
}

impl Frame {
    fn new(pose: &ForeignPose, person: &Person, figure: &Figure, alignment: &Alignment, scale: f64) -> Self {
        // what the source has turned since the reference pose
        let turned = |j: usize| pose.rotations[j] * alignment.reference[j].inverse();
        let ours = &alignment.ours;
        let mut world = [DQuat::IDENTITY; JOINTS];
        let mut set = |j: usize, turn: DQuat| world[j] = (turn * ours[j]).normalize();
        let pelvis = turned(person.pelvis);
        set(PELVIS, pelvis);
        let mut spine = vec![pelvis];
        spine.extend(person.spine.iter().map(|j| turned(*j)));
        for (k, joint) in SPINE.into_iter().enumerate() {
            set(joint, between(&spine, (k + 1) as f64 / 3.0 * (spine.len() - 1) as f64));
        }
        let chest = spine[spine.len() - 1];
        let mut neck = vec![chest];
        neck.extend(person.neck.iter().map(|j| turned(*j)));
        let head = person.head.map_or(neck[neck.len() - 1], turned);
        neck.push(head);
        set(NECK, between(&neck, 0.5 * (neck.len() - 1) as f64));
        set(HEAD, head);
        for side in 0..2 {
            let (leg, arm) = (&person.legs[side], &person.arms[side]);
            set(HIP[side], turned(leg.hip));
            set(KNEE[side], turned(leg.knee));
            set(ANKLE[side], turned(leg.ankle));
            set(BALL[side], turned(leg.toe.unwrap_or(leg.ankle)));
            set(COLLAR[side], arm.collar.map_or(chest, turned));
            set(SHOULDER[side], turned(arm.shoulder));
            set(ELBOW[side], turned(arm.elbow));
            let hand = turned(arm.wrist.unwrap_or(arm.elbow));
            set(WRIST[side], hand);
            set(HAND[side], hand);
        }
        let pelvis = person.hips(pose) * scale - world[PELVIS] * figure.hips();
        let balls = [0, 1].map(|s| pose.positions[person.legs[s].toe.unwrap_or(person.legs[s].ankle)] * scale);
        Self { world, pelvis, balls }
    }

    /// Rotations relative to the parents, axis-angle.
    fn local(&self, figure: &Figure) -> [DVec3; JOINTS] {
        std::array::from_fn(|j| match figure.parent(j) {
            Some(p) => axis_angle(self.world[p].inverse() * self.world[j]),
            None => axis_angle(self.world[j]),
        })
    }
}

/// Between rotations that follow each other along a chain.
fn between(chain: &[DQuat], at: f64) -> DQuat {
    let before = (at.floor() as usize).min(chain.len() - 1);
    let after = (before + 1).min(chain.len() - 1);
    chain[before].slerp(chain[after], at - before as f64)
}

/// Our forearm has no joint that turns it about itself: it takes a share of the hand's turn.
fn share_forearm_twist(frames: &mut [Frame], figure: &Figure, source: &ReadMotion, config: &RetargetConfig) {
    if source.facts.format == "AMASS" {
        return;
    }
    for side in 0..2 {
        let axis = figure.bone(ELBOW[side], WRIST[side]).normalize_or(DVec3::X);
        let mut last = 0.0;
        for frame in frames.iter_mut() {
            let local = frame.world[ELBOW[side]].inverse() * frame.world[WRIST[side]];
            let twist = 2.0 * DVec3::new(local.x, local.y, local.z).dot(axis).atan2(local.w);
            // a hand does not leap round
            let turns = ((last - twist) / std::f64::consts::TAU).round();
            last = twist + turns * std::f64::consts::TAU;
            frame.world[ELBOW[side]] *= DQuat::from_axis_angle(axis, config.forearm_twist * last);
        }
    }
}

/// Puts the soles on the floor and keeps bearing feet as the source has them.
fn plant(
    frames: &mut [Frame],
    figure: &Figure,
    fps: f64,
    config: &RetargetConfig,
    notes: &mut Vec<String>,
) -> ([usize; 2], f64) {
    let theirs: [Vec<DVec3>; 2] = [0, 1].map(|s| frames.iter().map(|f| f.balls[s]).collect());
    let runs = contacts(&theirs, fps, config);
    let mut ours: Vec<[DVec3; JOINTS]> = frames.iter().map(|f| figure.positions(&f.world, f.pelvis)).collect();
    let mut heights: Vec<f64> = (0..2)
        .flat_map(|s| runs[s].iter().cloned().flatten().map(|t| ours[t][BALL[s]].y).collect::<Vec<_>>())
        .collect();
    if heights.is_empty() {
        notes.push("no foot bears; its lowest is put on the floor".into());
        heights = ours.iter().map(|at| at[BALL[0]].y.min(at[BALL[1]].y)).collect();
        heights.sort_by(f64::total_cmp);
        heights.truncate(heights.len() / 50 + 1);
    }
    let lift = DVec3::Y * (figure.ball_height() - median(&mut heights));
    for (frame, at) in frames.iter_mut().zip(&mut ours) {
        frame.pelvis += lift;
        at.iter_mut().for_each(|p| *p += lift);
    }
    let fade = (config.fade_seconds * fps).max(1.0);
    let mut worst: f64 = 0.0;
    for side in 0..2 {
        let corrections = corrections(&theirs[side], &ours, side, &runs[side], figure, fade);
        for (t, (frame, correction)) in frames.iter_mut().zip(&corrections).enumerate() {
            let off = step(frame, &ours[t], figure, side, *correction);
            if runs[side].iter().any(|run| run.contains(&t)) {
                worst = worst.max(off);
            }
        }
    }
    ([0, 1].map(|s| runs[s].iter().map(|r| r.len()).sum()), worst)
}

/// How far each frame's ball joint has to move, `[T]`: in a contact so that it moves as the source's, around it fading.
fn corrections(
    theirs: &[DVec3],
    ours: &[[DVec3; JOINTS]],
    side: usize,
    runs: &[std::ops::Range<usize>],
    figure: &Figure,
    fade: f64,
) -> Vec<DVec3> {
    let mut sums = vec![(DVec3::ZERO, 0.0); ours.len()];
    for run in runs {
        let mut between = run.clone().map(|t| ours[t][BALL[side]] - theirs[t]).sum::<DVec3>() / run.len() as f64;
        let mut levels: Vec<f64> = run.clone().map(|t| theirs[t].y).collect();
        between.y = figure.ball_height() - median(&mut levels);
        let at = |t: usize| theirs[t] + between - ours[t][BALL[side]];
        let reach = fade.ceil() as usize;
        for t in run.start.saturating_sub(reach)..(run.end + reach).min(ours.len()) {
            let edge = t.clamp(run.start, run.end - 1);
            let away = (t.abs_diff(edge) as f64 / fade).min(1.0);
            let weight = (1.0 - away).powi(2) * (1.0 + 2.0 * away);
            sums[t].0 += at(edge) * weight;
            sums[t].1 += weight;
        }
    }
    sums.into_iter().map(|(sum, weight)| sum / f64::max(weight, 1.0)).collect()
}

/// Moves a foot by a correction, and out of the floor; returns how far it stays off.
fn step(frame: &mut Frame, at: &[DVec3; JOINTS], figure: &Figure, side: usize, correction: DVec3) -> f64 {
    let (ball, ankle) = (at[BALL[side]] + correction, at[ANKLE[side]] + correction);
    let under = (figure.ball_height() - ball.y).max(figure.ankle_height() - ankle.y).max(0.0);
    let target = ankle + DVec3::Y * under;
    if target.distance(at[ANKLE[side]]) < 1e-9 {
        return 0.0;
    }
    let (mut thigh, mut shank) = (frame.world[HIP[side]], frame.world[KNEE[side]]);
    let off = reach(figure, side, at[HIP[side]], target, &mut thigh, &mut shank);
    (frame.world[HIP[side]], frame.world[KNEE[side]]) = (thigh, shank);
    off
}

fn median(numbers: &mut [f64]) -> f64 {
    numbers.sort_by(f64::total_cmp);
    numbers.get(numbers.len() / 2).copied().unwrap_or(0.0)
}
