use crate::reference::{random_body, random_input, single};
use glam::Vec3;
use softtissue_body::Pose;
use softtissue_geometry::Frames;

#[test]
fn a_mirrored_pose_poses_to_mirrored_vertices() {
    let body = random_body(41);
    body.mirror.check().unwrap();
    for step in 0..4 {
        let input = random_input(&body, step, 0.5);
        let beta: Vec<f32> = input.beta.iter().map(|b| *b as f32).collect();
        let shaped = body.shaped(&beta);
        let (rotations, translation) = (input.rotations(), single(input.translation));
        let deltas: Vec<Vec3> = body.template.iter().map(|p| Vec3::new(p.y, p.z, p.x) * 0.1).collect();
        let posed = body.posed(&shaped, Pose { rotations: &rotations, translation }, Some(&deltas));
        let mirrored = body.mirror.rotations(&rotations);
        let pose = Pose { rotations: &mirrored, translation: body.mirror.translation(translation) };
        let mirrored = body.posed(&shaped, pose, Some(&body.mirror.field(&deltas)));
        let expected = body.mirror.field(&posed);
        for (v, (a, b)) in mirrored.iter().zip(&expected).enumerate() {
            assert!(a.distance(*b) < 1e-5, "case {step}, vertex {v}: {a} for {b}");
        }
        assert!(posed.iter().zip(&expected).any(|(a, b)| a.distance(*b) > 0.1), "a symmetric pose shows nothing");
    }
}

#[test]
fn mirroring_twice_is_the_identity() {
    let body = random_body(41);
    let inputs: Vec<_> = (0..3).map(|t| random_input(&body, t, 1.0)).collect();
    let mut rotations = Frames::new(body.joint_count());
    inputs.iter().for_each(|i| rotations.push(&i.rotations()));
    let translations: Vec<Vec3> = inputs.iter().map(|i| single(i.translation)).collect();
    let (once, once_translations) = body.mirror.motion(&rotations, &translations);
    assert_ne!(once, rotations);
    assert_eq!(body.mirror.motion(&once, &once_translations), (rotations, translations));
    let mut deltas = Frames::new(body.vertex_count());
    deltas.push(&body.template);
    deltas.push(&body.shape_directions[..body.vertex_count()]);
    assert_eq!(body.mirror.fields(&body.mirror.fields(&deltas)), deltas);
}

#[test]
fn a_map_that_is_no_involution_is_refused() {
    let mut body = random_body(41);
    body.mirror.vertices[3] = 5;
    let message = body.mirror.check().unwrap_err().to_string();
    assert!(message.contains("vertex"), "{message}");
    body.mirror.vertices[3] = 5000;
    assert!(body.mirror.check().is_err());
}
