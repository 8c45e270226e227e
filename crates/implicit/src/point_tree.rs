use glam::Vec3;
use rayon::prelude::*;

/// Points of a leaf.
const LEAF: usize = 8;
/// Queries below which a second thread does not pay.
const QUERIES_A_TASK: usize = 64;

/// Points in a balanced k-d tree (Bentley 1975), for the nearest of them.
#[derive(Clone, Debug)]
pub struct PointTree {
    /// In the tree's order.
    points: Vec<Vec3>,
    /// Of the points in the order they were given.
    indices: Vec<u32>,
    /// Axis of each split, by the index of its middle.
    axes: Vec<u8>,
}

/// The nearest points of many queries.
#[derive(Clone, Debug, PartialEq)]
pub struct Neighbours {
    /// Neighbours of a query.
    pub k: usize,
    /// `[Q, k]` points, nearest first; of equally near ones the lower index.
    pub indices: Vec<u32>,
    /// `[Q, k]` metres.
    pub distances: Vec<f32>,
}

impl PointTree {
    /// A tree over `points`, metres.
    pub fn new(points: &[Vec3]) -> Self {
        let mut indices: Vec<u32> = (0..points.len() as u32).collect();
        let mut axes = vec![0; points.len()];
        split(points, &mut indices, &mut axes);
        Self { points: indices.iter().map(|i| points[*i as usize]).collect(), indices, axes }
    }

    /// Points there are.
    pub fn len(&self) -> usize {
        self.points.len()
    }
    /// Whether there is no point.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// The `k` nearest of the points, or all if they are fewer, for each of `queries`. The same whatever the number of
    /// threads.
    pub fn nearest(&self, queries: &[Vec3], k: usize) -> Neighbours {
        let k = k.min(self.len());
        let mut out = Neighbours { k, indices: vec![0; queries.len() * k], distances: vec![0.0; queries.len() * k] };
        if k == 0 {
            return out;
        }
        let rows = out.indices.par_chunks_exact_mut(k).zip(out.distances.par_chunks_exact_mut(k));
        queries.par_iter().zip(rows).with_min_len(QUERIES_A_TASK).for_each_init(
            || Vec::with_capacity(k + 1),
            |best, (query, (indices, distances))| {
                best.clear();
                self.search(*query, k, 0, self.len(), best);
                for ((squared, index), (i, d)) in best.iter().zip(indices.iter_mut().zip(distances)) {
                    (*i, *d) = (*index, squared.sqrt());
                }
            },
        );
        out
    }

    /// Looks into the subtree of the points `start..end`; `best` holds squared distance and index, nearest first.
    fn search(&self, query: Vec3, k: usize, start: usize, end: usize, best: &mut Vec<(f32, u32)>) {
        if end - start <= LEAF {
            (start..end).for_each(|at| self.offer(query, k, at, best));
            return;
        }
        let middle = start + (end - start) / 2;
        self.offer(query, k, middle, best);
        let axis = usize::from(self.axes[middle]);
        let beyond = query[axis] - self.points[middle][axis];
        let (near, far) =
            if beyond < 0.0 { ((start, middle), (middle + 1, end)) } else { ((middle + 1, end), (start, middle)) };
        self.search(query, k, near.0, near.1, best);
        // an equally near point may have the lower index
        if best.len() < k || beyond * beyond <= best[k - 1].0 {
            self.search(query, k, far.0, far.1, best);
        }
    }

    fn offer(&self, query: Vec3, k: usize, at: usize, best: &mut Vec<(f32, u32)>) {
        let new = (self.points[at].distance_squared(query), self.indices[at]);
        let before = |old: &(f32, u32)| old.0.total_cmp(&new.0).then(old.1.cmp(&new.1)).is_lt();
        let place = best.partition_point(before);
        if place < k {
            best.truncate(k - 1);
            best.insert(place, new);
        }
    }
}

/// Orders `indices` so that the middle one of each subtree parts its points along the widest axis.
fn split(points: &[Vec3], indices: &mut [u32], axes: &mut [u8]) {
    if indices.len() <= LEAF {
        return;
    }
    let at = |i: &u32| points[*i as usize];
    let low = indices.iter().map(at).fold(Vec3::INFINITY, Vec3::min);
    let high = indices.iter().map(at).fold(Vec3::NEG_INFINITY, Vec3::max);
    let axis = (high - low).max_position();
    let middle = indices.len() / 2;
    indices.select_nth_unstable_by(middle, |a, b| at(a)[axis].total_cmp(&at(b)[axis]).then(a.cmp(b)));
    axes[middle] = axis as u8;
    let (left, right) = indices.split_at_mut(middle);
    let (left_axes, right_axes) = axes.split_at_mut(middle);
    split(points, left, left_axes);
    split(points, &mut right[1..], &mut right_axes[1..]);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes::draw;
    use softtissue_random::Draws;

    fn by_search_of_all(points: &[Vec3], queries: &[Vec3], k: usize) -> Vec<u32> {
        let row = |q: &Vec3| {
            let mut order: Vec<(f32, u32)> =
                points.iter().enumerate().map(|(i, p)| (p.distance_squared(*q), i as u32)).collect();
            order.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            order.into_iter().take(k).map(|(_, i)| i).collect::<Vec<u32>>()
        };
        queries.iter().flat_map(row).collect()
    }

    #[test]
    fn the_tree_finds_what_a_search_of_all_points_finds() {
        let mut draws = Draws::new(3, "points", 0, 0);
        let points: Vec<Vec3> = (0..700).map(|_| draw(&mut draws, 1.0)).collect();
        let queries: Vec<Vec3> = (0..300).map(|_| draw(&mut draws, 1.3)).collect();
        let tree = PointTree::new(&points);
        for k in [1, 8, 20] {
            let found = tree.nearest(&queries, k);
            assert_eq!(found.indices, by_search_of_all(&points, &queries, k));
            for (q, row) in queries.iter().zip(found.indices.chunks_exact(k).zip(found.distances.chunks_exact(k))) {
                row.0.iter().zip(row.1).for_each(|(i, d)| assert_eq!(*d, points[*i as usize].distance(*q)));
            }
        }
    }

    #[test]
    fn ties_go_to_the_lower_index_and_few_points_are_all_there_is() {
        let grid: Vec<Vec3> =
            (0..216).map(|i| Vec3::new((i % 6) as f32, (i / 6 % 6) as f32, (i / 36) as f32)).collect();
        let tree = PointTree::new(&grid);
        let queries: Vec<Vec3> = grid.iter().map(|p| *p + Vec3::splat(0.5)).collect();
        assert_eq!(tree.nearest(&queries, 12).indices, by_search_of_all(&grid, &queries, 12));
        let same = PointTree::new(&[Vec3::ONE; 40]);
        assert_eq!(same.nearest(&[Vec3::ZERO], 5).indices, [0, 1, 2, 3, 4]);
        assert_eq!(PointTree::new(&grid[..3]).nearest(&queries[..2], 20).k, 3);
        assert!(PointTree::new(&[]).nearest(&queries[..2], 20).indices.is_empty());
    }
}
