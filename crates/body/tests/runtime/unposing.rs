use crate::reference::{random_body, random_input, single};
use glam::Vec3;
use softtissue_body::{BodyError, Pose, SkinWeights};
use softtissue_geometry::Frames;

#[test]
fn unposing_takes_posed_deltas_back() {
    let body = random_body(201);
    let shaped = body.shaped(&[0.5, -1.0, 0.2]);
    let deltas: Vec<Vec3> = body.template.iter().map(|p| Vec3::new(p.z, p.x, -p.y) * 0.05).collect();
    let input = random_input(&body, 0, 0.25);
    let rotations = input.rotations();
    let pose = Pose { rotations: &rotations, translation: single(input.translation) };
    let posed = body.posed(&shaped, pose, Some(&deltas));
    let back = body.unposed_deltas(&shaped, pose, &posed).unwrap();
    for (v, (a, b)) in back.iter().zip(&deltas).enumerate() {
        assert!(a.distance(*b) < 2e-5, "vertex {v}: {a} for {b}");
    }
}

#[test]
fn many_frames_at_once_give_the_numbers_of_single_frames() {
    // neither the vertices nor the frames fill whole blocks
    let body = random_body(301);
    let shaped = body.shaped(&[1.0]);
    let frames = 11;
    let (mut rotations, mut deltas) = (Frames::new(24), Frames::new(body.vertex_count()));
    let mut translations = vec![];
    for t in 0..frames {
        let input = random_input(&body, t, 0.2);
        rotations.push(&input.rotations());
        translations.push(single(input.translation));
        deltas.push(&body.template.iter().map(|p| *p * (0.01 * t as f32)).collect::<Vec<_>>());
    }
    let posed = body.posed_frames(&shaped, &rotations, &translations, Some(&deltas));
    let back = body.unposed_delta_frames(&shaped, &rotations, &translations, &posed).unwrap();
    for t in 0..frames as usize {
        let pose = Pose { rotations: rotations.frame(t), translation: translations[t] };
        assert_eq!(posed.frame(t), body.posed(&shaped, pose, Some(deltas.frame(t))));
        assert_eq!(back.frame(t), body.unposed_deltas(&shaped, pose, posed.frame(t)).unwrap());
    }
}

#[test]
fn a_folded_vertex_is_an_error_that_names_it() {
    let mut body = random_body(41);
    // half of one bone, half of a bone turned by 170 degrees against it: the blend collapses two axes
    body.skin[7] = SkinWeights { joints: [0, 1, 0, 0], weights: [0.5, 0.5, 0.0, 0.0] };
    let shaped = body.shaped(&[]);
    let mut rotations = vec![Vec3::ZERO; 24];
    rotations[1] = Vec3::new(170f32.to_radians(), 0.0, 0.0);
    let pose = Pose { rotations: &rotations, translation: Vec3::ZERO };
    let posed = body.posed(&shaped, pose, None);
    match body.unposed_deltas(&shaped, pose, &posed) {
        Err(BodyError::Singular { vertex: 7, determinant }) => assert!(determinant < 0.1),
        other => panic!("{other:?}"),
    }
    assert!(body.unposed_jacobian(&shaped, pose, &posed).is_err());
    rotations[1] = Vec3::splat(f32::NAN);
    let pose = Pose { rotations: &rotations, translation: Vec3::ZERO };
    assert!(body.unposed_deltas(&shaped, pose, &posed).is_err(), "NaN must not come out silently");
}
