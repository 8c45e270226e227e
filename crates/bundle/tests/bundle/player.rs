use crate::reference;
use crate::tiny::{Parts, autoregressive, bundle, feedback_bundle, motion};
use glam::Vec3;
use softtissue_body::Pose;
use softtissue_bundle::descriptor::{Descriptor, FeatureKind};
use softtissue_bundle::*;
use softtissue_geometry::Frames;
use softtissue_random::Draws;

/// Every form of the graph.
fn forms() -> Vec<Parts> {
    vec![
        Parts::default(),
        Parts { direct: false, ..Default::default() },
        Parts { bank: false, recurrent: false, units: 0, ..Default::default() },
        Parts { features: FeatureKind::Pose, bank: false, ..Default::default() },
        Parts { features: FeatureKind::DisentangledPose, bank: false, ..Default::default() },
        Parts { look_ahead: 3, ..Default::default() },
        Parts { acquainted: true, ..Default::default() },
        Parts { acquainted: true, bank: false, ..Default::default() },
        Parts { hardening: false, ..Default::default() },
    ]
}

#[test]
fn a_rollout_is_the_documented_sum_in_f64() {
    let (rotations, translations) = motion(120);
    for parts in forms() {
        let bundle = bundle(parts);
        let beta = [0.7, -1.3];
        let mut player = Player::new(&bundle, &beta).unwrap();
        let deltas = player.rollout(&rotations, &translations).unwrap();
        let given = bundle.model.descriptor_parts(&bundle.descriptor);
        let descriptor = Descriptor::with_parts(&bundle.descriptor, &bundle.body, given).unwrap();
        let features = descriptor.run(&bundle.body, &bundle.body.shaped(&beta), &rotations, &translations);
        let latents = reference::regress(&bundle.model.recurrent().unwrap().regressor, &features, &beta);
        let largest = deltas.points().iter().fold(0.0, |m: f32, d| m.max(d.length()));
        assert!(largest > 1e-3 && deltas.len() == 120, "{parts:?}: the test bundle hardly moves");
        for (t, latent) in latents.iter().enumerate() {
            let expected = reference::decode(&bundle.model.recurrent().unwrap().subspace, latent);
            for (d, e) in deltas.frame(t).iter().flat_map(|d| d.to_array()).zip(expected) {
                assert!((f64::from(d) - e).abs() < 1e-4 * f64::from(largest), "{parts:?} frame {t}: {d} {e}");
            }
        }
    }
}

#[test]
fn the_encoder_is_the_documented_sum_in_f64() {
    let bundle = bundle(Parts::default());
    let subspace = &bundle.model.recurrent().unwrap().subspace;
    let mut draws = Draws::new(5, "deltas", 0, 0);
    let delta: Vec<f32> = (0..3 * subspace.vertex_count()).map(|_| (0.02 * draws.normal()) as f32).collect();
    let mut latent = vec![0.0; subspace.latent_count()];
    subspace.encode(&delta, &mut latent, &mut subspace.scratch());
    for (z, e) in latent.iter().zip(reference::encode(subspace, &delta)) {
        assert!((f64::from(*z) - e).abs() < 1e-5 * e.abs().max(0.1), "{z} {e}");
    }
}

#[test]
fn a_timed_frame_is_the_same_frame_and_its_parts_are_those_of_the_model() {
    use StepPart::{Decoder, Descriptor, Feedback, PoseEncoder, Regressor, Skinning};
    let (rotations, translations) = motion(30);
    let learned_pose = Parts { features: FeatureKind::DisentangledPose, bank: false, ..Default::default() };
    for (bundle, parts) in [
        (bundle(Parts::default()), vec![Skinning, Descriptor, Regressor, Decoder]),
        (bundle(learned_pose), vec![Skinning, Descriptor, PoseEncoder, Regressor, Decoder]),
        (feedback_bundle(true), vec![Skinning, Descriptor, Regressor, Feedback]),
        (autoregressive(), vec![Skinning, Descriptor, Regressor, Decoder]),
    ] {
        let mut plain = Player::new(&bundle, &[0.5]).unwrap();
        let mut timed = Player::new(&bundle, &[0.5]).unwrap();
        for t in 0..30 {
            let pose = Pose { rotations: rotations.frame(t), translation: translations[t] };
            let (report, times) = timed.timed_step(pose);
            assert_eq!(report, plain.step(pose));
            assert_eq!(timed.vertices(), plain.vertices());
            let found: Vec<StepPart> = StepPart::ALL.into_iter().filter(|p| times.part(*p).is_some()).collect();
            assert_eq!(found, parts);
            let sum: std::time::Duration = parts.iter().filter_map(|p| times.part(*p)).sum();
            assert!(sum <= times.whole && !times.whole.is_zero(), "{times:?}");
        }
    }
}

