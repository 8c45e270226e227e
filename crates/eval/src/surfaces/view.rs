use crate::viewer::{Layer, ViewClip};
use softtissue_geometry::{Frames, Topology};
use softtissue_implicit::{HeightConfig, Interpolation, drawn_over};

/// Heights that become a layer.
#[derive(Clone, Copy, Debug)]
pub struct HeightLayer<'a> {
    /// Names it within the page, as [`Layer::key`].
    pub key: &'static str,
    /// Names it to people.
    pub label: &'a str,
    /// `[T]` of `[N]`, metres.
    pub heights: &'a [Vec<f32>],
}

/// What heights are drawn over. A predicted surface has other vertices in every frame; moving the body's vertices along
/// their normals by the heights keeps one mesh, whose layers can be measured against each other. What the heights do not
/// hold – folds, and what lies farther than 8 cm – is not drawn.
#[derive(Clone, Copy, Debug)]
pub struct HeightView<'a> {
    /// Triangles of the body.
    pub topology: &'a Topology,
    /// Vertices from observers.
    pub spread: &'a Interpolation,
    /// How the heights were read.
    pub heights: &'a HeightConfig,
    /// The posed body, `[T, V]`, metres.
    pub posed: &'a Frames,
}

impl HeightView<'_> {
    /// A clip with a layer for each of `layers`, all `[T]`.
    pub fn clip(&self, name: String, fps: f32, start_s: f32, layers: &[HeightLayer]) -> ViewClip {
        let layer = |of: &HeightLayer| {
            let mut frames = Frames::new(self.posed.points_per_frame());
            for (posed, heights) in self.posed.iter().zip(of.heights) {
                frames.push(&drawn_over(posed, self.topology, self.spread, heights, self.heights));
            }
            Layer { key: of.key, label: of.label.to_owned(), over: None, frames }
        };
        ViewClip { name, fps, start_s, layers: layers.iter().map(layer).collect() }
    }
}
