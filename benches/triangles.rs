//! A frame of deltas to deformations of triangles, and their stitching. Beside it the same with the systems factored
//! anew for the frame, as one does without keeping the factors.

use crate::{assert_close, body};
use divan::{Bencher, black_box};
use glam::Vec3;
use softtissue_fit::{FitConfig, TriangleForm};

fn form(level: u8) -> TriangleForm {
    let body = body(level);
    TriangleForm::new(&body.template, &body.topology, FitConfig::default().triangle_smoothness).expect("one piece")
}

/// Waves over the body, 1 cm.
fn deltas(level: u8) -> Vec<Vec3> {
    let wave = |p: &Vec3| 0.01 * Vec3::new((9.0 * p.y).sin(), (11.0 * p.x + p.y).cos(), (8.0 * p.y).sin());
    body(level).template.iter().map(wave).collect()
}

#[divan::bench(args = [0, 1], sample_count = 20)]
fn extraction(bencher: Bencher, level: u8) {
    let (form, deltas) = (form(level), deltas(level));
    bencher.bench_local(|| form.gradients(black_box(&deltas)));
}

#[divan::bench(args = [0, 1], sample_count = 20)]
fn stitching(bencher: Bencher, level: u8) {
    let (form, deltas) = (form(level), deltas(level));
    let deformed = form.gradients(&deltas);
    assert_close(&form.stitch(&deformed), &deltas, 1e-4);
    bencher.bench_local(|| form.stitch(black_box(&deformed)));
}

#[divan::bench(args = [0, 1], sample_count = 5)]
fn factored_anew(bencher: Bencher, level: u8) {
    let deltas = deltas(level);
    bencher.bench_local(|| form(level).round_trip(black_box(&deltas)));
}
