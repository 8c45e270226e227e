use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Factors of the three terms.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TrajectoryWeights {
    /// Of the squared error itself, mm^2. Default 1.
    pub position: f64,
    /// Of the squared error of first differences, (mm a frame)^2. Default 13 (published: 1). What a
    /// scanner and a fit add drifts slowly: with an AR(1) error of 0.8 a frame, least squares weighs differences so.
    pub velocity: f64,
    /// Of the squared error of second differences, (mm a frame^2)^2. Default 0 (published: 1).
    pub acceleration: f64,
}

impl Default for TrajectoryWeights {
    fn default() -> Self {
        Self { position: 1.0, velocity: 13.0, acceleration: 0.0 }
    }
}

/// The three terms before their factors.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TrajectoryTerms {
    /// mm^2.
    pub position: f64,
    /// (mm a frame)^2.
    pub velocity: f64,
    /// (mm a frame^2)^2.
    pub acceleration: f64,
}

/// Position, velocity and acceleration terms (SoftSMPL eq. 10) as mean squared errors over vertices and frames.
/// All three are linear in the error `e_t` of each frame: `e_t - e_{t-1}` is the velocity's error, and so on.
#[derive(Clone, Debug)]
pub struct TrajectoryLoss {
    /// Factors of the terms.
    pub weights: TrajectoryWeights,
    /// Vertices `V` that a squared error is spread over.
    pub vertex_count: usize,
    /// Metres in one unit of the error.
    pub scale: f32,
}

impl TrajectoryLoss {
    /// `error [T, B, K]`, time-major, predicted minus wanted; clip `b` counts for its first `lengths[b]` frames, the
    /// rest is padding. Returns the weighted loss, its terms, and the gradient `[T, B, K]`.
    ///
    /// Each term is meaned over the frames of all clips that it is defined on.
    pub fn value_and_gradient(&self, error: &[f32], lengths: &[usize]) -> (f64, TrajectoryTerms, Vec<f32>) {
        let batch = lengths.len();
        let frames = lengths.iter().copied().max().unwrap_or(0);
        assert!(frames > 0 && error.len().is_multiple_of(batch * frames), "frames of a trajectory loss");
        let width = error.len() / (batch * frames);
        let mm = f64::from(self.scale) * 1000.0;
        let defined = |order: usize| lengths.iter().map(|n| n.saturating_sub(order)).sum::<usize>().max(1) as f64;
        let factors = [0, 1, 2].map(|order| mm * mm / (self.vertex_count as f64 * defined(order)));
        let weights = [self.weights.position, self.weights.velocity, self.weights.acceleration];
        let slopes = [0, 1, 2].map(|i| (2.0 * weights[i] * factors[i]) as f32);

        let per_clip: Vec<([f64; 3], Vec<f32>)> = (0..batch)
            .into_par_iter()
            .map(|b| {
                let at = |t: usize| &error[(t * batch + b) * width..][..width];
                one_clip(at, lengths[b], width, slopes)
            })
            .collect();

        let mut sums = [0.0; 3];
        let mut gradient = vec![0.0f32; error.len()];
        for (b, (terms, clip)) in per_clip.iter().enumerate() {
            (0..3).for_each(|i| sums[i] += terms[i]);
            for (t, row) in clip.chunks_exact(width).enumerate() {
                gradient[(t * batch + b) * width..][..width].copy_from_slice(row);
            }
        }
        let [position, velocity, acceleration] = [0, 1, 2].map(|i| factors[i] * sums[i]);
        let value = weights[0] * position + weights[1] * velocity + weights[2] * acceleration;
        (value, TrajectoryTerms { position, velocity, acceleration }, gradient)
    }
}

