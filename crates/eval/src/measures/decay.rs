use glam::DVec3;
use std::f64::consts::TAU;

/// A damped sinusoid fitted to a region's mean after an impact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Decay {
    /// Damped frequency `omega_d / 2 pi`, hertz.
    pub hz: f64,
    /// Damping ratio `zeta`: the envelope is `exp(-zeta omega_0 t)` with `omega_0 = omega_d / sqrt(1 - zeta^2)`.
    pub damping_ratio: f64,
    /// Share of the variance that the fit explains, at most 1.
    pub explained: f64,
    /// Rms of the signal round its end value, metres.
    pub rms_m: f64,
}

/// Slowest and fastest frequency searched, hertz.
const HZ: (f64, f64) = (1.0, 12.0);
/// Least and greatest damping ratio searched.
const RATIO: (f64, f64) = (0.005, 0.7);

/// Fits `exp(-zeta omega_0 t) (a cos omega_d t + b sin omega_d t) + c` to a `[T]` signal in metres, one
/// frequency and one damping ratio for the three axes. The linear part is eliminated (variable projection); the
/// two others come from a grid and repeated refinement. Absent for fewer than 12 frames or a still signal.
pub fn fit_decay(signal: &[DVec3], fps: f64) -> Option<Decay> {
    if signal.len() < 12 {
        return None;
    }
    let mean = signal.iter().sum::<DVec3>() / signal.len() as f64;
    let variance: f64 = signal.iter().map(|x| (*x - mean).length_squared()).sum();
    if variance.is_nan() || variance <= 1e-18 * signal.len() as f64 {
        return None;
    }
    let grid = |low: f64, high: f64, n: usize, i: usize| low * (high / low).powf(i as f64 / (n - 1) as f64);
    let (n_hz, n_ratio) = (60, 14);
    let mut best = (f64::INFINITY, HZ.0, RATIO.0);
    for i in 0..n_hz {
        for j in 0..n_ratio {
            let (hz, ratio) = (grid(HZ.0, HZ.1, n_hz, i), grid(RATIO.0, RATIO.1, n_ratio, j));
            let r = residual(signal, fps, hz, ratio);
            if r < best.0 {
                best = (r, hz, ratio);
            }
        }
    }
    // shrink a cross of steps (in the logarithms) until it is far below the precision asked for
    let (mut step_hz, mut step_ratio) =
        ((HZ.1 / HZ.0).ln() / (n_hz - 1) as f64, (RATIO.1 / RATIO.0).ln() / (n_ratio - 1) as f64);
    while step_hz > 1e-6 {
        let (_, hz, ratio) = best;
        let mut moved = false;
        for (i, j) in [(-1., 0.), (1., 0.), (0., -1.), (0., 1.), (-1., -1.), (1., 1.), (-1., 1.), (1., -1.)] {
            let hz = (hz * f64::exp(i * step_hz)).clamp(HZ.0, HZ.1);
            let ratio = (ratio * f64::exp(j * step_ratio)).clamp(RATIO.0, RATIO.1);
            let r = residual(signal, fps, hz, ratio);
            if r < best.0 {
                best = (r, hz, ratio);
                moved = true;
            }
        }
        if !moved {
            step_hz *= 0.5;
            step_ratio *= 0.5;
        }
    }
    let (r, hz, damping_ratio) = best;
    let rms_m = (variance / signal.len() as f64).sqrt();
    Some(Decay { hz, damping_ratio, explained: 1.0 - r / variance, rms_m })
}

