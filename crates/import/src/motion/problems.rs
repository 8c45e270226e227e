//! What looks wrong with a foreign motion.

use super::read::ReadMotion;
use glam::Vec3;
use softtissue_clips::inspection::{ClipFindings, Problem, ProblemKind, SequenceWatch, SideWatch, Sides, WatchConfig};

/// Frames that are looked at for left and right.
const LOOKED_AT: usize = 200;

/// Range of the joints, and what is wrong with the motion; nothing where nothing is.
pub fn examine(read: &ReadMotion) -> ClipFindings {
    let (motion, person) = (&read.motion, &read.person);
    let [left, right] = &person.legs;
    let mut sides = SideWatch::new(Sides {
        hips: [left.hip, right.hip],
        ankles: [left.ankle, right.ankle],
        toes: left.toe.zip(right.toe).map(|(l, r)| [l, r]),
        shoulders: [person.arms[0].shoulder, person.arms[1].shoulder],
    });
    let mut watch = SequenceWatch::new(motion.fps as f32, WatchConfig::joints()).named(motion.skeleton.names.clone());
    let step = motion.len().div_ceil(LOOKED_AT).max(1);
    for t in 0..motion.len() {
        let at: Vec<Vec3> = motion.pose(t).positions.iter().map(|p| p.as_vec3()).collect();
        watch.frame(t, &at);
        if t % step == 0 {
            sides.frame(&at);
        }
    }
    let range = watch.range();
    let mut problems = sides.finish();
    problems.extend(watch.finish());
    if person.head.is_none() {
        problems.push(Problem::new(ProblemKind::Incomplete, "it has no head joint"));
    }
    ClipFindings { range, problems, ..ClipFindings::default() }
}
