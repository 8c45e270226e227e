use crate::SignedDistance;
use glam::Vec3;
use serde::{Deserialize, Serialize};

/// How heights are read off a field.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct HeightConfig {
    /// Lowest height, metres, and the height where the surface is not met. Default -0.02 (AutoAvatar, sec. 3.1).
    pub lowest: f32,
    /// Highest height, metres. Default 0.08 (the same).
    pub highest: f32,
    /// Samples on the range, both ends among them. More find thinner gaps and cost as many values. Default 5.
    pub samples: usize,
    /// Halvings of the bracket before the straight line through its ends. Default 2.
    pub bisections: usize,
}

impl Default for HeightConfig {
    fn default() -> Self {
        Self { lowest: -0.02, highest: 0.08, samples: 5, bisections: 2 }
    }
}

impl HeightConfig {
    /// Heights of the samples, ascending.
    fn samples(&self) -> Vec<f32> {
        let last = self.samples.max(2) - 1;
        (0..=last).map(|i| self.lowest + (self.highest - self.lowest) * i as f32 / last as f32).collect()
    }
}

/// Part of a line on which the field turns from negative to not negative: heights and values of its ends.
#[derive(Clone, Copy)]
struct Bracket {
    line: usize,
    low: (f32, f32),
    high: (f32, f32),
}

/// The state of a surface (AutoAvatar, sec. 3.1): how far from each point, along its unit normal, the surface is met on
/// the way outwards; all `[N]`, metres, positive outwards.
///
/// Of the samples on the range the first that is not negative ends a bracket, which is halved and then cut by a straight
/// line. Where the field is not negative at the lowest height already, or negative at all, the height is the lowest one.
/// The field is asked `1 + bisections` times.
pub fn heights(field: &dyn SignedDistance, points: &[Vec3], normals: &[Vec3], config: &HeightConfig) -> Vec<f32> {
    assert_eq!(points.len(), normals.len(), "normals of the observer points");
    let mut out = vec![config.lowest; points.len()];
    let mut brackets = brackets(field, points, normals, config);
    for _ in 0..config.bisections {
        let middle = |b: &Bracket| 0.5 * (b.low.0 + b.high.0);
        let at: Vec<Vec3> = brackets.iter().map(|b| points[b.line] + normals[b.line] * middle(b)).collect();
        let mut values = vec![0.0; at.len()];
        field.values(&at, &mut values);
        for (b, value) in brackets.iter_mut().zip(values) {
            let end = (middle(b), value);
            if value < 0.0 { b.low = end } else { b.high = end }
        }
    }
    for Bracket { line, low, high } in brackets {
        let share = low.1 / (low.1 - high.1);
        // not finite where the field is not
        let share = if (0.0..=1.0).contains(&share) { share } else { 0.5 };
        out[line] = low.0 + (high.0 - low.0) * share;
    }
    out
}

