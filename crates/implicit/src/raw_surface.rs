use crate::{HeightConfig, ImplicitError, ObserverFrame, PointTree, Result, SignedDistance, heights};
use glam::Vec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use softtissue_clips::RawFrame;

/// How points become a surface. Distances are in units of the scan's spacing: the median distance of a point from its
/// `neighbours`-th neighbour.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RawSurfaceConfig {
    /// Points that are averaged: more take off more noise, and round off what is narrower. Default 8.
    pub neighbours: usize,
    /// A point that has its neighbours farther away than this many spacings is an outlier and left out. Default 3.
    pub outlier: f32,
    /// Sideways from the nearest point the surface goes on for this many spacings; beyond, there is a hole. Default 1.5.
    pub support: f32,
}

impl Default for RawSurfaceConfig {
    fn default() -> Self {
        Self { neighbours: 8, outlier: 3.0, support: 1.5 }
    }
}

/// The surface of a raw scan, points with normals, as a field: the mean height over the nearest points, weighted by a
/// Gaussian of half a spacing and leaving out points that face away from the nearest. The height over a point is taken
/// along the mean of its normal and that of all of them, which is across the chord of an arc: along its own normal, as in
/// implicit moving least squares (Kolluri 2008), all planes would touch a round surface from outside.
///
/// In a hole the surface of its border goes on, which closes small ones smoothly, and the distance grows with that from the
/// nearest point; [`Self::supports`] tells where the surface is seen and where it is guessed. Bridges of points between
/// surfaces that nearly touch are taken as surface.
#[derive(Clone, Debug)]
pub struct RawSurface {
    points: Vec<Vec3>,
    normals: Vec<Vec3>,
    tree: PointTree,
    spacing: f32,
    config: RawSurfaceConfig,
}

/// Heights of a raw scan over observer points, both `[N]`.
#[derive(Clone, Debug, PartialEq)]
pub struct ScanHeights {
    /// Metres; the lowest height where the surface was not met.
    pub values: Vec<f32>,
    /// Whether the surface was met where the scan has points that face as the observer does: not in a hole, not on
    /// another part of the body.
    pub known: Vec<bool>,
}

/// Cosine of the angle between normals of one part of the body, at least.
const LEAST_COSINE: f32 = 0.3;
/// Points below which a second thread does not pay.
const POINTS_A_TASK: usize = 64;

/// Where a place lies by the scan points round it.
struct Reading {
    nearest: usize,
    /// Over the points, metres.
    height: f32,
    /// From the nearest point along its plane, metres.
    sideways: f32,
}

impl RawSurface {
    /// The surface of a frame; points without a normal and outliers are left out.
    ///
    /// # Errors
    /// Fewer points with normals than `neighbours`.
    pub fn new(frame: &RawFrame, config: &RawSurfaceConfig) -> Result<Self> {
        let refused = ImplicitError::NoSurface { points: frame.points.len(), normals: frame.normals.len() };
        let k = config.neighbours.max(1);
        let sound = |(p, n): &(Vec3, Vec3)| p.is_finite() && n.is_finite() && *n != Vec3::ZERO;
        let all: Vec<(Vec3, Vec3)> =
            frame.points.iter().copied().zip(frame.normals.iter().copied()).filter(sound).collect();
        if all.len() <= k {
            return Err(refused);
        }
        let places: Vec<Vec3> = all.iter().map(|(p, _)| *p).collect();
        // the first neighbour of a point is itself
        let found = PointTree::new(&places).nearest(&places, k + 1);
        let reach: Vec<f32> = found.distances.chunks_exact(found.k).map(|d| d[found.k - 1]).collect();
        let mut ordered = reach.clone();
        let spacing = *ordered.select_nth_unstable_by(reach.len() / 2, f32::total_cmp).1;
        let kept = all.iter().zip(&reach).filter(|(_, reach)| **reach <= config.outlier * spacing);
        let (points, normals): (Vec<Vec3>, Vec<Vec3>) = kept.map(|((p, n), _)| (*p, n.normalize())).unzip();
        if points.len() < k {
            return Err(refused);
        }
        Ok(Self { tree: PointTree::new(&points), points, normals, spacing, config: config.clone() })
    }

    /// Points that are left, metres.
    pub fn points(&self) -> &[Vec3] {
        &self.points
    }
    /// Their unit normals.
    pub fn normals(&self) -> &[Vec3] {
        &self.normals
    }
    /// Median distance of a point from its `neighbours`-th neighbour, metres.
    pub fn spacing(&self) -> f32 {
        self.spacing
    }