#[test]
fn vertices_are_the_body_with_the_deltas() {
    let (rotations, translations) = motion(20);
    for parts in forms() {
        let bundle = bundle(parts);
        let mut player = Player::new(&bundle, &[0.4]).unwrap();
        let deltas = player.rollout(&rotations, &translations).unwrap();
        let vertices = player.rollout_vertices(&rotations, &translations).unwrap();
        let shaped = bundle.body.shaped(&[0.4]);
        for t in 0..20 {
            let pose = Pose { rotations: rotations.frame(t), translation: translations[t] };
            let expected = bundle.body.posed(&shaped, pose, Some(deltas.frame(t)));
            for (x, e) in vertices.frame(t).iter().zip(expected) {
                assert!(x.distance(e) < 2e-6, "{parts:?} frame {t}: {x} {e}");
            }
        }
    }
}

#[test]
fn a_reset_player_repeats_itself_to_the_bit() {
    let (rotations, translations) = motion(30);
    let bundle = bundle(Parts::default());
    let mut player = Player::new(&bundle, &[]).unwrap();
    let first = player.rollout(&rotations, &translations).unwrap();
    assert_eq!(first, player.rollout(&rotations, &translations).unwrap());
    assert_eq!(first, Player::new(&bundle, &[]).unwrap().rollout(&rotations, &translations).unwrap());
}

#[test]
fn bad_input_66_an_unusable_pose_holds_the_last_one() {
    let (rotations, translations) = motion(40);
    let bundle = bundle(Parts::default());
    let mut player = Player::new(&bundle, &[]).unwrap();
    let mut held = Player::new(&bundle, &[]).unwrap();
    for t in 0..40 {
        let pose = Pose { rotations: rotations.frame(t), translation: translations[t] };
        let mut rotations_bad = pose.rotations.to_vec();
        let bad = match t {
            10 => Pose { translation: Vec3::new(0.0, f32::NAN, 0.0), ..pose },
            11 => Pose { translation: Vec3::new(0.0, f32::INFINITY, 0.0), ..pose },
            12 => Pose { rotations: &rotations.frame(t)[..2], ..pose },
            13 => {
                rotations_bad[1].x = 1e30;
                Pose { rotations: &rotations_bad, ..pose }
            }
            14 => {
                rotations_bad[2].z = f32::NAN;
                Pose { rotations: &rotations_bad, ..pose }
            }
            _ => pose,
        };
        let last_good = t.min(9);
        let stand_in = match t {
            10..15 => Pose { rotations: rotations.frame(last_good), translation: translations[last_good] },
            _ => pose,
        };
        let report = player.step(bad);
        assert_eq!(report.pose_held, (10..15).contains(&t), "frame {t}");
        assert!(!held.step(stand_in).pose_held);
        assert_eq!(player.deltas(), held.deltas(), "frame {t}");
    }
    // Before the first good pose the body stands at rest.
    player.reset();
    let report = player.step(Pose { rotations: &[], translation: Vec3::NAN });
    assert!(report.pose_held && player.vertices().iter().all(|x| x.is_finite()));
}

#[test]
fn bad_input_66_a_teleport_is_no_motion() {
    let (rotations, translations) = motion(60);
    let far = Vec3::new(40.0, 3.0, -7.0);
    let jumped: Vec<Vec3> = translations.iter().enumerate().map(|(t, x)| if t < 30 { *x } else { *x + far }).collect();
    let bundle = bundle(Parts::default());
    let mut player = Player::new(&bundle, &[]).unwrap();
    let smooth = player.rollout(&rotations, &translations).unwrap();
    let there = player.rollout_vertices(&rotations, &translations).unwrap();
    let mut teleports = 0;
    let mut worst = 0.0f32;
    player
        .play(&rotations, &jumped, |t, player| {
            for (d, s) in player.deltas().iter().zip(smooth.frame(t)) {
                worst = worst.max(d.distance(*s));
            }
            let shift = if t < 30 { Vec3::ZERO } else { far };
            for (x, s) in player.vertices().iter().zip(there.frame(t)) {
                assert!(x.distance(*s + shift) < 2e-3, "frame {t}");
            }
            Ok(())
        })
        .map(|report| teleports = report.teleports)
        .unwrap();
    assert_eq!(teleports, 1);
    // The jump's own displacement is taken to be that of the frame before: a small difference, which dies away.
    let largest = smooth.points().iter().fold(0.0, |m: f32, d| m.max(d.length()));
    assert!(worst < 0.2 * largest, "{worst} of {largest}");
}

