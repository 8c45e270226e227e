use glam::Vec3;
use softtissue_clips::{ClipId, MotionClip};
use softtissue_geometry::Frames;
use softtissue_import::motion::resample;
use std::path::Path;

/// One joint that turns about `axis` by `angle(seconds)`, moving along x by the same number.
fn clip(frames: usize, fps: f32, axis: Vec3, angle: impl Fn(f32) -> f32) -> MotionClip {
    let at = |t: usize| angle(t as f32 / fps);
    let rotations = Frames::from_points(1, (0..frames).map(|t| axis * at(t)).collect());
    let translations = (0..frames).map(|t| Vec3::X * at(t)).collect();
    MotionClip { id: ClipId::new("a", "b", 0), fps, rotations, translations }
}

fn resampled(clip: &MotionClip, fps: f32) -> MotionClip {
    resample(clip, fps, Path::new("clip")).unwrap()
}

/// Greatest error of angle and of place against what the clip was sampled from.
fn errors(clip: &MotionClip, axis: Vec3, angle: impl Fn(f32) -> f32) -> (f32, f32) {
    (0..clip.len()).fold((0.0f32, 0.0f32), |(a, p), t| {
        let wanted = angle(t as f32 / clip.fps);
        let found = clip.rotations.frame(t)[0];
        let turn = |w: Vec3| softtissue_geometry::rotation_from_axis_angle(w);
        let off = (turn(found) - turn(axis * wanted)).to_cols_array().into_iter().fold(0.0f32, |m, x| m.max(x.abs()));
        (a.max(off), p.max((clip.translations[t] - Vec3::X * wanted).length()))
    })
}

#[test]
fn steady_motion_is_exact_at_any_rate() {
    let axis = Vec3::new(0.6, 0.0, 0.8);
    // through more than a whole turn: the axis-angle vectors leap, the rotations do not
    let steady = |s: f32| 2.0 * s;
    let source = clip(481, 120.0, axis, steady);
    for (fps, frames) in [(60.0, 241), (30.0, 121), (59.94, 240), (25.0, 101), (200.0, 801)] {
        let other = resampled(&source, fps);
        assert_eq!((other.len(), other.fps), (frames, fps));
        let (angle, place) = errors(&other, axis, steady);
        assert!(angle < 2e-5 && place < 2e-5, "{fps}: {angle} {place}");
    }
    assert_eq!(resampled(&source, 120.0), source);
}

#[test]
fn frames_that_fall_on_frames_are_kept_and_the_error_falls_with_the_rate() {
    let axis = Vec3::Y;
    let swing = |s: f32| (std::f32::consts::TAU * 1.5 * s).sin();
    let source = clip(61, 30.0, axis, swing);
    let double = resampled(&source, 60.0);
    for t in 0..61 {
        assert!(double.rotations.frame(2 * t)[0].abs_diff_eq(source.rotations.frame(t)[0], 1e-6));
        assert!(double.translations[2 * t].abs_diff_eq(source.translations[t], 1e-6));
    }
    // inside, away from the one-sided ends
    let inside = |clip: &MotionClip| {
        let (from, to) = (clip.len() / 4, 3 * clip.len() / 4);
        let mut part = clip.slice(0..to);
        for t in 0..from {
            part.rotations.frame_mut(t)[0] = axis * swing(t as f32 / clip.fps);
            part.translations[t] = Vec3::X * swing(t as f32 / clip.fps);
        }
        errors(&part, axis, swing)
    };
    let coarse = inside(&double);
    let fine = inside(&resampled(&clip(121, 60.0, axis, swing), 120.0));
    assert!(coarse.0 < 1e-2 && coarse.1 < 1e-2, "{coarse:?}");
    // third order at least: half the step, an eighth of the error
    assert!(fine.0 < coarse.0 / 7.0 && fine.1 < coarse.1 / 7.0, "{fine:?} {coarse:?}");
}

#[test]
fn a_clip_that_would_be_one_frame_is_refused() {
    let short = clip(3, 120.0, Vec3::X, |s| s);
    let message = resample(&short, 30.0, Path::new("short.bvh")).unwrap_err().to_string();
    assert!(message.contains("short.bvh") && message.contains("too short"), "{message}");
}

#[test]
fn a_clip_that_would_last_for_hours_is_refused() {
    for fps in [1e-3, f32::MIN_POSITIVE, 1e-45] {
        let slow = clip(400, fps, Vec3::X, |s| s.sin());
        let message = resample(&slow, 60.0, Path::new("slow.bvh")).unwrap_err().to_string();
        assert!(message.contains("slow.bvh") && message.contains("cut it"), "{fps}: {message}");
    }
}
