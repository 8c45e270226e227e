//! Motions as they come in live: at any rate, broken, unknown, starting and ending anywhere.

use crate::tiny::{Parts, autoregressive, bundle, feedback_bundle, motion, swinging};
use glam::Vec3;
use softtissue_body::{Pose, Region};
use softtissue_bundle::descriptor::FeatureKind;
use softtissue_bundle::*;
use softtissue_geometry::Frames;
use softtissue_random::Draws;

fn rms(points: &[Vec3]) -> f32 {
    (points.iter().map(|d| d.length_squared()).sum::<f32>() / points.len().max(1) as f32).sqrt()
}

fn largest(points: &[Vec3]) -> f32 {
    points.iter().fold(0.0, |m, d| m.max(d.length()))
}

fn difference(a: &[Vec3], b: &[Vec3]) -> Vec<Vec3> {
    a.iter().zip(b).map(|(a, b)| *a - *b).collect()
}

/// [`swinging`] at the bundle's rate.
fn native(frames: usize) -> (Frames, Vec<Vec3>) {
    let mut rotations = Frames::new(3);
    let mut translations = vec![];
    for t in 0..frames {
        let (pose, root) = swinging(t as f32 / 60.0);
        rotations.push(&pose);
        translations.push(root);
    }
    (rotations, translations)
}

/// Time steps of a caller for four seconds: a steady rate, or 0 for one that changes all the time.
fn time_steps(fps: f32) -> Vec<f32> {
    let mut draws = Draws::new(4, "time steps", 0, 0);
    let (mut steps, mut sum) = (vec![], 0.0);
    while sum < 4.0 {
        let dt = if fps > 0.0 { 1.0 / fps } else { draws.range(0.007, 0.028) as f32 };
        steps.push(dt);
        sum += dt;
    }
    steps
}

/// Departure from the deltas at the bundle's own rate over their root mean square, after a second of run-in. What the body shows
/// must be the body with these deltas in the pose of this moment.
fn departure(player: &mut Player<&Bundle>, exact: &Frames, fps: f32) -> f32 {
    player.reset();
    let (mut errors, mut time) = (vec![], 0.0f64);
    for (i, dt) in time_steps(fps).into_iter().enumerate() {
        time += if i == 0 { 0.0 } else { f64::from(dt) };
        let (rotations, translation) = swinging(time as f32);
        player.advance(Pose { rotations: &rotations, translation }, dt);
        if time > 1.0 {
            let frame = (60.0 * time + 1e-3) as usize;
            let part = (60.0 * time - frame as f64) as f32;
            let at = exact.frame(frame).iter().zip(exact.frame(frame + 1)).map(|(a, b)| a.lerp(*b, part));
            errors.extend(player.deltas().iter().zip(at).map(|(d, e)| *d - e));
            if player.delay_frames() == 0 {
                let pose = Pose { rotations: &rotations, translation };
                let (bundle, deltas) = (player.bundle().clone(), player.deltas().to_vec());
                let wanted = bundle.body.posed(player.shaped(), pose, Some(&deltas));
                assert!(largest(&difference(player.vertices(), &wanted)) < 1e-5, "{fps}, frame {i}");
            }
        }
    }
    rms(&errors) / rms(&exact.points()[60 * exact.points_per_frame()..])
}

#[test]
fn every_frame_rate_gives_the_same_motion() {
    let (rotations, translations) = native(260);
    let pose = Parts { features: FeatureKind::Pose, bank: false, ..Default::default() };
    for bundle in [bundle(Parts::default()), bundle(pose), autoregressive(), feedback_bundle(true)] {
        let mut player = Player::new(&bundle, &[0.3, -0.5]).unwrap();
        let exact = player.rollout(&rotations, &translations).unwrap();
        assert_eq!(player.latency(), 0.0);
        for fps in [24.0, 30.0, 50.0, 59.94, 60.0, 120.0, 144.0, 0.0] {
            let found = departure(&mut player, &exact, fps);
            assert!(found < 0.05, "{} at {fps} frames a second: {found}", bundle.info.method);
            assert!(fps != 60.0 || found < 1e-4, "{found}");
        }
    }
}

