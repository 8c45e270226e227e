/// One damped resonator: the free motion of a mass on a damped spring.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Resonator {
    /// Undamped frequency, Hz.
    pub frequency: f32,
    /// Damping ratio, in `(0, 1)`.
    pub damping: f32,
}

/// A bank of damped resonators run on each of the first `channels` inputs, a linear memory that is stable by
/// construction. With undamped angular frequency `w`, damping ratio `d` and `dt = 1 / fps` the pole of a resonator
/// is `p = exp((-d + i sqrt(1 - d^2)) w dt)`, and its complex state obeys
///
/// ```text
/// s_t = p s_{t-1} + (1 - p) u_t
/// ```
///
/// so that a constant input comes out unchanged (unit gain at rest). Outputs are `Re s_t` and `Im s_t`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ResonatorBank {
    poles: Vec<[f32; 2]>,
    resonators: Vec<Resonator>,
    channels: usize,
    fps: f32,
}

/// Damping ratios that a change of damping keeps within.
const DAMPING_RATIOS: (f32, f32) = (0.005, 0.95);
/// Share of the frame rate that a change of frequency goes up to.
const HIGHEST_FREQUENCY: f32 = 0.47;

impl ResonatorBank {
    /// A bank on `channels` inputs at `fps` frames a second. Panics if a frequency or damping ratio makes no
    /// stable pole (files are checked before).
    pub fn new(resonators: Vec<Resonator>, channels: usize, fps: f32) -> Self {
        let poles = resonators.iter().map(|r| r.pole(fps).expect("a stable resonator")).collect();
        Self { poles, resonators, channels, fps }
    }
    /// The resonators, `[P]`.
    pub fn resonators(&self) -> &[Resonator] {
        &self.resonators
    }
    /// Real and imaginary part of each pole, `[P]`.
    pub fn poles(&self) -> &[[f32; 2]] {
        &self.poles
    }
    /// The same bank with other frequencies and damping ratios, kept where every resonator is stable.
    pub fn scaled(&self, frequency: f32, damping: f32) -> Self {
        let (least, most) = DAMPING_RATIOS;
        let highest = HIGHEST_FREQUENCY * self.fps;
        let change = |r: &Resonator| Resonator {
            frequency: (frequency * r.frequency).min(highest.max(r.frequency)),
            damping: if damping == 1.0 { r.damping } else { (damping * r.damping).clamp(least, most) },
        };
        Self::new(self.resonators.iter().map(change).collect(), self.channels, self.fps)
    }
    /// Inputs that are filtered, `C`.
    pub fn channels(&self) -> usize {
        self.channels
    }
    /// Frames a second that the poles are for.
    pub fn fps(&self) -> f32 {
        self.fps
    }
    /// Outputs, `2 P C`; also the length of the state.
    pub fn outputs(&self) -> usize {
        2 * self.poles.len() * self.channels
    }
    /// One step. `input` holds at least `C` numbers. `state [2 P C]` is the output as well: pole after pole, within
    /// a pole the real parts of all channels, then the imaginary parts.
    pub fn step(&self, input: &[f32], state: &mut [f32]) {
        let c = self.channels;
        assert_eq!(state.len(), self.outputs(), "state of a resonator bank");
        for (&[a, b], state) in self.poles.iter().zip(state.chunks_exact_mut((2 * c).max(1))) {
            let (real, imaginary) = state.split_at_mut(c);
            for ((re, im), u) in real.iter_mut().zip(imaginary).zip(&input[..c]) {
                let (x, y) = (*re, *im);
                *re = a * x - b * y + (1.0 - a) * u;
                *im = b * x + a * y - b * u;
            }
        }
    }
}