#[test]
fn bad_input_66_garbage_stays_finite_and_is_clipped() {
    let bundle = bundle(Parts::default());
    assert!(Player::new(&bundle, &[f32::NAN]).is_err());
    // A shape far outside training too.
    let mut player = Player::new(&bundle, &[50.0, -50.0]).unwrap();
    let mut draws = Draws::new(9, "garbage", 0, 0);
    let mut clipped = 0;
    for t in 0..2000 {
        let mut number = || match draws.below(20) {
            0 => f32::NAN,
            1 => f32::INFINITY,
            2 => f32::MAX,
            3 => -1e4,
            _ => draws.range(-3.0, 3.0) as f32,
        };
        let rotations: Vec<Vec3> = (0..3).map(|_| Vec3::new(number(), number(), number())).collect();
        let calm = t % 3 == 0;
        let rotations = if calm { rotations.iter().map(|w| w.clamp_length_max(3.0)).collect() } else { rotations };
        let report = player.step(Pose { rotations: &rotations, translation: Vec3::new(number(), 0.0, 0.0) });
        clipped += report.features_clipped;
        assert!(!report.restarted && player.deltas().iter().all(|d| d.is_finite()), "step {t}");
        assert!(player.vertices().iter().all(|x| x.is_finite()), "step {t}");
    }
    assert!(clipped > 100, "{clipped}");
}

#[test]
fn bad_input_66_unequal_lengths_are_refused() {
    let (rotations, translations) = motion(10);
    let bundle = bundle(Parts::default());
    let mut player = Player::new(&bundle, &[]).unwrap();
    let message = player.rollout(&rotations, &translations[..9]).unwrap_err().to_string();
    assert!(message.contains("10 frames") && message.contains("9 root translations"), "{message}");
    assert!(player.rollout(&Frames::zeros(4, 10), &translations).unwrap_err().to_string().contains("3 joints"));
}

#[test]
fn bad_input_66_time_steps_of_zero_nan_and_ten_seconds() {
    let (rotations, translations) = motion(40);
    let bundle = bundle(Parts::default());
    let mut player = Player::new(&bundle, &[]).unwrap();
    let pose = |t: usize| Pose { rotations: rotations.frame(t), translation: translations[t] };
    for t in 0..30 {
        player.advance(pose(t), 1.0 / 60.0);
    }
    let before = player.deltas().to_vec();
    for dt in [0.0, -1.0, f32::NAN, f32::NEG_INFINITY] {
        let report = player.advance(pose(30), dt);
        assert!(report.time_ignored && player.deltas() == before, "dt {dt}");
    }
    for dt in [10.0, f32::INFINITY] {
        assert!(player.advance(pose(31), dt).restarted);
        let mut fresh = Player::new(&bundle, &[]).unwrap();
        fresh.step(pose(31));
        assert_eq!(player.deltas(), fresh.deltas());
    }
    assert!(player.vertices().iter().all(|x| x.is_finite()));
}

#[test]
fn the_example_plays_and_the_documentation_quotes_it() {
    let dir = tempfile::tempdir().unwrap();
    bundle(Parts::default()).write(dir.path()).unwrap();
    let largest = crate::play::play(dir.path()).unwrap();
    assert!(largest > 1e-6, "{largest}");
    assert!(crate::play::play(&dir.path().join("nowhere")).unwrap_err().to_string().contains("nowhere"));
    let home = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    let page = std::fs::read_to_string(home.join("../../docs/play.md")).unwrap();
    let snippet = page.split_once("```rust\n").unwrap().1.split_once("```").unwrap().0;
    let example = std::fs::read_to_string(home.join("examples/play.rs")).unwrap();
    assert!(example.contains(snippet.trim_end()));
}
