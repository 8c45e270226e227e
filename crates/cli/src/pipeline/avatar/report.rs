//! The report of an avatar's run.

use super::judge::AvatarJudgement;
use crate::pipeline::context::Context;
use crate::pipeline::job::Prepared;
use crate::pipeline::report::curves;
use anyhow::Result;
use softtissue_avatar::AvatarModel;
use softtissue_eval::report::{StageTime, SurfaceReport, write_surfaces};
use softtissue_eval::viewer::Surface;
use std::path::Path;

/// Writes it to `path`.
pub fn write_avatar_report(
    context: &Context,
    title: &str,
    job: &Prepared,
    model: &AvatarModel,
    judgement: &AvatarJudgement,
    path: &Path,
) -> Result<()> {
    let config = context.config;
    let validation: Vec<String> =
        model.networks.iter().map(|l| format!("{} {:.2} mm", l.conditioning.name(), l.validation_mm)).collect();
    let facts = [
        ("program", format!("softtissue {}", env!("CARGO_PKG_VERSION"))),
        ("method", config.method_name()),
        ("person", model.info.subject.clone()),
        ("seed", config.seed.to_string()),
        ("device", config.device.clone()),
        ("observers", model.config.observers.min(job.body.vertex_count()).to_string()),
        ("neighbours of a point", model.config.neighbours.to_string()),
        ("validation", validation.join(", ")),
    ]
    .map(|(term, value)| (term.to_owned(), value));
    let stages: Vec<StageTime> =
        context.times().into_iter().map(|(name, seconds)| StageTime { name, seconds }).collect();
    let report = SurfaceReport {
        title,
        metrics: &judgement.metrics,
        facts: &facts,
        stages: &stages,
        training: &curves(context)?,
        surface: Surface { faces: &job.body.topology.faces, regions: Some(&job.body.regions) },
        playback: &judgement.shown,
    };
    Ok(write_surfaces(&report, path)?)
}
