use crate::SignedDistance;
use glam::Vec3;
use serde::{Deserialize, Serialize};
use softtissue_random::Draws;

/// Where volume is looked at.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct VolumeProbeConfig {
    /// Points round each vertex. Default 10 (AutoAvatar, sec. 4.1).
    pub points: usize,
    /// Side of the cube that they are drawn in, metres. Default 0.05 (the same).
    pub side: f32,
    /// Seed of the points. Default 1.
    pub seed: u64,
}

impl Default for VolumeProbeConfig {
    fn default() -> Self {
        Self { points: 10, side: 0.05, seed: 1 }
    }
}

/// AutoAvatar's measure of how volume moves (sec. 4.1): round each vertex a few points, the share of them inside a surface,
/// and how it changes from frame to frame. The points are drawn once and go with the vertices, without turning, so that two
/// surfaces are asked at the same places.
#[derive(Clone, Debug, PartialEq)]
pub struct VolumeProbe {
    /// `[N, points]` from the vertex, metres.
    offsets: Vec<Vec3>,
    points: usize,
}

impl VolumeProbe {
    /// A probe round `vertices` vertices.
    pub fn new(vertices: usize, config: &VolumeProbeConfig) -> Self {
        let mut draws = Draws::new(config.seed, "volume-probe", 0, 0);
        let points = config.points.max(1);
        let half = f64::from(0.5 * config.side);
        let mut offset = || Vec3::from_array(std::array::from_fn(|_| draws.range(-half, half) as f32));
        Self { offsets: (0..vertices * points).map(|_| offset()).collect(), points }
    }

    /// The share of the points round each of the vertices, `[N]`, metres, that lie inside a surface, `[N]`.
    pub fn shares(&self, surface: &dyn SignedDistance, vertices: &[Vec3]) -> Vec<f32> {
        assert_eq!(vertices.len() * self.points, self.offsets.len(), "vertices of a volume probe");
        let rows = vertices.iter().zip(self.offsets.chunks_exact(self.points));
        let places: Vec<Vec3> = rows.flat_map(|(v, offsets)| offsets.iter().map(move |o| *v + *o)).collect();
        let mut values = vec![0.0; places.len()];
        surface.values(&places, &mut values);
        let share = |row: &[f32]| row.iter().filter(|f| **f < 0.0).count() as f32 / self.points as f32;
        values.chunks_exact(self.points).map(share).collect()
    }

    /// Mean squared error of the change of the shares from one frame to the next, each `[N]`. None without vertices.
    pub fn change_error(truth: [&[f32]; 2], predicted: [&[f32]; 2]) -> Option<f64> {
        let n = truth[0].len();
        assert!([truth[1], predicted[0], predicted[1]].iter().all(|s| s.len() == n), "vertices of the shares");
        let change = |pair: [&[f32]; 2], i: usize| f64::from(pair[1][i]) - f64::from(pair[0][i]);
        let sum: f64 = (0..n).map(|i| (change(predicted, i) - change(truth, i)).powi(2)).sum();
        (n > 0).then(|| sum / n as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes::Shape;

    fn plane(offset: f32) -> Shape {
        Shape::Plane { normal: Vec3::Y, offset }
    }

    /// A plane through a cube has below it the share of the cube that its height says; a plane that rises by `d` more than
    /// another changes the share by `d / side` more.
    #[test]
    fn shares_and_changes_of_a_rising_plane() {
        let config = VolumeProbeConfig { points: 1000, ..Default::default() };
        let vertices = [Vec3::ZERO, Vec3::new(1.0, 0.01, -3.0)];
        let probe = VolumeProbe::new(vertices.len(), &config);
        let shares = |offset: f32| probe.shares(&plane(offset), &vertices);
        for (share, wanted) in shares(0.0).iter().zip([0.5, 0.3]) {
            // three standard deviations of a thousand points
            assert!((share - wanted).abs() < 3.0 * (0.25f32 / 1000.0).sqrt(), "{share} for {wanted}");
        }
        assert_eq!((shares(0.1), shares(-0.1)), (vec![1.0; 2], vec![0.0; 2]));
        let (truth, predicted) = ([shares(0.0), shares(0.01)], [shares(0.0), shares(0.005)]);
        let error = VolumeProbe::change_error([&truth[0], &truth[1]], [&predicted[0], &predicted[1]]).unwrap();
        assert!((error.sqrt() - 0.1).abs() < 0.02, "{error}");
        let none = VolumeProbe::change_error([&truth[0], &truth[1]], [&truth[0], &truth[1]]);
        assert_eq!(none, Some(0.0), "what moves alike is not wrong, wherever it is");
        assert_eq!(VolumeProbe::change_error([&[], &[]], [&[], &[]]), None);
    }

    #[test]
    fn probes_are_the_same_for_the_same_seed_and_stay_in_their_cube() {
        let probe = VolumeProbe::new(50, &VolumeProbeConfig::default());
        assert_eq!(probe, VolumeProbe::new(50, &VolumeProbeConfig::default()));
        assert!(probe.offsets.iter().all(|o| o.abs().max_element() <= 0.025));
        assert_ne!(probe, VolumeProbe::new(50, &VolumeProbeConfig { seed: 2, ..Default::default() }));
    }
}
