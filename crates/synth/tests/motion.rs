//! Motions: physics of landings, planted feet, determinism, styles.
mod common;

use common::test_figure;
use glam::{DQuat, DVec3, Vec3};
use softtissue_clips::MotionClip;
use softtissue_synth::SynthError;
use softtissue_synth::motion::{Figure, MOTIONS, Performance, Request, Style, ground_reaction, landing_peaks, perform};

const HOPPING: [&str; 5] =
    ["jumping_jacks", "light_hopping_loose", "light_hopping_stiff", "one_leg_jump", "running_on_spot"];

fn request(motion: &str, take: u32, frames: usize) -> Request<'_> {
    Request { subject: "s00", motion, take, frames, fps: 60.0, seed: 3 }
}

/// Neutral and drawn styles with two takes each.
fn performances(motion: &str, frames: usize) -> Vec<(Style, Performance)> {
    let figure = test_figure();
    let styles = std::iter::once(Style::neutral()).chain((0..2).map(|s| Style::draw(3, s)));
    styles
        .flat_map(|style| (0..2).map(move |take| (style.clone(), take)))
        .map(|(style, take)| {
            let performance = perform(&request(motion, take, frames), &figure, &style).unwrap();
            (style, performance)
        })
        .collect()
}

/// The pads of left and right toes in a frame.
fn pads(figure: &Figure, clip: &MotionClip, t: usize) -> [DVec3; 2] {
    let rotations = clip.rotations.frame(t);
    let local = std::array::from_fn(|j| DQuat::from_scaled_axis(rotations[j].as_dvec3()));
    let (positions, world) = figure.forward(&local, clip.translations[t].as_dvec3());
    [0, 1].map(|side| figure.toe_pad(side, &positions, &world))
}

#[test]
fn every_landing_peaks_between_two_and_a_half_and_four_body_weights() {
    let figure = test_figure();
    for motion in HOPPING.into_iter().chain(["hop_then_stand", "one_leg_jump_then_stand"]) {
        let frames = if motion.ends_with("stand") { 300 } else { 210 };
        for (style, performance) in performances(motion, frames) {
            let peaks = landing_peaks(&ground_reaction(&figure, &performance.clip), 60.0);
            assert!(peaks.len() >= 2, "{motion} lands {} times", peaks.len());
            for peak in peaks {
                assert!((2.5..=4.0).contains(&peak), "{motion} lands with {peak:.2} body weights, {style:?}");
            }
        }
    }
}

#[test]
fn landings_have_an_impact_transient() {
    // a half sine alone is nearly straight over the first 70 ms; the transient stands out in their middle
    let figure = test_figure();
    let fine = Request { fps: 480.0, frames: 960, ..request("light_hopping_loose", 0, 0) };
    let clip = perform(&fine, &figure, &Style::neutral()).unwrap().clip;
    let force = ground_reaction(&figure, &clip);
    let landing = (501..force.len()).find(|&t| force[t - 1] < 0.02 && force[t] > 0.02).unwrap();
    let at = |ms: usize| force[landing + ms * 48 / 100];
    let bulge = at(35) - 0.5 * (at(0) + at(70));
    assert!((0.5..1.2).contains(&bulge), "{bulge:.2} body weights: {:.2} {:.2} {:.2}", at(0), at(35), at(70));
}

#[test]
fn feet_push_and_never_pull() {
    let figure = test_figure();
    for motion in MOTIONS {
        for (_, performance) in performances(motion, 180) {
            let force = ground_reaction(&figure, &performance.clip);
            let least = force.iter().copied().fold(f64::INFINITY, f64::min);
            assert!(least > -0.02, "{motion} pulls at the ground with {least:.2} body weights");
            let most = force.iter().copied().fold(0.0, f64::max);
            assert!(most < 4.0, "{motion} pushes with {most:.2} body weights");
        }
    }
}

#[test]
fn flights_are_ballistic() {
    let figure = test_figure();
    for motion in HOPPING {
        let performance = perform(&request(motion, 0, 180), &figure, &Style::neutral()).unwrap();
        let force = ground_reaction(&figure, &performance.clip);
        let mut flying = 0;
        for t in 1..performance.clip.len() - 1 {
            // well inside a flight: nothing bears in the frame before, in this one, or after
            if performance.contacts[t - 1..=t + 1].iter().all(|c| !c[0] && !c[1]) {
                assert!(force[t - 1].abs() < 0.01, "{motion} weighs {:.3} in flight", force[t - 1]);
                flying += 1;
            }
        }
        assert!(flying > 15, "{motion} flies for {flying} frames");
    }
}

#[test]
fn bearing_feet_stay_where_they_are() {
    let figure = test_figure();
    for motion in MOTIONS {
        for (_, performance) in performances(motion, 180) {
            assert!(performance.shortfall < 1e-6, "{motion} misses a foothold by {} m", performance.shortfall);
            for t in 1..performance.clip.len() {
                let (now, before) = (pads(&figure, &performance.clip, t), pads(&figure, &performance.clip, t - 1));
                for side in 0..2 {
                    let height = now[side].y - figure.ball_height(side);
                    assert!(height > -5e-5, "{motion} frame {t}: toes are {height} m under the ground");
                    if performance.contacts[t][side] && performance.contacts[t - 1][side] {
                        let slid = now[side].distance(before[side]);
                        assert!(slid < 5e-5, "{motion} frame {t}: a planted foot slides by {slid} m");
                        assert!(height < 5e-5, "{motion} frame {t}: a planted foot hovers at {height} m");
                    }
                }
            }
        }
    }
}

