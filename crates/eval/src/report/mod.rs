//! The report: one HTML file that needs no network, with figures, charts and a view that plays truth, body alone and
//! prediction side by side.

mod charts;
mod comparisons;
mod page;
pub mod plain;
mod surfaces;
mod tables;
mod text;

pub use surfaces::{SurfaceReport, tables as surface_tables, write_surfaces};
pub use text::is_channel;
pub(crate) use text::{by_rank, escape, method_label, number};

use crate::viewer::ViewClip;
use crate::{DecayTrace, Metrics, Result, Tally};
use softtissue_body::BodyModel;
use softtissue_store::write_atomic;
use std::path::Path;

/// How long a stage took.
#[derive(Clone, Debug, PartialEq)]
pub struct StageTime {
    /// Stage, e.g. `fit`.
    pub name: String,
    /// Wall-clock seconds.
    pub seconds: f64,
}

/// A curve over training steps, e.g. a loss.
#[derive(Clone, Debug, PartialEq)]
pub struct TrainingCurve {
    /// Which chart it belongs to, e.g. `regressor`.
    pub stage: String,
    /// Which line of it, e.g. `validation`.
    pub name: String,
    /// Step and value, in order of steps.
    pub points: Vec<[f64; 2]>,
}

/// What a report is made of. Whatever is empty is left out.
#[derive(Clone, Copy)]
pub struct ReportInput<'a> {
    /// Name of the run.
    pub title: &'a str,
    /// All figures.
    pub metrics: &'a Metrics,
    /// Curves over time and frequency.
    pub tally: Option<&'a Tally>,
    /// Free decays.
    pub decays: &'a [DecayTrace],
    /// What was run, as pairs of a term and its value.
    pub facts: &'a [(String, String)],
    /// How long it took.
    pub stages: &'a [StageTime],
    /// How training went.
    pub training: &'a [TrainingCurve],
    /// The body that the clips were made with.
    pub body: &'a BodyModel,
    /// Clips to play. Those that would make the file larger than about 25 MB are left out, the first one never.
    pub playback: &'a [ViewClip],
}

/// Writes the report, atomically.
pub fn write(input: &ReportInput, path: &Path) -> Result<()> {
    let html = page::html(input)?;
    Ok(write_atomic(path, |w| w.write_all(html.as_bytes()))?)
}
