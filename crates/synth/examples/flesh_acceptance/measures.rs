//! Figures taken from displacements.

use glam::Vec3;
use softtissue_geometry::Frames;

/// Root mean square length in mm over vertices and the frames from `first` on.
pub fn rms_mm(deltas: &Frames, vertices: &[usize], first: usize) -> f64 {
    let mut sum = 0.0;
    let mut count = 0usize;
    for t in first..deltas.len() {
        for &v in vertices {
            sum += f64::from(deltas.frame(t)[v].length_squared());
            count += 1;
        }
    }
    1e3 * (sum / count.max(1) as f64).sqrt()
}

/// A quantile of lengths in mm over vertices and the frames from `first` on.
pub fn quantile_mm(deltas: &Frames, vertices: &[usize], first: usize, q: f64) -> f64 {
    let frames = first..deltas.len();
    let mut lengths: Vec<f32> =
        frames.flat_map(|t| vertices.iter().map(move |&v| (t, v))).map(|(t, v)| deltas.frame(t)[v].length()).collect();
    lengths.sort_by(f32::total_cmp);
    let at = ((lengths.len().max(1) - 1) as f64 * q).round() as usize;
    1e3 * f64::from(lengths.get(at).copied().unwrap_or(0.0))
}

/// Mean and 99th percentile in mm of the distance between two runs, over vertices and the frames from `first` on.
pub fn distance_mm(a: &Frames, b: &Frames, vertices: &[usize], first: usize) -> (f64, f64) {
    let difference: Vec<Vec3> = a.points().iter().zip(b.points()).map(|(p, q)| *p - *q).collect();
    let difference = Frames::from_points(a.points_per_frame(), difference);
    (mean_mm(&difference, vertices, first), quantile_mm(&difference, vertices, first, 0.99))
}

/// Mean length in mm over vertices and the frames from `first` on.
pub fn mean_mm(deltas: &Frames, vertices: &[usize], first: usize) -> f64 {
    let frames = first..deltas.len();
    let count = (frames.len() * vertices.len()).max(1) as f64;
    let sum: f64 = frames
        .flat_map(|t| vertices.iter().map(move |&v| (t, v)))
        .map(|(t, v)| f64::from(deltas.frame(t)[v].length()))
        .sum();
    1e3 * sum / count
}

/// Height of a region's mean displacement, by frame, m.
pub fn mean_height(deltas: &Frames, vertices: &[usize]) -> Vec<f64> {
    let mean =
        |t: usize| vertices.iter().map(|&v| f64::from(deltas.frame(t)[v].y)).sum::<f64>() / vertices.len() as f64;
    (0..deltas.len()).map(mean).collect()
}

/// Frequency in Hz and damping ratio of the damped sinusoid nearest to a decay (least squares over a grid that is
/// refined about its best point; amplitude, phase and offset are solved for).
pub fn damped_sinusoid(decay: &[f64], fps: f64) -> (f64, f64) {
    let mut centre = (5.0f64, 0.25f64);
    let mut span = (4.2, 0.23);
    let mut best = f64::INFINITY;
    for _ in 0..6 {
        let around = centre;
        for i in -12..=12 {
            for j in -12..=12 {
                let hertz = around.0 + span.0 * f64::from(i) / 12.0;
                let ratio = around.1 + span.1 * f64::from(j) / 12.0;
                if hertz > 0.3 && (0.005..0.9).contains(&ratio) {
                    let error = misfit(decay, fps, hertz, ratio);
                    if error < best {
                        best = error;
                        centre = (hertz, ratio);
                    }
                }
            }
        }
        span = (span.0 * 0.3, span.1 * 0.3);
    }
    centre
}

/// Squared error left by the best `a e cos + b e sin + c`.
fn misfit(decay: &[f64], fps: f64, hertz: f64, ratio: f64) -> f64 {
    let omega = std::f64::consts::TAU * hertz;
    let rate = ratio / (1.0 - ratio * ratio).sqrt() * omega;
    let row = |t: usize| {
        let s = t as f64 / fps;
        let e = (-rate * s).exp();
        [e * (omega * s).cos(), e * (omega * s).sin(), 1.0]
    };
    let mut m = [[0.0; 4]; 3];
    for (t, y) in decay.iter().enumerate() {
        let r = row(t);
        for i in 0..3 {
            for j in 0..3 {
                m[i][j] += r[i] * r[j];
            }
            m[i][3] += r[i] * y;
        }
    }
    for i in 0..3 {
        for k in i + 1..3 {
            let f = m[k][i] / m[i][i];
            for j in i..4 {
                m[k][j] -= f * m[i][j];
            }
        }
    }
    let mut x = [0.0; 3];
    for i in (0..3).rev() {
        x[i] = (m[i][3] - (i + 1..3).map(|j| m[i][j] * x[j]).sum::<f64>()) / m[i][i];
    }
    decay.iter().enumerate().map(|(t, y)| (row(t).iter().zip(x).map(|(r, x)| r * x).sum::<f64>() - y).powi(2)).sum()
}
