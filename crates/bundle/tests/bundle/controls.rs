use crate::tiny::{Parts, bundle, motion, recurrent_of};
use glam::{Mat3, Vec3};
use softtissue_body::{Pose, Region};
use softtissue_bundle::*;
use softtissue_geometry::Frames;

const BETA: [f32; 2] = [0.2, 0.9];

fn played(bundle: &Bundle, controls: &Controls, frames: usize) -> Frames {
    let (rotations, translations) = motion(frames);
    let mut player = Player::new(bundle, &BETA).unwrap();
    player.set_controls(controls).unwrap();
    player.rollout(&rotations, &translations).unwrap()
}

fn everywhere(control: Control) -> Controls {
    Controls { everywhere: control, ..Default::default() }
}

/// Largest distance over all frames and vertices.
fn largest(a: &Frames, b: impl Fn(usize, usize) -> Vec3) -> f32 {
    let distance = |t: usize| a.frame(t).iter().enumerate().map(|(v, d)| d.distance(b(t, v))).fold(0.0, f32::max);
    (0..a.len()).map(distance).fold(0.0, f32::max)
}

fn size(frames: &Frames) -> f32 {
    frames.points().iter().fold(0.0, |m: f32, d| m.max(d.length()))
}

#[test]
fn gains_multiply_everywhere_by_region_and_as_painted() {
    let bundle = bundle(Parts::default());
    let plain = played(&bundle, &Controls::default(), 40);
    assert!(size(&plain) > 0.01);
    let twice = played(&bundle, &Controls::gain(-2.0), 40);
    assert!(largest(&twice, |t, v| -2.0 * plain.frame(t)[v]) < 1e-6);

    let painted: Vec<f32> = (0..bundle.body.vertex_count()).map(|v| v as f32 * 0.1).collect();
    let controls = Controls { painted: Some(painted.clone()), ..Controls::gain(3.0) };
    assert!(largest(&played(&bundle, &controls, 40), |t, v| 3.0 * painted[v] * plain.frame(t)[v]) < 1e-5);

    // the feet are the four lowest vertices; what is not named stays, with a blended edge between
    let still = Control { gain: 0.0, ..Default::default() };
    let feet = played(&bundle, &Controls { regions: vec![(Region::Feet, still)], ..Default::default() }, 40);
    let factor = |v: usize| feet.frame(30)[v].length() / plain.frame(30)[v].length();
    let up: Vec<f32> = (0..6).map(|level| factor(4 * level)).collect();
    assert!(up.windows(2).all(|w| w[0] < w[1]), "{up:?}");
    assert!(up[0] < 0.75 && up[5] > 0.95, "{up:?}");
    // a region's control stands on top of the whole body's
    let all = Region::ALL.map(|r| (r, Control { gain: 0.5, ..Default::default() })).to_vec();
    let controls = Controls { regions: all, ..Controls::gain(2.0) };
    assert!(largest(&played(&bundle, &controls, 40), |t, v| plain.frame(t)[v]) < 1e-6);
}

#[test]
fn a_mass_lends_a_body_the_flesh_of_a_heavier_one() {
    let bundle = bundle(Parts::default());
    let heavier = played(&bundle, &everywhere(Control { mass: 1.5, ..Default::default() }), 40);
    // the same features in a model of the heavier person; the body that moves stays
    let (rotations, translations) = motion(40);
    let mut player = Player::new(&bundle, &BETA).unwrap();
    let mut state = bundle.model.start(&[BETA[0], BETA[1] - 1.5]);
    let mut deltas = vec![0.0; 3 * bundle.body.vertex_count()];
    for t in 0..40 {
        player.step(Pose { rotations: rotations.frame(t), translation: translations[t] });
        bundle.model.step(player.features(), &mut state, &mut deltas);
        for (found, wanted) in heavier.frame(t).iter().zip(deltas.chunks_exact(3)) {
            assert!(found.distance(Vec3::from_slice(wanted)) < 1e-6, "frame {t}");
        }
    }
    assert!(largest(&heavier, |t, v| played(&bundle, &Controls::default(), 40).frame(t)[v]) > 1e-3);
}

#[test]
fn a_lag_delays_by_whole_and_broken_frames() {
    let bundle = bundle(Parts::default());
    let plain = played(&bundle, &Controls::default(), 40);
    for frames in [3.0f32, 2.5] {
        let late = played(&bundle, &everywhere(Control { lag: frames / 60.0, ..Default::default() }), 40);
        let (before, part) = (frames.floor() as usize, frames.fract());
        for t in 4..40 {
            for v in 0..bundle.body.vertex_count() {
                let wanted = plain.frame(t - before)[v].lerp(plain.frame(t - before - 1)[v], part);
                assert!(late.frame(t)[v].distance(wanted) < 1e-6, "{frames} {t} {v}");
            }
        }
        assert_eq!(late.frame(0)[5], Vec3::ZERO);
    }
}

/// A bundle whose memory is one resonator and nothing beside it.
fn ringing(frequency: f32, damping: f32) -> Bundle {
    let mut bundle = bundle(Parts { recurrent: false, direct: false, units: 0, ..Default::default() });
    let regressor = &mut recurrent_of(&mut bundle).regressor;
    let old = regressor.memory_count();
    regressor.bank = Some(ResonatorBank::new(vec![Resonator { frequency, damping }], 4, 60.0));
    regressor.shape_terms = vec![vec![]];
    let (new, weight) = (regressor.memory_count(), &regressor.shortcut.weight);
    assert!(new < old);
    let rows = (0..weight.rows()).flat_map(|r| weight.row(r)[..new + 2].to_vec()).collect();
    regressor.shortcut.weight = Matrix::new(weight.rows(), new + 2, rows);
    bundle
}