#[test]
fn clips_begin_in_the_a_pose_and_change_smoothly() {
    for motion in MOTIONS {
        for (_, performance) in performances(motion, 120) {
            let clip = &performance.clip;
            for t in 1..20 {
                for (a, b) in clip.rotations.frame(0).iter().zip(clip.rotations.frame(t)) {
                    assert!(a.distance(*b) < 1e-3, "{motion} moves at frame {t}");
                }
            }
            let moved: f32 = (60..120)
                .flat_map(|t| clip.rotations.frame(t).iter().zip(clip.rotations.frame(t - 1)))
                .map(|(a, b)| a.distance(*b))
                .sum();
            assert!(moved > 2.0, "{motion} hardly moves: {moved} rad");
            for t in 1..clip.len() {
                for (j, (a, b)) in clip.rotations.frame(t).iter().zip(clip.rotations.frame(t - 1)).enumerate() {
                    assert!(a.is_finite() && a.length() < 3.0, "{motion} joint {j} turns by {}", a.length());
                    assert!(a.distance(*b) < 0.6, "{motion} joint {j} jumps at frame {t} by {}", a.distance(*b));
                }
            }
        }
    }
}

#[test]
fn the_body_stands_still_after_a_stop() {
    for motion in ["hop_then_stand", "running_on_spot_then_stand", "shake_hips_then_stand", "knees_then_stand"] {
        for (_, performance) in performances(motion, 270) {
            let clip = &performance.clip;
            // 2 s from the end, less the settling of the last landing
            for t in 190..269 {
                let moved = clip.translations[t].distance(clip.translations[t + 1]);
                let turned = (0..24)
                    .map(|j| clip.rotations.frame(t)[j].distance(clip.rotations.frame(t + 1)[j]))
                    .fold(0.0, f32::max);
                assert!(moved < 1e-4 && turned < 1e-3, "{motion} frame {t} moves by {moved} m and {turned} rad");
            }
        }
    }
}

#[test]
fn counted_hops_land_just_before_the_standing() {
    for (style, performance) in performances("hop_then_stand", 270) {
        let changes: Vec<usize> =
            (1..270).filter(|&t| performance.contacts[t] != performance.contacts[t - 1]).collect();
        assert_eq!(changes.len(), 4, "two hops: {changes:?} {style:?}");
        let (landing, stands) = (changes[3], 150);
        assert!((stands - 36..stands - 6).contains(&landing), "it lands at frame {landing}, {style:?}");
        let clip = &performance.clip;
        for t in stands + 1..269 {
            let moved = clip.translations[t].distance(clip.translations[t + 1]);
            assert!(moved < 1e-4, "frame {t} moves by {moved} m, {style:?}");
        }
    }
}

#[test]
fn the_same_request_gives_the_same_clip_and_another_take_another() {
    let figure = test_figure();
    let style = Style::draw(5, 1);
    let make = |seed, take| {
        let request = Request { seed, ..request("jumping_jacks", take, 150) };
        perform(&request, &figure, &style).unwrap().clip
    };
    assert_eq!(make(1, 0), make(1, 0));
    assert_ne!(make(1, 0).rotations, make(1, 1).rotations);
    assert_ne!(make(1, 1).rotations, make(2, 1).rotations);
}

#[test]
fn a_subject_shows_in_the_wrists() {
    // mean wrist angle of two motions: within a subject alike, between subjects different
    let figure = test_figure();
    let wrist = |subject: u64, motion: &str| -> Vec3 {
        let clip = perform(&request(motion, 0, 150), &figure, &Style::draw(9, subject)).unwrap().clip;
        clip.rotations.iter().map(|frame| frame[20]).sum::<Vec3>() / clip.len() as f32
    };
    let wrists: Vec<[Vec3; 2]> = (0..6).map(|s| [wrist(s, "hips"), wrist(s, "jumping_jacks")]).collect();
    let within = wrists.iter().map(|w| w[0].distance(w[1])).sum::<f32>() / 6.0;
    let between = (0..6).map(|s| wrists[s][0].distance(wrists[(s + 1) % 6][0])).sum::<f32>() / 6.0;
    assert!(between > 3.0 * within, "between {between}, within {within}");
}

#[test]
fn an_unknown_motion_is_named_with_the_known_ones() {
    for name in ["jumping_jack", "dance_then_stand", "", "hop"] {
        let error = perform(&request(name, 0, 30), &test_figure(), &Style::neutral()).unwrap_err();
        assert!(matches!(error, SynthError::UnknownMotion { .. }));
        assert!(error.to_string().contains("jumping_jacks"), "{error}");
    }
}

#[test]
fn short_and_slow_clips_are_fine() {
    for (frames, fps) in [(0, 60.0), (1, 60.0), (60, 30.0), (60, 120.0)] {
        for motion in MOTIONS {
            let request = Request { frames, fps, ..request(motion, 0, 0) };
            let clip = perform(&request, &test_figure(), &Style::neutral()).unwrap().clip;
            assert_eq!(clip.len(), frames);
        }
    }
}
