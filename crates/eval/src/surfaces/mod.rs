//! Methods that predict surfaces and not displacements of vertices (AutoAvatar, Bai et al. 2022): the measures of its
//! table 1 beside those that standing still does not improve. The protocol itself is `softtissue_implicit`'s.

mod heights;
mod metrics;
mod view;

pub use heights::{HeightTrace, cycle_figures};
pub use metrics::{CycleFigures, STILL, SurfaceCurves, SurfaceFigures, SurfaceMetrics};
pub use view::{HeightLayer, HeightView};
