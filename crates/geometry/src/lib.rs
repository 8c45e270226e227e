//! Meshes, adjacency, normals, rotations, and what is wrong with a mesh. SI units, right-handed, Y up.
//!
//! This room knows nothing of files, people or learning.

mod faults;
mod frames;
mod mesh;
mod rotation;
mod self_intersection;
#[cfg(feature = "surface-tree")]
mod surface_tree;

pub use faults::MeshFaults;
pub use frames::Frames;
pub use mesh::{Adjacency, Mesh, Topology, TopologyError, face_normals, signed_volume, vertex_normals};
pub use rotation::{
    axis_angle_from_rotation, left_jacobian, reflect_axis_angle_x, rotation_derivatives, rotation_from_axis_angle,
};
pub use self_intersection::self_intersections;
#[cfg(feature = "surface-tree")]
pub use surface_tree::{Place, SurfaceTree, closest_on_triangle};