fn brackets(field: &dyn SignedDistance, points: &[Vec3], normals: &[Vec3], config: &HeightConfig) -> Vec<Bracket> {
    let samples = config.samples();
    let at: Vec<Vec3> = points.iter().zip(normals).flat_map(|(p, n)| samples.iter().map(|h| *p + *n * *h)).collect();
    let mut values = vec![0.0; at.len()];
    field.values(&at, &mut values);
    let bracket = |(line, values): (usize, &[f32])| {
        let first = values.iter().position(|f| *f >= 0.0).filter(|first| *first > 0)?;
        let end = |i: usize| (samples[i], values[i]);
        Some(Bracket { line, low: end(first - 1), high: end(first) })
    };
    values.chunks_exact(samples.len()).enumerate().filter_map(bracket).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes::{Shape, draw};
    use proptest::prelude::*;
    use softtissue_random::Draws;
    use std::cell::Cell;

    /// Points `depth` metres inside a sphere and its outward normals.
    fn under_sphere(radius: f32, depth: f32) -> (Vec<Vec3>, Vec<Vec3>) {
        let mut draws = Draws::new(2, "heights", 0, 0);
        let normals: Vec<Vec3> = (0..50).map(|_| draw(&mut draws, 1.0).normalize()).collect();
        (normals.iter().map(|n| *n * (radius - depth)).collect(), normals)
    }

    #[test]
    fn closed_forms() {
        let config = HeightConfig::default();
        for depth in [-0.019, -0.004, 0.0, 0.013, 0.0777] {
            let (points, normals) = under_sphere(0.3, depth);
            let sphere = Shape::Sphere { centre: Vec3::ZERO, radius: 0.3 };
            let plane = Shape::Plane { normal: Vec3::Y, offset: 1.0 };
            let capsule = Shape::Capsule { a: Vec3::ZERO, b: Vec3::X * 0.4, radius: 0.05 };
            for h in heights(&sphere, &points, &normals, &config) {
                assert!((h - depth).abs() < 1e-5, "{h} for {depth}");
            }
            // 60 degrees from the plane's normal the way is twice as long
            let slant = Vec3::new(0.75f32.sqrt(), 0.5, 0.0);
            let h = heights(&plane, &[Vec3::Y * (1.0 - 0.5 * depth)], &[slant], &config);
            assert!((h[0] - depth).abs() < 1e-5, "{} for {depth}", h[0]);
            let h = heights(&capsule, &[Vec3::new(0.2, 0.0, 0.05 - depth)], &[Vec3::Z], &config);
            assert!((h[0] - depth).abs() < 1e-5, "{} for {depth}", h[0]);
        }
    }

    #[test]
    fn without_a_crossing_the_height_is_the_lowest() {
        let config = HeightConfig::default();
        let plane = Shape::Plane { normal: Vec3::Y, offset: 0.0 };
        let points = [Vec3::Y * 0.5, Vec3::Y * -0.5, Vec3::Y * 0.0201, Vec3::Y * -0.0801];
        assert_eq!(heights(&plane, &points, &[Vec3::Y; 4], &config), [-0.02; 4]);
        // the field turns from outside to inside: no crossing on the way outwards
        assert_eq!(heights(&plane, &[Vec3::Y * 0.01], &[Vec3::NEG_Y], &config), [-0.02]);
        struct Broken;
        impl SignedDistance for Broken {
            fn values(&self, _: &[Vec3], out: &mut [f32]) {
                out.fill(f32::NAN);
            }
        }
        assert_eq!(heights(&Broken, &points, &[Vec3::Y; 4], &config), [-0.02; 4]);
    }

    #[test]
    fn the_first_of_two_surfaces_counts_and_the_field_is_asked_three_times() {
        struct Two(Cell<usize>);
        impl SignedDistance for Two {
            fn values(&self, points: &[Vec3], out: &mut [f32]) {
                self.0.set(self.0.get() + 1);
                let (near, far) = (
                    Shape::Sphere { centre: Vec3::ZERO, radius: 0.1 },
                    Shape::Sphere { centre: Vec3::Y * 0.2, radius: 0.05 },
                );
                points.iter().zip(out).for_each(|(p, out)| *out = near.at(*p).min(far.at(*p)));
            }
        }
        let field = Two(Cell::new(0));
        let h = heights(&field, &[Vec3::Y * 0.095], &[Vec3::Y], &HeightConfig::default());
        assert!((h[0] - 0.005).abs() < 1e-3, "{}", h[0]);
        assert_eq!(field.0.get(), 3);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        /// A line that meets a plane within the range meets it where the closed form says; otherwise the lowest height.
        #[test]
        fn a_plane_is_met_where_it_lies(depth in -0.03f32..0.09, angle in 0.0f32..1.3) {
            let plane = Shape::Plane { normal: Vec3::Y, offset: 0.4 };
            let normal = Vec3::new(angle.sin(), angle.cos(), 0.0);
            let h = heights(&plane, &[Vec3::Y * (0.4 - depth)], &[normal], &HeightConfig::default())[0];
            let wanted = depth / angle.cos();
            let edge = [-0.02f32, 0.08].iter().any(|e| (wanted - e).abs() < 1e-5);
            let wanted = if (-0.02..0.08).contains(&wanted) { wanted } else { -0.02 };
            prop_assert!(edge || (h - wanted).abs() < 1e-5, "{} and {}", h, wanted);
        }
    }
}
