//! Motions at another rate: splines in the space of rotations.

use super::MotionLimits;
use crate::{ImportError, Result};
use glam::{DQuat, DVec3};
use softtissue_clips::MotionClip;
use softtissue_geometry::Frames;
use std::path::Path;

/// A motion clip at `fps` frames a second, from its first frame to the last that lies inside it.
///
/// Positions follow a cubic Hermite spline, rotations a cumulative cubic Bezier curve (Kim, Kim & Shin, "A General
/// Construction Scheme for Unit Quaternion Curves with Simple High Order Derivatives", 1995), both with the central
/// differences of the frames as velocities: through every frame, with continuous velocity. Nothing is filtered: what
/// moves faster than half the new rate is folded down.
///
/// # Errors
/// Less than two frames are left, or more than [`MotionLimits`] has rotations for; `source` is named.
pub fn resample(clip: &MotionClip, fps: f32, source: &Path) -> Result<MotionClip> {
    if clip.fps == fps {
        return Ok(clip.clone());
    }
    let last = clip.len().saturating_sub(1) as f64;
    let step = f64::from(clip.fps) / f64::from(fps);
    let joints = clip.rotations.points_per_frame();
    // A last frame that is missed by rounding alone counts.
    let frames = (last / step + 1e-6).floor() + 1.0;
    let most = MotionLimits::default().rotations / joints.max(1);
    if frames > most as f64 {
        let reason = format!("{} frames at {} a second are more than {most} at {fps}; cut it", clip.len(), clip.fps);
        return Err(ImportError::file(source, reason));
    }
    let frames = frames as usize;
    if frames < 2 {
        let reason = format!("{} frames at {} a second leave one at {fps}; it is too short", clip.len(), clip.fps);
        return Err(ImportError::file(source, reason));
    }
    let mut out =
        MotionClip { id: clip.id.clone(), fps, rotations: Frames::zeros(joints, frames), translations: vec![] };
    let times: Vec<(usize, f64)> = (0..frames)
        .map(|t| {
            let at = (t as f64 * step).min(last);
            let before = (at.floor() as usize).min(clip.len() - 2);
            (before, at - before as f64)
        })
        .collect();
    let places: Vec<DVec3> = clip.translations.iter().map(|p| p.as_dvec3()).collect();
    out.translations = times.iter().map(|(t, u)| place(&places, *t, *u).as_vec3()).collect();
    for j in 0..joints {
        let turns: Vec<DQuat> =
            clip.rotations.iter().map(|frame| DQuat::from_scaled_axis(frame[j].as_dvec3())).collect();
        for (k, (t, u)) in times.iter().enumerate() {
            out.rotations.frame_mut(k)[j] = axis_angle(turn(&turns, *t, *u)).as_vec3();
        }
    }
    Ok(out)
}

/// The axis-angle vector of a rotation, angle in `[0, pi]`.
pub(super) fn axis_angle(turn: DQuat) -> DVec3 {
    (if turn.w < 0.0 { -turn } else { turn }).normalize().to_scaled_axis()
}

fn place(places: &[DVec3], t: usize, u: f64) -> DVec3 {
    let velocity = |t: usize| {
        let (before, after) = (t.saturating_sub(1), (t + 1).min(places.len() - 1));
        (places[after] - places[before]) / (after - before) as f64
    };
    let (a, b) = (places[t], places[t + 1]);
    let [b1, b2, b3] = bernstein_sums(u);
    // Hermite in Bezier form, summed up as the rotations are.
    let (va, vb) = (velocity(t) / 3.0, velocity(t + 1) / 3.0);
    a + va * b1 + (b - a - va - vb) * b2 + vb * b3
}

fn turn(turns: &[DQuat], t: usize, u: f64) -> DQuat {
    let difference = |from: DQuat, to: DQuat| axis_angle(from.inverse() * to);
    let velocity = |t: usize| {
        let before = t.checked_sub(1).map(|b| difference(turns[b], turns[t]));
        let after = turns.get(t + 1).map(|a| difference(turns[t], *a));
        match (before, after) {
            (Some(a), Some(b)) => 0.5 * (a + b),
            (a, b) => a.or(b).unwrap_or_default(),
        }
    };
    let (a, b) = (turns[t], turns[t + 1]);
    let (wa, wb) = (velocity(t) / 3.0, velocity(t + 1) / 3.0);
    let exp = DQuat::from_scaled_axis;
    let middle = difference(a * exp(wa), b * exp(-wb));
    let [b1, b2, b3] = bernstein_sums(u);
    (a * exp(wa * b1) * exp(middle * b2) * exp(wb * b3)).normalize()
}

/// Sums of the cubic Bernstein polynomials from the k-th on, k = 1, 2, 3.
fn bernstein_sums(u: f64) -> [f64; 3] {
    let v = 1.0 - u;
    [1.0 - v * v * v, u * u * (3.0 - 2.0 * u), u * u * u]
}