    /// Whether the scan has points near the places, `[N]`, that face as `normals` do.
    pub fn supports(&self, places: &[Vec3], normals: &[Vec3]) -> Vec<bool> {
        let reach = self.config.support * self.spacing;
        let readings = self.readings(places);
        let seen = |(r, n): (Reading, &Vec3)| {
            r.height.abs() <= reach && r.sideways <= reach && self.normals[r.nearest].dot(*n) >= LEAST_COSINE
        };
        readings.into_iter().zip(normals).map(seen).collect()
    }

    /// True heights for training, by the same encoder as a network's field, and where they are known.
    pub fn heights(&self, observers: &ObserverFrame, config: &HeightConfig) -> ScanHeights {
        let (positions, normals) = (&observers.positions, &observers.normals);
        let values = heights(self, positions, normals, config);
        let met: Vec<Vec3> = (0..values.len()).map(|i| positions[i] + normals[i] * values[i]).collect();
        let mut known = self.supports(&met, normals);
        // where nothing was met the lowest place may lie on the scan by chance: skin about to touch skin
        known.iter_mut().zip(&values).for_each(|(known, height)| *known &= *height > config.lowest);
        ScanHeights { values, known }
    }

    fn readings(&self, places: &[Vec3]) -> Vec<Reading> {
        let found = self.tree.nearest(places, self.config.neighbours);
        let rows = found.indices.par_chunks_exact(found.k).zip(found.distances.par_chunks_exact(found.k));
        let pairs = places.par_iter().zip(rows).with_min_len(POINTS_A_TASK);
        pairs.map(|(place, (indices, distances))| self.reading(*place, indices, distances)).collect()
    }

    fn reading(&self, place: Vec3, indices: &[u32], distances: &[f32]) -> Reading {
        let nearest = indices[0] as usize;
        let facing = self.normals[nearest];
        let narrow = 2.0 * (0.5 * self.spacing).powi(2);
        let near = || {
            let weighted =
                |(i, d): (&u32, &f32)| (*i as usize, (-(d * d - distances[0] * distances[0]) / narrow).exp());
            indices.iter().zip(distances).map(weighted).filter(|(i, _)| self.normals[*i].dot(facing) >= LEAST_COSINE)
        };
        let total: f32 = near().map(|(_, w)| w).sum();
        let mean = near().map(|(i, w)| self.normals[i] * w).sum::<Vec3>().normalize_or(facing);
        let from_arc = |i: usize| 0.5 * (self.normals[i] + mean).dot(place - self.points[i]);
        let height = near().map(|(i, w)| w * from_arc(i)).sum::<f32>() / total;
        let own = facing.dot(place - self.points[nearest]);
        let sideways = (distances[0] * distances[0] - own * own).max(0.0).sqrt();
        Reading { nearest, height, sideways }
    }
}

