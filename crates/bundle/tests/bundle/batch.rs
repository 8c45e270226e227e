use crate::tiny::{Parts, autoregressive, bundle, feedback_bundle, motion};
use glam::Vec3;
use softtissue_body::{Pose, Region};
use softtissue_bundle::*;

const SHAPES: [&[f32]; 5] = [&[0.5], &[], &[-1.0, 2.0], &[0.1, -2.0], &[1.5]];

#[test]
fn characters_of_a_batch_move_as_players_of_their_own_to_the_bit() {
    let (rotations, translations) = motion(60);
    let bundles = [
        bundle(Parts::default()),
        bundle(Parts { look_ahead: 2, ..Default::default() }),
        autoregressive(),
        feedback_bundle(true),
        bundle(Parts::default()).reduced(Precision::F16).unwrap(),
        bundle(Parts::default()).reduced(Precision::I8).unwrap(),
    ];
    for bundle in &bundles {
        for threads in [0, 1, 2, 3, 9] {
            let mut batch = Batch::new(bundle, &SHAPES, threads).unwrap();
            assert_eq!(batch.len(), 5);
            let mut single = SHAPES.map(|shape| Player::new(bundle, shape).unwrap());
            for player in [&mut single[1], batch.player_mut(1)] {
                player.set_controls(&Controls::gain(1.3)).unwrap();
            }
            for player in [&mut single[3], batch.player_mut(3)] {
                if bundle.model.basis().is_some() {
                    player.set_detail(&Detail { components: Some(4), still: vec![Region::Feet] }).unwrap();
                }
            }
            for t in 0..60 {
                // Each is somewhere else in the motion; one of them loses its pose for a while, one jumps away.
                let mut poses: Vec<Pose> = (0..5)
                    .map(|i| {
                        let frame = (t + 7 * i) % 60;
                        Pose { rotations: rotations.frame(frame), translation: translations[frame] }
                    })
                    .collect();
                if t % 9 == 4 {
                    poses[2].translation = Vec3::NAN;
                    poses[4].translation = Vec3::splat(50.0);
                }
                batch.step(&poses).unwrap();
                for (i, player) in single.iter_mut().enumerate() {
                    assert_eq!(batch.report(i), player.step(poses[i]), "character {i}, frame {t}");
                    assert_eq!(batch.vertices(i), player.vertices(), "character {i}, frame {t}, {threads} threads");
                    assert_eq!(batch.player(i).deltas(), player.deltas());
                }
            }
        }
    }
}

#[test]
fn another_player_of_a_bundle_is_a_new_one() {
    let bundle = bundle(Parts::default());
    let (rotations, translations) = motion(20);
    let mut first = Player::new(&bundle, &[0.5]).unwrap();
    first.set_controls(&Controls::gain(3.0)).unwrap();
    first.rollout(&rotations, &translations).unwrap();
    let found = first.another(&[-1.0]).unwrap().rollout(&rotations, &translations).unwrap();
    assert_eq!(found, Player::new(&bundle, &[-1.0]).unwrap().rollout(&rotations, &translations).unwrap());
    assert!(first.another(&[f32::NAN]).is_err());
}

#[test]
fn nobody_and_another_number_of_poses_are_refused() {
    let bundle = bundle(Parts::default());
    assert!(Batch::new(&bundle, &[], 1).err().unwrap().to_string().contains("no shape"));
    let mut batch = Batch::new(&bundle, &SHAPES, 2).unwrap();
    let rest = [Vec3::ZERO; 3];
    let pose = Pose { rotations: &rest, translation: Vec3::ZERO };
    assert!(batch.step(&[pose; 4]).unwrap_err().to_string().contains("4 poses for 5 characters"));
    batch.step(&[pose; 5]).unwrap();
}

#[test]
fn the_example_of_a_crowd_plays_and_the_documentation_quotes_it() {
    let dir = tempfile::tempdir().unwrap();
    bundle(Parts::default()).write(dir.path()).unwrap();
    let heights = crate::crowd::crowd(dir.path()).unwrap();
    assert!(heights.len() == 3 && heights.iter().all(|h| (1.5..2.5).contains(h)), "{heights:?}");
    let home = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    let page = std::fs::read_to_string(home.join("../../docs/play.md")).unwrap();
    let snippet = page.split("```rust\n").nth(2).unwrap().split_once("```").unwrap().0;
    let example = std::fs::read_to_string(home.join("examples/crowd.rs")).unwrap();
    assert!(example.contains(snippet.trim_end()) && snippet.contains("Batch::new"));
}
