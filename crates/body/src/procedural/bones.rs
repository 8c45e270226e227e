use glam::Vec3;
use serde::{Deserialize, Serialize};

/// A rigid core that turns with one joint: a round cone in rest space.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct BoneCapsule {
    /// The joint that turns it.
    pub joint: u8,
    /// First end, metres.
    pub start: Vec3,
    /// Second end, metres.
    pub end: Vec3,
    /// Radius at the first end, metres.
    pub start_radius: f32,
    /// Radius at the second end, metres.
    pub end_radius: f32,
}

impl BoneCapsule {
    /// Distance to the surface (negative inside) and its gradient, both continuous off the axis.
    pub fn distance(&self, p: Vec3) -> (f32, Vec3) {
        let axis = self.end - self.start;
        let length = axis.length().max(1e-6);
        let axis = axis / length;
        // the sphere of the sweep that comes nearest: least |p - c(u)| - r(u) over u
        let slope = ((self.end_radius - self.start_radius) / length).clamp(-0.99, 0.99);
        let along = (p - self.start).dot(axis);
        let radial = (p - self.start - axis * along).length();
        let u = (along + radial * slope / (1.0 - slope * slope).sqrt()).clamp(0.0, length);
        let away = p - self.start - axis * u;
        let reach = away.length().max(1e-7);
        (reach - (self.start_radius + slope * u), away / reach)
    }
}

/// All bones of a body at one shape, in its rest space.
#[derive(Clone, Debug, PartialEq)]
pub struct BoneField {
    /// The bones.
    pub bones: Vec<BoneCapsule>,
}

impl BoneField {
    /// Smooth distance `-k log sum exp(-d_i / k)` over all bones and its gradient, for `k` metres.
    pub fn distance(&self, p: Vec3, k: f32) -> (f32, Vec3) {
        let samples: Vec<(f32, Vec3)> = self.bones.iter().map(|b| b.distance(p)).collect();
        let least = samples.iter().fold(f32::INFINITY, |m, s| m.min(s.0));
        let (mut sum, mut gradient) = (0.0, Vec3::ZERO);
        for (d, g) in samples {
            let w = ((least - d) / k).exp();
            sum += w;
            gradient += g * w;
        }
        (least - k * sum.ln(), gradient / sum)
    }
}

/// The bones between `joints` (`[24]`), for a body `scale` times the neutral one.
pub fn bones(joints: &[Vec3], scale: f32) -> BoneField {
    let s = scale;
    let mut bones = Vec::new();
    let mut add = |joint: usize, start: Vec3, start_radius: f32, end: Vec3, end_radius: f32| {
        bones.push(BoneCapsule {
            joint: joint as u8,
            start,
            end,
            start_radius: start_radius * s,
            end_radius: end_radius * s,
        });
    };
    let j = joints;
    let at = |joint: usize, x: f32, y: f32, z: f32| j[joint] + Vec3::new(x, y, z) * s;
    add(0, at(1, 0.0, 0.01, -0.01), 0.045, at(2, 0.0, 0.01, -0.01), 0.045);
    add(0, at(0, 0.0, -0.03, -0.03), 0.045, at(0, 0.0, 0.06, -0.03), 0.035);
    add(3, at(3, 0.0, 0.0, 0.0), 0.026, at(6, 0.0, 0.0, -0.005), 0.028);
    add(6, at(6, 0.0, 0.0, -0.005), 0.032, at(9, 0.0, 0.0, 0.0), 0.055);
    // the rib cage: two lobes and the upper chest
    for side in [1.0, -1.0] {
        add(9, at(9, side * 0.050, -0.01, 0.007), 0.053, at(9, side * 0.042, 0.10, -0.008), 0.042);
        let (collar, shoulder, elbow, wrist, hand) =
            if side > 0.0 { (13, 16, 18, 20, 22) } else { (14, 17, 19, 21, 23) };
        let (hip, knee, ankle, foot) = if side > 0.0 { (1, 4, 7, 10) } else { (2, 5, 8, 11) };
        add(collar, j[collar], 0.026, j[shoulder], 0.024);
        add(shoulder, j[shoulder], 0.022, j[elbow], 0.018);
        add(elbow, j[elbow], 0.018, j[wrist], 0.014);
        add(wrist, j[wrist], 0.012, j[hand], 0.012);
        add(hand, j[hand], 0.009, j[hand] + (j[hand] - j[wrist]).normalize() * (0.045 * s), 0.005);
        add(hip, j[hip], 0.030, j[knee], 0.028);
        add(knee, j[knee], 0.028, j[ankle], 0.018);
        add(ankle, j[ankle], 0.020, j[foot], 0.015);
        add(ankle, j[ankle], 0.020, at(ankle, 0.0, -0.045, -0.025), 0.020);
        add(foot, j[foot], 0.013, at(foot, 0.0, -0.008, 0.050), 0.009);
    }
    add(12, at(12, 0.0, -0.03, -0.01), 0.030, at(15, 0.0, 0.0, -0.01), 0.030);
    add(15, at(15, 0.0, 0.06, 0.01), 0.045, at(15, 0.0, 0.115, 0.0), 0.065);
    BoneField { bones }
}
