use glam::DVec3;
use rustfft::{FftPlanner, num_complex::Complex};
use softtissue_geometry::Frames;

/// A region's mean displacement in each frame, `[T]`, metres.
pub fn region_mean(deltas: &Frames, vertices: &[u32]) -> Vec<DVec3> {
    let scale = 1.0 / vertices.len().max(1) as f64;
    deltas.iter().map(|f| vertices.iter().map(|&v| f[v as usize].as_dvec3()).sum::<DVec3>() * scale).collect()
}

/// Lowest frequency of spectral measures, hertz: slower change is posture, not motion of the flesh.
pub const LOWEST_HZ: f64 = 0.75;
/// Highest frequency of spectral measures, hertz: above it lies noise.
pub const HIGHEST_HZ: f64 = 15.0;
/// Segment length of the spectra, seconds; the frequency step is its inverse.
const SEGMENT_S: f64 = 2.0;
/// What lies further than this under the reference's own peak counts as equally silent, decibels.
const FLOOR_DB: f64 = 40.0;

/// A power spectrum between [`LOWEST_HZ`] and [`HIGHEST_HZ`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Spectrum {
    /// Frequencies, hertz, ascending.
    pub hz: Vec<f64>,
    /// Power density, mm^2 / Hz, summed over the three axes.
    pub power: Vec<f64>,
}

/// Welch's estimate of a `[T]` signal in metres: Hann-windowed segments of 2 s with half overlap, mean taken
/// out of each, averaged. A shorter signal is one segment, padded with zeros. Empty below four frames.
pub fn spectrum(signal: &[DVec3], fps: f64) -> Spectrum {
    let n = (SEGMENT_S * fps).round() as usize;
    let window_length = n.min(signal.len());
    if window_length < 4 {
        return Spectrum::default();
    }
    let window: Vec<f64> = (0..window_length)
        .map(|i| 0.5 - 0.5 * (std::f64::consts::TAU * (i as f64 + 0.5) / window_length as f64).cos())
        .collect();
    let gain: f64 = window.iter().map(|w| w * w).sum();
    let fft = FftPlanner::new().plan_fft_forward(n);
    let bins: Vec<usize> =
        (1..=n / 2).filter(|k| (LOWEST_HZ..=HIGHEST_HZ).contains(&(*k as f64 * fps / n as f64))).collect();
    let mut power = vec![0.0; bins.len()];
    let last = signal.len() - window_length;
    let step = (window_length / 2).max(1);
    let starts: Vec<usize> = (0..=last).step_by(step).collect();
    for &start in &starts {
        let segment = &signal[start..start + window_length];
        let mean = segment.iter().sum::<DVec3>() / window_length as f64;
        for axis in 0..3 {
            let mut buffer = vec![Complex::new(0.0, 0.0); n];
            for (b, (x, w)) in buffer.iter_mut().zip(segment.iter().zip(&window)) {
                b.re = (x[axis] - mean[axis]) * w * 1e3;
            }
            fft.process(&mut buffer);
            for (p, &k) in power.iter_mut().zip(&bins) {
                // one-sided density: twice the two-sided one, except at Nyquist
                let sides = if 2 * k == n { 1.0 } else { 2.0 };
                *p += sides * buffer[k].norm_sqr() / (gain * fps) / starts.len() as f64;
            }
        }
    }
    Spectrum { hz: bins.iter().map(|&k| k as f64 * fps / n as f64).collect(), power }
}

/// Rms difference of two log power spectra in decibels. Both are floored 40 dB under the reference's peak, so
/// that a silent prediction is far away but finite. Absent if the reference is silent or the grids differ.
pub fn spectral_distance(predicted: &Spectrum, reference: &Spectrum) -> Option<f64> {
    let peak = reference.power.iter().copied().fold(0.0, f64::max);
    if peak <= 0.0 || predicted.hz != reference.hz {
        return None;
    }
    let floor = peak * 10f64.powf(-FLOOR_DB / 10.0);
    let db = |p: f64| 10.0 * p.max(floor).log10();
    let sum: f64 = predicted.power.iter().zip(&reference.power).map(|(p, r)| (db(*p) - db(*r)).powi(2)).sum();
    Some((sum / reference.power.len() as f64).sqrt())
}

/// Frequency of the highest peak, by a parabola through the log power of its neighbours. Absent for silence.
pub fn peak_hz(spectrum: &Spectrum) -> Option<f64> {
    let (k, &top) = spectrum.power.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1))?;
    if top <= 0.0 {
        return None;
    }
    if k == 0 || k + 1 == spectrum.power.len() {
        return Some(spectrum.hz[k]);
    }
    let [a, b, c] = [k - 1, k, k + 1].map(|i| spectrum.power[i].max(top * 1e-12).ln());
    Some(spectrum.hz[k] + parabola_peak(a, b, c) * (spectrum.hz[k + 1] - spectrum.hz[k]))
}

