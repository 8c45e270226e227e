use serde::{Deserialize, Serialize};

/// What a body's mass, `beta[1]`, does to the answer of its flesh: with `m` the mass less `centre`, frequencies are
/// multiplied by `exp(frequency m)` and deltas by `exp(amplitude m)`. More of it hangs lower and swings slower and
/// farther; both laws carry over to people whom training has not seen, and beyond them they are held.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MassLaw {
    /// Logarithm of the frequencies, for one unit of `beta[1]`.
    pub frequency: f32,
    /// Logarithm of the deltas, for one unit of `beta[1]`.
    pub amplitude: f32,
    /// `beta[1]` at which neither changes.
    pub centre: f32,
    /// Least and greatest `beta[1]`; others count as the nearer of them.
    pub range: [f32; 2],
}

/// Largest value of the laws' slopes and of `beta[1]`, far beyond bodies.
const LARGEST: f32 = 20.0;

impl MassLaw {
    /// Factor on the frequencies of a body.
    pub fn frequency(&self, beta: &[f32]) -> f32 {
        (self.frequency * self.mass(beta)).exp()
    }
    /// Factor on the deltas of a body.
    pub fn amplitude(&self, beta: &[f32]) -> f32 {
        (self.amplitude * self.mass(beta)).exp()
    }
    /// What is wrong with a law from a file.
    pub(crate) fn check(&self) -> Result<(), String> {
        let numbers = [self.frequency, self.amplitude, self.centre, self.range[0], self.range[1]];
        let sound = numbers.iter().all(|x| x.abs() <= LARGEST) && self.range[0] <= self.range[1];
        // The factors themselves must be numbers that a body can have.
        let farthest = self.range.iter().map(|b| (b - self.centre).abs()).fold(0.0, f32::max);
        let steepest = self.frequency.abs().max(self.amplitude.abs());
        match sound && steepest * farthest <= LARGEST {
            true => Ok(()),
            false => Err(format!("its law of mass {self:?} is no body's; export it again")),
        }
    }
    fn mass(&self, beta: &[f32]) -> f32 {
        beta.get(1).copied().unwrap_or(0.0).clamp(self.range[0], self.range[1]) - self.centre
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_laws_are_exponential_within_their_range_and_held_beyond() {
        let law = MassLaw { frequency: 0.25, amplitude: -0.4, centre: -0.5, range: [-2.0, 1.0] };
        assert!((law.frequency(&[3.0, 0.5]) - 1.284_025_4).abs() < 1e-6);
        assert!((law.amplitude(&[3.0, -1.5]) - 1.491_824_7).abs() < 1e-6);
        assert_eq!(law.amplitude(&[0.0, -9.0]), law.amplitude(&[0.0, -2.0]));
        assert_eq!(law.frequency(&[]), law.frequency(&[0.0, 0.0]));
        assert_eq!(MassLaw::default().amplitude(&[0.0, 3.0]), 1.0);
    }

    #[test]
    fn laws_that_no_body_obeys_are_refused() {
        let good = MassLaw { frequency: 0.25, amplitude: -0.4, centre: -0.5, range: [-2.0, 1.0] };
        assert_eq!(good.check(), Ok(()));
        for bad in [
            MassLaw { frequency: f32::NAN, ..good },
            MassLaw { amplitude: f32::INFINITY, ..good },
            MassLaw { range: [1.0, -2.0], ..good },
            MassLaw { frequency: 19.0, ..good },
            MassLaw { range: [-2.0, f32::NAN], ..good },
        ] {
            assert!(bad.check().is_err(), "{bad:?}");
        }
    }
}
