//! `import` and what may come in.

use super::{ImportBodyArgs, Settings};
use clap::{Args, Subcommand, ValueEnum};
use softtissue_import::motion::MotionUnits;
use std::path::PathBuf;

/// `import`.
#[derive(Debug, Args)]
pub struct ImportArgs {
    /// What comes in.
    #[command(subcommand)]
    pub what: Import,
}

/// What may come in.
#[derive(Debug, Subcommand)]
pub enum Import {
    /// A parametric body: SMPL, SMPL-H, SMPL-X or Anny into a body file.
    Body(ImportBodyArgs),
    /// 4D scans into a scan set: HDF5 of DFAUST and Dyna, OBJ and PLY sequences, npz of vertices.
    Scans(ImportScansArgs),
    /// A motion: BVH, ASF/AMC or AMASS into a motion clip on our skeleton.
    Motion(ImportMotionArgs),
}

/// `import scans`.
#[derive(Debug, Args)]
pub struct ImportScansArgs {
    /// An *.hdf5, *.h5 or *.npz file, or a folder of such files or of SUBJECT/MOTION/*.{obj,ply}.
    pub source: PathBuf,
    /// The scan set to write.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Frames a second [default: what the file says, else 60].
    #[arg(long)]
    pub fps: Option<f32>,
    /// Unit of the coordinates [default: guessed from the height].
    #[arg(long, value_enum)]
    pub units: Option<LengthUnit>,
    /// Which way is up [default: guessed, the longer of Y and Z].
    #[arg(long, value_enum, allow_hyphen_values = true)]
    pub up: Option<ScanUp>,
    /// Make frames whose number is missing by interpolation.
    #[arg(long)]
    pub fill_gaps: bool,
    /// Register HDF5, OBJ or PLY scans anew, whatever their topology. Raw scans, whose vertex count changes from frame to
    /// frame, are registered without it.
    #[arg(long)]
    pub register: bool,
    /// Settings (for the body whose topology the frames must have).
    #[command(flatten)]
    pub settings: Settings,
}

/// `import motion`.
#[derive(Debug, Args)]
pub struct ImportMotionArgs {
    /// A motion: `.bvh`, `.amc` or `.npz` (AMASS).
    pub source: PathBuf,
    /// The motion clip to write (`.safetensors`).
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// Frames a second of the clip [default: the file's].
    #[arg(long)]
    pub fps: Option<f32>,
    /// What the file does not say.
    #[command(flatten)]
    pub foreign: MotionSourceArgs,
    /// Settings (for the body that moves).
    #[command(flatten)]
    pub settings: Settings,
}

/// What a foreign motion does not say, or says wrongly.
#[derive(Debug, Args, Clone, Default)]
pub struct MotionSourceArgs {
    /// Skeleton of an `.amc` file [default: the `.asf` beside it].
    #[arg(long, value_name = "FILE.asf")]
    pub skeleton: Option<PathBuf>,
    /// Unit of a foreign motion: metres, centimetres, millimetres, inches, cmu, or its length in metres [default: guessed from
    /// the skeleton's height].
    #[arg(long, value_name = "UNIT", value_parser = unit)]
    pub units: Option<f64>,
    /// Up axis of a foreign motion [default: guessed from where heads are].
    #[arg(long, value_enum)]
    pub up: Option<Up>,
    /// Frames a second of a foreign motion [default: what it says, or 120].
    #[arg(long)]
    pub source_fps: Option<f64>,
}

/// Metres of a unit.
fn unit(text: &str) -> Result<f64, String> {
    let named = MotionUnits::ALL.into_iter().find(|u| format!("{u:?}").eq_ignore_ascii_case(text));
    let metres = named.map(MotionUnits::metres).or_else(|| text.parse().ok());
    metres
        .filter(|m| (1e-6..=1e3).contains(m))
        .ok_or_else(|| "write metres, centimetres, millimetres, inches, cmu, or the unit's length in metres".to_owned())
}

/// Up axes on the command line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Up {
    /// Y.
    Y,
    /// Z.
    Z,
}

/// Units on the command line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum LengthUnit {
    /// Metres.
    Metres,
    /// Centimetres.
    Centimetres,
    /// Millimetres.
    Millimetres,
}

/// Up axes of scans on the command line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum ScanUp {
    /// Y is up, as here.
    Y,
    /// Z is up.
    Z,
    /// X is up.
    X,
    /// Y is down.
    #[value(name = "-y")]
    MinusY,
}
