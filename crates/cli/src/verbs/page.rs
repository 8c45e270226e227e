//! The page of a bundle, for the verbs that write or serve it.

use crate::args::PageMotionArgs;
use crate::verbs::motion::{Wanted, motion};
use anyhow::Result;
use softtissue_bundle::{Bundle, BundleFiles};
use softtissue_clips::MotionClip;
use softtissue_monitor::Monitor;
use softtissue_page::{Site, player_module};
use std::path::Path;

/// Motions of a page that nobody chose any for: light and hard landings, shaking of several parts, and one that comes to
/// rest, in which flesh is seen to ring.
pub const MOTIONS: [&str; 6] = [
    "synth:jumping_jacks",
    "synth:hop_then_stand",
    "synth:running_on_spot",
    "synth:shake_hips",
    "synth:one_leg_jump",
    "synth:chicken_wings",
];

/// Frames of generated motions that nobody said otherwise for.
const FRAMES: usize = 300;

/// The page, its motions on the mean body.
pub fn site(bundle: &Path, motions: &PageMotionArgs, monitor: &dyn Monitor) -> Result<Site> {
    let player = player_module()?;
    let files = BundleFiles::read(bundle)?;
    let read = Bundle::from_memory(files.clone())?;
    let names: Vec<&str> = match motions.chosen.as_slice() {
        [] => MOTIONS.into(),
        chosen => chosen.iter().map(String::as_str).collect(),
    };
    let on_the_body = |name| {
        let wanted = Wanted { name, foreign: &motions.foreign, frames: motions.frames.unwrap_or(FRAMES) };
        motion(&wanted, &read.body, &vec![0.0; read.body.shape_count()], read.descriptor.fps, monitor)
    };
    let clips = names.into_iter().map(on_the_body).collect::<Result<Vec<MotionClip>>>()?;
    Ok(Site::new(&title(bundle), &read, &files, &clips, player)?)
}

/// A bundle is called by its run: `runs/quick/bundle` is "quick".
fn title(bundle: &Path) -> String {
    let name = |path: &Path| path.file_name().map(|n| n.to_string_lossy().into_owned());
    let whole = std::fs::canonicalize(bundle).unwrap_or_else(|_| bundle.to_owned());
    let own = name(&whole).filter(|n| n != "bundle");
    own.or_else(|| whole.parent().and_then(name)).unwrap_or_else(|| "softtissue".into())
}