/// How late a `[T]` prediction is, in seconds (negative: early): the shift within `+-window_s` that maximises
/// its normalised cross-correlation with the reference, to a fraction of a frame. Absent if either is still.
pub fn lag_s(predicted: &[DVec3], reference: &[DVec3], fps: f64, window_s: f64) -> Option<f64> {
    let n = reference.len();
    let most = ((window_s * fps).round() as usize).min(n / 2);
    let (p, r) = (centred(predicted), centred(reference));
    let correlation = |shift: isize| {
        let range = shift.max(0)..(n as isize + shift.min(0));
        let (mut dot, mut pp, mut rr) = (0.0, 0.0, 0.0);
        for t in range {
            let (a, b) = (p[t as usize], r[(t - shift) as usize]);
            dot += a.dot(b);
            pp += a.length_squared();
            rr += b.length_squared();
        }
        if pp > 0.0 && rr > 0.0 { dot / (pp * rr).sqrt() } else { f64::NAN }
    };
    let most = most as isize;
    let values: Vec<f64> = (-most..=most).map(correlation).collect();
    let (k, best) = values.iter().enumerate().filter(|(_, c)| c.is_finite()).max_by(|a, b| a.1.total_cmp(b.1))?;
    let fraction = if k == 0 || k + 1 == values.len() || !(values[k - 1] + values[k + 1]).is_finite() {
        0.0
    } else {
        parabola_peak(values[k - 1], *best, values[k + 1])
    };
    Some((k as f64 - most as f64 + fraction) / fps)
}

fn centred(signal: &[DVec3]) -> Vec<DVec3> {
    let mean = signal.iter().sum::<DVec3>() / signal.len().max(1) as f64;
    signal.iter().map(|x| *x - mean).collect()
}

/// Where a parabola through three equidistant values peaks, in steps from the middle one.
fn parabola_peak(a: f64, b: f64, c: f64) -> f64 {
    let curvature = a - 2.0 * b + c;
    if curvature >= 0.0 { 0.0 } else { (0.5 * (a - c) / curvature).clamp(-0.5, 0.5) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    fn sine(hz: f64, amplitude_m: f64, delay_s: f64, frames: usize, fps: f64) -> Vec<DVec3> {
        let x = |t: usize| amplitude_m * (TAU * hz * (t as f64 / fps - delay_s)).sin();
        (0..frames).map(|t| DVec3::new(0.02, x(t), 0.5 * x(t))).collect()
    }

    #[test]
    fn power_of_a_sine_integrates_to_its_variance() {
        // Parseval: variance a^2/2 on Y and (a/2)^2/2 on Z, in mm^2.
        let s = spectrum(&sine(4.0, 0.010, 0.0, 600, 60.0), 60.0);
        let step = s.hz[1] - s.hz[0];
        let integral: f64 = s.power.iter().sum::<f64>() * step;
        assert!((integral / (50.0 * 1.25) - 1.0).abs() < 0.01, "{integral}");
        assert!((step - 0.5).abs() < 1e-9);
    }

    #[test]
    fn peaks_between_bins_are_found() {
        for hz in [2.1, 3.3, 4.75, 7.9] {
            let found = peak_hz(&spectrum(&sine(hz, 0.01, 0.0, 300, 60.0), 60.0)).unwrap();
            assert!((found - hz).abs() < 0.05, "{hz} {found}");
        }
        assert_eq!(peak_hz(&spectrum(&[DVec3::ONE; 300], 60.0)), None);
    }

    #[test]
    fn a_scaled_signal_is_its_decibels_away() {
        let r: Vec<DVec3> = (0..900)
            .map(|t| {
                // all bins well above the floor: a chirp from 0.75 to 15 Hz and back
                let time = t as f64 / 60.0;
                DVec3::X
                    * (TAU * (7.875 * time - 7.125 * 7.5 / std::f64::consts::PI * (TAU * time / 15.0).sin())).sin()
                    * 0.01
            })
            .collect();
        let half: Vec<DVec3> = r.iter().map(|x| *x * 0.5).collect();
        let (r, half) = (spectrum(&r, 60.0), spectrum(&half, 60.0));
        let d = spectral_distance(&half, &r).unwrap();
        assert!((d - 20.0 * 2f64.log10()).abs() < 0.05, "{d}");
        assert_eq!(spectral_distance(&r, &r), Some(0.0));
        let silent = Spectrum { power: vec![0.0; r.hz.len()], ..r.clone() };
        assert!(spectral_distance(&silent, &r).unwrap() > 20.0);
        assert_eq!(spectral_distance(&r, &silent), None);
    }

    #[test]
    fn lags_are_found_to_a_fraction_of_a_frame() {
        let reference = sine(3.0, 0.01, 0.0, 240, 60.0);
        for late in [-0.05, -0.0125, 0.0, 0.02, 0.0583] {
            let found = lag_s(&sine(3.0, 0.004, late, 240, 60.0), &reference, 60.0, 0.15).unwrap();
            assert!((found - late).abs() < 1e-3, "{late} {found}");
        }
        assert_eq!(lag_s(&[DVec3::ONE; 240], &reference, 60.0, 0.15), None);
    }

    #[test]
    fn region_means_average_their_vertices() {
        let mut f = Frames::zeros(3, 2);
        f.frame_mut(1)[0] = glam::Vec3::X;
        f.frame_mut(1)[2] = glam::Vec3::Y;
        assert_eq!(region_mean(&f, &[0, 2]), [DVec3::ZERO, DVec3::new(0.5, 0.5, 0.0)]);
    }
}
