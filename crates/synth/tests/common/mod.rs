//! A figure without a body.
use glam::Vec3;
use softtissue_synth::motion::{Figure, JOINTS};

/// Rest joints of an adult in SMPL's order, for tests without a body: 1.72 m, T-pose.
pub fn test_figure() -> Figure {
    let half: [(f32, f32, f32); 15] = [
        (0.0, 0.95, 0.0),
        (0.085, 0.87, 0.0),
        (0.0, 1.06, -0.01),
        (0.095, 0.48, 0.0),
        (0.0, 1.19, -0.01),
        (0.1, 0.075, -0.02),
        (0.0, 1.25, -0.01),
        (0.12, 0.025, 0.1),
        (0.0, 1.45, -0.02),
        (0.07, 1.38, -0.02),
        (0.0, 1.53, 0.01),
        (0.17, 1.4, -0.02),
        (0.43, 1.4, -0.03),
        (0.68, 1.4, -0.03),
        (0.76, 1.4, -0.03),
    ];
    // (index into `half`, mirrored) of the 24 joints
    const ORDER: [(usize, bool); JOINTS] = [
        (0, false),
        (1, false),
        (1, true),
        (2, false),
        (3, false),
        (3, true),
        (4, false),
        (5, false),
        (5, true),
        (6, false),
        (7, false),
        (7, true),
        (8, false),
        (9, false),
        (9, true),
        (10, false),
        (11, false),
        (11, true),
        (12, false),
        (12, true),
        (13, false),
        (13, true),
        (14, false),
        (14, true),
    ];
    let joints: Vec<_> = ORDER
        .iter()
        .map(|&(i, mirrored)| {
            let (x, y, z) = half[i];
            Vec3::new(if mirrored { -x } else { x }, y, z).as_dvec3()
        })
        .collect();
    Figure::from_joints(&joints, 0.0).expect("a standing figure")
}
