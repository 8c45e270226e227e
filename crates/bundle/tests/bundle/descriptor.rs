use crate::tiny;
use glam::{Mat3, Vec3};
use softtissue_body::BodyModel;
use softtissue_bundle::descriptor::{
    Descriptor, DescriptorConfig, DescriptorError, DescriptorParts, FeatureKind, PoseEncoder,
};
use softtissue_bundle::{Linear, Matrix};
use softtissue_geometry::{Frames, rotation_from_axis_angle};
use std::sync::Arc;

const FPS: f32 = 60.0;
const GRAVITY: Vec3 = Vec3::new(0.0, -9.81, 0.0);
/// First vertex of a soft region.
const SOFT: usize = 4;

fn config(features: FeatureKind) -> DescriptorConfig {
    DescriptorConfig { features, modes: 3, pose_entries: false, ..Default::default() }
}

/// A body without blendshapes, so that its rest pose is rigid.
fn rigid_body() -> BodyModel {
    let mut body = tiny::body();
    body.pose_directions.iter_mut().for_each(|d| *d = Vec3::ZERO);
    body
}

/// Modes that read off the force on one soft vertex.
fn probe(body: &BodyModel) -> Vec<f32> {
    let width = 3 * body.vertex_count();
    let mut modes = vec![0.0; 3 * width];
    (0..3).for_each(|axis| modes[axis * width + 3 * SOFT + axis] = 1.0);
    modes
}

/// The force on the probed vertex in every frame of a motion of the root; the joints rest.
fn forces(config: &DescriptorConfig, root: impl Fn(f32) -> (Vec3, Vec3), frames: usize) -> Vec<Vec3> {
    let body = rigid_body();
    let descriptor = Descriptor::new(config, &body, Some(&probe(&body))).unwrap();
    let (mut rotations, mut translations) = (Frames::new(3), vec![]);
    for t in 0..frames {
        let (rotation, translation) = root(t as f32 / FPS);
        rotations.push(&[rotation, Vec3::ZERO, Vec3::ZERO]);
        translations.push(translation);
    }
    let features = descriptor.run(&body, &body.shaped(&[]), &rotations, &translations);
    features.as_chunks::<3>().0.iter().map(|f| Vec3::from_array(*f)).collect()
}

fn assert_near(got: Vec3, expected: Vec3, tolerance: f32) {
    assert!(got.distance(expected) < tolerance, "{got}, expected {expected}");
}

#[test]
fn standing_feels_gravity_turned_into_the_rest_frame() {
    let config = config(FeatureKind::ModalForces);
    for w in [Vec3::ZERO, Vec3::new(0.0, 0.0, 1.2), Vec3::new(0.7, -0.4, 0.2)] {
        let rest_from_world = rotation_from_axis_angle(w).transpose();
        for f in forces(&config, |_| (w, Vec3::Y), 4) {
            assert_near(f, rest_from_world * GRAVITY - GRAVITY, 1e-3);
        }
    }
}

#[test]
fn flight_is_weightless_and_a_push_is_felt_backwards() {
    let config = config(FeatureKind::ModalForces);
    // Free fall from the first frame: the flesh is lifted by what gravity did to it at rest.
    let fall = forces(&config, |s| (Vec3::ZERO, 0.5 * GRAVITY * s * s + Vec3::new(1.0, 2.0, 0.0) * s), 40);
    assert_near(fall[39], -GRAVITY, 0.02);
    let push = Vec3::new(3.0, 0.0, -1.0);
    assert_near(forces(&config, |s| (Vec3::ZERO, 0.5 * push * s * s), 40)[39], -push, 0.02);
}

#[test]
fn turning_is_felt_outwards() {
    let config = DescriptorConfig { cutoff_hz: 0.0, ..config(FeatureKind::ModalForces) };
    let rate = 4.0;
    let f = forces(&config, |s| (Vec3::new(0.0, rate * s, 0.0), Vec3::ZERO), 60)[59];
    let body = rigid_body();
    let arm = (body.template[SOFT] - body.shaped(&[]).joints[0]) * Vec3::new(1.0, 0.0, 1.0);
    // The second difference stands one frame late and chords are shorter than arcs.
    let step = rate / FPS;
    let seen = Mat3::from_rotation_y(-step) * arm * (2.0 - 2.0 * step.cos()) * FPS * FPS;
    assert_near(f, seen, 5e-3);
    assert!(f.distance(arm * rate * rate) < 0.08 * f.length());
}

#[test]
fn a_clip_cut_in_mid_motion_starts_without_a_spike() {
    let velocity = Vec3::new(2.0, 1.0, -3.0);
    for f in forces(&config(FeatureKind::ModalForces), |s| (Vec3::ZERO, velocity * s), 30) {
        assert_near(f, Vec3::ZERO, 0.02);
    }
}

