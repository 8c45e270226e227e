use crate::layer::{indices, tensor};
use burn::tensor::{Device, Int, Tensor};
use glam::Vec3;
use rayon::prelude::*;
use softtissue_implicit::ObserverFrame;

/// Distances are encoded in decimetres.
pub(crate) const PER_METRE: f32 = 10.0;

/// How a point lies to one of its nearest observers (sec. 3.3), and how that changes with the point. With `x = q - v` the
/// distance is `d = sqrt(|x|^2 + s^2)` and the cosine `c = n.x / d`, where the softening `s` keeps the derivative
/// `dc/dq = (n - c x/d) / d` bounded at the vertex; `s = 0` is the paper's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Relation {
    /// Metres.
    pub distance: f32,
    /// Of the angle between normal and offset.
    pub cosine: f32,
    /// `dd/dq`.
    pub distance_gradient: Vec3,
    /// `dc/dq`, 1/m.
    pub cosine_gradient: Vec3,
    /// Distance from the vertex's tangent plane, metres.
    pub plane: f32,
}

impl Relation {
    /// Of `point` to a vertex.
    pub fn new(point: Vec3, vertex: Vec3, normal: Vec3, softening: f32) -> Self {
        let offset = point - vertex;
        let distance = (offset.length_squared() + softening * softening).sqrt();
        let plane = normal.dot(offset);
        let (cosine, distance_gradient) = (plane / distance, offset / distance);
        let cosine_gradient = (normal - cosine * distance_gradient) / distance;
        Self { distance, cosine, distance_gradient, cosine_gradient, plane }
    }
}

/// Query points as the decoder sees them, `N` points with `k` neighbours each.
#[derive(Clone, Debug)]
pub struct Queries {
    /// `[N, k]`.
    pub(crate) shape: [usize; 2],
    /// Rows of the neighbours, `[N k]`.
    pub(crate) rows: Tensor<1, Int>,
    /// Encoded distance and cosine, `[N k, 2 E]`.
    pub(crate) encoded: Tensor<2>,
    /// Distances from the tangent planes, `[N, k, 1]`.
    pub(crate) planes: Tensor<3>,
    /// What a gradient needs.
    pub(crate) tangents: Option<Tangents>,
}

/// How the decoder's inputs change with the query point.
#[derive(Clone, Debug)]
pub(crate) struct Tangents {
    /// Derivatives of the encodings by distance, `[N k, E]`, and by cosine, `[N k, E]`.
    pub rates: [Tensor<2>; 2],
    /// `dd/dq` and `dc/dq`, `[N, k, 3]`.
    pub gradients: [Tensor<3>; 2],
    /// Normals of the neighbours, which are the gradients of the planes, `[N, k, 3]`.
    pub normals: Tensor<3>,
}

/// How queries are made.
#[derive(Clone, Copy, Debug)]
pub struct Encoding {
    /// Fourier frequencies.
    pub frequencies: usize,
    /// Metres.
    pub softening: f32,
}

impl Encoding {
    /// Numbers that one number becomes, `E`: itself, sines and cosines.
    pub fn width(self) -> usize {
        1 + 2 * self.frequencies
    }

    /// `x`, and `sin` and `cos` of `2^i pi x`, with derivatives by `x` times `scale`.
    fn encode(self, x: f32, scale: f32, values: &mut [f32], rates: &mut [f32]) {
        let x = x * scale;
        (values[0], rates[0]) = (x, scale);
        for i in 0..self.frequencies {
            let frequency = std::f32::consts::PI * (1u32 << i) as f32;
            let (sin, cos) = (frequency * x).sin_cos();
            values[1 + 2 * i..3 + 2 * i].copy_from_slice(&[sin, cos]);
            let rate = frequency * scale;
            rates[1 + 2 * i..3 + 2 * i].copy_from_slice(&[rate * cos, -rate * sin]);
        }
    }
}

