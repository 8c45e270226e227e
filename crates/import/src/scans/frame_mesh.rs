use crate::ObjFrame;
use glam::Vec3;
use softtissue_geometry::{Topology, vertex_normals};
use std::collections::HashSet;

/// One frame of a scan as its file has it: vertices in file order, so that correspondence survives.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FrameMesh {
    /// `[V]`, the file's units and axes.
    pub positions: Vec<Vec3>,
    /// `[V]` or empty where the file has none.
    pub normals: Vec<Vec3>,
    /// Polygons, 0-based; empty for a point cloud.
    pub faces: Vec<Vec<u32>>,
}

impl From<ObjFrame> for FrameMesh {
    fn from(frame: ObjFrame) -> Self {
        Self { positions: frame.positions, normals: vec![], faces: frame.faces }
    }
}

impl FrameMesh {
    /// Says which face names a vertex that is not there.
    pub(crate) fn check_faces(&self) -> Result<(), String> {
        let count = self.positions.len();
        let stray = |(f, corners): (usize, &Vec<u32>)| corners.iter().find(|i| **i as usize >= count).map(|i| (f, *i));
        match self.faces.iter().enumerate().find_map(stray) {
            Some((f, i)) => Err(format!("face {f}: it names vertex {i}, the last one is {}", count - 1)),
            None => Ok(()),
        }
    }

    /// The file's normals, or those of its faces, or none: `[V]` or empty. Indices must have been checked.
    pub(crate) fn normals_or_from_faces(&self) -> Vec<Vec3> {
        if !self.normals.is_empty() || self.faces.is_empty() {
            return self.normals.clone();
        }
        let fan = |c: &Vec<u32>| (1..c.len() - 1).map(|k| [c[0], c[k], c[k + 1]]).collect::<Vec<_>>();
        let triangles: Vec<[u32; 3]> = self.faces.iter().flat_map(fan).collect();
        vertex_normals(&self.positions, &triangles)
    }
}

/// The template that registered scans must match.
pub(crate) struct Template<'a> {
    pub topology: &'a Topology,
    edges: HashSet<[u32; 2]>,
}

impl<'a> Template<'a> {
    pub fn new(topology: &'a Topology) -> Self {
        Self { topology, edges: topology.edges().into_iter().collect() }
    }

    /// Says what is wrong with a vertex count.
    pub fn check_count(&self, count: usize) -> Result<(), String> {
        let wanted = self.topology.vertex_count;
        if count == wanted {
            return Ok(());
        }
        Err(format!(
            "{count} vertices, but the template has {wanted}: bring the body that it is registered to, or register it \
             anew (`softtissue import scans --register`)"
        ))
    }

    /// Says which polygon joins vertices that the template does not. Quads may be split along either diagonal, so
    /// polygons are compared by their border edges.
    pub fn check_faces<'f>(&self, faces: impl Iterator<Item = &'f [u32]>) -> Result<(), String> {
        for (f, corners) in faces.enumerate() {
            let border = (0..corners.len()).map(|k| [corners[k], corners[(k + 1) % corners.len()]]);
            let foreign = border.map(|[a, b]| [a.min(b), a.max(b)]).filter(|edge| !self.edges.contains(edge)).count();
            if foreign > usize::from(corners.len() == 3) {
                return Err(format!(
                    "face {} joins vertices that the template does not: same count, other connectivity; export in the \
                     template's vertex order",
                    f + 1
                ));
            }
        }
        Ok(())
    }
}
