//! Dyna against NumPy, against closed forms of the weighted risk, and on a mixture whose people are known.

use super::*;
use crate::{ModelError, TrainingClip};
use glam::Vec3;
use serde_json::Value;
use softtissue_body::{
    BodyBuild, BodyModel, JointRegressor, Mirror, Region, RegionMap, Skeleton, SkinWeights, UvAtlas,
};
use softtissue_bundle::descriptor::{DescriptorConfig, FeatureBlock};
use softtissue_bundle::{AutoregressiveModel, DeltaBasis, Matrix};
use softtissue_clips::ClipId;
use softtissue_geometry::Topology;
use softtissue_random::Draws;
use std::sync::Arc;

/// A box 0.22 m wide, 0.2 m deep and 1.7 m high; `beta[0]` adds 0.05 m to the height, `beta[1]` takes 0.02 m off the
/// width.
fn body() -> BodyModel {
    let corner = |v: usize| Vec3::new((v & 1) as f32 - 0.5, ((v >> 1) & 1) as f32, ((v >> 2) & 1) as f32 - 0.5);
    let corners: Vec<Vec3> = (0..8).map(corner).collect();
    let sides: [[u32; 4]; 6] = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let faces = sides.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).collect();
    BodyModel {
        topology: Arc::new(Topology { vertex_count: 8, faces, quads: vec![] }),
        template: corners.iter().map(|c| *c * Vec3::new(0.22, 1.7, 0.2)).collect(),
        shape_directions: [Vec3::new(0.0, 0.05, 0.0), Vec3::new(-0.02, 0.0, 0.0)]
            .iter()
            .flat_map(|change| corners.iter().map(|c| *c * *change))
            .collect(),
        pose_directions: vec![],
        joint_regressor: JointRegressor { rows: vec![vec![(0, 1.0)]] },
        skin: vec![SkinWeights { joints: [0; 4], weights: [1.0, 0.0, 0.0, 0.0] }; 8],
        skeleton: Skeleton { names: vec!["root".into()], parents: vec![None] },
        uv: UvAtlas::default(),
        mirror: Mirror { vertices: (0..8).collect(), joints: vec![0] },
        regions: RegionMap(vec![Region::Belly; 8]),
    }
}

/// `components` directions that each move one coordinate of the box.
fn basis(components: usize) -> DeltaBasis {
    let mut directions = Matrix::zeros(components, 24);
    (0..components).for_each(|k| directions.row_mut(k)[5 * k] = 1.0);
    DeltaBasis { mean: vec![0.0; 24], directions, coefficient_mean: vec![0.0; components] }
}

fn clip(subject: &str, beta: &[f32], features: Vec<f32>, coefficients: Vec<f32>, frames: usize) -> TrainingClip {
    TrainingClip { id: ClipId::new(subject, "m", 0), beta: beta.to_vec(), features, coefficients, frames }
}

fn fitted(config: &DynaConfig, clips: &[TrainingClip]) -> Result<AutoregressiveModel, ModelError> {
    let blocks = FeatureBlock::in_a_row(&[("drive", clips[0].feature_count())]);
    let descriptor = DescriptorConfig::default();
    let set = FeatureSet { descriptor: &descriptor, blocks: &blocks, train: clips, validation: &[] };
    Ok(fit_dyna(config, &basis(clips[0].coefficient_count()), &body(), set)?.model)
}

fn at_strength(strength: f64) -> DynaConfig {
    DynaConfig { ar2: Ar2Config { strengths: vec![strength], ..Ar2Config::default() }, ..DynaConfig::default() }
}

fn numbers(value: &Value) -> Vec<f32> {
    value.as_array().expect("a list").iter().map(|x| x.as_f64().expect("a number") as f32).collect()
}

fn number(value: &Value) -> f32 {
    value.as_f64().expect("a number") as f32
}

fn close(what: &str, found: &[f32], expected: &[f32], tolerance: f32) {
    assert_eq!(found.len(), expected.len(), "{what}");
    let worst = found.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    assert!(worst < tolerance, "{what}: {worst} apart\n{found:?}\n{expected:?}");
}