#[test]
fn controlled_flesh_and_models_that_look_ahead_keep_time_too() {
    let (rotations, translations) = native(260);
    let bundles = [bundle(Parts::default()), bundle(Parts { look_ahead: 3, ..Default::default() })];
    let region = |softness: f32, lag: f32| (Region::Feet, Control { softness, lag, ..Default::default() });
    let controls = [
        Controls::gain(1.5),
        Controls { regions: vec![region(2.0, 0.0)], ..Default::default() },
        Controls { regions: vec![region(1.0, 0.01), region(0.7, 0.1)], ..Default::default() },
    ];
    for (bundle, latency) in bundles.iter().zip([0.0, 3.0 / 60.0]) {
        let mut player = Player::new(bundle, &[]).unwrap();
        assert_eq!(player.latency(), latency);
        for controls in &controls {
            player.set_controls(controls).unwrap();
            // Live, deltas come after their poses by the look-ahead.
            player.reset();
            let mut exact = Frames::new(bundle.body.vertex_count());
            for t in 0..260 {
                player.step(Pose { rotations: rotations.frame(t), translation: translations[t] });
                exact.push(player.deltas());
            }
            for fps in [24.0, 144.0] {
                let found = departure(&mut player, &exact, fps);
                assert!(found < 0.07, "{controls:?} at {fps}, {latency} s late: {found}");
            }
        }
    }
}

/// Whatever a program at its worst may hand over.
fn hostile(draws: &mut Draws, player: &mut Player<&Bundle>) -> StepReport {
    let (mut rotations, mut translation) = swinging(draws.range(0.0, 4.0) as f32);
    let mut dt = 1.0 / 60.0;
    let odd = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, f32::MIN_POSITIVE, -1.0, 0.0, 1e-30, 900.0, 2e3];
    let number = |draws: &mut Draws| odd[draws.below(odd.len())];
    match draws.below(9) {
        0 => rotations[draws.below(3)].y = number(draws),
        1 => translation.x = number(draws),
        2 => dt = number(draws),
        3 => dt = [10.0, 0.4999, 0.5001, 3600.0][draws.below(4)],
        4 => translation += Vec3::splat(draws.range(-9e4, 9e4) as f32),
        5 => rotations.truncate(draws.below(3)),
        6 => rotations.iter_mut().for_each(|w| *w = Vec3::splat(draws.range(-50.0, 50.0) as f32)),
        7 => rotations = vec![Vec3::splat(number(draws)); 5],
        _ => dt = draws.range(0.0, 0.1) as f32,
    }
    let pose = Pose { rotations: &rotations, translation };
    if draws.below(3) == 0 { player.step(pose) } else { player.advance(pose, dt) }
}

#[test]
fn bad_input_66_whatever_comes_in_is_reported_survived_and_forgotten() {
    let ahead = Parts { look_ahead: 2, ..Default::default() };
    for bundle in [bundle(Parts::default()), bundle(ahead), autoregressive(), feedback_bundle(true)] {
        let mut draws = Draws::new(8, "hostile", 0, 0);
        let (mut player, mut calm) =
            (Player::new(&bundle, &[9.0, -4.0]).unwrap(), Player::new(&bundle, &[9.0, -4.0]).unwrap());
        let (mut held, mut jumps, mut ignored, mut restarts) = (0, 0, 0, 0);
        let mut worst = 0.0f32;
        for round in 0..6 {
            for i in 0..200 {
                let report = hostile(&mut draws, &mut player);
                held += usize::from(report.pose_held);
                jumps += usize::from(report.teleported);
                ignored += usize::from(report.time_ignored);
                restarts += usize::from(report.restarted);
                assert!((0.0..=1.0).contains(&report.trust) && (0.0..=1.0).contains(&player.trust()));
                assert!(
                    !(report.pose_held || report.teleported) || report.trust == 0.0 || report.waiting,
                    "{report:?}"
                );
                if i % 20 == 0 {
                    assert!(player.vertices().iter().all(|x| x.is_finite()), "{report:?}");
                }
                assert!(player.deltas().iter().all(|x| x.is_finite()), "{report:?}");
            }
            // Both see the same from here on; the other one has seen nothing else before.
            let mut time = 10.0 * round as f32;
            for _ in 0..8 * 60 {
                let (rotations, translation) = swinging(time);
                let pose = Pose { rotations: &rotations, translation };
                player.advance(pose, 1.0 / 60.0);
                calm.advance(pose, 1.0 / 60.0);
                time += 1.0 / 60.0;
            }
            worst = worst.max(largest(&difference(player.deltas(), calm.deltas())) / largest(calm.deltas()));
        }
        assert!(held > 100 && jumps > 30 && ignored > 30 && restarts > 20, "{held} {jumps} {ignored} {restarts}");
        assert!(worst < 0.02, "{}: {worst} of the deltas is left of what came before", bundle.info.method);
    }
}

