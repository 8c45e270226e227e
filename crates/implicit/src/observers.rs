use crate::harmonic::Harmonic;
use crate::{ImplicitError, Interpolation, Result};
use glam::Vec3;
use softtissue_geometry::{Topology, vertex_normals};

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

    /// Values of all vertices from those of the observers: `V` rows of `N` sources, at most twelve a row. An observer keeps
    /// its value, any other vertex is the mean of its neighbours (harmonic, by mean value weights on the rest mesh), so that
    /// values change smoothly and none passes from arm to trunk.
    pub fn vertices_from_observers(&self, rest: &[Vec3], topology: &Topology) -> Interpolation {
        Harmonic::new(rest, topology).rows(&self.vertices)
    }

    /// Fills in values, `[N]`, of observers that are not `known` from those that are, as
    /// [`Self::vertices_from_observers`] does: heights in the holes of a scan. If none is known nothing changes.
    pub fn fill(&self, over: &Harmonic, values: &mut [f32], known: &[bool]) {
        assert!(values.len() == self.len() && known.len() == self.len(), "values of the observers");
        let (mut all, mut fixed) = (vec![0.0; self.vertex_count], vec![false; self.vertex_count]);
        for (i, v) in self.vertices.iter().enumerate() {
            (all[*v as usize], fixed[*v as usize]) = (values[i], known[i]);
        }
        if known.contains(&true) {
            over.extend(&mut all, &fixed);
            values.copy_from_slice(&self.pick(&all));
        }
    }
}
