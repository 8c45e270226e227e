//! Vertical movement of the centre of mass from the force under the feet.
//!
//! Each phase prescribes the ground reaction in body weights, `F(t)`; `z'' = g (F - 1)`. Two coefficients of each
//! stance are solved so that its impulse and its displacement join the neighbouring flights exactly. Stance
//! forces have the two parts of real landings: an impact transient in the first 70 ms and the muscles' push.

/// Standard gravity, m/s^2.
pub const GRAVITY: f64 = 9.81;
/// Half-width of the impact transient, seconds.
const IMPACT: f64 = 0.035;
/// Height of the impact transient, body weights.
const IMPACT_PEAK: f64 = 0.8;
/// Integration steps of a phase.
const STEPS: usize = 256;

/// What the feet do in a phase.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Force {
    /// From standing to take-off: dip, then push.
    PushOff,
    /// In the air.
    Flight,
    /// From a landing to the next take-off.
    Bounce,
    /// From a landing to standing.
    Settle,
}

/// Vertical speed and height over standing at the start and the end of a phase.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ends {
    pub speed: [f64; 2],
    pub height: [f64; 2],
}

/// One phase: integrated force.
#[derive(Clone, Debug)]
pub(crate) struct Phase {
    pub start: f64,
    pub duration: f64,
    height: Vec<f64>,
    speed: Vec<f64>,
    /// Largest and smallest ground reaction, body weights.
    pub peak: f64,
    pub least: f64,
}

impl Phase {
    /// Integrates `force` from `start` over `duration` seconds so that it meets both ends.
    pub fn new(force: Force, start: f64, duration: f64, ends: Ends) -> Self {
        let h = duration / STEPS as f64;
        let shapes: Vec<[f64; 3]> =
            (0..STEPS).map(|i| shapes(force, (i as f64 + 0.5) / STEPS as f64, duration)).collect();
        let [a, c] = if force == Force::Flight { [0.0; 2] } else { coefficients(&shapes, h, ends) };
        let (mut y, mut v) = (ends.height[0], ends.speed[0]);
        let mut phase = Self { start, duration, height: vec![y], speed: vec![v], peak: f64::MIN, least: f64::MAX };
        for [base, first, second] in shapes {
            let f = base + a * first + c * second;
            let acceleration = GRAVITY * (f - 1.0);
            y += h * (v + 0.5 * h * acceleration);
            v += h * acceleration;
            phase.height.push(y);
            phase.speed.push(v);
            phase.peak = phase.peak.max(f);
            phase.least = phase.least.min(f);
        }
        phase
    }

    /// Duration at which the force peaks at `peak` body weights, seconds.
    pub fn duration_for_peak(force: Force, ends: Ends, peak: f64) -> f64 {
        let [mut short, mut long] = [0.08, 0.9];
        for _ in 0..40 {
            let middle = 0.5 * (short + long);
            if Self::new(force, 0.0, middle, ends).peak > peak { short = middle } else { long = middle }
        }
        0.5 * (short + long)
    }

    /// Height over standing at time `t` within the phase (cubic Hermite between steps).
    pub fn height(&self, t: f64) -> f64 {
        let h = self.duration / STEPS as f64;
        let s = ((t - self.start) / h).clamp(0.0, STEPS as f64);
        let i = (s as usize).min(STEPS - 1);
        let u = s - i as f64;
        let (y0, y1) = (self.height[i], self.height[i + 1]);
        let (v0, v1) = (self.speed[i] * h, self.speed[i + 1] * h);
        let (u2, u3) = (u * u, u * u * u);
        y0 * (2.0 * u3 - 3.0 * u2 + 1.0) + v0 * (u3 - 2.0 * u2 + u) + y1 * (3.0 * u2 - 2.0 * u3) + v1 * (u3 - u2)
    }

    /// Whether `t` lies before the phase's end.
    pub fn ends_after(&self, t: f64) -> bool {
        t < self.start + self.duration
    }
}

/// Force at `u` in `[0, 1]` of a phase: fixed part, and the two shapes whose sizes are solved for.
fn shapes(force: Force, u: f64, duration: f64) -> [f64; 3] {
    use std::f64::consts::PI;
    let impact = IMPACT_PEAK * hump(u * duration, 0.0, 2.0 * IMPACT);
    match force {
        Force::Flight => [0.0; 3],
        Force::Bounce => [impact, (PI * u).sin(), (2.0 * PI * u).sin()],
        Force::PushOff => [1.0 - smooth((u - 0.87) / 0.13), hump(u, 0.0, 0.7), hump(u, 0.4, 1.0)],
        Force::Settle => [impact + smooth(u / 0.3), hump(u, 0.0, 0.5), hump(u, 0.3, 1.0)],
    }
}

/// Sizes of the two shapes that give the impulse and the displacement which `ends` ask for.
fn coefficients(shapes: &[[f64; 3]], h: f64, ends: Ends) -> [f64; 2] {
    let duration = h * shapes.len() as f64;
    let (mut speed, mut height) = ([0.0; 3], [0.0; 3]);
    for (i, f) in shapes.iter().enumerate() {
        // what remains of the phase carries this step's speed on
        let rest = duration - (i as f64 + 0.5) * h;
        for k in 0..3 {
            let push = GRAVITY * (if k == 0 { f[0] - 1.0 } else { f[k] }) * h;
            speed[k] += push;
            height[k] += push * rest;
        }
    }
    let want_speed = ends.speed[1] - ends.speed[0] - speed[0];
    let want_height = ends.height[1] - ends.height[0] - ends.speed[0] * duration - height[0];
    let determinant = speed[1] * height[2] - speed[2] * height[1];
    [
        (want_speed * height[2] - speed[2] * want_height) / determinant,
        (speed[1] * want_height - want_speed * height[1]) / determinant,
    ]
}

/// `sin^2` between `from` and `to`, else zero.
pub(crate) fn hump(x: f64, from: f64, to: f64) -> f64 {
    if x <= from || x >= to { 0.0 } else { (std::f64::consts::PI * (x - from) / (to - from)).sin().powi(2) }
}

/// Smootherstep: 0 below 0, 1 above 1, with vanishing first and second derivatives at both.
pub(crate) fn smooth(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    x * x * x * (x * (6.0 * x - 15.0) + 10.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn phases_meet_their_ends_and_their_peak() {
        for (force, ends) in [
            (Force::PushOff, Ends { speed: [0.0, 1.2], height: [0.0, 0.05] }),
            (Force::Bounce, Ends { speed: [-1.2, 1.1], height: [0.05, 0.06] }),
            (Force::Settle, Ends { speed: [-1.2, 0.0], height: [0.05, 0.0] }),
        ] {
            let duration = Phase::duration_for_peak(force, ends, 3.0);
            let phase = Phase::new(force, 1.0, duration, ends);
            assert!((phase.peak - 3.0).abs() < 0.01, "{force:?} peaks at {}", phase.peak);
            assert!(phase.least > -0.05, "{force:?} pulls at the ground: {}", phase.least);
            assert!((phase.height(1.0 + duration) - ends.height[1]).abs() < 1e-9);
            assert!((phase.speed[STEPS] - ends.speed[1]).abs() < 1e-9);
        }
    }
}
