//! Foreign motions on a body of ours, for the verbs that take them.

use crate::args::{MotionSourceArgs, Up};
use anyhow::Result;
use serde_json::{Value, json};
use softtissue_body::{BodyModel, ShapedBody};
use softtissue_clips::{ClipId, MotionClip};
use softtissue_import::motion::{
    MotionConfig, MotionLimits, ReadMotion, RetargetConfig, UpAxis, read_motion, resample, retarget,
};
use softtissue_store::sha256_file;
use std::path::Path;

/// A foreign motion on a body of ours.
pub struct Moved {
    /// The motion.
    pub clip: MotionClip,
    /// Where it came from and how it was read.
    pub provenance: Value,
    /// What it is and what was guessed, in a line.
    pub line: String,
}

impl MotionSourceArgs {
    /// Reads a foreign motion.
    pub fn read(&self, path: &Path) -> Result<ReadMotion> {
        let up = self.up.map(|up| match up {
            Up::Y => UpAxis::Y,
            Up::Z => UpAxis::Z,
        });
        let limits = MotionLimits::default();
        let config =
            MotionConfig { skeleton: self.skeleton.clone(), units_m: self.units, up, fps: self.source_fps, limits };
        Ok(read_motion(path, &config)?)
    }
}

/// Puts a motion onto a body, at `fps` frames a second or the file's rate.
pub fn moved(path: &Path, read: &ReadMotion, body: &BodyModel, shaped: &ShapedBody, fps: Option<f32>) -> Result<Moved> {
    let id = ClipId::new("imported", file_name(path), 0);
    let retargeted = retarget(path, read, id, &body.skeleton, shaped, &RetargetConfig::default())?;
    let clip = resample(&retargeted.clip, fps.unwrap_or(retargeted.clip.fps), path)?;
    let mut line = format!("{}: {}", path.display(), read.facts.sentence());
    retargeted.notes.iter().for_each(|note| line.push_str(&format!("; {note}")));
    if clip.fps != retargeted.clip.fps {
        line.push_str(&format!("; resampled to {} a second", clip.fps));
    }
    let provenance = json!({
        "source": path.file_name().map(|n| n.to_string_lossy()),
        "sha256": sha256_file(path)?,
        "read": read.facts,
        "root_scale": retargeted.scale,
        "contact_frames": retargeted.contact_frames,
        "notes": retargeted.notes,
    });
    Ok(Moved { clip, provenance, line })
}

/// The file's name as a clip's: letters, digits, `_` and `-`.
fn file_name(path: &Path) -> String {
    let stem = path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
    let plain = |c: char| if c.is_ascii_alphanumeric() || c == '-' { c } else { '_' };
    let name: String = stem.chars().take(64).map(plain).collect();
    if name.is_empty() { "motion".into() } else { name }
}
