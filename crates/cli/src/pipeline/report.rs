//! The report of a run.

use super::bundle::BundleMethod;
use super::context::Context;
use super::job::Prepared;
use super::judge::{Judgement, heaviest};
use super::learn::Learned;
use anyhow::Result;
use softtissue_body::BodyModel;
use softtissue_clips::{ClipId, FitSet};
use softtissue_eval::report::{ReportInput, StageTime, TrainingCurve, write};
use softtissue_eval::viewer::playback;
use softtissue_eval::{Metrics, Scene, Tally};
use std::collections::BTreeMap;
use std::io::{BufRead, BufReader};
use std::path::Path;

/// Writes a report to `path`.
pub fn write_report(
    context: &Context,
    title: &str,
    job: &Prepared,
    learned: &Learned,
    judgement: &Judgement,
    path: &Path,
) -> Result<()> {
    let truth = job.scans.open_truth()?;
    let scene = Scene { body: &job.body, fit: &job.fit, scans: Some(&job.scans.set), truth: truth.as_ref() };
    let ours = BundleMethod::as_learned(&learned.bundle);
    let clips = shown(&job.fit, &job.split.test, context.config.eval.playback_clips)?;
    let playback = clips.iter().map(|id| Ok(playback(&scene, &ours, id)?)).collect::<Result<Vec<_>>>()?;
    let stages: Vec<StageTime> =
        context.times().into_iter().map(|(name, seconds)| StageTime { name, seconds }).collect();
    let training = curves(context)?;
    let input = ReportInput {
        title,
        metrics: &judgement.metrics,
        tally: Some(&judgement.tally),
        decays: &judgement.decays,
        facts: &facts(context, job, learned),
        stages: &stages,
        training: &training,
        body: &job.body,
        playback: &playback,
    };
    Ok(write(&input, path)?)
}

/// Writes the report of a protocol to `path`: what its folds were judged by. They keep nothing to play.
pub fn write_protocol_report(
    context: &Context,
    title: &str,
    body: &BodyModel,
    metrics: &Metrics,
    tally: &Tally,
    path: &Path,
) -> Result<()> {
    let config = context.config;
    let facts = [
        ("program", format!("softtissue {}", env!("CARGO_PKG_VERSION"))),
        ("method", config.method_name()),
        ("seed", config.seed.to_string()),
        ("device", config.device.clone()),
    ]
    .map(|(term, value)| (term.to_owned(), value));
    let input = ReportInput {
        title,
        metrics,
        tally: Some(tally),
        decays: &[],
        facts: &facts,
        stages: &[],
        training: &[],
        body,
        playback: &[],
    };
    Ok(write(&input, path)?)
}

/// So many of `clips`, those of the heaviest subjects first: there the flesh is seen to move.
pub fn shown(fit: &FitSet, clips: &[ClipId], count: usize) -> Result<Vec<ClipId>> {
    let mut left = clips.to_vec();
    let mut clips = Vec::new();
    while clips.len() < count {
        let Some(next) = heaviest(fit, &left)? else { break };
        left.retain(|id| *id != next);
        clips.push(next);
    }
    Ok(clips)
}

fn facts(context: &Context, job: &Prepared, learned: &Learned) -> Vec<(String, String)> {
    let config = context.config;
    let (split, pca) = (&job.split, &learned.pca);
    let at95 = pca.components_for(0.95).map_or_else(|| format!("more than {}", pca.components()), |k| k.to_string());
    let facts = [
        ("program", format!("softtissue {}", env!("CARGO_PKG_VERSION"))),
        ("method", learned.bundle.info.method.clone()),
        ("seed", config.seed.to_string()),
        ("device", config.device.clone()),
        ("vertices", job.body.vertex_count().to_string()),
        ("subjects", job.scans.set.subjects().len().to_string()),
        ("clips", format!("{} train, {} select, {} test", split.train.len(), split.validation.len(), split.test.len())),
        ("components for 95 % of the variance of scan deltas", at95),
    ]
    .map(|(term, value)| (term.to_owned(), value));
    facts.into_iter().chain(learned.facts.iter().cloned()).collect()
}

/// Loss and validation curves out of the log, thinned to a few hundred points a stage.
pub(super) fn curves(context: &Context) -> Result<Vec<TrainingCurve>> {
    const MOST: usize = 400;
    let path = context.run.root().join("log.jsonl");
    let file = std::fs::File::open(&path).map_err(|e| softtissue_store::StoreError::io("read", &path, e))?;
    let mut points: BTreeMap<(String, &str), Vec<[f64; 2]>> = BTreeMap::new();
    for line in BufReader::new(file).lines().map_while(std::io::Result::ok) {
        let Ok(value) = serde_json::from_str::<serde_json::Value>(&line) else { continue };
        let (Some(stage), Some(step)) = (value["stage"].as_str(), value["step"].as_f64()) else { continue };
        for (key, name) in [("loss", "loss"), ("validation_mm", "validation")] {
            if let Some(y) = value[key].as_f64() {
                points.entry((stage.to_owned(), name)).or_default().push([step, y]);
            }
        }
    }
    Ok(points
        .into_iter()
        .map(|((stage, name), all)| {
            let every = all.len().div_ceil(MOST).max(1);
            TrainingCurve { stage, name: name.to_owned(), points: all.into_iter().step_by(every).collect() }
        })
        .collect())
}
