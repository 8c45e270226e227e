use crate::tiny::{feedback_bundle, motion};
use glam::Vec3;
use softtissue_body::Pose;
use softtissue_bundle::*;

fn model(bundle: &mut Bundle) -> &mut FeedbackModel {
    match &mut bundle.model {
        Model::Feedback(model) => model,
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_bundle_of_several_people_reads_back_and_plays_the_same_to_the_bit() {
    let (rotations, translations) = motion(50);
    for clipped in [true, false] {
        let dir = tempfile::tempdir().unwrap();
        let written = feedback_bundle(clipped);
        written.write(dir.path()).unwrap();
        let read = Bundle::read(dir.path()).unwrap();
        assert_eq!(read.model, written.model);
        assert_eq!(read.manifest().unwrap(), written.manifest().unwrap());
        let play = |bundle: &Bundle, beta: &[f32]| {
            Player::new(bundle, beta).unwrap().rollout(&rotations, &translations).unwrap()
        };
        let heavy = play(&read, &[0.2, -0.9]);
        assert_eq!(heavy, play(&written, &[0.2, -0.9]));
        assert!(heavy.points().iter().any(|d| d.length() > 1e-3), "the test bundle hardly moves");
        assert_ne!(heavy, play(&written, &[0.2, 0.9]), "the nearest shape's networks move a body");
    }
}

#[test]
fn whatever_the_poses_the_deltas_stay_finite_and_a_reset_repeats_them() {
    let (rotations, translations) = motion(30);
    let bundle = feedback_bundle(true);
    let mut player = Player::new(&bundle, &[]).unwrap();
    let first = player.rollout(&rotations, &translations).unwrap();
    let wild = [Vec3::splat(f32::NAN), Vec3::splat(40.0), Vec3::new(0.0, 3.0, -3.0)];
    for rotation in wild {
        let report = player.step(Pose { rotations: &[rotation; 3], translation: Vec3::Y * 50.0 });
        assert!(report.pose_held || report.features_clipped > 0, "{report:?}");
        assert!(player.deltas().iter().all(|d| d.is_finite()));
    }
    assert_eq!(player.rollout(&rotations, &translations).unwrap(), first);
}

#[test]
fn people_who_do_not_fit_are_not_written() {
    let dir = tempfile::tempdir().unwrap();
    let refused = |change: fn(&mut FeedbackModel), says: &str| {
        let mut bundle = feedback_bundle(true);
        change(model(&mut bundle));
        let message = bundle.write(&dir.path().join("out")).unwrap_err().to_string();
        assert!(message.contains(says), "{message}");
    };
    refused(|m| m.people.clear(), "0 people");
    refused(|m| m.people[1].latent_limits = None, "person heavy");
    refused(|m| m.people[0].beta[0] = f32::NAN, "person.0.beta");
    refused(|m| m.people.iter_mut().for_each(|p| p.output.weight = Matrix::zeros(0, p.hidden.outputs())), "encoder.0");
}
