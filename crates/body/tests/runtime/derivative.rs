//! Analytic derivatives in f32 against central differences of the f64 reference.

use crate::reference::{self, Input, Point, random_body, random_input};
use glam::Vec3;
use softtissue_body::{BodyModel, Jacobian, Pose};

/// Central differences of `field` by every parameter; step 1e-5, so their own error is about 1e-10.
fn differences(input: &Input, field: impl Fn(&Input) -> Vec<Point>) -> Vec<Vec<Point>> {
    let h = 1e-5;
    (0..input.parameters())
        .map(|i| {
            let [mut plus, mut minus] = [input.clone(), input.clone()];
            *plus.at(i) += h;
            *minus.at(i) -= h;
            let (plus, minus) = (field(&plus), field(&minus));
            let change = plus.iter().zip(&minus).map(|(a, b)| std::array::from_fn(|c| (a[c] - b[c]) / (2.0 * h)));
            change.collect()
        })
        .collect()
}

fn compare(analytic: &Jacobian, numeric: &[Vec<Point>], what: &str) {
    assert_eq!(analytic.parameter_count(), numeric.len());
    for (i, column) in numeric.iter().enumerate() {
        let scale = column.iter().flatten().fold(1e-3f64, |m, x| m.max(x.abs()));
        for (v, (a, n)) in analytic.column(i).iter().zip(column).enumerate() {
            let error = (0..3).map(|c| (f64::from(a[c]) - n[c]).abs()).fold(0.0, f64::max);
            assert!(error < 2e-5 * (1.0 + scale), "{what}, parameter {i}, vertex {v}: {a} for {n:?}");
        }
    }
}

fn cases(body: &BodyModel) -> Vec<Input> {
    let mut cases = vec![random_input(body, 0, 0.3), random_input(body, 1, 0.6)];
    // the series near zero, and the rest pose itself
    cases.push(random_input(body, 2, 1e-3));
    let mut rest = random_input(body, 3, 0.3);
    rest.angles.iter_mut().for_each(|a| *a = [0.0; 3]);
    cases.push(rest);
    cases
}

fn deltas(body: &BodyModel) -> Vec<Vec3> {
    body.template.iter().map(|p| Vec3::new(p.y, -p.z, p.x) * 0.02).collect()
}

#[test]
fn derivatives_of_posed_vertices() {
    let body = random_body(31);
    let deltas = deltas(&body);
    for (i, input) in cases(&body).iter().enumerate() {
        let beta: Vec<f32> = input.beta.iter().map(|b| *b as f32).collect();
        let rotations = input.rotations();
        let pose = Pose { rotations: &rotations, translation: reference::single(input.translation) };
        let analytic = body.posed_jacobian(&body.shaped(&beta), pose, Some(&deltas));
        let numeric = differences(input, |at| reference::posed(&body, at, &deltas));
        compare(&analytic, &numeric, &format!("case {i}"));
    }
}

#[test]
fn derivatives_of_unposed_deltas() {
    // a rotation blended with its opposite has no inverse, so the angles stay small enough for random weights
    let body = random_body(31);
    let deltas = deltas(&body);
    let mut compared = 0;
    for (i, input) in cases(&body).iter().enumerate() {
        let beta: Vec<f32> = input.beta.iter().map(|b| *b as f32).collect();
        let rotations = input.rotations();
        let pose = Pose { rotations: &rotations, translation: reference::single(input.translation) };
        let target = reference::posed(&body, input, &deltas);
        let single: Vec<Vec3> = target.iter().map(|p| reference::single(*p)).collect();
        let target: Vec<Point> = single.iter().map(|p| p.to_array().map(f64::from)).collect();
        let Ok(analytic) = body.unposed_jacobian(&body.shaped(&beta), pose, &single) else { continue };
        let numeric = differences(input, |at| reference::unposed_deltas(&body, at, &target));
        compare(&analytic, &numeric, &format!("case {i}"));
        compared += 1;
    }
    assert!(compared >= 3, "only {compared} cases could be unposed");
}
