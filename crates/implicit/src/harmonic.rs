use crate::Interpolation;
use glam::Vec3;
use softtissue_geometry::Topology;
use std::collections::{BTreeMap, VecDeque};

/// Sources that a vertex keeps, the heaviest.
const SOURCES: usize = 12;
/// Sweeps at most, and the change of a row at which they end.
const SWEEPS: usize = 300;
const ENOUGH: f32 = 1e-4;

/// Harmonic functions on a mesh: fixed at some vertices, at any other the mean of the neighbours by mean value weights
/// (Floater 2003). These are never negative, so that no value leaves the range of those it comes from, and reproduce what is
/// linear where the mesh is flat. Nothing passes but along edges.
#[derive(Clone, Debug)]
pub struct Harmonic {
    /// Neighbours of each vertex and their shares, which sum to one.
    shares: Vec<Vec<(u32, f32)>>,
}

impl Harmonic {
    /// The weights of a rest mesh, `[V]`, metres.
    pub fn new(rest: &[Vec3], topology: &Topology) -> Self {
        let mut weights: Vec<BTreeMap<u32, f32>> = vec![BTreeMap::new(); rest.len()];
        for face in &topology.faces {
            for i in 0..3 {
                let [at, a, b] = [0, 1, 2].map(|k| face[(i + k) % 3]);
                let (to_a, to_b) = (rest[a as usize] - rest[at as usize], rest[b as usize] - rest[at as usize]);
                let half = (0.5 * to_a.angle_between(to_b)).tan();
                for (other, way) in [(a, to_a), (b, to_b)] {
                    let weight = half / way.length();
                    // a degenerate triangle says nothing
                    let weight = if weight.is_finite() { weight.max(1e-6) } else { 1e-6 };
                    *weights[at as usize].entry(other).or_default() += weight;
                }
            }
        }
        let share = |row: BTreeMap<u32, f32>| {
            let total: f32 = row.values().sum();
            row.into_iter().map(|(v, w)| (v, w / total)).collect()
        };
        Self { shares: weights.into_iter().map(share).collect() }
    }

    /// The values of all vertices as shares of those of `fixed` ones: rows of [`SOURCES`] at most.
    pub(crate) fn rows(&self, fixed: &[u32]) -> Interpolation {
        let mut rows: Vec<Vec<(u32, f32)>> = self.nearest(fixed).into_iter().map(|i| vec![(i, 1.0)]).collect();
        let mut free = vec![true; rows.len()];
        fixed.iter().for_each(|v| free[*v as usize] = false);
        for _ in 0..SWEEPS {
            let mut change = 0.0f32;
            for v in (0..rows.len()).filter(|v| free[*v] && !self.shares[*v].is_empty()) {
                let row = self.mean_row(&rows, v);
                change = change.max(difference(&row, &rows[v]));
                rows[v] = row;
            }
            if change < ENOUGH {
                break;
            }
        }
        Interpolation::from_rows(fixed.len(), rows)
    }

    /// Gives vertices that are not `known` the harmonic values of those that are; nothing if none is.
    pub(crate) fn extend(&self, values: &mut [f32], known: &[bool]) {
        let fixed: Vec<u32> = (0..values.len() as u32).filter(|v| known[*v as usize]).collect();
        if fixed.is_empty() {
            return;
        }
        for (v, from) in self.nearest(&fixed).into_iter().enumerate() {
            values[v] = values[fixed[from as usize] as usize];
        }
        let range = values.iter().fold(0.0f32, |most, x| most.max(x.abs()));
        for _ in 0..SWEEPS {
            let mut change = 0.0f32;
            for v in (0..values.len()).filter(|v| !known[*v] && !self.shares[*v].is_empty()) {
                let mean = self.shares[v].iter().map(|(n, share)| values[*n as usize] * share).sum::<f32>();
                change = change.max((mean - values[v]).abs());
                values[v] = mean;
            }
            if change < ENOUGH * range {
                break;
            }
        }
    }