impl SignedDistance for RawSurface {
    fn values(&self, points: &[Vec3], out: &mut [f32]) {
        let reach = self.config.support * self.spacing;
        for (reading, out) in self.readings(points).into_iter().zip(out) {
            let beyond = (reading.sideways - reach).max(0.0);
            *out = reading.height.hypot(beyond).copysign(reading.height);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes::{Shape, draw};
    use softtissue_random::Draws;

    const RADIUS: f32 = 0.1;

    /// Points of a sphere, `noise` metres off along the normal, without a cap of `hole` radians round +Y.
    fn sphere(points: usize, noise: f32, hole: f32) -> RawFrame {
        let mut draws = Draws::new(6, "raw-sphere", 0, 0);
        let mut frame = RawFrame::default();
        while frame.points.len() < points {
            let Some(n) = Some(draw(&mut draws, 1.0)).filter(|p| p.length() < 1.0).and_then(Vec3::try_normalize) else {
                continue;
            };
            if n.y < hole.cos() || hole == 0.0 {
                frame.points.push(n * (RADIUS + noise * draws.normal() as f32));
                frame.normals.push(n);
            }
        }
        frame
    }

    fn observers(directions: &[Vec3], under: f32) -> ObserverFrame {
        let positions = directions.iter().map(|n| *n * (RADIUS - under)).collect();
        ObserverFrame { positions, normals: directions.to_vec() }
    }

    fn directions(n: usize) -> Vec<Vec3> {
        let mut draws = Draws::new(7, "directions", 0, 0);
        (0..n).map(|_| draw(&mut draws, 1.0).normalize()).collect()
    }

    fn rms(errors: impl Iterator<Item = f32>) -> f32 {
        let (sum, n) = errors.fold((0.0, 0), |(sum, n), e| (sum + e * e, n + 1));
        (sum / n as f32).sqrt()
    }

    /// Without noise the sphere comes back to a thousandth of its radius; with noise it is off by less than a point is.
    #[test]
    fn heights_of_a_scanned_sphere() {
        let at = observers(&directions(300), 0.012);
        for (noise, tolerance) in [(0.0, 1e-4), (0.0007, 0.00045)] {
            let surface = RawSurface::new(&sphere(3000, noise, 0.0), &RawSurfaceConfig::default()).unwrap();
            let found = surface.heights(&at, &HeightConfig::default());
            assert!(found.known.iter().all(|k| *k));
            let error = rms(found.values.iter().map(|h| h - 0.012));
            assert!(error < tolerance, "{error} with noise of {noise}");
        }
    }

    #[test]
    fn the_field_is_the_spheres_distance_away_from_it_too() {
        let surface = RawSurface::new(&sphere(3000, 0.0, 0.0), &RawSurfaceConfig::default()).unwrap();
        let mut draws = Draws::new(8, "away", 0, 0);
        let points: Vec<Vec3> = (0..500).map(|_| draw(&mut draws, 0.12)).filter(|p| p.length() > 0.05).collect();
        let mut values = vec![0.0; points.len()];
        surface.values(&points, &mut values);
        let truth = Shape::Sphere { centre: Vec3::ZERO, radius: RADIUS };
        let error = rms(points.iter().zip(&values).map(|(p, f)| f - truth.at(*p)));
        assert!(error < 0.002, "{error}");
        assert!(
            points.iter().zip(&values).all(|(p, f)| truth.at(*p).abs() < 0.002 || (*f < 0.0) == (truth.at(*p) < 0.0))
        );
    }

    /// In a hole the surface goes on from its border and the heights there are told apart.
    #[test]
    fn a_hole_is_bridged_and_known_to_be_one() {
        let surface = RawSurface::new(&sphere(3000, 0.0, 0.5), &RawSurfaceConfig::default()).unwrap();
        let at = observers(&directions(300), 0.012);
        let found = surface.heights(&at, &HeightConfig::default());
        let spacing = surface.spacing() / RADIUS;
        for (n, (h, known)) in at.normals.iter().zip(found.values.iter().zip(&found.known)) {
            let from_middle = n.y.acos();
            if from_middle < 0.5 - 2.0 * spacing {
                assert!(!known, "{from_middle} rad from the middle of a hole of 0.5");
            } else if from_middle > 0.5 + spacing {
                assert!(*known && (h - 0.012).abs() < 5e-4, "{h} at {from_middle} rad");
            }
            // tangents from the border lie above the cap by its height at most
            let bridge = RADIUS / 0.5f32.cos() - RADIUS;
            assert!((-0.001..bridge + 0.001).contains(&(h - 0.012)), "{h} at {from_middle} rad");
        }
    }

    /// Between two sheets of skin about to touch no sample of an observer's line falls: it meets nothing, though its lowest
    /// place happens to lie beside a sheet that faces as the observer does.
    #[test]
    fn a_height_that_was_not_met_is_not_known() {
        let config = HeightConfig::default();
        let side = |i: usize| 0.002 * (i as f32 - 20.0);
        let sheet = |y: f32, normal: Vec3| {
            (0..41 * 41).map(move |i| (Vec3::new(side(i % 41), y, side(i / 41)), normal)).collect::<Vec<_>>()
        };
        let heights = |sheets: &[Vec<(Vec3, Vec3)>], lowest: f32| {
            let (points, normals) = sheets.concat().into_iter().unzip();
            let surface = RawSurface::new(&RawFrame { points, normals }, &RawSurfaceConfig::default()).unwrap();
            let positions = vec![Vec3::Y * (lowest - config.lowest)];
            surface.heights(&ObserverFrame { positions, normals: vec![Vec3::Y] }, &config)
        };
        let (own, other) = (sheet(0.0, Vec3::Y), sheet(0.004, -Vec3::Y));
        for lowest in [-0.0005, 0.0005] {
            let found = heights(&[own.clone(), other.clone()], lowest);
            assert_eq!((found.values[0], found.known[0]), (config.lowest, false), "{lowest}");
        }
        let found = heights(&[own], -0.0005);
        assert!((found.values[0] - config.lowest - 0.0005).abs() < 1e-4 && found.known[0], "{:?}", found.values);
    }

    #[test]
    fn outliers_are_left_out_and_little_is_refused() {
        let config = RawSurfaceConfig::default();
        let mut frame = sphere(3000, 0.0, 0.0);
        for n in directions(10) {
            frame.points.push(n * (RADIUS + 0.05));
            frame.normals.push(n);
        }
        frame.points.push(Vec3::NAN);
        frame.normals.push(Vec3::Y);
        let surface = RawSurface::new(&frame, &config).unwrap();
        assert!(surface.points().iter().all(|p| (p.length() - RADIUS).abs() < 1e-6));
        // points at random have gaps and clumps, which are none
        assert!(surface.points().len() > 2990, "{}", surface.points().len());
        frame.normals.clear();
        assert!(RawSurface::new(&frame, &config).unwrap_err().to_string().contains("3011 points with 0 normals"));
        assert!(RawSurface::new(&RawFrame::default(), &config).is_err());
    }
}
