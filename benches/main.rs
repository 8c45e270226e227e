//! Speed of what runs for every frame, each beside a plain way to the same numbers, timed in the same run:
//!
//! ```text
//! cargo bench
//! cargo bench -- skinning
//! ```
//!
//! The plain ways are written here; skinning and decoding are checked to give the same numbers before they are timed.

mod fit;
mod implicit;
mod networks;
mod skinning;
mod triangles;

use glam::Vec3;
use softtissue_body::procedural::{ProceduralConfig, generate};
use softtissue_body::{BodyModel, Pose};
use std::sync::OnceLock;

fn main() {
    divan::main();
}

/// The procedural body of a level, made once.
fn body(level: u8) -> &'static BodyModel {
    static BODIES: [OnceLock<BodyModel>; 2] = [OnceLock::new(), OnceLock::new()];
    let make = || generate(&ProceduralConfig { level, ..Default::default() }).expect("a body").model;
    BODIES[usize::from(level)].get_or_init(make)
}

/// Joint rotations `[J]` of a frame of somebody who swings arms, legs and trunk.
fn swing(joints: usize, frame: usize) -> Vec<Vec3> {
    let phase = 0.16 * frame as f32;
    let joint = |j: usize| {
        let lag = 0.8 * (j as f32).sin();
        Vec3::new(0.35 * (phase + lag).sin(), 0.15 * (phase - lag).cos(), 0.2 * (phase + 2.0 * lag).sin())
    };
    (0..joints).map(joint).collect()
}

/// A pose of these rotations at a fixed place.
fn pose(rotations: &[Vec3]) -> Pose<'_> {
    Pose { rotations, translation: Vec3::new(0.1, 0.9, -0.2) }
}

/// Asserts that two ways give the same points within `tolerance` metres.
fn assert_close(a: &[Vec3], b: &[Vec3], tolerance: f32) {
    let worst = a.iter().zip(b).map(|(a, b)| a.distance(*b)).fold(0.0, f32::max);
    assert!(a.len() == b.len() && worst <= tolerance, "two ways to the same are {worst} m apart");
}
