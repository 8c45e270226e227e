//! Motions that verbs play: generated, foreign, or clips of ours.

use crate::args::MotionSourceArgs;
use crate::exit::{InputError, UsageError};
use crate::verbs::foreign_motion::moved;
use anyhow::Result;
use softtissue_body::BodyModel;
use softtissue_clips::MotionClip;
use softtissue_import::motion::{is_motion_file, resample};
use softtissue_monitor::Monitor;
use softtissue_synth::motion::{Request, Style, generate};
use std::path::Path;

/// What a motion is generated with where only its name is given.
const GENERATOR_SEED: u64 = 1;

/// A motion as it is asked for.
pub struct Wanted<'a> {
    /// `synth:NAME`, or a file.
    pub name: &'a str,
    /// What a foreign motion does not say.
    pub foreign: &'a MotionSourceArgs,
    /// Frames of a generated motion.
    pub frames: usize,
}

/// The motion on a body of shape `beta`, at `fps` frames a second.
pub fn motion(wanted: &Wanted, body: &BodyModel, beta: &[f32], fps: f32, monitor: &dyn Monitor) -> Result<MotionClip> {
    if let Some(name) = wanted.name.strip_prefix("synth:") {
        if !(2..=36_000).contains(&wanted.frames) {
            return Err(UsageError(format!("--frames is {}; write 2 to 36000", wanted.frames)).into());
        }
        let request =
            Request { subject: "anybody", motion: name, take: 0, frames: wanted.frames, fps, seed: GENERATOR_SEED };
        return Ok(generate(&request, &body.shaped(beta), &Style::neutral())?);
    }
    let path = Path::new(wanted.name);
    if is_motion_file(path) {
        let read = wanted.foreign.read(path)?;
        let moved = moved(path, &read, body, &body.shaped(beta), Some(fps))?;
        monitor.say(&moved.line);
        return Ok(moved.clip);
    }
    let clip = MotionClip::read(path)?;
    let (found, expected) = (clip.rotations.points_per_frame(), body.joint_count());
    if found != expected {
        let message = format!("{}: {found} joints, but the body has {expected}; retarget it", path.display());
        return Err(InputError(message).into());
    }
    if clip.fps != fps {
        monitor.say(&format!("{}: {} frames a second, resampled to {fps}", path.display(), clip.fps));
    }
    Ok(resample(&clip, fps, path)?)
}
