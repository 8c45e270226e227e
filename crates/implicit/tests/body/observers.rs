use crate::body;
use softtissue_implicit::{Observers, PointTree};

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
    let at = observers.frame(&body.template, &body.topology);
    for (i, v) in observers.vertices().iter().enumerate() {
        assert_eq!(at.positions[i], body.template[*v as usize]);
        assert!((at.normals[i].length() - 1.0).abs() < 1e-5);
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
