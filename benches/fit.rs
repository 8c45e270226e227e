//! A frame of the pose fit, warm-started: several analytic gradients and Gauss-Newton matrices. Beside it one gradient
//! by forward differences of the same objective, the least that a fit without derivatives would need for one step.

use crate::{body, pose, swing};
use divan::{Bencher, black_box};
use glam::Vec3;
use softtissue_body::ShapedBody;
use softtissue_clips::{ClipId, ScanClip};
use softtissue_fit::{FitConfig, Objective, ObjectiveKind, PackedBody, WeightedBody, fit_motion, region_weights};
use softtissue_geometry::Frames;
use softtissue_monitor::Silent;
use std::sync::Arc;

/// Frames of the clip: the first, which starts from nothing, is shared out among the others.
const FRAMES: usize = 16;

fn objective(level: u8) -> (Objective, ShapedBody) {
    let body = body(level);
    let shaped = body.shaped(&[0.5, -0.5]);
    let weighted = WeightedBody::new(Arc::new(PackedBody::new(body)), &region_weights(&body.regions));
    (Objective::new(weighted, ObjectiveKind::Unposed, &shaped, None), shaped)
}

/// The scanned clip, without flesh or noise.
#[divan::bench(args = [0, 1], sample_count = 10)]
fn sixteen_frames(bencher: Bencher, level: u8) {
    let (objective, shaped) = objective(level);
    let body = body(level);
    let mut vertices = Frames::new(body.vertex_count());
    (0..FRAMES).for_each(|t| vertices.push(&body.posed(&shaped, pose(&swing(body.joint_count(), t)), None)));
    let scan = ScanClip { id: ClipId::new("a", "swing", 0), fps: 60.0, vertices };
    let config = FitConfig::default();
    bencher.bench_local(|| fit_motion(&objective, black_box(&scan), 1, &config, &Silent).expect("a fit"));
}

#[divan::bench(args = [0, 1], sample_count = 10)]
fn one_gradient_by_differences(bencher: Bencher, level: u8) {
    const STEP: f32 = 1e-3;
    let (objective, shaped) = objective(level);
    let body = body(level);
    let scan = body.posed(&shaped, pose(&swing(body.joint_count(), 1)), None);
    let rotations = swing(body.joint_count(), 0);
    bencher.bench_local(|| {
        let here = objective.value(pose(&rotations), black_box(&scan));
        let mut gradient = Vec::with_capacity(3 * rotations.len() + 3);
        for axis in [Vec3::X, Vec3::Y, Vec3::Z] {
            for joint in 0..rotations.len() {
                let mut turned = rotations.clone();
                turned[joint] += axis * STEP;
                gradient.push((objective.value(pose(&turned), &scan) - here) / f64::from(STEP));
            }
            let mut moved = pose(&rotations);
            moved.translation += axis * STEP;
            gradient.push((objective.value(moved, &scan) - here) / f64::from(STEP));
        }
        gradient
    });
}
