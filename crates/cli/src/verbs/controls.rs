//! An animator's controls out of the command line.

use crate::args::AnimateArgs;
use crate::exit::{InputError, UsageError};
use anyhow::Result;
use glam::Vec3;
use softtissue_body::{BodyModel, Region};
use softtissue_bundle::{Control, Controls, Detail};
use softtissue_import::{ImportLimits, read_obj_frame};
use std::path::Path;

/// Largest file of controls, bytes.
const LONGEST_CONTROLS: u64 = 1 << 16;

/// All that `animate` was asked to change.
pub fn controls(args: &AnimateArgs, body: &BodyModel) -> Result<Controls> {
    let mut controls = Controls::gain(args.gain);
    let kept = args.controls.as_deref().map(kept).transpose()?.unwrap_or_default();
    let typed = args.control.iter().map(|text| ("--control".to_owned(), text.clone()));
    for (place, text) in kept.into_iter().chain(typed) {
        let wrong = |reason: String| UsageError(format!("{place} {text:?}: {reason}"));
        let (name, changes) = text
            .split_once(':')
            .ok_or_else(|| wrong("write a region, a colon and changes, as in belly:gain=2,softness=1.5".into()))?;
        let control = control(changes).map_err(wrong)?;
        if name == "everywhere" {
            let gain = controls.everywhere.gain * control.gain;
            controls.everywhere = Control { gain, ..control };
            continue;
        }
        let region =
            region(name).map_err(|known| wrong(format!("{name:?} is no region; choose everywhere, {known}")))?;
        controls.regions.push((region, control));
    }
    controls.painted = args.paint.as_deref().map(|path| painted(path, body)).transpose()?;
    Ok(controls)
}

/// The lines of a file of controls with their places; empty ones and remarks (`#`) are skipped.
fn kept(path: &Path) -> Result<Vec<(String, String)>> {
    let bytes = softtissue_store::read_limited(path, LONGEST_CONTROLS)?;
    let text = String::from_utf8(bytes).map_err(|_| {
        InputError(format!("{}: no text; give lines such as belly:gain=2,softness=1.5", path.display()))
    })?;
    let lines = text.lines().enumerate().map(|(i, line)| (format!("{} line {}", path.display(), i + 1), line.trim()));
    Ok(lines.filter(|(_, l)| !l.is_empty() && !l.starts_with('#')).map(|(at, l)| (at, l.to_owned())).collect())
}

/// Controls as a line of such a file.
pub fn line(region: Region, control: &Control) -> String {
    let Control { gain, softness, damping, lag, mass } = control;
    let neutral = Control::default();
    let changes = [
        ("gain", gain, neutral.gain),
        ("softness", softness, neutral.softness),
        ("damping", damping, neutral.damping),
        ("lag", lag, neutral.lag),
        ("mass", mass, neutral.mass),
    ];
    let changes = changes.iter().filter(|(_, value, neutral)| **value != *neutral);
    let changes: Vec<String> = changes.map(|(name, value, _)| format!("{name}={value}")).collect();
    let changes = if changes.is_empty() { "gain=1".into() } else { changes.join(",") };
    format!("{}:{changes}", region.name())
}

/// How much of the flesh `animate` was asked to compute.
pub fn detail(args: &AnimateArgs) -> Result<Detail> {
    let still = |name: &String| {
        region(name).map_err(|known| UsageError(format!("--still {name:?} is no region; choose {known}")))
    };
    let still = args.still.iter().map(still).collect::<std::result::Result<_, _>>()?;
    Ok(Detail { components: args.components, still })
}

/// The region of a name; all names where there is none.
fn region(name: &str) -> std::result::Result<Region, String> {
    let region = Region::ALL.into_iter().find(|r| r.name() == name);
    region.ok_or_else(|| Region::ALL.map(Region::name).join(", "))
}

fn control(changes: &str) -> std::result::Result<Control, String> {
    let mut control = Control::default();
    for change in changes.split(',') {
        let (key, value) =
            change.split_once('=').ok_or_else(|| format!("{change:?} is no change; write gain=2, for example"))?;
        let number: f32 = value.trim().parse().map_err(|_| format!("{value:?} is no number"))?;
        match key.trim() {
            "gain" => control.gain = number,
            "softness" => control.softness = number,
            "damping" => control.damping = number,
            "lag" => control.lag = number,
            "mass" => control.mass = number,
            other => return Err(format!("{other:?} cannot be changed; choose gain, softness, damping, lag or mass")),
        }
    }
    Ok(control)
}

/// The brightness of each vertex.
fn painted(path: &Path, body: &BodyModel) -> Result<Vec<f32>> {
    let frame = read_obj_frame(path, &ImportLimits::default())?;
    let (found, expected) = (frame.positions.len(), body.vertex_count());
    if found != expected {
        let message =
            format!("{}: {found} vertices, but the body has {expected}; paint a mesh of its topology", path.display());
        return Err(InputError(message).into());
    }
    if frame.colors.is_empty() {
        let message = format!(
            "{}: not every vertex has a colour (`v x y z r g b`); export the mesh with vertex colours",
            path.display()
        );
        return Err(InputError(message).into());
    }
    if let Some(v) = frame.colors.iter().position(|c| !(c.min_element() >= 0.0 && c.max_element() <= 1.0)) {
        let message =
            format!("{}: the colour of vertex {} is not between 0 and 1; export it again", path.display(), v + 1);
        return Err(InputError(message).into());
    }
    Ok(frame.colors.iter().map(|c| c.element_sum() / 3.0).collect())
}

/// The rest mesh of another body, metres.
pub fn rest_mesh(path: &Path, body: &BodyModel) -> Result<Vec<Vec3>> {
    let frame = read_obj_frame(path, &ImportLimits::default())?;
    let (found, expected) = (frame.positions.len(), body.vertex_count());
    if found != expected {
        let message = format!(
            "{}: {found} vertices, but the body has {expected}; give a mesh of its topology, vertices in its order",
            path.display()
        );
        return Err(InputError(message).into());
    }
    Ok(frame.positions)
}
