//! A bundle in fewer bits, with what that loses.

use crate::args::MotionSourceArgs;
use crate::exit::UsageError;
use crate::verbs::motion::{Wanted, motion};
use crate::verbs::page::MOTIONS;
use anyhow::Result;
use serde_json::json;
use softtissue_bundle::{Bundle, BundleError, Precision, PrecisionLoss};
use softtissue_export::ExportError;
use softtissue_monitor::Monitor;
use std::path::Path;

/// Frames of each generated motion that the loss is measured on.
const FRAMES: usize = 180;

/// What `--precision` asks for.
pub fn parse(name: &str) -> Result<Precision> {
    let precision: Precision = name.parse().map_err(|reason| UsageError(format!("--precision: {reason}")))?;
    match precision {
        Precision::F32 => Err(UsageError("--precision f32 is what the bundle has; write f16 or i8".into()).into()),
        Precision::F16 | Precision::I8 => Ok(precision),
    }
}

/// Writes the bundle in fewer bits to another folder; prints what it loses and keeps it in the manifest.
pub fn write(from: &Path, bundle: &Bundle, precision: Precision, dir: &Path, monitor: &dyn Monitor) -> Result<()> {
    // Fewer bits cannot be made more again.
    if std::fs::canonicalize(dir).is_ok_and(|dir| std::fs::canonicalize(from).is_ok_and(|from| from == dir)) {
        let message = format!("--out {} is the bundle itself; name another folder", dir.display());
        return Err(UsageError(message).into());
    }
    let mut reduced = bundle.reduced(precision).map_err(|error| match error {
        BundleError::Input(_) => UsageError(error.to_string()).into(),
        other => anyhow::Error::from(other),
    })?;
    let loss = loss(bundle, &reduced, monitor)?;
    if !reduced.info.measured.is_object() {
        reduced.info.measured = json!({});
    }
    reduced.info.measured["precision_loss"] = json!({
        "mean_mm": loss.mean_mm(), "max_mm": loss.max_mm(), "frames": loss.frames(), "motions": MOTIONS,
    });
    reduced.write(dir)?;
    crate::print_line(&format!(
        "{}: {} off by {:.4} mm in the mean and {:.4} mm at most, soft vertices of {} frames",
        dir.display(),
        precision.name(),
        loss.mean_mm(),
        loss.max_mm(),
        loss.frames()
    ));
    Ok(())
}

/// Over the self-check's motion on its body, and generated motions on the mean body.
fn loss(bundle: &Bundle, reduced: &Bundle, monitor: &dyn Monitor) -> Result<PrecisionLoss> {
    let mut loss = PrecisionLoss::default();
    let check = &bundle.self_check;
    loss.add(bundle, reduced, &check.beta, &check.rotations, &check.translations)?;
    let beta = vec![0.0; bundle.body.shape_count()];
    let foreign = MotionSourceArgs::default();
    monitor.begin("precision", MOTIONS.len() as u64, "motions");
    for name in MOTIONS {
        let wanted = Wanted { name, foreign: &foreign, frames: FRAMES };
        let clip = motion(&wanted, &bundle.body, &beta, bundle.descriptor.fps, monitor)?;
        loss.add(bundle, reduced, &beta, &clip.rotations, &clip.translations)?;
        monitor.advance(1, name);
        if monitor.should_stop() {
            return Err(ExportError::Stopped.into());
        }
    }
    monitor.end();
    Ok(loss)
}