/// `tests/golden/dyna_reference.py`: body mass index, weighted risk, mixture and rollout, with and without memory.
#[test]
fn weighted_risk_and_mixture_match_the_numpy_reference() {
    let golden: Value =
        serde_json::from_str(include_str!("../../tests/golden/dyna_reference.json")).expect("the committed reference");
    let people = golden["people"].as_array().expect("people");
    let clips: Vec<TrainingClip> = people
        .iter()
        .enumerate()
        .map(|(i, p)| {
            let features = numbers(&p["features"]);
            let frames = features.len() / 3;
            clip(&format!("s{i}"), &numbers(&p["beta"]), features, numbers(&p["coefficients"]), frames)
        })
        .collect();
    let new = &golden["new"];
    for order in [0, 2] {
        let config =
            DynaConfig { order, tau: number(&golden["tau"]), ..at_strength(golden["strength"].as_f64().unwrap()) };
        let model = fitted(&config, &clips).unwrap();
        let expected = &golden[format!("order_{order}")];
        for (i, person) in model.people.iter().enumerate() {
            let dynamics = &expected["people"][i];
            close("index", &[person.bmi], &[number(&people[i]["bmi"])], 1e-4);
            close("lags", person.dynamics.lags.data(), &numbers(&dynamics["lags"]), 1e-5);
            close("weight", person.dynamics.weight.data(), &numbers(&dynamics["weight"]), 1e-5);
            close("bias", &person.dynamics.bias, &numbers(&dynamics["bias"]), 1e-5);
        }
        let beta = numbers(&new["beta"]);
        close("new index", &[model.build.bmi(&beta)], &[number(&new["bmi"])], 1e-4);
        close("mixture", &model.weights(model.build.bmi(&beta)), &numbers(&new["weights"]), 1e-4);
        let mut state = model.start(&beta);
        let (mut deltas, mut played) = (vec![0.0; 24], vec![]);
        for features in numbers(&new["features"]).chunks_exact(3) {
            assert_eq!(model.step(features, &mut state, &mut deltas), 0, "nothing is clipped");
            played.extend([deltas[0], deltas[5]]);
        }
        close("rollout", &played, &numbers(&expected["rollout"]), 1e-4);
    }
}

/// With constant targets and a motion that explains nothing, person j's bias is the mean of everybody's constants with
/// weights 2 (N - 1) for the own and 1 for the others (eq. 25).
#[test]
fn the_own_data_weigh_twice_what_all_others_weigh() {
    let constants = [1.0f32, 4.0, -2.0, 7.0];
    let clips: Vec<TrainingClip> = constants
        .iter()
        .enumerate()
        .map(|(i, c)| {
            // Different lengths, one clip or two: a person counts by its mean error, not by its frames.
            let frames = 12 + 10 * i;
            let wave = (0..frames).map(|t| if t % 2 == 0 { 1.0 } else { -1.0 }).collect();
            clip(&format!("s{i}"), &[0.0, i as f32], wave, vec![*c; frames], frames)
        })
        .collect();
    let model = fitted(&DynaConfig { order: 0, ..at_strength(1e-6) }, &clips).unwrap();
    let total: f32 = constants.iter().sum();
    for (person, own) in model.people.iter().zip(constants) {
        let expected = (6.0 * own + total - own) / 9.0;
        close("bias", &person.dynamics.bias, &[expected], 1e-5);
    }
    let alone = fitted(&DynaConfig { order: 0, ..at_strength(1e-6) }, &clips[1..2]).unwrap();
    close("somebody alone", &alone.people[0].dynamics.bias, &[4.0], 1e-5);
}

/// People who all obey one recursion give it back, whatever the weights; its free rollout is the data's.
#[test]
fn a_recursion_that_everybody_shares_is_recovered() {
    let mut draws = Draws::new(7, "dyna", 0, 0);
    let clips: Vec<TrainingClip> = [-1.0f32, 0.0, 1.5]
        .iter()
        .map(|b1| {
            let frames = 120;
            let features: Vec<f32> = (0..frames).map(|_| draws.normal() as f32).collect();
            let mut c = vec![0.0f32; 2];
            for x in &features {
                let n = c.len();
                c.push(1.6 * c[n - 1] - 0.8 * c[n - 2] + 0.5 * x + 0.1);
            }
            clip(&format!("{b1}"), &[0.0, *b1], features, c[2..].to_vec(), frames)
        })
        .collect();
    let model = fitted(&at_strength(1e-10), &clips).unwrap();
    for beta in [[0.0, -3.0], [0.0, 0.4], [1.0, 1.0]] {
        let mixed = model.mixed(&beta);
        close("lags", mixed.lags.data(), &[1.6, -0.8], 1e-4);
        close("bias", &mixed.bias, &[0.1], 1e-4);
        let rolled = mixed.rollout(&model.input.apply_clip(&clips[0].features), &[0.0]);
        close("rollout", &rolled, &clips[0].coefficients, 1e-3);
    }
}