/// Sums of squares of the error's differences of order 0, 1 and 2, and the gradient `[frames, width]` of
/// `sum_i slopes[i] / 2 * sums[i]`.
fn one_clip<'a>(
    at: impl Fn(usize) -> &'a [f32],
    frames: usize,
    width: usize,
    slopes: [f32; 3],
) -> ([f64; 3], Vec<f32>) {
    let mut sums = [0.0f64; 3];
    let mut gradient = vec![0.0f32; frames * width];
    for t in 0..frames {
        let now = at(t);
        let before = &mut gradient[t.saturating_sub(2) * width..(t + 1) * width];
        let offset = |order: usize| (t.min(2) - order) * width;
        for k in 0..width {
            let e = now[k];
            sums[0] += f64::from(e * e);
            before[offset(0) + k] += slopes[0] * e;
            if t >= 1 {
                let v = e - at(t - 1)[k];
                sums[1] += f64::from(v * v);
                before[offset(0) + k] += slopes[1] * v;
                before[offset(1) + k] -= slopes[1] * v;
            }
            if t >= 2 {
                let a = e - 2.0 * at(t - 1)[k] + at(t - 2)[k];
                sums[2] += f64::from(a * a);
                before[offset(0) + k] += slopes[2] * a;
                before[offset(1) + k] -= 2.0 * slopes[2] * a;
                before[offset(2) + k] += slopes[2] * a;
            }
        }
    }
    (sums, gradient)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn loss() -> TrajectoryLoss {
        let weights = TrajectoryWeights { position: 0.7, velocity: 1.3, acceleration: 2.1 };
        TrajectoryLoss { weights, vertex_count: 3, scale: 0.001 }
    }

    fn error(frames: usize, lengths: &[usize], width: usize) -> Vec<f32> {
        (0..frames * lengths.len() * width).map(|i| ((i * 37 + 11) as f32).sin()).collect()
    }

    #[test]
    fn gradient_matches_finite_differences_and_padding_has_none() {
        let lengths = [6, 4, 1];
        let error = error(6, &lengths, 2);
        let loss = loss();
        let (_, _, gradient) = loss.value_and_gradient(&error, &lengths);
        for i in 0..error.len() {
            let at = |step: f32| {
                let mut moved = error.clone();
                moved[i] += step;
                loss.value_and_gradient(&moved, &lengths).0
            };
            let numeric = (at(0.02) - at(-0.02)) / 0.04;
            assert!((numeric - f64::from(gradient[i])).abs() < 1e-5, "{i}: {numeric} {}", gradient[i]);
            let (t, b) = (i / 2 / lengths.len(), i / 2 % lengths.len());
            assert_eq!(t >= lengths[b], gradient[i] == 0.0, "frame {t} of clip {b}");
        }
    }

    #[test]
    fn terms_are_mean_squares_of_differences() {
        // One vertex coordinate, one clip: errors 1, 3, 2 mm; differences 2, -1; second difference -3.
        let loss = TrajectoryLoss { vertex_count: 1, ..loss() };
        let (value, terms, _) = loss.value_and_gradient(&[1.0, 3.0, 2.0], &[3]);
        let close = |a: f64, b: f64| (a - b).abs() < 1e-5;
        assert!(close(terms.position, 14.0 / 3.0) && close(terms.velocity, 2.5) && close(terms.acceleration, 9.0));
        assert!(close(value, 0.7 * 14.0 / 3.0 + 1.3 * 2.5 + 2.1 * 9.0));
    }

    #[test]
    fn padding_changes_nothing() {
        let loss = loss();
        let both = error(5, &[5, 3], 2);
        let clip = |b: usize, n: usize| (0..n).flat_map(|t| both[(t * 2 + b) * 2..][..2].to_vec()).collect::<Vec<_>>();
        let (_, whole, _) = loss.value_and_gradient(&both, &[5, 3]);
        let (_, first, _) = loss.value_and_gradient(&clip(0, 5), &[5]);
        let (_, second, _) = loss.value_and_gradient(&clip(1, 3), &[3]);
        assert!((whole.position - (5.0 * first.position + 3.0 * second.position) / 8.0).abs() < 1e-6);
        assert!((whole.acceleration - (3.0 * first.acceleration + second.acceleration) / 4.0).abs() < 1e-6);
    }
}
