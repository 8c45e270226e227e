use super::Figure;
use super::track::GRAVITY;
use glam::{DQuat, DVec3};
use softtissue_clips::MotionClip;

/// Centre of mass of each frame, metres, from the joints and segment masses of `figure`.
fn masses(figure: &Figure, clip: &MotionClip) -> Vec<DVec3> {
    (0..clip.len())
        .map(|t| {
            let rotations = clip.rotations.frame(t);
            let local = std::array::from_fn(|j| DQuat::from_scaled_axis(rotations[j].as_dvec3()));
            figure.centre_of_mass(&figure.forward(&local, clip.translations[t].as_dvec3()).0)
        })
        .collect()
}

/// Vertical ground reaction of frames 1..T-1 in body weights: `1 + a/g`, with `a` the second difference of the
/// centre of mass over neighbouring frames. `[T - 2]`; empty for shorter clips.
pub fn ground_reaction(figure: &Figure, clip: &MotionClip) -> Vec<f64> {
    let rate = f64::from(clip.fps);
    masses(figure, clip).windows(3).map(|w| 1.0 + (w[0].y - 2.0 * w[1].y + w[2].y) * rate * rate / GRAVITY).collect()
}

/// Largest ground reaction within 0.25 s after each landing (a frame under 0.1 body weights followed by one above
/// 0.5 within three frames); landings closer than that to the end are left out.
pub fn landing_peaks(reaction: &[f64], fps: f32) -> Vec<f64> {
    let window = (0.25 * fps).round() as usize;
    let mut peaks = Vec::new();
    let mut flying = false;
    let mut since_flight = 0;
    for (t, f) in reaction.iter().enumerate() {
        if *f < 0.1 {
            (flying, since_flight) = (true, 0);
        } else if flying {
            since_flight += 1;
            if *f > 0.5 {
                if t + window < reaction.len() {
                    // the next flight ends the landing
                    let end = (t..t + window).find(|&i| reaction[i] < 0.1).unwrap_or(t + window);
                    peaks.push(reaction[t..end].iter().copied().fold(0.0, f64::max));
                }
                flying = false;
            } else if since_flight > 3 {
                flying = false;
            }
        }
    }
    peaks
}
