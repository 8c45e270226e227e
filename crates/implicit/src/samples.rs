use crate::RawSurface;
use glam::Vec3;
use serde::{Deserialize, Serialize};
use softtissue_random::Draws;

/// How many points a training step asks the field at, and where.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SampleConfig {
    /// Points on the scan. Default 10000 (AutoAvatar, sec. 3.4; 1000 in its second stage).
    pub surface: usize,
    /// Points near it. Default 10000 (the same; 1000).
    pub near: usize,
    /// Standard deviation of those from it along each axis, metres. Default 0.1 (the same).
    pub deviation: f32,
    /// Points in the box round the scan. Default 2000 (the same; 500).
    pub within: usize,
    /// How far the box stands off the scan, metres; the paper does not pad. Default 0.1: as far as a mesh is sought.
    pub padding: f32,
}

impl Default for SampleConfig {
    fn default() -> Self {
        Self { surface: 10_000, near: 10_000, deviation: 0.1, within: 2000, padding: 0.1 }
    }
}

/// Points of one training step, metres.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Samples {
    /// On the scan.
    pub surface: Vec<Vec3>,
    /// Their unit normals.
    pub normals: Vec<Vec3>,
    /// Near the scan, by Gaussian noise.
    pub near: Vec<Vec3>,
    /// Uniform in the padded box round the scan.
    pub within: Vec<Vec3>,
}

impl Samples {
    /// Draws points for a scan. Surface points are scan points, each as likely as any other and drawn anew each time, so
    /// that they are spread as the scanner spread them.
    pub fn draw(scan: &RawSurface, config: &SampleConfig, draws: &mut Draws) -> Self {
        let (points, normals) = (scan.points(), scan.normals());
        let mut out = Self::default();
        for _ in 0..config.surface {
            let i = draws.below(points.len());
            out.surface.push(points[i]);
            out.normals.push(normals[i]);
        }
        for _ in 0..config.near {
            let from = points[draws.below(points.len())];
            out.near.push(from + config.deviation * Vec3::from_array(std::array::from_fn(|_| draws.normal() as f32)));
        }
        let low = points.iter().copied().fold(Vec3::INFINITY, Vec3::min) - config.padding;
        let high = points.iter().copied().fold(Vec3::NEG_INFINITY, Vec3::max) + config.padding;
        let mut anywhere = || low + (high - low) * Vec3::from_array(std::array::from_fn(|_| draws.uniform() as f32));
        out.within = (0..config.within).map(|_| anywhere()).collect();
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::RawSurfaceConfig;
    use softtissue_clips::RawFrame;

    #[test]
    fn points_lie_where_they_should_and_come_again_for_the_same_key() {
        let points: Vec<Vec3> = (0..400).map(|i| Vec3::new((i % 20) as f32, 0.0, (i / 20) as f32) * 0.05).collect();
        let normals = vec![Vec3::Y; points.len()];
        let surface = RawSurface::new(&RawFrame { points, normals }, &RawSurfaceConfig::default()).unwrap();
        let config = SampleConfig { surface: 500, near: 4000, within: 4000, ..Default::default() };
        let draw = |step: u64| Samples::draw(&surface, &config, &mut Draws::new(1, "samples", 0, step));
        let samples = draw(0);
        assert_eq!(samples, draw(0));
        assert_ne!(samples, draw(1));
        assert_eq!((samples.surface.len(), samples.normals.len()), (500, 500));
        assert!(samples.surface.iter().all(|p| surface.points().contains(p)));
        // the plane is flat, so that what lies off it is the noise
        let spread = samples.near.iter().map(|p| p.y * p.y).sum::<f32>() / 4000.0;
        assert!((spread.sqrt() - 0.1).abs() < 0.004, "{spread}");
        let (low, high) = (Vec3::new(-0.1, -0.1, -0.1), Vec3::new(1.05, 0.1, 1.05));
        assert!(samples.within.iter().all(|p| p.cmpge(low).all() && p.cmple(high).all()));
        let mean = samples.within.iter().sum::<Vec3>() / 4000.0;
        assert!(mean.distance(0.5 * (low + high)) < 0.02, "{mean}");
    }
}
