use crate::Outcome;
use softtissue_clips::{ClipEntry, ClipId};
use softtissue_fit::FitConfig;
use softtissue_geometry::Frames;
use std::path::PathBuf;

const USAGE: &str = "usage: fit_accuracy DIR [from=N] [frames=N] [clips=TEXT,...] [SETTING=VALUE ...]";

/// What the command line asks for.
pub struct Arguments {
    pub root: PathBuf,
    from: usize,
    frames: usize,
    clips: String,
    pub config: FitConfig,
}

impl Arguments {
    pub fn read(mut arguments: impl Iterator<Item = String>) -> Outcome<Self> {
        let root = arguments.next().ok_or(USAGE)?.into();
        let (mut from, mut frames, mut clips, mut settings) = (0, usize::MAX, String::new(), String::new());
        for argument in arguments {
            match argument.split_once('=').ok_or(USAGE)? {
                ("from", n) => from = n.parse()?,
                ("frames", n) => frames = n.parse()?,
                ("clips", text) => clips = text.to_owned(),
                _ => settings += &format!("{argument}\n"),
            }
        }
        Ok(Self { root, from, frames, clips, config: toml::from_str(&settings)? })
    }

    /// Whether a clip is wanted.
    pub fn takes(&self, id: &ClipId) -> bool {
        let name = id.to_string();
        self.clips.split(',').any(|part| name.contains(part))
    }

    /// The wanted frames of a clip of so many.
    pub fn range(&self, frames: usize) -> std::ops::Range<usize> {
        self.from.min(frames)..frames.min(self.from.saturating_add(self.frames))
    }

    /// The wanted frames.
    pub fn cut(&self, all: &Frames) -> Frames {
        all.slice(self.range(all.len()))
    }

    /// A clip's entry after the cut.
    pub fn entry(&self, clip: &ClipEntry) -> ClipEntry {
        ClipEntry { frames: self.range(clip.frames).len(), ..clip.clone() }
    }
}