#[test]
fn a_gap_without_poses_is_bridged() {
    let bundle = bundle(Parts::default());
    let new = || Player::new(&bundle, &[]).unwrap();
    let (mut player, mut held, mut whole) = (new(), new(), new());
    let (mut bridged, mut jerked) = (vec![], vec![]);
    for t in 0..240 {
        let (rotations, translation) = swinging(t as f32 / 60.0);
        let pose = Pose { rotations: &rotations, translation };
        whole.advance(pose, 1.0 / 60.0);
        // Three poses of every twenty are lost.
        let lost = t % 20 > 16;
        let given = if lost { Pose { translation: Vec3::NAN, ..pose } } else { pose };
        let shown = player.deltas().to_vec();
        let report = player.advance(given, 1.0 / 60.0);
        assert_eq!((report.pose_held, report.restarted), (lost, false));
        // Frame by frame the last pose stands in, and the way of four frames is taken for one's.
        held.step(given);
        if lost {
            assert_eq!(player.deltas(), shown);
        } else if t > 60 {
            bridged.extend(difference(player.deltas(), whole.deltas()));
            jerked.extend(difference(held.deltas(), whole.deltas()));
        }
    }
    assert!(rms(&bridged) < 0.3 * rms(&jerked), "{} {}", rms(&bridged), rms(&jerked));
}

#[test]
fn a_jump_of_the_root_costs_no_motion_at_any_rate() {
    let [linear, hardening] = [false, true].map(|hardening| bundle(Parts { hardening, ..Default::default() }));
    // What the root did on its way is guessed, the longer the step the worse; springs that harden remember the guess longer.
    for (fps, bundle, most) in [
        (24.0f32, &linear, 0.2),
        (60.0, &linear, 0.05),
        (144.0, &linear, 0.05),
        (24.0, &hardening, 0.4),
        (60.0, &hardening, 0.1),
        (144.0, &hardening, 0.1),
    ] {
        let (mut player, mut calm) = (Player::new(bundle, &[]).unwrap(), Player::new(bundle, &[]).unwrap());
        let (mut jumps, mut worst) = (0, 0.0f32);
        for t in 0..(3.0 * fps) as usize {
            let (rotations, translation) = swinging(t as f32 / fps);
            let far = if t as f32 > 1.5 * fps { Vec3::new(40.0, 3.0, -7.0) } else { Vec3::ZERO };
            let report = player.advance(Pose { rotations: &rotations, translation: translation + far }, 1.0 / fps);
            calm.advance(Pose { rotations: &rotations, translation }, 1.0 / fps);
            jumps += usize::from(report.teleported);
            worst = worst.max(largest(&difference(player.deltas(), calm.deltas())) / largest(calm.deltas()));
            let moved = player.body_alone().zip(calm.body_alone()).map(|(a, b)| (a - b).distance(far));
            assert!(moved.fold(0.0, f32::max) < 1e-4, "{fps}, {t}");
        }
        assert_eq!(jumps, 1, "{fps}");
        assert!(worst > 0.0 && worst < most, "{fps}: {worst}");
    }
}

