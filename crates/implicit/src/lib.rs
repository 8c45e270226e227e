//! Signed distance fields round a body (AutoAvatar, Bai et al. 2022, without its networks): the state of the surface as
//! heights over observer points, the texture atlas that carries them to a network and back, nearest neighbours, meshes
//! by marching cubes, fields of raw scans, and the measures.
//!
//! Units: metres. Distances are negative inside and positive outside. What gives the distances is known by the trait
//! [`SignedDistance`] alone: this room knows nothing of networks and training.

mod atlas;
mod error;
mod field;
mod heights;
mod interpolation;
mod marching_cubes;
mod mesh_field;
mod nearby;
mod observers;
mod point_tree;
mod raw_surface;
mod rollout;
mod samples;
mod scan_distance;
mod volume_change;

pub use atlas::Atlas;
pub use error::ImplicitError;
pub use field::SignedDistance;
pub use heights::{HeightConfig, heights};
pub use interpolation::Interpolation;
pub use marching_cubes::{MarchingCubes, SurfaceMesh};
pub use mesh_field::MeshField;
pub use observers::{ObserverFrame, Observers};
pub use point_tree::{Neighbours, PointTree};
pub use raw_surface::{RawSurface, RawSurfaceConfig, ScanHeights};
pub use rollout::{
    FreeRollout, MeshFrame, MeshPredictor, PredictedSurface, RolloutClip, RolloutConfig, RolloutFigures, RolloutTally,
    SurfacePredictor, drawn_over,
};
pub use samples::{SampleConfig, Samples};
pub use scan_distance::mean_distance;
pub use volume_change::{VolumeProbe, VolumeProbeConfig};

#[cfg(test)]
mod shapes;

/// Result of this crate.
pub type Result<T> = std::result::Result<T, ImplicitError>;