    /// For each vertex which of `fixed` is the fewest edges away, of equally far ones the first reached; 0 where none is.
    fn nearest(&self, fixed: &[u32]) -> Vec<u32> {
        let mut from = vec![None; self.shares.len()];
        let mut front: VecDeque<u32> = fixed.iter().copied().collect();
        (0..).zip(fixed).for_each(|(i, v)| from[*v as usize] = Some(i));
        while let Some(v) = front.pop_front() {
            for (next, _) in &self.shares[v as usize] {
                if from[*next as usize].is_none() {
                    from[*next as usize] = from[v as usize];
                    front.push_back(*next);
                }
            }
        }
        from.into_iter().map(|i| i.unwrap_or(0)).collect()
    }

    fn mean_row(&self, rows: &[Vec<(u32, f32)>], v: usize) -> Vec<(u32, f32)> {
        let mut sum: BTreeMap<u32, f32> = BTreeMap::new();
        for (next, share) in &self.shares[v] {
            for (source, weight) in &rows[*next as usize] {
                *sum.entry(*source).or_default() += share * weight;
            }
        }
        let mut row: Vec<(u32, f32)> = sum.into_iter().collect();
        row.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        row.truncate(SOURCES);
        let total: f32 = row.iter().map(|(_, w)| w).sum();
        row.iter_mut().for_each(|(_, w)| *w /= total);
        row
    }
}

/// The largest change of a weight between two rows.
fn difference(a: &[(u32, f32)], b: &[(u32, f32)]) -> f32 {
    let weight = |row: &[(u32, f32)], source: u32| row.iter().find(|r| r.0 == source).map_or(0.0, |r| r.1);
    let both = a.iter().chain(b);
    both.map(|(source, _)| (weight(a, *source) - weight(b, *source)).abs()).fold(0.0, f32::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A flat grid of 9 x 9 vertices, bent nowhere, with uneven triangles.
    fn grid() -> (Vec<Vec3>, Topology) {
        let at = |i: u32| {
            let (x, y) = ((i % 9) as f32, (i / 9) as f32);
            let inside = (1.0..8.0).contains(&x) && (1.0..8.0).contains(&y);
            let push = if inside { 0.3 * Vec3::new((7.0 * y).sin(), (5.0 * x).cos(), 0.0) } else { Vec3::ZERO };
            Vec3::new(x, y, 0.0) + push
        };
        let cell = |i: u32| [[i, i + 1, i + 10], [i, i + 10, i + 9]];
        let faces = (0..72).filter(|i| i % 9 < 8).flat_map(cell).collect();
        ((0..81).map(at).collect(), Topology { vertex_count: 81, faces, quads: vec![] })
    }

    #[test]
    fn what_is_linear_on_a_plane_is_reproduced_and_nothing_leaves_its_range() {
        let (rest, topology) = grid();
        let harmonic = Harmonic::new(&rest, &topology);
        let border: Vec<u32> = (0..81).filter(|i| i % 9 == 0 || i % 9 == 8 || i / 9 == 0 || i / 9 == 8).collect();
        let known: Vec<bool> = (0..81).map(|i| border.contains(&i)).collect();
        let linear: Vec<f32> = rest.iter().map(|p| 0.3 * p.x - 0.2 * p.y + 1.0).collect();
        let mut values: Vec<f32> = linear.iter().zip(&known).map(|(x, k)| if *k { *x } else { 99.0 }).collect();
        harmonic.extend(&mut values, &known);
        values.iter().zip(&linear).for_each(|(a, b)| assert!((a - b).abs() < 0.01, "{a} and {b}"));
        // the same by rows, which leave out small shares of a ring of 32
        let fixed: Vec<f32> = border.iter().map(|v| linear[*v as usize]).collect();
        let map = harmonic.rows(&border);
        assert!(map.width() <= SOURCES);
        let by_rows = map.apply(&fixed, 1);
        by_rows.iter().zip(&linear).for_each(|(a, b)| assert!((a - b).abs() < 0.15, "{a} and {b}"));
        let (low, high) = fixed.iter().fold((f32::MAX, f32::MIN), |(l, h), x| (l.min(*x), h.max(*x)));
        assert!(by_rows.iter().chain(&values).all(|x| (low - 1e-5..=high + 1e-5).contains(x)));
    }

    #[test]
    fn without_a_known_value_nothing_changes() {
        let (rest, topology) = grid();
        let mut values = vec![0.5; 81];
        Harmonic::new(&rest, &topology).extend(&mut values, &[false; 81]);
        assert_eq!(values, [0.5; 81]);
    }
}
