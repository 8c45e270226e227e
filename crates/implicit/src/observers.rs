use crate::nearby::{Walk, in_plane, weights};
use crate::{ImplicitError, Interpolation, Result};
use glam::Vec3;
use softtissue_geometry::{Adjacency, Topology, vertex_normals};

/// Observers that a vertex draws from.
const NEAREST: usize = 8;

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

    /// Values of all vertices from those of the observers: `V` rows of `N` sources, at most eight a row. An observer keeps
    /// its value; any other vertex takes a mean of the eight observers that are nearest along the edges of the rest mesh,
    /// so that nothing passes from arm to trunk, by positive weights that reproduce what is linear in its tangent plane.
    pub fn vertices_from_observers(&self, rest: &[Vec3], topology: &Topology) -> Interpolation {
        let adjacency = Adjacency::new(topology);
        let normals = vertex_normals(rest, &topology.faces);
        let mut walk = Walk::new(rest, &adjacency, &self.vertices);
        let row = |v: usize| {
            if let Some(own) = walk.observer(v) {
                return vec![(own, 1.0)];
            }
            let near = walk.nearest(v, NEAREST);
            let others = near.iter().map(|i| rest[self.vertices[*i as usize] as usize]);
            let weights = weights(&in_plane(rest[v], normals[v], others));
            near.into_iter().zip(weights).collect()
        };
        Interpolation::from_rows(self.len(), (0..self.vertex_count).map(row).collect())
    }
}
