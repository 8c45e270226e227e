use crate::body;
use glam::Vec3;
use softtissue_body::Pose;
use softtissue_geometry::Mesh;
use softtissue_implicit::{MeshField, Observers, PointTree, SignedDistance};

#[test]
fn observers_are_spread_evenly() {
    let rest = &body().template;
    let observers = Observers::spread(rest, 400).unwrap();
    assert_eq!(observers, Observers::spread(rest, 400).unwrap());
    assert!(observers.vertices().windows(2).all(|w| w[0] < w[1]));
    // what farthest point sampling promises: nobody is farther from an observer than two observers from each other
    let chosen = observers.pick(rest);
    let tree = PointTree::new(&chosen);
    let covering = tree.nearest(rest, 1).distances.into_iter().fold(0.0, f32::max);
    let apart = tree.nearest(&chosen, 2).distances.chunks_exact(2).map(|d| d[1]).fold(f32::MAX, f32::min);
    assert!(apart >= covering && covering < 0.06, "{apart} m apart, {covering} m to the nearest");
    assert_eq!(Observers::spread(rest, rest.len()).unwrap(), Observers::all(rest.len()));
    assert!(Observers::spread(rest, 0).is_err() && Observers::spread(rest, rest.len() + 1).is_err());
}

#[test]
fn observers_stand_on_the_posed_body_and_look_outwards() {
    let body = body();
    let observers = Observers::spread(&body.template, 300).unwrap();
    let bent: Vec<Vec3> = (0..body.joint_count()).map(|j| Vec3::X * 0.1 * (j as f32).sin()).collect();
    let pose = Pose { rotations: &bent, translation: Vec3::new(0.3, -0.2, 1.0) };
    let posed = body.posed(&body.shaped(&[]), pose, None);
    let at = observers.frame(&posed, &body.topology);
    for (i, v) in observers.vertices().iter().enumerate() {
        assert_eq!(at.positions[i], posed[*v as usize]);
        assert!((at.normals[i].length() - 1.0).abs() < 1e-5);
        assert!(at.positions[i].distance(body.template[*v as usize]) > 0.5);
    }
    // a millimetre along the normal is outside, one against it inside
    let mesh = Mesh::new(posed, body.topology.clone());
    let beside = |by: f32| -> Vec<Vec3> { at.positions.iter().zip(&at.normals).map(|(p, n)| *p + *n * by).collect() };
    for (by, outside) in [(0.001, true), (-0.001, false)] {
        let mut distances = vec![0.0; observers.len()];
        MeshField::new(&mesh).values(&beside(by), &mut distances);
        let right = distances.iter().filter(|d| (**d > 0.0) == outside).count();
        assert_eq!(right, observers.len(), "{by}");
    }
}

/// Root mean square error of a field of two waves of amplitude one and 0.7 m that `count` observers pass on.
fn passed_on(count: usize) -> f32 {
    let (rest, topology) = (&body().template, &body().topology);
    let observers = Observers::spread(rest, count).unwrap();
    let map = observers.vertices_from_observers(rest, topology);
    assert_eq!((map.rows(), map.sources()), (rest.len(), count));
    for row in map.weights().chunks_exact(map.width()) {
        assert!((row.iter().sum::<f32>() - 1.0).abs() < 1e-5 && row.iter().all(|w| *w >= 0.0));
    }
    let smooth: Vec<f32> = rest.iter().map(|p| (9.0 * p.y).sin() + (7.0 * p.x + 5.0 * p.z).cos()).collect();
    let back = map.apply(&observers.pick(&smooth), 1);
    observers.vertices().iter().for_each(|v| assert_eq!(back[*v as usize], smooth[*v as usize]));
    let squares: f32 = back.iter().zip(&smooth).map(|(a, b)| (a - b).powi(2)).sum();
    (squares / rest.len() as f32).sqrt()
}

/// 600 observers stand 6 cm apart, half a radian of the field; the error goes with the square of that.
#[test]
fn vertices_draw_smoothly_from_observers() {
    let errors = [600, 1200, 2400].map(passed_on);
    println!("rms error of 600, 1200, 2400 observers: {errors:?}");
    assert!(errors[0] < 0.06 && errors[1] < 0.6 * errors[0] && errors[2] < 0.6 * errors[1], "{errors:?}");
}

/// What tells left from right does not pass between the thighs, where they face each other.
#[test]
fn vertices_draw_from_their_own_limb() {
    let (rest, topology) = (&body().template, &body().topology);
    let observers = Observers::spread(rest, 600).unwrap();
    let sides: Vec<f32> = rest.iter().map(|p| p.x.signum()).collect();
    let back = observers.vertices_from_observers(rest, topology).apply(&observers.pick(&sides), 1);
    let legs = rest.iter().zip(&back).filter(|(p, _)| p.y < 0.6 && p.y > 0.3 && p.x.abs() < 0.3);
    for (p, side) in legs {
        assert!((side - p.x.signum()).abs() < 1e-5, "{side} at {p}");
    }
}

/// What is known stays, and a hole of the scan closes smoothly from its border.
#[test]
fn holes_are_filled_from_their_border() {
    let (rest, topology) = (&body().template, &body().topology);
    let observers = Observers::spread(rest, 600).unwrap();
    let at = observers.pick(rest);
    let means = observers.means_of_others(rest, topology);
    let smooth: Vec<f32> = at.iter().map(|p| 0.02 * (5.0 * p.y).sin()).collect();
    let middle = at.iter().copied().min_by(|a, b| (a.z - 0.1 * a.y).total_cmp(&(b.z - 0.1 * b.y))).unwrap();
    let known: Vec<bool> = at.iter().map(|p| p.distance(middle) > 0.1).collect();
    assert!(known.iter().filter(|k| !**k).count() > 5);
    let mut values: Vec<f32> = smooth.iter().zip(&known).map(|(x, k)| if *k { *x } else { -0.02 }).collect();
    Observers::fill(&means, &mut values, &known);
    for (i, known) in known.iter().enumerate() {
        let error = (values[i] - smooth[i]).abs();
        assert!(if *known { error == 0.0 } else { error < 0.004 }, "{error} at observer {i}");
    }
}
