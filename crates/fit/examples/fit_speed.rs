//! Speed of the pose fit on one core, at both levels of the procedural body:
//!
//! ```text
//! cargo run --release -p softtissue-fit --example fit_speed
//! ```
//!
//! A person swings arms, legs and trunk while soft vertices carry about a centimetre of flesh motion at 4 Hz and every
//! vertex half a millimetre of noise, so that warm starts, residuals and iteration counts are those of real use.

use glam::Vec3;
use softtissue_body::procedural::{ProceduralConfig, generate};
use softtissue_body::{BodyModel, Region};
use softtissue_clips::{ClipId, ScanClip};
use softtissue_fit::{FitConfig, Objective, ObjectiveKind, PackedBody, WeightedBody, fit_motion, region_weights};
use softtissue_geometry::Frames;
use softtissue_monitor::Silent;
use softtissue_random::Draws;
use std::sync::Arc;
use std::time::{Duration, Instant};

const FRAMES: usize = 30;
const FPS: f32 = 60.0;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    for level in [0, 1] {
        let body = generate(&ProceduralConfig { level, ..Default::default() })?.model;
        let shaped = body.shaped(&[0.5, -0.5]);
        let scan = scan(&body);
        let start = Instant::now();
        let packed = Arc::new(PackedBody::new(&body));
        let weighted = WeightedBody::new(packed, &region_weights(&body.regions));
        let ready = start.elapsed().as_secs_f64();
        for kind in [ObjectiveKind::Unposed, ObjectiveKind::Posed] {
            let objective = Objective::new(weighted.clone(), kind, &shaped, None);
            let start = busy();
            let fitted = fit_motion(&objective, &scan, 1, &FitConfig::default(), &Silent)?;
            let seconds = (busy() - start).as_secs_f64();
            let trips = fitted.evaluations.iter().sum::<usize>() as f64 / FRAMES as f64;
            println!(
                "{} vertices, {kind:?}: {:.0} frames/s on one core, {trips:.1} evaluations a frame ({ready:.2} s to prepare a body)",
                body.vertex_count(),
                FRAMES as f64 / seconds,
            );
        }
    }
    Ok(())
}

/// Time that this thread has run, so that a busy machine does not distort the figure; where the system does not tell,
/// the time that has passed.
fn busy() -> Duration {
    static START: std::sync::OnceLock<Instant> = std::sync::OnceLock::new();
    let told = std::fs::read_to_string("/proc/thread-self/schedstat").ok();
    let nanoseconds = told.and_then(|text| text.split(' ').next()?.parse().ok());
    nanoseconds.map_or_else(|| START.get_or_init(Instant::now).elapsed(), Duration::from_nanos)
}

/// A clip with known pose, flesh and noise.
fn scan(body: &BodyModel) -> ScanClip {
    let (mut rotations, mut deltas, mut translations) =
        (Frames::new(body.joint_count()), Frames::new(body.vertex_count()), vec![]);
    for t in 0..FRAMES {
        let phase = std::f32::consts::TAU * 1.5 * t as f32 / FPS;
        let swing = |j: usize| {
            let (a, b) = (0.8 * (j as f32).sin(), 0.8 * (2.3 * j as f32).cos());
            Vec3::new(0.35 * (phase + a).sin(), 0.15 * (phase + b).cos(), 0.2 * (phase + a + b).sin())
        };
        rotations.push(&(0..body.joint_count()).map(swing).collect::<Vec<_>>());
        translations.push(Vec3::new(0.3 * phase.sin(), 0.1 * (2.0 * phase).cos(), 0.2 * phase.cos()));
        let wobble = std::f32::consts::TAU * 4.0 * t as f32 / FPS;
        let flesh = |(p, region): (&Vec3, &Region)| {
            let amplitude = if region.is_soft() { 0.008 } else { 0.0 };
            amplitude * (12.0 * *p + wobble).map(f32::sin)
        };
        deltas.push(&body.template.iter().zip(&body.regions.0).map(flesh).collect::<Vec<_>>());
    }
    let mut vertices = body.posed_frames(&body.shaped(&[0.5, -0.5]), &rotations, &translations, Some(&deltas));
    let mut draws = Draws::new(1, "fit speed", 0, 0);
    vertices
        .points_mut()
        .iter_mut()
        .for_each(|p| *p += Vec3::from_array([0; 3].map(|_: i32| 5e-4 * draws.normal() as f32)));
    ScanClip { id: ClipId::new("a", "swing", 0), fps: FPS, vertices }
}
