//! Where the joints of a body lie at rest.

use super::parameters::ShapeParameters;
use glam::Vec3;

/// Joints in SMPL's order, see [`crate::Skeleton::smpl`].
pub const JOINTS: usize = 24;

const fn v(x: f32, y: f32, z: f32) -> Vec3 {
    Vec3::new(x, y, z)
}

/// Rest joints of the neutral body; right-hand joints are mirror images.
const NEUTRAL_JOINTS: [Vec3; JOINTS] = [
    v(0.0, 0.915, -0.005),
    v(0.088, 0.865, 0.0),
    v(-0.088, 0.865, 0.0),
    v(0.0, 1.005, -0.020),
    v(0.138, 0.465, 0.008),
    v(-0.138, 0.465, 0.008),
    v(0.0, 1.125, -0.030),
    v(0.182, 0.080, -0.025),
    v(-0.182, 0.080, -0.025),
    v(0.0, 1.195, -0.030),
    v(0.192, 0.028, 0.095),
    v(-0.192, 0.028, 0.095),
    v(0.0, 1.395, -0.030),
    v(0.072, 1.330, -0.025),
    v(-0.072, 1.330, -0.025),
    v(0.0, 1.480, 0.002),
    v(0.168, 1.345, -0.028),
    v(-0.168, 1.345, -0.028),
    v(0.343, 1.150, -0.032),
    v(-0.343, 1.150, -0.032),
    v(0.502, 0.968, -0.010),
    v(-0.502, 0.968, -0.010),
    v(0.557, 0.905, -0.002),
    v(-0.557, 0.905, -0.002),
];

/// Rest joints of a body: the knobs move them, stature scales them.
pub fn joints(p: &ShapeParameters) -> [Vec3; JOINTS] {
    let s = p.scale();
    let leg = 1.0 + 0.022 * p.leg;
    let hip_y = NEUTRAL_JOINTS[1].y;
    let crown = 1.68;
    // the trunk gives what the legs take
    let trunk = (crown - hip_y * leg) / (crown - hip_y);
    let heavy = 0.006 * p.mass;
    std::array::from_fn(|j| {
        let mut x = NEUTRAL_JOINTS[j];
        let is_arm = matches!(j, 13 | 14 | 16..=23);
        let is_leg = matches!(j, 1 | 2 | 4 | 5 | 7 | 8 | 10 | 11);
        let side = x.x.signum();
        if is_leg {
            x.y *= leg;
            // heavier people stand wider
            x.x += side * heavy * ((hip_y - NEUTRAL_JOINTS[j].y) / hip_y).clamp(0.0, 1.0) * 2.0;
        } else if is_arm {
            let collar = NEUTRAL_JOINTS[13].y;
            x.y = hip_y * leg + (collar - hip_y) * trunk + (x.y - collar);
            let wide = 0.008 * p.shoulder + 0.003 * p.muscle + 0.004 * p.mass;
            x.x += side * wide * if matches!(j, 13 | 14) { 0.4 } else { 1.0 };
        } else if matches!(j, 12 | 15) {
            let neck = NEUTRAL_JOINTS[12].y;
            x.y = hip_y * leg + (neck - hip_y) * trunk + (x.y - neck);
        } else {
            x.y = hip_y * leg + (x.y - hip_y) * trunk;
        }
        x * s
    })
}