#[test]
fn trust_falls_on_the_unknown_and_deltas_fade_without_a_jump() {
    let bundle = bundle(Parts::default());
    let mut player = Player::new(&bundle, &[0.3]).unwrap();
    let mut plain = Player::new(&bundle, &[0.3]).unwrap();
    for bad in [Fade { below: 1.5, ..Fade::default() }, Fade { seconds: 0.0, ..Fade::default() }] {
        assert!(player.set_fade(Some(bad)).unwrap_err().to_string().contains("give"));
    }
    player.set_fade(Some(Fade { below: 0.5, patience: 0.2, seconds: 0.5 })).unwrap();
    let (rotations, translations) = motion(90);
    let mut draws = Draws::new(3, "nonsense", 0, 0);
    let (mut faded, mut known_trust) = (vec![], 0.0);
    for t in 0..600 {
        // Two seconds of what training has seen, three of nonsense, then known again.
        let nonsense = (120..300).contains(&t);
        let wild: Vec<Vec3> = (0..3).map(|_| Vec3::splat(draws.range(-2.0, 2.0) as f32)).collect();
        let known = Pose { rotations: rotations.frame(t % 90), translation: translations[t % 90] };
        let pose = if nonsense { Pose { rotations: &wild, ..known } } else { known };
        let report = player.step(pose);
        assert_eq!(report, plain.step(pose));
        assert_eq!(plain.faded(), 1.0);
        if nonsense {
            assert!(report.trust < 0.5, "frame {t}: {report:?}");
        } else if t < 80 {
            known_trust += report.trust / 80.0;
        }
        for (d, whole) in player.deltas().iter().zip(plain.deltas()) {
            assert!(d.distance(player.faded() * *whole) < 1e-7, "frame {t}");
        }
        faded.push(player.faded());
    }
    assert!(known_trust > 0.9, "{known_trust}");
    let steepest = faded.windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f32::max);
    assert!(steepest > 0.0 && steepest <= 1.5 / 30.0 + 1e-5, "{steepest}");
    assert!(faded[..120].iter().all(|f| *f == 1.0) && faded[125] == 1.0, "it is patient");
    assert!(faded[175..300].iter().all(|f| *f == 0.0) && faded[599] == 1.0);

    // Switched off while nothing is shown, it comes back as smoothly.
    let mut player = Player::new(&bundle, &[40.0]).unwrap();
    player.set_fade(Some(Fade::default())).unwrap();
    let step = |player: &mut Player<&Bundle>, t: usize| {
        player.step(Pose { rotations: rotations.frame(t), translation: translations[t] }).trust
    };
    for t in 0..60 {
        assert_eq!(step(&mut player, t), 0.0, "nobody was like this body");
    }
    assert_eq!(player.faded(), 0.0);
    player.set_fade(None).unwrap();
    step(&mut player, 60);
    assert!(player.faded() < 0.06);
    for t in 61..90 {
        step(&mut player, t);
    }
    assert_eq!(player.faded(), 1.0);
}

#[test]
fn a_rollout_says_where_trust_was_least() {
    let bundle = bundle(Parts::default());
    let (mut rotations, translations) = motion(60);
    rotations.frame_mut(33)[1] = Vec3::new(1.5, 0.0, -2.0);
    let mut player = Player::new(&bundle, &[]).unwrap();
    let report = player.play(&rotations, &translations, |_, _| Ok(())).unwrap();
    assert!(report.least_trust < 0.5 && (33..38).contains(&report.least_trust_frame), "{report:?}");
}

#[test]
fn a_pre_roll_is_having_stood_there_and_makes_no_jolt() {
    let ahead = Parts { look_ahead: 2, ..Default::default() };
    // Of a body that moves all at once, the velocity jumps: a model that sees it answers at once.
    let all = [
        (bundle(Parts::default()), true),
        (bundle(ahead), true),
        (autoregressive(), true),
        (feedback_bundle(true), false),
    ];
    for (bundle, sees_forces) in all {
        let mut player = Player::new(&bundle, &[0.3]).unwrap();
        let mut stood = Player::new(&bundle, &[0.3]).unwrap();
        let (rotations, translation) = swinging(0.4);
        let pose = Pose { rotations: &rotations, translation };
        for _ in 0..1200 {
            stood.step(pose);
        }
        let steady = stood.deltas().to_vec();
        player.pre_roll(pose, 3.0);
        let size = largest(&steady);
        assert!(size > 1e-4 && largest(&difference(player.deltas(), &steady)) < 0.01 * size, "{}", bundle.info.method);
        // Into the middle of a movement: no frame changes more than later ones do.
        let mut changes = vec![];
        let mut before = player.deltas().to_vec();
        for t in 0..180 {
            let (rotations, translation) = swinging(0.4 + t as f32 / 60.0);
            player.step(Pose { rotations: &rotations, translation });
            changes.push(largest(&difference(player.deltas(), &before)));
            before = player.deltas().to_vec();
        }
        let later = changes[60..].iter().copied().fold(0.0, f32::max);
        let soft = changes[..10].iter().all(|c| *c <= later);
        assert!(soft || !sees_forces, "{}: {:?} {later}", bundle.info.method, &changes[..10]);
        // Seconds that are none, and a pose that is none.
        for seconds in [f32::NAN, -1.0, 0.0] {
            player.pre_roll(pose, seconds);
            assert!(player.deltas().iter().all(|d| *d == Vec3::ZERO));
        }
        assert!(player.pre_roll(Pose { rotations: &[], translation }, 0.1).pose_held);
        assert!(player.vertices().iter().all(|x| x.is_finite()));
    }
}