#[test]
fn softer_flesh_is_that_of_a_lower_frequency() {
    let (stiff, soft) = (ringing(5.0, 0.15), ringing(2.5, 0.15));
    let slow = played(&soft, &Controls::default(), 240);
    let control = Control { softness: 2.0, ..Default::default() };
    let softened = played(&stiff, &everywhere(control), 240);
    // two frames late, and with the coarser steps of a model at half its rate
    let late = |t: usize, v: usize| slow.frame(t.saturating_sub(2))[v];
    let moving = size(&Frames::from_points(1, slow.iter().map(|f| f[12] - slow.frame(0)[12]).collect()));
    let error = (20..240).map(|t| softened.frame(t)[12].distance(late(t, 12))).fold(0.0, f32::max);
    assert!(error < 0.2 * moving, "{error} of {moving}");
    let unchanged = played(&stiff, &Controls::default(), 240);
    let error_of_none = (20..240).map(|t| unchanged.frame(t)[12].distance(late(t, 12))).fold(0.0, f32::max);
    assert!(error_of_none > 2.0 * error, "{error_of_none} {error}");
}

#[test]
fn damping_is_that_of_the_resonators() {
    let (plain, damped) = (ringing(4.0, 0.1), ringing(4.0, 0.3));
    let wanted = played(&damped, &Controls::default(), 100);
    let found = played(&plain, &everywhere(Control { damping: 3.0, ..Default::default() }), 100);
    assert!(largest(&found, |t, v| wanted.frame(t)[v]) < 1e-5);
    let never = Player::new(&bundle(Parts { bank: false, ..Default::default() }), &BETA)
        .unwrap()
        .set_controls(&everywhere(Control { damping: 3.0, ..Default::default() }))
        .unwrap_err();
    assert!(never.to_string().contains("resonators"), "{never}");
}

#[test]
fn whatever_is_asked_for_the_rollout_stays_bounded() {
    let bundle = bundle(Parts::default());
    // features are clipped to their range in training and every resonator has unit gain at rest: twice the largest
    // displacement of the model itself at its loosest is generous
    let bound = 4.0 * size(&played(&bundle, &Controls::default(), 4000));
    for (softness, damping) in [(0.25, 0.1), (4.0, 0.1), (1.7, 0.3), (0.4, 10.0)] {
        let control = Control { softness, damping, lag: 0.13, ..Default::default() };
        let regions = vec![(Region::Feet, Control { softness: 1.0, ..Default::default() })];
        let found = played(&bundle, &Controls { everywhere: control, regions, painted: None }, 4000);
        assert!(size(&found) < bound, "{softness} {damping}: {} of {bound}", size(&found));
    }
}

#[test]
fn controls_out_of_range_are_refused_by_name() {
    let bundle = bundle(Parts::default());
    let mut player = Player::new(&bundle, &BETA).unwrap();
    let one = Control::default();
    for (controls, word) in [
        (Controls::gain(f32::NAN), "gain"),
        (Controls::gain(101.0), "gain"),
        (everywhere(Control { softness: 5.0, ..one }), "softness"),
        (everywhere(Control { damping: 0.0, ..one }), "damping"),
        (everywhere(Control { lag: -0.1, ..one }), "lag"),
        (
            Controls {
                regions: vec![(Region::Belly, Control { softness: 3.0, ..one })],
                ..everywhere(Control { softness: 3.0, ..one })
            },
            "softness of 9",
        ),
        (Controls { painted: Some(vec![1.0; 3]), ..Default::default() }, "painted"),
        (Controls { painted: Some(vec![f32::INFINITY; 26]), ..Default::default() }, "painted"),
    ] {
        let message = player.set_controls(&controls).unwrap_err().to_string();
        assert!(message.contains(word), "{word}: {message}");
    }
}

#[test]
fn deltas_turn_and_grow_with_the_body_that_shows_them() {
    let bundle = bundle(Parts::default());
    let (rotations, translations) = motion(30);
    let still = Frames::zeros(3, 30);
    let rest = bundle.body.shaped(&BETA).vertices;
    let turn = Mat3::from_rotation_y(1.1);
    let mut player = Player::new(&bundle, &BETA).unwrap();
    let own = player.rollout_vertices(&rotations, &translations).unwrap();
    player.show_on(Some(rest.clone())).unwrap();
    let same = player.rollout_vertices(&rotations, &translations).unwrap();
    assert!(largest(&same, |t, v| own.frame(t)[v]) < 1e-5);
    player.show_on(None).unwrap();
    assert_eq!(player.rollout_vertices(&rotations, &translations).unwrap(), own);

    // standing still with the deltas of gravity: the shown mesh is twice as large and turned
    player.show_on(Some(rest.iter().map(|p| 2.0 * (turn * *p)).collect())).unwrap();
    let none = vec![Vec3::ZERO; 30];
    let shown = player.rollout_vertices(&still, &none).unwrap();
    let deltas = player.rollout(&still, &none).unwrap();
    assert!(size(&deltas) > 1e-3);
    for v in 0..rest.len() {
        let offsets = bundle.body.pose_offsets(still.frame(0));
        let wanted = 2.0 * (turn * (rest[v] + deltas.frame(29)[v])) + offsets[v];
        assert!(shown.frame(29)[v].distance(wanted) < 2e-4, "{v}");
    }
    assert!(player.show_on(Some(vec![Vec3::ONE; 4])).unwrap_err().to_string().contains("26"));
}
