//! The viewer: layers of clips side by side in 3D, as a part of the report and as a page of its own that needs no network.
//!
//! A [`Layer`] is a body with points of its own, or what is added to another layer: soft tissue to a body, a scanner's
//! error to the truth. Layers of one clip have the same vertices, so that they can be measured against each other.

mod data;
mod fitted;
mod pack;
mod page;
mod plan;
mod playback;
mod true_clip;

pub(crate) use data::ViewData;
pub use fitted::fitted;
pub(crate) use page::{Stage, document};
pub use plan::{MOST_POINTS, Pick, Plan, plan};
pub use playback::playback;
pub use true_clip::true_clip;

use crate::{EvalError, Result};
use softtissue_body::RegionMap;
use softtissue_geometry::Frames;
use softtissue_store::write_atomic;
use std::path::Path;

/// One body of a clip, or what is added to one.
#[derive(Clone, Debug, PartialEq)]
pub struct Layer {
    /// Names it within the page: `alone`, `reference`, `predicted`, `fit`, `deltas`, `scan`,
    /// `surface`.
    pub key: &'static str,
    /// Names it to people.
    pub label: String,
    /// The layer that it is added to. Without one its points stand by themselves.
    pub over: Option<&'static str>,
    /// Points, or displacements in the posed frame, `[T, V, 3]`, metres.
    pub frames: Frames,
}

/// A clip to look at.
#[derive(Clone, Debug, PartialEq)]
pub struct ViewClip {
    /// Names it to people.
    pub name: String,
    /// Frames a second, as shown.
    pub fps: f32,
    /// Time of the first frame, seconds.
    pub start_s: f32,
    /// What can be shown of it, what is shown first at the front.
    pub layers: Vec<Layer>,
}

impl ViewClip {
    /// A layer by its key.
    pub fn layer(&self, key: &str) -> Option<&Layer> {
        self.layers.iter().find(|l| l.key == key)
    }

    /// Takes what a plan leaves of the clip.
    #[must_use]
    pub fn picked(mut self, pick: &Pick) -> Self {
        if pick.start == 0 && pick.every == 1 && self.layers.iter().all(|l| l.frames.len() == pick.count) {
            return self;
        }
        for layer in &mut self.layers {
            let mut kept = Frames::new(layer.frames.points_per_frame());
            pick.frames().filter(|t| *t < layer.frames.len()).for_each(|t| kept.push(layer.frames.frame(t)));
            layer.frames = kept;
        }
        self.start_s += pick.start as f32 / self.fps;
        self.fps /= pick.every as f32;
        self
    }
}

/// The mesh of all layers.
#[derive(Clone, Copy)]
pub struct Surface<'a> {
    /// Triangles.
    pub faces: &'a [[u32; 3]],
    /// The region of each vertex, where the mesh is a body's.
    pub regions: Option<&'a RegionMap>,
}

/// What a page shows.
#[derive(Clone, Copy)]
pub struct View<'a> {
    /// Its title.
    pub title: &'a str,
    /// What it is, in a line.
    pub about: &'a str,
    /// What else is to be known, a sentence each.
    pub notes: &'a [String],
    /// The mesh.
    pub surface: Surface<'a>,
    /// Key of the layer from which distances are measured first; without one colours show displacements.
    pub reference: Option<&'static str>,
    /// The clips, all with the same layers.
    pub clips: &'a [ViewClip],
}

/// Writes a page, atomically. The same view gives the same bytes.
///
/// # Errors
/// No clip, clips whose layers differ, layers of other sizes than the mesh, more points than [`MOST_POINTS`], or the disk.
pub fn write(view: &View, path: &Path) -> Result<()> {
    check(view)?;
    let html = page::html(view)?;
    Ok(write_atomic(path, |w| w.write_all(html.as_bytes()))?)
}

/// Refuses what cannot be shown.
///
/// # Errors
/// No clip, clips whose layers differ, layers of other sizes than the mesh, or more points than [`MOST_POINTS`].
pub fn check(view: &View) -> Result<()> {
    let refuse = |reason: String| Err(EvalError::Refused(reason));
    let Some(first) = view.clips.first() else { return refuse(format!("{} has no clip to show", view.title)) };
    let vertices = first.layers.first().map_or(0, |l| l.frames.points_per_frame());
    let mut points = 0;
    for clip in view.clips {
        let same = |(a, b): (&Layer, &Layer)| a.key == b.key && a.over == b.over;
        if clip.layers.len() != first.layers.len() || !clip.layers.iter().zip(&first.layers).all(same) {
            return refuse(format!("{} has other layers than {}; show them apart", clip.name, first.name));
        }
        let frames = clip.layers.first().map_or(0, |l| l.frames.len());
        if frames == 0 || vertices == 0 {
            return refuse(format!("{} has no frame to show", clip.name));
        }
        for layer in &clip.layers {
            let (t, v) = (layer.frames.len(), layer.frames.points_per_frame());
            if (t, v) != (frames, vertices) {
                return refuse(format!(
                    "{}: {} has {t} frames of {v} vertices, expected {frames} of {vertices}; make it again from the same \
                     scans and body",
                    clip.name, layer.label
                ));
            }
            if layer.over.is_some_and(|key| key == layer.key || clip.layer(key).is_none()) {
                return refuse(format!("{}: {} is added to a layer that is not there", clip.name, layer.label));
            }
            points += t * v;
        }
    }
    if let Some(stray) = view.surface.faces.iter().flatten().find(|i| **i as usize >= vertices) {
        return refuse(format!("{}: a face names vertex {stray} of {vertices}", view.title));
    }
    if points > MOST_POINTS {
        return refuse(format!("{}: {points} points are more than the {MOST_POINTS} that a page holds", view.title));
    }
    Ok(())
}