/// A motion of `frames` that repeats itself, moving on by `travel` every round.
fn round_motion(frames: usize, travel: Vec3, count: usize) -> (Frames, Vec<Vec3>) {
    let mut rotations = Frames::new(3);
    let mut translations = vec![];
    for t in 0..count {
        let s = t as f32 / frames as f32;
        let w = std::f32::consts::TAU * s;
        rotations.push(&[
            Vec3::new(0.0, 0.2 * w.sin(), 0.0),
            Vec3::new(0.4 * (2.0 * w).sin(), 0.2 * w.cos(), 0.1),
            Vec3::new(-0.3 * w.sin(), 0.0, 0.3 * (3.0 * w).cos()),
        ]);
        translations.push(Vec3::new(0.0, 0.03 * (2.0 * w).sin(), 0.02 * w.cos()) + s * travel);
    }
    (rotations, translations)
}

#[test]
fn a_loop_runs_into_its_own_beginning() {
    let bundle = bundle(Parts::default());
    let mut player = Player::new(&bundle, &[0.3]).unwrap();
    let looped = |player: &mut Player<&Bundle>, (rotations, translations): &(Frames, Vec<Vec3>)| {
        let (mut deltas, mut roots) = (Frames::new(bundle.body.vertex_count()), vec![]);
        let report = player.play_loop(rotations, translations, |t, player| {
            assert_eq!(t, deltas.len());
            deltas.push(player.deltas());
            let still = player.body_alone().fold(Vec3::ZERO, |sum, v| sum + v);
            roots.push(still / bundle.body.vertex_count() as f32);
            Ok(())
        });
        (report.unwrap(), deltas, roots)
    };
    let (report, deltas, roots) = looped(&mut player, &round_motion(50, Vec3::ZERO, 50));
    assert_eq!((report.frames, deltas.len(), report.rollout.frames), (50, 50, 50));
    assert!(report.is_cyclic() && report.is_closed() && report.mismatch_m <= LOOP_MISMATCH_M, "{report:?}");
    // The same as many rounds in a row, and not what the first one is.
    let (rotations, translations) = round_motion(50, Vec3::ZERO, 600);
    let long = player.rollout(&rotations, &translations).unwrap();
    let of_round = |r: usize| &long.points()[r * 50 * long.points_per_frame()..][..deltas.points().len()];
    assert!(largest(&difference(deltas.points(), of_round(11))) < 3.0 * LOOP_MISMATCH_M);
    assert!(largest(&difference(deltas.points(), of_round(0))) > 10.0 * LOOP_MISMATCH_M);

    // Walking on at a steady pace is no other motion, and the frames stand where the motion has them.
    let walking = round_motion(50, Vec3::new(0.0, 0.0, 1.4), 50);
    let (report, walked, places) = looped(&mut player, &walking);
    assert!(report.is_closed() && report.rollout.teleports == 0, "{report:?}");
    assert!(largest(&difference(walked.points(), deltas.points())) < 0.05 * largest(deltas.points()));
    for (t, (place, root)) in places.iter().zip(&roots).enumerate() {
        let on = Vec3::new(0.0, 0.0, 1.4 * t as f32 / 50.0);
        assert!(place.distance(*root + on) < 1e-4, "{t}: {place} {root}");
    }
    // A last pose that is the first again is not shown twice.
    let (report, again, _) = looped(&mut player, &round_motion(50, Vec3::ZERO, 51));
    assert!(report.frames == 50 && largest(&difference(again.points(), deltas.points())) < LOOP_MISMATCH_M);
    // Half a round is no loop, and says so.
    let (report, open, _) = looped(&mut player, &round_motion(50, Vec3::ZERO, 20));
    assert!(!report.is_cyclic() && report.seam > 2.0 * report.largest_turn && open.len() == 20, "{report:?}");
    for frames in [0, 1, 2] {
        assert_eq!(looped(&mut player, &round_motion(50, Vec3::ZERO, frames)).1.len(), frames);
    }
}