impl Resonator {
    /// The pole at `fps` as real and imaginary part, computed in f64; `None` unless `0 < damping < 1`, the
    /// frequency is positive and under half the frame rate.
    pub fn pole(&self, fps: f32) -> Option<[f32; 2]> {
        let (frequency, damping, fps) = (f64::from(self.frequency), f64::from(self.damping), f64::from(fps));
        let stable = fps > 0.0 && frequency > 0.0 && frequency < 0.5 * fps && damping > 0.0 && damping < 1.0;
        stable.then(|| {
            let step = std::f64::consts::TAU * frequency / fps;
            let radius = (-damping * step).exp();
            let angle = (1.0 - damping * damping).sqrt() * step;
            [(radius * angle.cos()) as f32, (radius * angle.sin()) as f32]
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bank() -> ResonatorBank {
        let resonators = [(1.2, 0.08), (4.0, 0.2), (12.0, 0.4)];
        let resonators = resonators.map(|(frequency, damping)| Resonator { frequency, damping }).to_vec();
        ResonatorBank::new(resonators, 2, 60.0)
    }

    #[test]
    fn steps_match_complex_arithmetic_in_f64() {
        let bank = bank();
        let mut state = vec![0.0; bank.outputs()];
        let mut exact = [[0.0f64; 2]; 6];
        for t in 0..200 {
            let u = [(t as f32 * 0.3).sin(), if t < 40 { 1.0 } else { -0.5 }];
            bank.step(&u, &mut state);
            for (p, r) in bank.resonators().iter().enumerate() {
                let step = std::f64::consts::TAU * f64::from(r.frequency) / 60.0;
                let d = f64::from(r.damping);
                let radius = (-d * step).exp();
                let (b, a) = ((1.0 - d * d).sqrt() * step).sin_cos();
                let (a, b) = (radius * a, radius * b);
                for c in 0..2 {
                    let [x, y] = exact[2 * p + c];
                    let u = f64::from(u[c]);
                    exact[2 * p + c] = [a * x - b * y + (1.0 - a) * u, b * x + a * y - b * u];
                    assert!((f64::from(state[4 * p + c]) - exact[2 * p + c][0]).abs() < 2e-5);
                    assert!((f64::from(state[4 * p + 2 + c]) - exact[2 * p + c][1]).abs() < 2e-5);
                }
            }
        }
    }

    #[test]
    fn a_constant_comes_out_unchanged_and_silence_decays() {
        let bank = bank();
        let mut state = vec![0.0; bank.outputs()];
        (0..3000).for_each(|_| bank.step(&[0.7, -0.2], &mut state));
        for p in 0..3 {
            let s = &state[4 * p..4 * p + 4];
            assert!((s[0] - 0.7).abs() < 1e-4 && (s[1] + 0.2).abs() < 1e-4 && s[2].abs() < 1e-4 && s[3].abs() < 1e-4);
        }
        (0..3000).for_each(|_| bank.step(&[0.0, 0.0], &mut state));
        assert!(state.iter().all(|s| s.abs() < 1e-6));
    }

    #[test]
    fn a_changed_bank_is_the_bank_of_changed_resonators_and_always_stable() {
        let changed = bank().scaled(1.5, 2.0);
        let wanted = [(1.8, 0.16), (6.0, 0.4), (18.0, 0.8)];
        for (r, (frequency, damping)) in changed.resonators().iter().zip(wanted) {
            assert!((r.frequency - frequency).abs() < 1e-5 && (r.damping - damping).abs() < 1e-6, "{r:?}");
        }
        assert_eq!(bank().scaled(1.0, 1.0), bank());
        for (frequency, damping) in [(100.0, 1.0), (1e-3, 1e-3), (3.0, 100.0)] {
            let wild = bank().scaled(frequency, damping);
            assert!(wild.resonators().iter().all(|r| r.pole(60.0).is_some()), "{wild:?}");
        }
    }

    #[test]
    fn unstable_resonators_have_no_pole() {
        for (frequency, damping) in [(0.0, 0.2), (40.0, 0.2), (3.0, 0.0), (3.0, 1.0), (f32::NAN, 0.2), (3.0, f32::NAN)]
        {
            assert_eq!(Resonator { frequency, damping }.pole(60.0), None);
        }
    }
}
