//! What the viewer shows as a log for Rerun (rerun.io): every layer of every clip a mesh over time, whose colours show
//! what those of the page show. Empty without the feature `log`.
//!
//! Entities are `clip/layer`; layers stand side by side, clips behind each other. Timelines: `frame`, from 0, and `time` in
//! seconds. Positions are metres, Y up. A layer has its vertices in every frame, its triangles once, and beside it `mm`, the
//! mean over the vertices of what its colours show.

#[cfg(feature = "log")]
mod log;

#[cfg(feature = "log")]
pub use log::write;
