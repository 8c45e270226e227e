use std::ops::{Add, Mul, Sub};

/// Two equal one-pole low-passes in a row: causal, no overshoot, gain one at rest.
/// `y_t = p y_{t-1} + (1 - p) x_t` twice, with `p` such that the power falls to a half at the cutoff.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LowPass {
    pole: f32,
}

impl LowPass {
    /// A filter with its half-power point at `cutoff_hz` of a signal of `fps` samples a second. A cutoff of zero,
    /// or at or above half the rate, passes everything.
    pub fn new(cutoff_hz: f32, fps: f32) -> Self {
        if !(cutoff_hz > 0.0 && cutoff_hz < 0.5 * fps) {
            return Self { pole: 0.0 };
        }
        // One stage has |H|^2 = (1-p)^2 / (1 - 2 p cos w + p^2); two make a half when one makes 1/sqrt 2.
        let cos = (std::f64::consts::TAU * f64::from(cutoff_hz) / f64::from(fps)).cos();
        let c = std::f64::consts::SQRT_2;
        let half = c - cos;
        Self { pole: ((half - (half * half - (c - 1.0).powi(2)).sqrt()) / (c - 1.0)) as f32 }
    }
    /// Frames by which slow motion comes late (the group delay at rest).
    pub fn lag_frames(&self) -> f32 {
        2.0 * self.pole / (1.0 - self.pole)
    }
    /// Filters a velocity and differentiates it.
    pub(super) fn step<X: Quantity>(&self, track: &mut VelocityTrack<X>, velocity: X, fps: f32) -> (X, X) {
        if !track.moving {
            // Constant velocity before the first difference: a clip cut in mid-motion starts without a spike.
            *track = VelocityTrack { first: velocity, second: velocity, moving: true };
            return (velocity, X::default());
        }
        let before = track.second;
        let pass = |x: X, y: X| x * (1.0 - self.pole) + y * self.pole;
        track.first = pass(velocity, track.first);
        track.second = pass(track.first, track.second);
        (track.second, (track.second - before) * fps)
    }
}

/// A number or a vector that can be filtered.
pub(super) trait Quantity:
    Copy + Default + Add<Output = Self> + Sub<Output = Self> + Mul<f32, Output = Self>
{
}

impl<X: Copy + Default + Add<Output = X> + Sub<Output = X> + Mul<f32, Output = X>> Quantity for X {}

/// Filter memory of one quantity.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct VelocityTrack<X> {
    first: X,
    second: X,
    moving: bool,
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    /// Amplitude and delay (frames) of the filter's answer to a sinusoid, measured.
    fn answer(low_pass: LowPass, hz: f32, fps: f32) -> (f32, f32) {
        let w = std::f32::consts::TAU * hz / fps;
        let mut track = VelocityTrack::default();
        let (mut sine, mut cosine) = (0.0, 0.0);
        let n = 6000;
        for t in 0..2 * n {
            let x = (w * t as f32).sin();
            let (y, _) = low_pass.step(&mut track, Vec3::splat(x), fps);
            if t >= n {
                sine += y.x * (w * t as f32).sin();
                cosine += y.x * (w * t as f32).cos();
            }
        }
        let scale = 2.0 / n as f32;
        ((sine * scale).hypot(cosine * scale), -(cosine.atan2(sine)) / w)
    }

    #[test]
    fn half_power_at_the_cutoff_and_the_stated_lag_near_rest() {
        for cutoff in [6.0, 12.0] {
            let low_pass = LowPass::new(cutoff, 60.0);
            let (gain, _) = answer(low_pass, cutoff, 60.0);
            assert!((gain - 0.5f32.sqrt()).abs() < 2e-3, "{cutoff} Hz: gain {gain}");
            let (gain, lag) = answer(low_pass, 0.5, 60.0);
            assert!((gain - 1.0).abs() < 0.01 && (lag - low_pass.lag_frames()).abs() < 0.02, "{gain} {lag}");
        }
        assert_eq!(LowPass::new(0.0, 60.0).lag_frames(), 0.0);
        assert_eq!(LowPass::new(30.0, 60.0).lag_frames(), 0.0);
    }
}
