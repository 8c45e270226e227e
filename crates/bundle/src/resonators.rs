/// One damped resonator: the free motion of a mass on a damped spring.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Resonator {
    /// Undamped frequency, Hz.
    pub frequency: f32,
    /// Damping ratio, in `(0, 1)`.
    pub damping: f32,
}

/// How flesh that is driven harder answers: it swings faster and yields less than in proportion, as a hardening spring does.
/// `E` is the drive's mean square, smoothed over `seconds`; every frequency of the bank is multiplied by `h` and every input
/// divided by it:
///
/// ```text
/// E_t = k E_{t-1} + (1 - k) mean_c u_c^2        k = exp(-1 / (fps seconds)), E = 0 at the start
/// h_t = ((E_t + floor) / (1 + floor))^(exponent / 2)
/// ```
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Hardening {
    /// Power of the drive's root mean square that frequencies follow. Zero: a linear spring.
    pub exponent: f32,
    /// Time constant of the drive's mean square, seconds.
    pub seconds: f32,
    /// Mean square below which less drive changes little; the inputs' own is about one.
    pub floor: f32,
}

/// A bank of damped resonators run on each of the first `channels` inputs, a memory that is stable by construction: poles
/// stay within the unit circle, with [`Hardening`] too, whatever drives them. With undamped angular frequency `w`, damping
/// ratio `d` and `dt = 1 / fps` the pole of a resonator is `p = exp((-d + i sqrt(1 - d^2)) w dt)`, and its complex state
/// obeys
///
/// ```text
/// s_t = p s_{t-1} + (1 - p) u_t
/// ```
///
/// so that a constant input comes out unchanged (unit gain at rest; divided by `h` of a hardening bank). Outputs are
/// `Re s_t` and `Im s_t`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ResonatorBank {
    poles: Vec<[f32; 2]>,
    resonators: Vec<Resonator>,
    channels: usize,
    fps: f32,
    hardening: Option<Hardening>,
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
        Self { poles, resonators, channels, fps, hardening: None }
    }
    /// The same bank on springs that harden, or on linear ones. Panics if the law is none (files are checked before).
    pub fn with_hardening(self, hardening: Option<Hardening>) -> Self {
        assert!(hardening.is_none_or(|law| law.check().is_ok()), "{hardening:?}");
        Self { hardening, ..self }
    }
    /// How the springs harden, where they do.
    pub fn hardening(&self) -> Option<Hardening> {
        self.hardening
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
        Self::new(self.resonators.iter().map(change).collect(), self.channels, self.fps).with_hardening(self.hardening)
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
    /// Largest factor by which a hardening bank raises a pole's frequency, which ends below half the frame rate.
    pub fn hardest(&self, pole: usize) -> f32 {
        (HIGHEST_FREQUENCY * self.fps / self.resonators[pole].frequency).max(1.0)
    }
    /// One step. `input` holds at least `C` numbers. `state [2 P C]` is the output as well: pole after pole, within
    /// a pole the real parts of all channels, then the imaginary parts. `drive` is the drive's smoothed mean square.
    pub fn step(&self, input: &[f32], state: &mut [f32], drive: &mut f32) {
        let c = self.channels;
        assert_eq!(state.len(), self.outputs(), "state of a resonator bank");
        let input = &input[..c];
        let hardness = self.hardening.map_or(1.0, |law| law.step(input, self.fps, drive));
        for (p, state) in state.chunks_exact_mut((2 * c).max(1)).enumerate() {
            let [a, b] = match self.hardening {
                Some(_) => self.resonators[p].turn(self.fps, hardness.min(self.hardest(p))),
                None => self.poles[p],
            };
            let (real, imaginary) = state.split_at_mut(c);
            for ((re, im), u) in real.iter_mut().zip(imaginary).zip(input) {
                let (x, y, u) = (*re, *im, u / hardness);
                *re = a * x - b * y + (1.0 - a) * u;
                *im = b * x + a * y - b * u;
            }
        }
    }
}

/// Largest exponent and time constant of a [`Hardening`], and the least and largest floor, far beyond flesh.
const LARGEST_EXPONENT: f32 = 2.0;
const LONGEST_SECONDS: f32 = 10.0;
const FLOORS: (f32, f32) = (1e-3, 1e3);

impl Hardening {
    /// What is wrong with a law from a file.
    pub fn check(&self) -> Result<(), String> {
        let Self { exponent, seconds, floor } = *self;
        let sound = exponent.abs() <= LARGEST_EXPONENT
            && (0.0..=LONGEST_SECONDS).contains(&seconds)
            && (FLOORS.0..=FLOORS.1).contains(&floor);
        match sound {
            true => Ok(()),
            false => Err(format!("its law of hardening {self:?} is no flesh's; export it again")),
        }
    }
    /// What is left of the drive's mean square after a frame.
    pub fn kept(&self, fps: f32) -> f32 {
        (-1.0 / (fps * self.seconds)).exp()
    }
    /// Takes a frame's inputs into the drive and returns `h`.
    fn step(&self, input: &[f32], fps: f32, drive: &mut f32) -> f32 {
        let kept = self.kept(fps);
        let square = input.iter().map(|u| u * u).sum::<f32>() / input.len().max(1) as f32;
        *drive = kept * *drive + (1.0 - kept) * square;
        ((*drive + self.floor) / (1.0 + self.floor)).powf(0.5 * self.exponent)
    }
}

