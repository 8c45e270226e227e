//! What looks wrong with a foreign motion.

use super::read::ReadMotion;
use glam::DVec3;

/// Joints faster than this jump, m/s: a punching fist makes 12.
const TELEPORT: f64 = 20.0;
/// Joints lower than this below the floor `y = 0`, metres.
const BELOW: f64 = 0.15;
/// Problems that are listed one by one.
const LISTED: usize = 8;

/// What is wrong with a motion, each in a few words; empty where nothing is.
pub fn problems(read: &ReadMotion) -> Vec<String> {
    let (motion, person) = (&read.motion, &read.person);
    let mut found = Vec::new();
    let mut before = motion.pose(0);
    if left_is_right(read) {
        found.push("left and right look swapped".to_owned());
    }
    let mut low = f64::INFINITY;
    let mut jumps = Vec::new();
    for t in 0..motion.len() {
        let pose = motion.pose(t);
        low = pose.positions.iter().map(|p| p.y).fold(low, f64::min);
        if t > 0 {
            let moved = |j: &usize| pose.positions[*j].distance(before.positions[*j]);
            let fastest = (0..pose.positions.len()).max_by(|a, b| moved(a).total_cmp(&moved(b))).unwrap_or(0);
            let speed = moved(&fastest) * motion.fps;
            if speed > TELEPORT {
                jumps.push(format!("frame {t}: {} moves at {speed:.0} m/s", motion.skeleton.names[fastest]));
            } else if pose == before {
                jumps.push(format!("frame {t} repeats the one before"));
            }
        }
        before = pose;
    }
    let more = jumps.len().saturating_sub(LISTED);
    found.extend(jumps.into_iter().take(LISTED));
    if more > 0 {
        found.push(format!("... and {more} more"));
    }
    if low < -BELOW {
        found.push(format!("its lowest joint is {:.2} m below the floor", -low));
    }
    if person.head.is_none() {
        found.push("it has no head joint".to_owned());
    }
    found
}

/// Whether feet that point ahead say that the left hip is on the right: over all frames.
fn left_is_right(read: &ReadMotion) -> bool {
    let [left, right] = &read.person.legs;
    let (Some(left_toe), Some(right_toe)) = (left.toe, right.toe) else { return false };
    let step = read.motion.len().div_ceil(200).max(1);
    let agreement: f64 = (0..read.motion.len())
        .step_by(step)
        .map(|t| {
            let at = read.motion.pose(t).positions;
            let ahead = at[left_toe] - at[left.ankle] + at[right_toe] - at[right.ankle];
            (at[left.hip] - at[right.hip]).normalize_or_zero().dot(DVec3::Y.cross(ahead).normalize_or_zero())
        })
        .sum();
    agreement < 0.0
}
