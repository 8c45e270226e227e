//! Sets of clips: `<out>/scans` is what a learner may read, `<out>/truth` is opened by evaluation alone.

mod bodies;
mod config;
mod write;

pub use bodies::Bodies;
pub use config::SynthConfig;
pub use write::{mean_flesh, scans_path, true_clip, truth_path, write, write_with};
