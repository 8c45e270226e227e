//! Other people's scans into ours.

use crate::exit::UsageError;
use anyhow::Result;
use softtissue_body::BodyModel;
use softtissue_clips::ScanSet;
use softtissue_fit::{RegistrationConfig, register_set};
use softtissue_import::scans::{RawScanSource, ScanImportConfig, ScanSource, import_scans};
use softtissue_monitor::Monitor;
use std::path::Path;

/// Brings a file or folder of foreign scans into a set at `out`. Raw scans are registered, and so are others where
/// `register` asks for it. Where that fails, a folder that was not there before is not there afterwards.
pub fn bring_in(
    source: &Path,
    import: &ScanImportConfig,
    register: bool,
    body: &BodyModel,
    registration: &RegistrationConfig,
    out: &Path,
    monitor: &dyn Monitor,
) -> Result<ScanSet> {
    if lies_in(out, source) {
        let (out, source) = (out.display(), source.display());
        return Err(UsageError(format!("--out {out} lies in {source}, the scans that come in; choose another")).into());
    }
    let fresh = !out.exists();
    let outcome = take_in(source, import, register, body, registration, out, monitor);
    if outcome.is_err() && fresh {
        // what a refusal or a stop leaves cannot be gone on with
        let _ = std::fs::remove_dir_all(out);
    }
    outcome
}

fn take_in(
    source: &Path,
    import: &ScanImportConfig,
    register: bool,
    body: &BodyModel,
    registration: &RegistrationConfig,
    out: &Path,
    monitor: &dyn Monitor,
) -> Result<ScanSet> {
    let scans = ScanSource::open(source, import)?;
    if !register && !scans.is_raw(body.vertex_count())? {
        return Ok(import_scans(&scans, &body.topology, out, monitor)?);
    }
    let raw = RawScanSource::new(&scans)?;
    monitor.say(&format!("  import: {} holds raw scans; they are registered to the body's template", source.display()));
    raw.notes().iter().for_each(|note| monitor.say(&format!("  import: {note}")));
    Ok(register_set(&raw, body, registration, out, monitor)?)
}

/// Whether a folder is another or lies below it.
fn lies_in(inner: &Path, outer: &Path) -> bool {
    let Ok(outer) = outer.canonicalize() else { return false };
    let place = inner.ancestors().find_map(|a| a.canonicalize().ok());
    place.is_some_and(|place| place.starts_with(&outer)) && outer.is_dir()
}
