//! What the viewer's script reads.

use super::pack::{Packed, pack, pack_bytes};
use super::{Layer, Surface, ViewClip};
use serde::Serialize;
use softtissue_body::Region;

#[derive(Serialize)]
pub struct ViewData {
    mesh: MeshData,
    layers: Vec<LayerData>,
    /// Index of the layer that distances are measured from.
    reference: Option<usize>,
    clips: Vec<ClipData>,
}

#[derive(Serialize)]
struct MeshData {
    vertices: usize,
    faces: String,
    /// A byte a vertex, an index into `names`.
    #[serde(skip_serializing_if = "Option::is_none")]
    regions: Option<String>,
    names: Vec<&'static str>,
    soft: Vec<bool>,
}

#[derive(Serialize)]
struct LayerData {
    key: &'static str,
    label: String,
    over: Option<usize>,
}

#[derive(Serialize)]
struct ClipData {
    clip: String,
    fps: f32,
    start: f32,
    frames: usize,
    layers: Vec<Packed>,
}

impl ViewData {
    /// Packs clips that all have the layers of the first one. Those that would make the packed frames larger than
    /// `most_bytes` are left out, the first one never.
    pub fn new(surface: &Surface, clips: &[ViewClip], reference: Option<&str>, most_bytes: usize) -> Self {
        let first = clips.first().map_or(&[][..], |c| &c.layers);
        let index = |key: &str| first.iter().position(|l| l.key == key);
        let layer = |l: &Layer| LayerData { key: l.key, label: l.label.clone(), over: l.over.and_then(index) };
        let vertices = first.first().map_or(0, |l| l.frames.points_per_frame());
        Self {
            mesh: mesh(surface, vertices),
            layers: first.iter().map(layer).collect(),
            reference: reference.and_then(index),
            clips: packed(clips, most_bytes),
        }
    }
    /// Names of the clips that made it into the page.
    pub fn clip_names(&self) -> impl Iterator<Item = &str> {
        self.clips.iter().map(|c| c.clip.as_str())
    }
    /// Names of the layers.
    pub fn labels(&self) -> impl Iterator<Item = (&'static str, &str)> {
        self.layers.iter().map(|l| (l.key, l.label.as_str()))
    }
    /// Index of the layer that distances are measured from.
    pub fn reference(&self) -> Option<usize> {
        self.reference
    }
    /// Whether the layers have regions.
    pub fn has_regions(&self) -> bool {
        self.mesh.regions.is_some()
    }
    /// Whether anything moves.
    pub fn plays(&self) -> bool {
        self.clips.iter().any(|c| c.frames > 1)
    }
}

fn mesh(surface: &Surface, vertices: usize) -> MeshData {
    let faces: Vec<u8> = surface.faces.iter().flatten().flat_map(|i| i.to_le_bytes()).collect();
    let index = |r: &Region| Region::ALL.iter().position(|o| o == r).unwrap_or(Region::ALL.len() - 1) as u8;
    MeshData {
        vertices,
        faces: pack_bytes(&faces),
        regions: surface.regions.map(|map| pack_bytes(&map.0.iter().map(index).collect::<Vec<u8>>())),
        names: Region::ALL.map(Region::name).to_vec(),
        soft: Region::ALL.map(Region::is_soft).to_vec(),
    }
}

fn packed(clips: &[ViewClip], most_bytes: usize) -> Vec<ClipData> {
    let mut used = 0;
    let mut kept: Vec<ClipData> = Vec::new();
    for clip in clips {
        // a tenth of a millimetre for bodies, a fiftieth for displacements: neither can be seen
        let packed =
            |l: &Layer| if l.over.is_none() { pack(&l.frames, 1e-4, true) } else { pack(&l.frames, 2e-5, false) };
        let data = ClipData {
            clip: clip.name.clone(),
            fps: clip.fps,
            start: clip.start_s,
            frames: clip.layers.first().map_or(0, |l| l.frames.len()),
            layers: clip.layers.iter().map(packed).collect(),
        };
        let bytes: usize = data.layers.iter().map(|l| l.data.len()).sum();
        if used + bytes <= most_bytes || kept.is_empty() {
            used += bytes;
            kept.push(data);
        }
    }
    kept
}