/// The kernel's limits: everybody's mean when wide, the nearest person when narrow; beyond the people its ends.
#[test]
fn the_mixture_follows_the_index_and_stays_inside_the_people() {
    let clips: Vec<TrainingClip> = [2.0f32, 0.0, -2.5]
        .iter()
        .map(|b1| clip(&format!("{b1}"), &[0.0, *b1], vec![1.0, -1.0, 0.5, 0.2, 1.0], vec![*b1; 5], 5))
        .collect();
    let config = |tau| DynaConfig { order: 0, tau, ..at_strength(1e-3) };
    let model = fitted(&config(2.0), &clips).unwrap();
    let bmi: Vec<f32> = model.people.iter().map(|p| p.bmi).collect();
    let (low, high) = model.bmi_range();
    assert!(low > 20.0 && high < 36.0 && bmi.contains(&low) && bmi.contains(&high), "{bmi:?}");
    for (beyond, end) in [(high + 1e4, high), (low - 15.0, low)] {
        close("an end", &model.weights(beyond), &model.weights(end), 1e-5);
    }
    close("wide", &fitted(&config(1e4), &clips).unwrap().weights(25.0), &[1.0 / 3.0; 3], 1e-3);
    let narrow = fitted(&config(0.01), &clips).unwrap();
    close("narrow", &narrow.weights(bmi[1]), &[0.0, 1.0, 0.0], 1e-6);
    let build = BodyBuild::fit(&body());
    let heavier = build.at_bmi(&[0.0, 0.0], high).unwrap();
    close("a wanted index", &model.weights(build.bmi(&heavier)), &model.weights(high), 1e-4);
}

/// Lags whose poles lie in a radius form a convex set, so that no mixture of stable people is unstable.
#[test]
fn a_mixture_of_stable_people_is_stable() {
    let mut draws = Draws::new(3, "mixed poles", 0, 0);
    let lags = |draws: &mut Draws| {
        let (radius, angle) = (0.995 * draws.uniform().sqrt(), draws.range(0.0, std::f64::consts::PI));
        if draws.uniform() < 0.5 {
            (2.0 * radius * angle.cos(), -radius * radius)
        } else {
            let other = draws.range(-0.995, 0.995);
            (radius + other, -radius * other)
        }
    };
    for _ in 0..500 {
        let (a, b, share) = (lags(&mut draws), lags(&mut draws), draws.uniform());
        let (a1, a2) = (share * a.0 + (1.0 - share) * b.0, share * a.1 + (1.0 - share) * b.1);
        let d = a1 * a1 + 4.0 * a2;
        let size = if d < 0.0 { (-a2).sqrt() } else { 0.5 * (a1.abs() + d.sqrt()) };
        assert!(size <= 0.995 + 1e-9, "{a:?} {b:?} {share}: {size}");
    }
}

#[test]
fn settings_and_data_that_give_no_model_are_refused_in_one_sentence() {
    let good = vec![clip("a", &[0.0, 0.0], vec![1.0, -1.0, 0.5, 0.2, 1.0], vec![1.0; 5], 5)];
    let refuse = |config: DynaConfig, says: &str| {
        let message = fitted(&config, &good).expect_err(says).to_string();
        assert!(message.contains(says) && !message.contains('\n'), "{message}");
    };
    let own = || at_strength(1e-3);
    refuse(DynaConfig { order: 1, ..own() }, "dyna.order");
    refuse(DynaConfig { tau: 0.0, ..own() }, "dyna.tau");
    refuse(DynaConfig { tau: f32::NAN, ..own() }, "dyna.tau");
    refuse(DynaConfig { components: 0, ..own() }, "dyna.components");
    refuse(DynaConfig { variance: 1.5, ..own() }, "dyna.variance");
    refuse(DynaConfig { ar2: Ar2Config { strengths: vec![], ..Ar2Config::default() }, ..own() }, "dyna.ar2.strengths");
    refuse(at_strength(-1.0), "strength");
    refuse(DynaConfig { ar2: Ar2Config { pole_radius: 1.0, ..Ar2Config::default() }, ..own() }, "pole_radius");
    let nobody = clip("a", &[0.0, 40.0], vec![1.0, -1.0, 0.5, 0.2, 1.0], vec![1.0; 5], 5);
    let message = fitted(&own(), &[nobody]).expect_err("a negative weight").to_string();
    assert!(message.contains("body mass index"), "{message}");
}
