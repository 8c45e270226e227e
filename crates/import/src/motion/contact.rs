//! When a foot bears.

use super::RetargetConfig;
use glam::DVec3;
use std::ops::Range;

/// Rank, among all heights of a ball joint, of its usual height on the ground: lower ones are noise.
const GROUND_RANK: f64 = 0.05;

/// Frames in which a ball of a foot bears: it is slow, and not higher than it is on the ground. `balls` is `[T]` for
/// each side, metres at the size of our body, Y up.
pub(super) fn contacts(balls: &[Vec<DVec3>; 2], fps: f64, config: &RetargetConfig) -> [Vec<Range<usize>>; 2] {
    let speeds: [Vec<f64>; 2] = [0, 1].map(|s| speed(&balls[s], fps));
    let slow = |s: usize, t: usize| speeds[s][t] < config.contact_speed;
    let mut heights: Vec<f64> =
        (0..2).flat_map(|s| balls[s].iter().enumerate().filter(move |(t, _)| slow(s, *t)).map(|(_, p)| p.y)).collect();
    heights.sort_by(f64::total_cmp);
    let Some(ground) = heights.get((heights.len() as f64 * GROUND_RANK) as usize) else {
        return [Vec::new(), Vec::new()];
    };
    let shortest = (config.contact_seconds * fps).round().max(1.0) as usize;
    [0, 1].map(|s| {
        let bears: Vec<bool> =
            (0..balls[s].len()).map(|t| slow(s, t) && balls[s][t].y < ground + config.contact_height).collect();
        joined(&bears, shortest)
    })
}

/// Speeds `[T]` by central differences.
fn speed(at: &[DVec3], fps: f64) -> Vec<f64> {
    (0..at.len())
        .map(|t| {
            let (before, after) = (t.saturating_sub(1), (t + 1).min(at.len() - 1));
            at[before].distance(at[after]) * fps / (after - before).max(1) as f64
        })
        .collect()
}

/// Runs of true, with gaps of at most `shortest` closed and runs shorter than that left out.
fn joined(bears: &[bool], shortest: usize) -> Vec<Range<usize>> {
    let mut runs: Vec<Range<usize>> = Vec::new();
    for (t, _) in bears.iter().enumerate().filter(|(_, b)| **b) {
        match runs.last_mut() {
            Some(run) if t <= run.end + shortest => run.end = t + 1,
            _ => runs.push(t..t + 1),
        }
    }
    runs.retain(|run| run.len() > shortest);
    runs
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_foot_bears_where_it_is_slow_and_low() {
        // Still on the ground for a second, then in the air for one, still again; the other foot never comes down.
        let step = |t: usize| {
            let u = (t as f64 / 100.0).clamp(1.0, 2.0) - 1.0;
            DVec3::new(u, 0.08 + 0.2 * (std::f64::consts::PI * u).sin(), 0.0)
        };
        let balls = [(0..300).map(step).collect(), (0..300).map(|t| step(t) + DVec3::Y * 0.5).collect()];
        let [left, right] = contacts(&balls, 100.0, &RetargetConfig::default());
        assert_eq!(left.len(), 2, "{left:?}");
        assert!(left[0].start == 0 && (99..=101).contains(&left[0].end), "{left:?}");
        assert!((199..=202).contains(&left[1].start) && left[1].end == 300, "{left:?}");
        assert!(right.is_empty(), "{right:?}");
    }
}
