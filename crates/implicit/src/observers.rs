use crate::{ImplicitError, Interpolation, Result};
use glam::Vec3;
use softtissue_geometry::{Adjacency, Topology, vertex_normals};
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Observers that a vertex draws from, unless it is one itself.
const NEAREST: usize = 4;

/// Articulated observer points (AutoAvatar, sec. 3.1): chosen vertices of the body, which are where the posed body has
/// them.
#[derive(Clone, Debug, PartialEq)]
pub struct Observers {
    vertices: Vec<u32>,
    vertex_count: usize,
}

/// Observer points at a frame, both `[N]`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ObserverFrame {
    /// Metres.
    pub positions: Vec<Vec3>,
    /// Unit outward normals.
    pub normals: Vec<Vec3>,
}

impl Observers {
    /// Every vertex.
    pub fn all(vertex_count: usize) -> Self {
        Self { vertices: (0..vertex_count as u32).collect(), vertex_count }
    }

    /// `count` of the vertices, spread evenly over the rest mesh by farthest point sampling: each next one is the
    /// farthest from those before it, starting from vertex 0; of equally far ones the lower. Ascending.
    ///
    /// # Errors
    /// No point, or more than there are vertices.
    pub fn spread(rest: &[Vec3], count: usize) -> Result<Self> {
        if count == 0 || count > rest.len() {
            return Err(ImplicitError::ObserverCount { asked: count, vertices: rest.len() });
        }
        let mut distance = vec![f32::INFINITY; rest.len()];
        let mut vertices = Vec::with_capacity(count);
        let mut next = 0;
        for _ in 0..count {
            vertices.push(next as u32);
            let from = rest[next];
            // chosen ones stay below every other, vertices at the same place among them
            distance[next] = -1.0;
            distance.iter_mut().zip(rest).for_each(|(d, p)| *d = d.min(p.distance_squared(from)));
            next = (0..rest.len()).max_by(|a, b| distance[*a].total_cmp(&distance[*b]).then(b.cmp(a))).unwrap_or(0);
        }
        vertices.sort_unstable();
        Ok(Self { vertices, vertex_count: rest.len() })
    }

    /// Which vertices they are, ascending, `[N]`.
    pub fn vertices(&self) -> &[u32] {
        &self.vertices
    }
    /// Points `N`.
    pub fn len(&self) -> usize {
        self.vertices.len()
    }
    /// Whether there is no point.
    pub fn is_empty(&self) -> bool {
        self.vertices.is_empty()
    }

    /// Positions and normals on a posed body, `[V]`.
    pub fn frame(&self, posed: &[Vec3], topology: &Topology) -> ObserverFrame {
        assert_eq!(posed.len(), self.vertex_count, "vertices of a posed body");
        let normals = vertex_normals(posed, &topology.faces);
        ObserverFrame { positions: self.pick(posed), normals: self.pick(&normals) }
    }

    /// What the observers hold of a field on the vertices, `[N]` of `[V]`.
    pub fn pick<T: Copy>(&self, field: &[T]) -> Vec<T> {
        self.vertices.iter().map(|v| field[*v as usize]).collect()
    }

    /// Values of all vertices from those of the observers: `V` rows of `N` sources. An observer keeps its value; any other
    /// vertex takes the mean of the four observers nearest along the edges of the rest mesh, weighted by
    /// `((r - d) / (r d))^2` with `r` the distance of the fifth (Franke and Little's form of Shepard's), which leaves no
    /// jump where the four change. Distances along edges, so that nothing passes from arm to trunk.
    pub fn vertices_from_observers(&self, rest: &[Vec3], topology: &Topology) -> Interpolation {
        let adjacency = Adjacency::new(topology);
        let mut walk = Walk::new(self.vertex_count);
        let mut observer = vec![None; self.vertex_count];
        self.vertices.iter().enumerate().for_each(|(i, v)| observer[*v as usize] = Some(i as u32));
        let row = |v: usize| match observer[v] {
            Some(own) => vec![(own, 1.0)],
            None => shepard(&walk.nearest(v, rest, &adjacency, &observer, NEAREST + 1)),
        };
        Interpolation::from_rows(self.len(), (0..self.vertex_count).map(row).collect())
    }

    /// For each observer the `k` others nearest along the edges of the rest mesh, `[N]` lists, nearest first.
    pub fn links(&self, rest: &[Vec3], topology: &Topology, k: usize) -> Vec<Vec<u32>> {
        let adjacency = Adjacency::new(topology);
        let mut walk = Walk::new(self.vertex_count);
        let mut observer = vec![None; self.vertex_count];
        self.vertices.iter().enumerate().for_each(|(i, v)| observer[*v as usize] = Some(i as u32));
        let others = |v: &u32| {
            let found = walk.nearest(*v as usize, rest, &adjacency, &observer, k + 1);
            found.into_iter().skip(1).map(|(i, _)| i).collect()
        };
        self.vertices.iter().map(others).collect()
    }
}

/// Weights of observers at these distances, ascending; the last only says where the others' weight has faded.
fn shepard(found: &[(u32, f32)]) -> Vec<(u32, f32)> {
    // a part of the mesh with few observers has no fifth
    let (near, reach) = match found {
        [near @ .., last] if near.len() == NEAREST => (near, last.1),
        all => (all, 2.0 * all.last().map_or(0.0, |l| l.1)),
    };
    let weight = |d: f32| ((reach - d) / (reach * d)).powi(2);
    let total: f32 = near.iter().map(|(_, d)| weight(*d)).sum();
    if total.is_finite() && total > 0.0 {
        near.iter().map(|(i, d)| (*i, weight(*d) / total)).collect()
    } else {
        // all equally far, or at the same place
        near.iter().map(|(i, _)| (*i, 1.0 / near.len() as f32)).collect()
    }
}

/// Shortest ways along edges (Dijkstra), from one vertex at a time.
struct Walk {
    distance: Vec<f32>,
    touched: Vec<u32>,
}

impl Walk {
    fn new(vertices: usize) -> Self {
        Self { distance: vec![f32::INFINITY; vertices], touched: Vec::new() }
    }

    /// The `count` observers nearest to vertex `from`, nearest first, with distances, metres.
    fn nearest(
        &mut self,
        from: usize,
        rest: &[Vec3],
        adjacency: &Adjacency,
        observer: &[Option<u32>],
        count: usize,
    ) -> Vec<(u32, f32)> {
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
            if let Some(i) = observer[at as usize] {
                found.push((i, distance));
                if found.len() == count {
                    break;
                }
            }
            for &next in adjacency.neighbours(at as usize) {
                let way = distance + rest[at as usize].distance(rest[next as usize]);
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
