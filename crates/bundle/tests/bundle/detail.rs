use crate::tiny::{Parts, autoregressive, bundle, feedback_bundle, motion};
use glam::Vec3;
use softtissue_body::Region;
use softtissue_bundle::*;
use std::collections::BTreeSet;

/// Deltas of a motion and the latent numbers behind them.
fn played(bundle: &Bundle, detail: &Detail, controls: &Controls) -> Vec<(Vec<Vec3>, Vec<f32>)> {
    let (rotations, translations) = motion(60);
    let mut player = Player::new(bundle, &[0.4, -0.6]).unwrap();
    player.set_controls(controls).unwrap();
    player.set_detail(detail).unwrap();
    let mut frames = vec![];
    let keep = |_, player: &mut Player<&Bundle>| {
        frames.push((player.deltas().to_vec(), player.latent().to_vec()));
        Ok(())
    };
    player.play(&rotations, &translations, keep).unwrap();
    frames
}

fn components(count: usize) -> Detail {
    Detail { components: Some(count), ..Default::default() }
}

fn still(regions: &[Region]) -> Detail {
    Detail { still: regions.to_vec(), ..Default::default() }
}

#[test]
fn fewer_components_are_the_sum_over_the_first_ones() {
    for precision in Precision::ALL {
        let bundle = bundle(Parts::default()).reduced(precision).unwrap();
        let subspace = &bundle.model.recurrent().unwrap().subspace;
        let basis = &subspace.basis;
        let mut scratch = subspace.scratch();
        let directions = basis.directions.numbers();
        let (mut coefficients, mut moved) = (vec![0.0; 7], 0.0f32);
        for (deltas, latent) in played(&bundle, &components(3), &Controls::default()) {
            subspace.decode_coefficients(&latent, &mut coefficients, &mut scratch);
            for (i, found) in deltas.iter().flat_map(|d| d.to_array()).enumerate() {
                let part = |k: usize| {
                    let own = if k < 3 { f64::from(coefficients[k]) } else { 0.0 };
                    (own + f64::from(basis.coefficient_mean[k])) * f64::from(directions[k * basis.mean.len() + i])
                };
                let expected = f64::from(basis.mean[i]) + (0..7).map(part).sum::<f64>();
                assert!((f64::from(found) - expected).abs() < 1e-5, "{precision:?}: {found} {expected}");
                moved = moved.max(found.abs());
            }
        }
        assert!(moved > 1e-3);
    }
}

#[test]
fn all_components_are_the_whole_and_fewer_are_farther_from_it() {
    for bundle in [bundle(Parts::default()), autoregressive()] {
        let whole = played(&bundle, &Detail::default(), &Controls::default());
        let distance = |detail: &Detail| {
            let other = played(&bundle, detail, &Controls::default());
            let pairs = whole.iter().zip(&other).flat_map(|(a, b)| a.0.iter().zip(&b.0));
            pairs.fold(0.0f32, |m, (a, b)| m.max(a.distance(*b)))
        };
        assert!(distance(&components(7)) < 1e-7);
        assert!(distance(&components(6)) > 1e-6);
        assert!(distance(&components(1)) > distance(&components(6)));
        // No vertex is of the head.
        assert!(distance(&still(&[Region::Head])) < 1e-7);
    }
}

/// One in the belly and zero in the feet, then six times the mean of a vertex and its neighbours.
fn belly_share(bundle: &Bundle) -> Vec<f32> {
    let body = &bundle.body;
    let mut round = vec![BTreeSet::new(); body.vertex_count()];
    for face in &body.topology.faces {
        for a in face {
            round[*a as usize].extend(face.iter().map(|b| *b as usize));
        }
    }
    let mut share: Vec<f32> = body.regions.0.iter().map(|r| if *r == Region::Belly { 1.0 } else { 0.0 }).collect();
    for _ in 0..6 {
        share = round.iter().map(|all| all.iter().map(|v| share[*v]).sum::<f32>() / all.len() as f32).collect();
    }
    share
}

#[test]
fn still_regions_are_faded_out_across_their_edges() {
    let bundle = bundle(Parts::default());
    let gains = Controls::gain(1.5);
    for controls in [Controls::default(), gains] {
        let whole = played(&bundle, &Detail::default(), &controls);
        let found = played(&bundle, &still(&[Region::Feet]), &controls);
        // A factor for each vertex, the same in every frame.
        let share = |v: usize, t: usize| found[t].0[v].dot(whole[t].0[v]) / whole[t].0[v].length_squared();
        for v in 0..26 {
            for t in 1..60 {
                assert!((share(v, t) - share(v, 0)).abs() < 1e-4 && (-1e-6..1.0 + 1e-6).contains(&share(v, t)));
            }
        }
        for (v, expected) in belly_share(&bundle).into_iter().enumerate() {
            assert!((share(v, 0) - expected).abs() < 1e-4, "vertex {v}: {} {expected}", share(v, 0));
        }
        let none = played(&bundle, &still(&[Region::Feet, Region::Belly]), &controls);
        assert!(none.iter().all(|(deltas, _)| deltas.iter().all(|d| *d == Vec3::ZERO)));
    }
}

#[test]
fn a_change_of_detail_does_not_start_over() {
    let bundle = bundle(Parts::default());
    let (rotations, translations) = motion(40);
    let mut player = Player::new(&bundle, &[]).unwrap();
    let mut changing = Player::new(&bundle, &[]).unwrap();
    for t in 0..40 {
        let detail = if (10..30).contains(&t) { components(2) } else { Detail::default() };
        changing.set_detail(&detail).unwrap();
        let pose = softtissue_body::Pose { rotations: rotations.frame(t), translation: translations[t] };
        player.step(pose);
        changing.step(pose);
        assert_eq!(player.latent(), changing.latent());
        assert_eq!(player.deltas() == changing.deltas(), detail == Detail::default());
    }
}

#[test]
fn a_detail_that_cannot_be_is_refused() {
    let says = |bundle: &Bundle, detail: &Detail, says: &str| {
        let message = Player::new(bundle, &[]).unwrap().set_detail(detail).unwrap_err().to_string();
        assert!(message.contains(says), "{message}");
    };
    let good = bundle(Parts::default());
    says(&good, &components(0), "0 components; give 1 to 7");
    says(&good, &components(8), "8 components");
    says(&feedback_bundle(true), &still(&[Region::Feet]), "without a basis");
    Player::new(&feedback_bundle(true), &[]).unwrap().set_detail(&Detail::default()).unwrap();
}