#[test]
fn root_motion_is_seen_from_the_root() {
    let body = rigid_body();
    let descriptor = Descriptor::new(&config(FeatureKind::Pose), &body, None).unwrap();
    let (turn, acceleration) = (Vec3::new(0.3, 0.9, -0.2), Vec3::new(1.0, -2.0, 0.5));
    let (mut rotations, mut translations) = (Frames::new(3), vec![]);
    let bend = |s: f32| Vec3::new(0.0, 0.0, 2.0 * s);
    for t in 0..30 {
        let s = t as f32 / FPS;
        rotations.push(&[turn, bend(s), Vec3::ZERO]);
        translations.push(0.5 * acceleration * s * s);
    }
    let features = descriptor.run(&body, &body.shaped(&[]), &rotations, &translations);
    let last = &features[29 * descriptor.len()..];
    let block = |name: &str| {
        let range = descriptor.blocks().iter().find(|b| b.name == name).unwrap().range.clone();
        Vec3::from_slice(&last[range])
    };
    let root_from_world = rotation_from_axis_angle(turn).transpose();
    assert_near(block("rotations"), bend(29.0 / FPS), 1e-5);
    assert_near(block("angular-velocities"), Vec3::new(0.0, 0.0, 2.0), 1e-3);
    assert_near(block("angular-accelerations"), Vec3::ZERO, 2e-2);
    assert_near(block("root-acceleration"), root_from_world * acceleration, 0.01);
    // A backward difference stands half a frame late, and the low-pass adds its lag.
    let late = descriptor.lag_frames() - 0.5;
    assert_near(block("root-velocity"), root_from_world * acceleration * ((29.0 - late) / FPS), 2e-3);
    assert_near(block("root-angular-velocity"), Vec3::ZERO, 1e-3);
}

/// SoftSMPL eq. 11 with an encoder whose derivative is known.
#[test]
fn a_disentangled_pose_comes_with_its_velocity_and_acceleration() {
    let body = rigid_body();
    // p = (2 x the middle joint's angle about z + 1, the top joint's about x less half the middle's)
    let weight = Matrix::new(2, 6, vec![0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0, -0.5, 1.0, 0.0, 0.0]);
    let encoder = Arc::new(PoseEncoder { layers: vec![Linear { weight, bias: vec![1.0, 0.0] }] });
    let config = DescriptorConfig { root_angular_velocity: false, ..config(FeatureKind::DisentangledPose) };
    let parts = DescriptorParts { modes: None, encoder: Some(&encoder) };
    let descriptor = Descriptor::with_parts(&config, &body, parts).unwrap();
    let sizes: Vec<usize> = descriptor.blocks().iter().map(|b| b.range.len()).collect();
    assert_eq!(sizes, [2, 2, 2, 3, 3]);
    let (mut rotations, mut translations) = (Frames::new(3), vec![]);
    let (middle, top) = (|s: f32| 1.5 * s * s, |s: f32| 0.8 * s);
    let push = Vec3::new(1.0, -2.0, 0.5);
    for t in 0..40 {
        let s = t as f32 / FPS;
        // a root that turns is no part of p
        rotations.push(&[Vec3::new(0.0, 3.0 * s, 0.0), Vec3::Z * middle(s), Vec3::X * top(s)]);
        translations.push(0.5 * push * s * s);
    }
    let features = descriptor.run(&body, &body.shaped(&[]), &rotations, &translations);
    let last = &features[39 * descriptor.len()..];
    let s = 39.0 / FPS;
    let late = s - (descriptor.lag_frames() - 0.5) / FPS;
    let expected: [f32; 6] = [2.0 * middle(s) + 1.0, top(s) - 0.5 * middle(s), 6.0 * late, 0.8 - 1.5 * late, 6.0, -1.5];
    for (found, expected) in last.iter().zip(expected) {
        assert!((found - expected).abs() < 0.02, "{last:?} {expected}");
    }
    let root_from_world = rotation_from_axis_angle(Vec3::new(0.0, 3.0 * s, 0.0)).transpose();
    assert_near(Vec3::from_slice(&last[9..]), root_from_world * push, 0.02);

    let refused = |parts| Descriptor::with_parts(&config, &body, parts).map(|_| ()).unwrap_err();
    assert!(matches!(refused(DescriptorParts::default()), DescriptorError::Encoder { .. }));
    let mut foreign = (*encoder).clone();
    foreign.layers[0].weight = Matrix::zeros(2, 9);
    let message = refused(DescriptorParts { modes: None, encoder: Some(&Arc::new(foreign)) }).to_string();
    assert!(message.contains("9 to 2") && message.contains("6 numbers come in"), "{message}");
}

