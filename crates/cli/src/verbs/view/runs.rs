//! Runs: what was to be predicted, what is, and what the fit made of the scan.

use super::avatars;
use super::choice::Asked;
use super::shown::{Shown, title};
use crate::args::ViewArgs;
use crate::config::Method as Learns;
use crate::exit::UsageError;
use crate::pipeline::{BundleMethod, Kept, kept, shown};
use crate::settings::stored;
use crate::verbs::train::Provenance;
use anyhow::Result;
use softtissue_bundle::Bundle;
use softtissue_clips::{ClipId, Part, Split, TruthSet};
use softtissue_eval::viewer::{Layer, ViewClip, fitted, playback};
use softtissue_eval::{BodyAlone, EvalError, Method, Scene};
use softtissue_monitor::Monitor;
use softtissue_store::read_json;
use std::path::Path;
use std::sync::Arc;

/// Layers of a played clip, and those that its fit adds.
const LAYERS: (usize, usize) = (3, 4);
/// The order of all layers: those at the front are shown first.
const ORDER: [&str; 7] = ["scan", "fit", "reference", "predicted", "surface", "alone", "deltas"];
/// Why the fit is not where the truth is.
const FIT_NOTE: &str = "Scan, fit and true surface have the person's static detail and the fit its own pose; truth, prediction and \
                        body alone stand on the fitted shape without that detail. Distances between the two groups hold both.";

/// Clips of a run, those left out for testing first.
pub fn run(path: &Path, args: &ViewArgs, asked: &Asked, monitor: &dyn Monitor) -> Result<Shown> {
    let config = stored(&path.join("config.toml"))?;
    let provenance: Provenance = read_json(&path.join("provenance.json"))?;
    let data_dir = args.data_dir.clone().unwrap_or(provenance.data_dir);
    let kept = kept(path, &config, provenance.data.as_deref(), &data_dir, monitor)?;
    if config.method == Learns::Autoavatar {
        if args.fit {
            return Err(UsageError("--fit is for runs that learn registered scans; leave it out".into()).into());
        }
        return avatars::run(path, &config, provenance.data.as_deref(), &kept, asked, monitor);
    }
    let truth = kept.scans.open_truth()?;
    let method = method(path, &kept)?;
    let layers = LAYERS.0 + if args.fit { LAYERS.1 } else { 0 };
    let likely = likely(&kept)?;
    let points = kept.body.vertex_count() * layers;
    let chosen = asked.choose(kept.fit.clips(), &likely, points, path)?;
    let mut notes = chosen.notes;
    let alone = BodyAlone { vertex_count: kept.body.vertex_count() };
    let playing: &dyn Method = method.as_ref().map_or(&alone as &dyn Method, |m| m as &dyn Method);
    if method.is_none() {
        notes.push("No bundle yet: nothing is predicted before the run has finished its training.".into());
    }
    let scene = Scene { body: &kept.body, fit: &kept.fit, scans: Some(&kept.scans.set), truth: truth.as_ref() };
    if args.fit {
        notes.push(FIT_NOTE.into());
    }
    let mut clips = Vec::new();
    for (id, pick) in &chosen.clips {
        if monitor.should_stop() {
            return Err(EvalError::Stopped.into());
        }
        let mut clip = playback(&scene, playing, id)?;
        if method.is_none() {
            clip.layers.retain(|l| l.key != "predicted");
        }
        if args.fit {
            add_fit(&mut clip, &kept, truth.as_ref(), id)?;
        }
        clip.name = format!("{id} · {}", part_of(&kept.split, id));
        clips.push(clip.picked(pick));
    }
    let about = about(&kept, playing.name(), method.is_some(), truth.is_some());
    let title = title(path);
    Ok(Shown { reference: Some("reference"), title, ..Shown::on(&kept.body, path, about, clips, notes) })
}

fn about(kept: &Kept, method: &str, finished: bool, truth: bool) -> String {
    format!(
        "Run{}: {} clips, {} vertices; {}.",
        if finished { format!(" of method {method}") } else { String::new() },
        kept.fit.clips().len(),
        kept.body.vertex_count(),
        if truth {
            "truth and prediction in the true pose, on the body of the fitted shape"
        } else {
            "the scans' deltas and the prediction in the fitted pose"
        }
    )
}

/// The run's bundle, where training is through.
fn method(path: &Path, kept: &Kept) -> Result<Option<BundleMethod>> {
    let dir = path.join("bundle");
    if !dir.join("manifest.json").exists() {
        return Ok(None);
    }
    let bundle = Bundle::read(&dir)?;
    bundle.require_topology(&dir, &kept.body.topology.hash())?;
    Ok(Some(BundleMethod::as_learned(&Arc::new(bundle))))
}

/// What is likely to be asked for: clips that training has not seen, of the heaviest first.
fn likely(kept: &Kept) -> Result<Vec<ClipId>> {
    let split = &kept.split;
    let parts = [&split.test, &split.validation, &split.train];
    let unseen = parts.into_iter().find(|p| !p.is_empty()).map_or(&[][..], Vec::as_slice);
    shown(&kept.fit, unseen, unseen.len())
}

fn part_of(split: &Split, id: &ClipId) -> &'static str {
    match split.part(id) {
        Some(Part::Train) => "seen in training",
        Some(Part::Validation) => "selected by",
        _ => "test",
    }
}

/// Puts the scan, its fit and the true surface among the played layers.
fn add_fit(clip: &mut ViewClip, kept: &Kept, truth: Option<&TruthSet>, id: &ClipId) -> Result<()> {
    let scan = kept.scans.set.scan(id)?;
    clip.layers.extend(fitted(&kept.body, &kept.fit, Some(&scan), id)?.layers);
    if let Some(truth) = truth {
        let frames = truth.clean(id)?.vertices;
        clip.layers.push(Layer { key: "surface", label: "True surface".into(), over: None, frames });
    }
    // Without truth the reference is the scan too, but on another body than the fit's.
    let of_scan = clip.layers.iter_mut().filter(|l| l.key == "reference" && l.label == "Scan");
    of_scan.for_each(|l| l.label = "Scan's deltas".into());
    clip.layers.sort_by_key(|l| ORDER.iter().position(|key| *key == l.key));
    Ok(())
}