/// Sum of squares left when amplitudes and offset are solved for.
fn residual(signal: &[DVec3], fps: f64, hz: f64, ratio: f64) -> f64 {
    let decay_rate = ratio / (1.0 - ratio * ratio).sqrt() * TAU * hz;
    let mut normal = [[0.0; 3]; 3];
    let mut right = [DVec3::ZERO; 3];
    let mut total = 0.0;
    for (t, x) in signal.iter().enumerate() {
        let time = t as f64 / fps;
        let envelope = (-decay_rate * time).exp();
        let (sin, cos) = (TAU * hz * time).sin_cos();
        let basis = [envelope * cos, envelope * sin, 1.0];
        for i in 0..3 {
            for j in 0..3 {
                normal[i][j] += basis[i] * basis[j];
            }
            right[i] += *x * basis[i];
        }
        total += x.length_squared();
    }
    let Some(solution) = solve(normal, right) else { return f64::INFINITY };
    // |x - A s|^2 = |x|^2 - s . (A^T x) at the minimum
    (total - (0..3).map(|i| solution[i].dot(right[i])).sum::<f64>()).max(0.0)
}

/// Cholesky solution of a symmetric positive definite 3 x 3 system with a vector for every unknown.
fn solve(m: [[f64; 3]; 3], right: [DVec3; 3]) -> Option<[DVec3; 3]> {
    let mut l = [[0.0f64; 3]; 3];
    for i in 0..3 {
        for j in 0..=i {
            let s = m[i][j] - (0..j).map(|k| l[i][k] * l[j][k]).sum::<f64>();
            if i == j {
                if s <= 1e-12 * m[i][i] {
                    return None;
                }
                l[i][i] = s.sqrt();
            } else {
                l[i][j] = s / l[j][j];
            }
        }
    }
    let mut y = right;
    for i in 0..3 {
        for k in 0..i {
            y[i] -= y[k] * l[i][k];
        }
        y[i] /= l[i][i];
    }
    for i in (0..3).rev() {
        for k in i + 1..3 {
            y[i] -= y[k] * l[k][i];
        }
        y[i] /= l[i][i];
    }
    Some(y)
}

#[cfg(test)]
mod tests {
    use super::*;
    use softtissue_random::Draws;

    fn damped(hz: f64, ratio: f64, frames: usize, noise_m: f64) -> Vec<DVec3> {
        let mut draws = Draws::new(3, "decay", 0, 0);
        let rate = ratio / (1.0 - ratio * ratio).sqrt() * TAU * hz;
        (0..frames)
            .map(|t| {
                let time = t as f64 / 60.0;
                let x = (-rate * time).exp() * (TAU * hz * time + 0.7).cos();
                let y = (-rate * time).exp() * (TAU * hz * time - 0.4).sin();
                let mut n = || draws.normal() * noise_m;
                DVec3::new(0.004 * x + n(), 0.012 * y - 0.02 + n(), 0.001 + n())
            })
            .collect()
    }

    #[test]
    fn a_clean_decay_gives_its_frequency_and_damping_ratio() {
        for (hz, ratio) in [(2.6, 0.10), (3.4, 0.23), (4.9, 0.17), (6.7, 0.05)] {
            let fit = fit_decay(&damped(hz, ratio, 120, 0.0), 60.0).unwrap();
            assert!((fit.hz - hz).abs() < 1e-3 && (fit.damping_ratio - ratio).abs() < 1e-3, "{hz} {ratio} {fit:?}");
            assert!(fit.explained > 0.999_99);
        }
    }

    #[test]
    fn noise_moves_it_less_than_the_gate() {
        // 1 mm of noise on each axis of a 12 mm swing
        let fit = fit_decay(&damped(4.0, 0.15, 120, 0.001), 60.0).unwrap();
        assert!((fit.hz - 4.0).abs() < 0.15 && (fit.damping_ratio - 0.15).abs() < 0.03, "{fit:?}");
        assert!(fit.explained > 0.5 && fit.explained < 0.999);
    }

    #[test]
    fn stillness_and_short_signals_have_no_decay() {
        assert_eq!(fit_decay(&[DVec3::ONE; 100], 60.0), None);
        assert_eq!(fit_decay(&damped(4.0, 0.1, 11, 0.0), 60.0), None);
    }
}