impl Resonator {
    /// The pole at `fps` as real and imaginary part, computed in f64; `None` unless `0 < damping < 1`, the
    /// frequency is positive and under half the frame rate.
    pub fn pole(&self, fps: f32) -> Option<[f32; 2]> {
        let (frequency, damping, fps) = (f64::from(self.frequency), f64::from(self.damping), f64::from(fps));
        let stable = fps > 0.0 && frequency > 0.0 && frequency < 0.5 * fps && damping > 0.0 && damping < 1.0;
        stable.then(|| self.turn(fps as f32, 1.0))
    }
    /// Logarithm of the pole's radius and its angle at `fps`.
    pub fn decay_and_angle(&self, fps: f32) -> [f64; 2] {
        let (frequency, damping) = (f64::from(self.frequency), f64::from(self.damping));
        let step = std::f64::consts::TAU * frequency / f64::from(fps);
        [-damping * step, (1.0 - damping * damping).sqrt() * step]
    }
    /// The pole of `factor` times the frequency.
    fn turn(&self, fps: f32, factor: f32) -> [f32; 2] {
        let [decay, angle] = self.decay_and_angle(fps).map(|x| f64::from(factor) * x);
        let (sine, cosine) = angle.sin_cos();
        [(decay.exp() * cosine) as f32, (decay.exp() * sine) as f32]
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
            bank.step(&u, &mut state, &mut 0.0);
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
        (0..3000).for_each(|_| bank.step(&[0.7, -0.2], &mut state, &mut 0.0));
        for p in 0..3 {
            let s = &state[4 * p..4 * p + 4];
            assert!((s[0] - 0.7).abs() < 1e-4 && (s[1] + 0.2).abs() < 1e-4 && s[2].abs() < 1e-4 && s[3].abs() < 1e-4);
        }
        (0..3000).for_each(|_| bank.step(&[0.0, 0.0], &mut state, &mut 0.0));
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

    fn hardening() -> Hardening {
        Hardening { exponent: 0.6, seconds: 0.05, floor: 0.1 }
    }

    #[test]
    fn a_hardening_bank_yields_less_to_a_larger_constant() {
        let law = hardening();
        for size in [0.0, 0.2, 1.0, 5.0] {
            let bank = bank().with_hardening(Some(law));
            let (mut state, mut drive) = (vec![0.0; bank.outputs()], 0.0);
            (0..3000).for_each(|_| bank.step(&[size, -size], &mut state, &mut drive));
            let hardness = ((size * size + 0.1) / 1.1).powf(0.3);
            assert!((drive - size * size).abs() < 1e-4 * (1.0 + size * size));
            for p in 0..3 {
                assert!((state[4 * p] - size / hardness).abs() < 1e-3, "{size} {p}: {state:?}");
                assert!((state[4 * p + 1] + size / hardness).abs() < 1e-3 && state[4 * p + 2].abs() < 1e-3);
            }
        }
    }

    #[test]
    fn a_hardening_bank_rings_faster_while_it_is_driven() {
        // A drive on one channel that the other does not feel: its ringing tells its frequency alone.
        let bank = ResonatorBank::new(vec![Resonator { frequency: 3.0, damping: 0.02 }], 2, 60.0)
            .with_hardening(Some(hardening()));
        let crossings = |push: f32| {
            let (mut state, mut drive) = (vec![1.0, 0.0, 0.0, 0.0], 0.0);
            (0..600)
                .filter(|_| {
                    let before = state[0];
                    bank.step(&[0.0, push], &mut state, &mut drive);
                    (before < 0.0) != (state[0] < 0.0)
                })
                .count() as f32
        };
        // Two crossings a cycle in 10 s; mean of squares over two channels.
        for push in [0.0f32, 1.0, 3.0] {
            let hardness = ((0.5 * push * push + 0.1) / 1.1).powf(0.3);
            assert!((crossings(push) - 60.0 * hardness).abs() < 2.5, "{push}: {} {hardness}", crossings(push));
        }
    }

    #[test]
    fn whatever_drives_a_hardening_bank_it_stays_bounded() {
        let law = Hardening { exponent: 2.0, seconds: 0.0, floor: 1e-3 };
        let bank = bank().with_hardening(Some(law));
        let (mut state, mut drive) = (vec![0.0; bank.outputs()], 0.0);
        for t in 0..20_000 {
            let size = if (t / 37) % 2 == 0 { 8.0 } else { 0.01 };
            bank.step(&[size * (t as f32).sin(), size * (0.37 * t as f32).cos()], &mut state, &mut drive);
            assert!(state.iter().all(|s| s.abs() < 100.0), "{t}: {state:?}");
        }
    }

    #[test]
    fn laws_that_no_flesh_obeys_are_refused() {
        assert_eq!(hardening().check(), Ok(()));
        for bad in [
            Hardening { exponent: f32::NAN, ..hardening() },
            Hardening { exponent: -3.0, ..hardening() },
            Hardening { seconds: -0.1, ..hardening() },
            Hardening { seconds: f32::INFINITY, ..hardening() },
            Hardening { floor: 0.0, ..hardening() },
        ] {
            assert!(bad.check().is_err(), "{bad:?}");
        }
    }
}
