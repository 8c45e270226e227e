//! One module a verb.

pub mod animate;
mod animation_format;
pub mod avatar;
mod body_shape;
pub mod config;
mod contact_sheet;
mod controls;
pub mod eval;
pub mod export;
pub mod fit;
mod foreign_body;
mod foreign_motion;
pub mod import;
pub mod inspect;
mod kind;
mod motion;
mod near;
mod page;
mod precision;
pub mod synth;
pub mod train;
pub mod tune;
pub mod view;

use crate::args::Settings;
use std::path::PathBuf;

/// Where generated and imported clips are kept.
fn data_dir(settings: &Settings) -> PathBuf {
    settings.data_dir.clone().unwrap_or_else(|| PathBuf::from("data"))
}
