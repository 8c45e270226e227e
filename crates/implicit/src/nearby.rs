//! Means of the observers round a vertex, by ways along the mesh.

use glam::{Mat2, Vec2, Vec3};
use softtissue_geometry::Adjacency;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// How narrow the weights are: `exp(-NARROW (d / r)^2)` before they are made to reproduce what is linear, with `r` the
/// distance of the farthest observer that counts.
const NARROW: f32 = 9.0;
/// Newton steps at most, and the farthest a step goes.
const STEPS: usize = 20;
const LONGEST_STEP: f32 = 4.0;
/// How far from zero the mean offset may stay, in units of `r`.
const ENOUGH: f32 = 1e-4;

/// Local maximum-entropy weights (Arroyo and Ortiz 2006): positive, of sum one, and such that the mean of the `offsets`
/// from a place, metres, is zero, so that what is linear round the place is reproduced. Where the offsets lie to one side
/// the last cannot be, and the weights are those of the distances alone.
pub(crate) fn weights(offsets: &[Vec2]) -> Vec<f32> {
    let reach = offsets.iter().fold(0.0f32, |r, o| r.max(o.length()));
    if reach == 0.0 {
        return vec![1.0 / offsets.len() as f32; offsets.len()];
    }
    let scaled: Vec<Vec2> = offsets.iter().map(|o| *o / reach).collect();
    let tilted = |tilt: Vec2| {
        let powers: Vec<f32> = scaled.iter().map(|o| tilt.dot(*o) - NARROW * o.length_squared()).collect();
        let most = powers.iter().copied().fold(f32::MIN, f32::max);
        let raw: Vec<f32> = powers.iter().map(|p| (p - most).exp()).collect();
        let total: f32 = raw.iter().sum();
        raw.into_iter().map(|w| w / total).collect::<Vec<f32>>()
    };
    let mean = |w: &[f32]| scaled.iter().zip(w).map(|(o, w)| *o * *w).sum::<Vec2>();
    let mut tilt = Vec2::ZERO;
    for _ in 0..STEPS {
        let w = tilted(tilt);
        let m = mean(&w);
        if m.length() < ENOUGH {
            return w;
        }
        // the second derivative of the logarithm of the sum: the covariance of the offsets
        let spread = scaled.iter().zip(&w).fold(Mat2::from_diagonal(Vec2::splat(1e-5)), |sum, (o, w)| {
            let from_mean = *o - m;
            sum + Mat2::from_cols(from_mean * from_mean.x, from_mean * from_mean.y) * *w
        });
        tilt -= (spread.inverse() * m).clamp_length_max(LONGEST_STEP);
    }
    tilted(Vec2::ZERO)
}

/// Offsets from a vertex as they lie in its tangent plane.
pub(crate) fn in_plane(at: Vec3, normal: Vec3, others: impl Iterator<Item = Vec3>) -> Vec<Vec2> {
    let (u, v) = if normal.is_normalized() { normal.any_orthonormal_pair() } else { (Vec3::X, Vec3::Y) };
    others.map(|p| Vec2::new((p - at).dot(u), (p - at).dot(v))).collect()
}

/// Shortest ways along edges (Dijkstra), from one vertex at a time.
pub(crate) struct Walk<'a> {
    rest: &'a [Vec3],
    adjacency: &'a Adjacency,
    /// The observer at each vertex.
    observer: Vec<Option<u32>>,
    distance: Vec<f32>,
    touched: Vec<u32>,
}

impl<'a> Walk<'a> {
    pub fn new(rest: &'a [Vec3], adjacency: &'a Adjacency, observers: &[u32]) -> Self {
        let mut observer = vec![None; rest.len()];
        (0..).zip(observers).for_each(|(i, v)| observer[*v as usize] = Some(i));
        Self { rest, adjacency, observer, distance: vec![f32::INFINITY; rest.len()], touched: Vec::new() }
    }

    /// The observer at a vertex, if it is one.
    pub fn observer(&self, vertex: usize) -> Option<u32> {
        self.observer[vertex]
    }

    /// The `count` observers nearest to a vertex that are not at it, nearest first.
    pub fn nearest(&mut self, from: usize, count: usize) -> Vec<u32> {
        self.touched.drain(..).for_each(|v| self.distance[v as usize] = f32::INFINITY);
        let mut found = Vec::with_capacity(count);
        // bits of floats that are not negative order as the floats
        let mut front = BinaryHeap::from([Reverse((0u32, from as u32))]);
        self.distance[from] = 0.0;
        self.touched.push(from as u32);
        while let Some(Reverse((bits, at))) = front.pop() {
            let distance = f32::from_bits(bits);
            if distance > self.distance[at as usize] {
                continue;
            }
            if let Some(i) = self.observer[at as usize].filter(|_| at as usize != from) {
                found.push(i);
                if found.len() == count {
                    break;
                }
            }
            for &next in self.adjacency.neighbours(at as usize) {
                let way = distance + self.rest[at as usize].distance(self.rest[next as usize]);
                if way < self.distance[next as usize] {
                    self.distance[next as usize] = way;
                    self.touched.push(next);
                    front.push(Reverse((way.to_bits(), next)));
                }
            }
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use softtissue_random::Draws;

    #[test]
    fn weights_are_positive_sum_to_one_and_reproduce_what_is_linear() {
        let mut draws = Draws::new(9, "nearby", 0, 0);
        let mut offset = || Vec2::new(draws.normal() as f32, draws.normal() as f32);
        for _ in 0..50 {
            // four of them surround the place
            let mut offsets =
                vec![Vec2::X, Vec2::Y, Vec2::NEG_X, Vec2::NEG_Y].into_iter().map(|a| a * 0.7).collect::<Vec<_>>();
            offsets.extend((0..4).map(|_| offset()));
            let w = weights(&offsets);
            assert!(w.iter().all(|w| *w > 0.0) && (w.iter().sum::<f32>() - 1.0).abs() < 1e-5);
            let mean: Vec2 = offsets.iter().zip(&w).map(|(o, w)| *o * *w).sum();
            assert!(mean.length() < 1e-3, "{mean}");
        }
        // the nearer counts more
        let w = weights(&[Vec2::X, Vec2::Y, Vec2::NEG_X * 0.5, Vec2::NEG_Y * 0.5]);
        assert!(w[2] > w[0] && w[3] > w[1]);
    }

    #[test]
    fn offsets_to_one_side_and_none_at_all_still_give_a_mean() {
        for offsets in [vec![Vec2::X, Vec2::X * 2.0, Vec2::new(1.0, 0.5)], vec![Vec2::ZERO; 3], vec![Vec2::Y]] {
            let w = weights(&offsets);
            assert!(w.iter().all(|w| *w > 0.0) && (w.iter().sum::<f32>() - 1.0).abs() < 1e-5, "{offsets:?} {w:?}");
        }
    }
}