#[test]
fn angles_are_those_of_all_joints_and_the_root_s_velocity_is_its_own() {
    let body = rigid_body();
    let velocity = Vec3::new(1.0, -2.0, 0.5);
    for (root_position, turn) in [(false, Vec3::new(0.3, 0.9, -0.2)), (true, Vec3::ZERO)] {
        let config = DescriptorConfig { root_position, ..config(FeatureKind::Angles) };
        let descriptor = Descriptor::new(&config, &body, None).unwrap();
        assert_eq!(descriptor.len(), 3 * 3 + 3, "three numbers a joint and three of the root");
        let (mut rotations, mut translations) = (Frames::new(3), vec![]);
        for t in 0..30 {
            // Past half a turn, where the shortest axis angle flips.
            let angle = 2.0 + 2.0 * t as f32 / 29.0;
            let short = if angle > std::f32::consts::PI { angle - std::f32::consts::TAU } else { angle };
            rotations.push(&[turn, Vec3::new(0.0, 0.0, short), Vec3::X * 0.4]);
            translations.push(velocity * (t as f32 / FPS));
        }
        let features = descriptor.run(&body, &body.shaped(&[]), &rotations, &translations);
        let at = |t: usize, joint: usize| Vec3::from_slice(&features[t * 12 + 3 * joint..]);
        assert_near(at(29, 0), turn, 1e-6);
        assert_near(at(29, 1), Vec3::new(0.0, 0.0, 4.0), 1e-4);
        assert_near(at(29, 2), Vec3::X * 0.4, 1e-6);
        assert_near(at(0, 3), Vec3::ZERO, 1e-6);
        let root_from_world = rotation_from_axis_angle(turn).transpose();
        let wanted = if root_position { translations[29] } else { root_from_world * velocity };
        assert_near(at(29, 3), wanted, 1e-4);
    }
}

#[test]
fn features_do_not_know_the_future_and_look_ahead_is_a_shift() {
    for features in [FeatureKind::Pose, FeatureKind::DisentangledPose, FeatureKind::ModalForces, FeatureKind::Angles] {
        let body = tiny::body();
        let modes: Vec<f32> = (0..9 * body.vertex_count()).map(|i| (i as f32 * 0.7).sin()).collect();
        let config = DescriptorConfig { features, modes: 3, ..Default::default() };
        let encoder = tiny::pose_encoder();
        let parts = DescriptorParts { modes: Some(modes[..].into()), encoder: Some(&encoder) };
        let descriptor = Descriptor::with_parts(&config, &body, parts.clone()).unwrap();
        let (rotations, mut translations) = tiny::motion(40);
        let run = |d: &Descriptor, x: &[Vec3]| d.run(&body, &body.shaped(&[0.4]), &rotations, x);
        let before = run(&descriptor, &translations);
        let ahead = DescriptorConfig { look_ahead: 2, ..config };
        let ahead = Descriptor::with_parts(&ahead, &body, parts).unwrap();
        let d = descriptor.len();
        assert_eq!(run(&ahead, &translations)[..38 * d], before[2 * d..]);
        translations[25..].iter_mut().for_each(|x| *x += Vec3::new(0.3, 0.1, 0.0));
        let after = run(&descriptor, &translations);
        assert_eq!(before[..25 * d], after[..25 * d]);
        assert_ne!(before[25 * d..26 * d], after[25 * d..26 * d]);
    }
}

#[test]
fn settings_and_modes_that_do_not_fit_are_refused() {
    let body = tiny::body();
    let modes = probe(&body);
    let new = |c: &DescriptorConfig, m| Descriptor::new(c, &body, m).map(|_| ());
    let fits = config(FeatureKind::ModalForces);
    assert_eq!(new(&fits, Some(modes.as_slice())), Ok(()));
    assert!(matches!(new(&fits, None), Err(DescriptorError::Modes { needed: 3, found: 0, .. })));
    assert!(matches!(new(&fits, Some(&modes[1..])), Err(DescriptorError::Modes { .. })));
    for bad in [
        DescriptorConfig { fps: 0.0, ..fits.clone() },
        DescriptorConfig { fps: f32::NAN, ..fits.clone() },
        DescriptorConfig { cutoff_hz: -1.0, ..fits.clone() },
        DescriptorConfig { modes: 0, ..fits.clone() },
    ] {
        assert!(matches!(new(&bad, Some(modes.as_slice())), Err(DescriptorError::Config { .. })), "{bad:?}");
    }
}