impl Queries {
    /// Of `points` and the rows of their nearest vertices, `neighbours [N k]`. With `gradients`, the decoder can give the
    /// field's gradient too.
    ///
    /// Panics if the counts do not fit.
    pub fn new(
        points: &[Vec3],
        neighbours: &[u32],
        observers: &ObserverFrame,
        encoding: Encoding,
        gradients: bool,
        device: &Device,
    ) -> Self {
        let (n, e) = (points.len(), encoding.width());
        let k = neighbours.len() / n.max(1);
        assert!(n > 0 && k > 0 && neighbours.len() == n * k, "{} neighbours of {n} points", neighbours.len());
        let mut encoded = vec![0.0; n * k * 2 * e];
        let mut rates = [vec![0.0; n * k * e], vec![0.0; n * k * e]];
        let relations: Vec<Relation> = {
            let [by_distance, by_cosine] = &mut rates;
            let rows = encoded.par_chunks_exact_mut(2 * e).zip(by_distance.par_chunks_exact_mut(e));
            let rows = rows.zip(by_cosine.par_chunks_exact_mut(e)).enumerate();
            rows.map(|(row, ((encoded, by_distance), by_cosine))| {
                let v = neighbours[row] as usize;
                let relation =
                    Relation::new(points[row / k], observers.positions[v], observers.normals[v], encoding.softening);
                let (distance, cosine) = encoded.split_at_mut(e);
                encoding.encode(relation.distance, PER_METRE, distance, by_distance);
                encoding.encode(relation.cosine, 1.0, cosine, by_cosine);
                relation
            })
            .collect()
        };
        let vectors = |of: &dyn Fn(usize, &Relation) -> Vec3| {
            let data = relations.iter().enumerate().flat_map(|(row, r)| of(row, r).to_array()).collect();
            tensor(data, [n, k, 3], device)
        };
        let tangents = gradients.then(|| Tangents {
            gradients: [vectors(&|_, r| r.distance_gradient), vectors(&|_, r| r.cosine_gradient)],
            normals: vectors(&|row, _| observers.normals[neighbours[row] as usize]),
            rates: rates.map(|rates| tensor(rates, [n * k, e], device)),
        });
        Self {
            shape: [n, k],
            rows: indices(neighbours, device),
            encoded: tensor(encoded, [n * k, 2 * e], device),
            planes: tensor(relations.iter().map(|r| r.plane).collect(), [n, k, 1], device),
            tangents,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Central differences of a function of a point.
    fn differences(point: Vec3, f: impl Fn(Vec3) -> f32) -> Vec3 {
        let step = 1e-3;
        Vec3::from_array(
            [Vec3::X, Vec3::Y, Vec3::Z].map(|a| (f(point + step * a) - f(point - step * a)) / (2.0 * step)),
        )
    }

    #[test]
    fn relations_change_as_their_differences() {
        let (vertex, normal) = (Vec3::new(0.1, -0.2, 0.05), Vec3::new(0.6, 0.0, 0.8));
        for point in [Vec3::new(0.15, -0.1, 0.1), Vec3::new(0.0, -0.25, 0.02), vertex + 0.004 * Vec3::Y] {
            let of = |p: Vec3| Relation::new(p, vertex, normal, 0.01);
            let found = of(point);
            let close = |a: Vec3, b: Vec3, at_most: f32| assert!(a.distance(b) < at_most, "{a} {b}");
            close(found.distance_gradient, differences(point, |p| of(p).distance), 5e-3);
            close(found.cosine_gradient, differences(point, |p| of(p).cosine), 2e-2 * found.cosine_gradient.length());
        }
    }

    #[test]
    fn encodings_change_as_their_differences() {
        let encoding = Encoding { frequencies: 4, softening: 0.01 };
        let of = |x: f32| {
            let (mut values, mut rates) = (vec![0.0; encoding.width()], vec![0.0; encoding.width()]);
            encoding.encode(x, PER_METRE, &mut values, &mut rates);
            (values, rates)
        };
        let (x, step) = (0.037, 1e-4);
        let ((_, rates), (above, _), (below, _)) = (of(x), of(x + step), of(x - step));
        for i in 0..encoding.width() {
            let difference = (above[i] - below[i]) / (2.0 * step);
            assert!((rates[i] - difference).abs() < 2e-3 * rates[i].abs().max(10.0), "{i}: {} {difference}", rates[i]);
        }
    }
}
