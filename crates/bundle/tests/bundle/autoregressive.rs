//! Bundles of autoregressions: eq. 21 as it stands, files and back, and what is refused.

use crate::tiny::{autoregressive, autoregressive_of, motion};
use softtissue_bundle::descriptor::Descriptor;
use softtissue_bundle::*;

/// Everybody predicts from the mixture's own history and the predictions are mixed (Dyna eq. 21), in f64.
#[test]
fn the_player_mixes_everybody_s_predictions() {
    let bundle = autoregressive();
    let model = bundle.model.autoregressive().unwrap();
    let (rotations, translations) = motion(50);
    let descriptor = Descriptor::new(&bundle.descriptor, &bundle.body, bundle.model.modes().as_deref()).unwrap();
    for beta in [[0.3, -0.8], [0.0, 2.0], [-1.0, -9.0]] {
        let features = descriptor.run(&bundle.body, &bundle.body.shaped(&beta), &rotations, &translations);
        let root = 4.1 + 0.05 * f64::from(beta[0]) - 0.2 * f64::from(beta[1]);
        let bmi = root.powi(3) / (1.7 + 0.06 * f64::from(beta[0])).powi(2);
        let kernel: Vec<f64> = model.people.iter().map(|p| (-(f64::from(p.bmi) - bmi).abs() / 2.0).exp()).collect();
        let sum: f64 = kernel.iter().sum();
        let k = model.components();
        let numbers = |x: &[f32]| x.iter().map(|x| f64::from(*x)).collect::<Vec<f64>>();
        let dot = |a: &[f32], b: &[f32]| numbers(a).iter().zip(numbers(b)).map(|(a, b)| a * b).sum::<f64>();
        let rest = |i: usize| {
            -dot(model.basis.directions.row(i), &model.basis.mean) - f64::from(model.basis.coefficient_mean[i])
        };
        let mut last: Vec<f64> = (0..k).map(rest).collect();
        let mut before = last.clone();
        let played = Player::new(&bundle, &beta).unwrap().rollout(&rotations, &translations).unwrap();
        for (t, x) in model.input.apply_clip(&features).chunks_exact(model.input.len()).enumerate() {
            let next = |i: usize| {
                let each = model.people.iter().zip(&kernel).map(|(p, weight)| {
                    let (lags, own) = (p.dynamics.lags.row(i), &p.dynamics);
                    let driven = dot(own.weight.row(i), x) + f64::from(own.bias[i]);
                    weight / sum * (f64::from(lags[0]) * last[i] + f64::from(lags[1]) * before[i] + driven)
                });
                each.sum::<f64>()
            };
            let now: Vec<f64> = (0..k).map(next).collect();
            before = std::mem::replace(&mut last, now);
            for (v, delta) in played.frame(t).iter().enumerate() {
                for axis in 0..3 {
                    let decoded = (0..k).map(|i| {
                        let c = last[i] + f64::from(model.basis.coefficient_mean[i]);
                        c * f64::from(model.basis.directions.row(i)[3 * v + axis])
                    });
                    let expected = f64::from(model.basis.mean[3 * v + axis]) + decoded.sum::<f64>();
                    let found = f64::from(delta[axis]);
                    assert!((found - expected).abs() < 1e-5, "frame {t}, vertex {v}: {found} {expected}");
                }
            }
        }
    }
}

#[test]
fn a_motion_starts_from_no_delta_and_can_start_again() {
    let bundle = autoregressive();
    let (rotations, translations) = motion(30);
    let mut player = Player::new(&bundle, &[0.2]).unwrap();
    let first = player.rollout(&rotations, &translations).unwrap();
    assert_eq!(first, player.rollout(&rotations, &translations).unwrap());
    let model = bundle.model.autoregressive().unwrap();
    let (mut state, mut delta) = (model.start(&[0.2]), vec![1.0; model.basis.mean.len()]);
    assert_eq!(state.coefficients(), model.basis.rest_coefficients());
    model.step(&vec![0.3; model.input.input_size], &mut state, &mut delta);
    assert_ne!(state.coefficients(), model.basis.rest_coefficients());
    state.reset();
    assert_eq!(state.coefficients(), model.basis.rest_coefficients());
}

#[test]
fn a_bundle_comes_back_from_its_files() {
    let (dir, bundle) = (tempfile::tempdir().unwrap(), autoregressive());
    bundle.write(dir.path()).unwrap();
    let read = Bundle::read(dir.path()).unwrap();
    assert_eq!(read.model, bundle.model);
    assert_eq!((read.info, read.descriptor), (bundle.info.clone(), bundle.descriptor.clone()));
}

/// What is wrong with a model is said in one sentence and not written.
#[test]
fn models_that_do_not_fit_together_are_refused() {
    type Break = fn(&mut AutoregressiveModel);
    let cases: [(&str, Break); 9] = [
        ("kernel width", |m| m.tau = 0.0),
        ("kernel width", |m| m.tau = f32::INFINITY),
        ("0 people", |m| m.people.clear()),
        ("257 people", |m| m.people = vec![m.people[0].clone(); 257]),
        ("body mass index", |m| m.people[1].bmi = -3.0),
        ("dynamics of \"s02\"", |m| m.people[2].dynamics.bias.truncate(2)),
        ("coefficient mean", |m| m.basis.coefficient_mean.truncate(1)),
        ("weight and height", |m| m.build.height.truncate(1)),
        ("lags holds NaN", |m| m.people[0].dynamics.lags.data_mut()[3] = f32::NAN),
    ];
    for (says, damage) in cases {
        let mut bundle = autoregressive();
        damage(autoregressive_of(&mut bundle));
        let dir = tempfile::tempdir().unwrap();
        let message = bundle.write(dir.path()).expect_err(says).to_string();
        assert!(message.contains(says) && !message.contains('\n'), "expected {says:?} in: {message}");
        assert!(!dir.path().join(MANIFEST_FILE).exists());
    }
}

/// A recurrent model's arrays under an autoregressive manifest, and people that the arrays do not hold.
#[test]
fn a_manifest_that_asks_for_other_arrays_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    autoregressive().write(dir.path()).unwrap();
    let path = dir.path().join(MANIFEST_FILE);
    let good = std::fs::read_to_string(&path).unwrap();
    let refuse = |from: &str, to: &str, says: &str| {
        assert!(good.contains(from), "{good}");
        std::fs::write(&path, good.replacen(from, to, 1)).unwrap();
        let message = Bundle::read(dir.path()).expect_err(says).to_string();
        assert!(message.contains(says) && !message.contains('\n'), "expected {says:?} in: {message}");
    };
    let person = "\"name\": \"s00\",";
    refuse(person, "\"name\": \"s00\", \"age\": 3,", "age");
    refuse("\"autoregressive\"", "\"recurrent\"", "unknown field");
    refuse("\"autoregressive\"", "\"psychic\"", "psychic");
    refuse("\"tau\": 2.0", "\"tau\": -2.0", "kernel width");
    refuse("\"people\": [", "\"people\": [{\"name\": \"more\", \"bmi\": 22.0},", "person.3");
    // Somebody else's index changes the mixture, which the self-check hears.
    refuse("\"bmi\": 20.5", "\"bmi\": 30.5", "self-check");
}

#[test]
fn controls_that_need_resonators_are_refused_and_the_others_play() {
    let bundle = autoregressive();
    let (rotations, translations) = motion(30);
    let mut player = Player::new(&bundle, &[0.2]).unwrap();
    let controlled = |control: Control| Controls { everywhere: control, ..Controls::default() };
    player.set_controls(&controlled(Control { softness: 2.0, lag: 0.05, ..Control::default() })).unwrap();
    assert!(player.rollout(&rotations, &translations).unwrap().points().iter().all(|d| d.is_finite()));
    let error = player.set_controls(&controlled(Control { damping: 2.0, ..Control::default() })).unwrap_err();
    assert!(error.to_string().contains("resonators"), "{error}");
}
