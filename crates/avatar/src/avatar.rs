use crate::config::Conditioning;
use crate::decoder::FieldValues;
use crate::features::{PoseTrack, height_features, localisation};
use crate::layer::tensor;
use crate::network::{AvatarNetwork, FrameInput, Ground};
use crate::queries::Queries;
use crate::rows::WeightedRows;
use crate::{AvatarError, NetworkConfig, Result};
use burn::tensor::{Device, Tensor};
use glam::Vec3;
use softtissue_body::{BodyModel, Region};
use softtissue_implicit::{Atlas, HeightConfig, ObserverFrame, Observers, PointTree, SignedDistance, heights};
use softtissue_model::host;
use std::cell::OnceCell;
use std::collections::VecDeque;

/// Points that the field is asked for at once; bounds its memory.
const CHUNK: usize = 4096;

/// What networks of one body and one size share.
#[derive(Clone, Debug)]
pub struct AvatarBody {
    /// The network's size.
    pub config: NetworkConfig,
    /// The points that hold the state.
    pub observers: Observers,
    /// Joints of the body.
    pub joints: usize,
    /// How heights are read.
    pub heights: HeightConfig,
    ground: Ground,
    /// Whether an observer lies on face, hands or feet, `[M]`.
    still: Vec<bool>,
    /// One where it does, `[M, 1]`.
    frozen: Tensor<2>,
}

impl AvatarBody {
    /// Lays observers and tables over a body; a smaller body than observers are asked for has one at every vertex.
    /// `device` is without autodiff.
    ///
    /// # Errors
    /// A body without texture coordinates.
    pub fn new(config: &NetworkConfig, body: &BodyModel, device: &Device) -> Result<Self> {
        let data = |e: softtissue_implicit::ImplicitError| AvatarError::Data(e.to_string());
        let count = config.observers.min(body.vertex_count());
        let observers = match count == body.vertex_count() {
            true => Observers::all(count),
            false => Observers::spread(&body.template, count).map_err(data)?,
        };
        let atlas = Atlas::new(&body.topology, &body.uv, config.atlas).map_err(data)?;
        let spread = observers.vertices_from_observers(&body.template, &body.topology);
        let scatter = atlas.texels_from_vertices().after(&spread);
        let gather = atlas.vertices_from_texels();
        let width = gather.width();
        let at = |v: &u32| *v as usize * width..(*v as usize + 1) * width;
        let rows: Vec<u32> = observers.vertices().iter().flat_map(|v| gather.indices()[at(v)].to_vec()).collect();
        let weights: Vec<f32> = observers.vertices().iter().flat_map(|v| gather.weights()[at(v)].to_vec()).collect();
        let local = localisation(body, observers.vertices());
        let frozen = |v: &u32| matches!(body.regions.0[*v as usize], Region::Head | Region::Hands | Region::Feet);
        let still: Vec<bool> = observers.vertices().iter().map(frozen).collect();
        let ground = Ground {
            localisation: tensor(local, [count, body.joint_count() - 1], device),
            scatter: WeightedRows::new(scatter.indices(), scatter.weights(), scatter.width(), device),
            gather: WeightedRows::new(&rows, &weights, width, device),
            means: observers.means_of_others(&body.template, &body.topology),
        };
        let (config, joints) = (config.clone(), body.joint_count());
        Ok(Self::from_parts(config, observers, joints, HeightConfig::default(), ground, still, device))
    }

    pub(crate) fn from_parts(
        config: NetworkConfig,
        observers: Observers,
        joints: usize,
        heights: HeightConfig,
        ground: Ground,
        still: Vec<bool>,
        device: &Device,
    ) -> Self {
        let frozen = still.iter().map(|still| if *still { 1.0 } else { 0.0 }).collect();
        let frozen = tensor(frozen, [still.len(), 1], device);
        Self { config, observers, joints, heights, ground, still, frozen }
    }

    /// Observers that lie on neither face, hands nor feet.
    pub fn moving(&self) -> Vec<usize> {
        (0..self.still.len()).filter(|i| !self.still[*i]).collect()
    }

    /// Heights of a surface over the observers of a frame, `[M]`, metres, closed where it is not met.
    pub fn heights_of(&self, surface: &dyn SignedDistance, observers: &ObserverFrame) -> Vec<f32> {
        let mut found = heights(surface, &observers.positions, &observers.normals, &self.heights);
        let met: Vec<bool> = found.iter().map(|h| *h > self.heights.lowest).collect();
        self.close(&mut found, &met);
        found
    }

    /// Heights, `[M]`, that are not `known` closed smoothly from those round them: a hole of a scan, or where skin touches
    /// skin and no surface is met.
    pub(crate) fn close(&self, heights: &mut [f32], known: &[bool]) {
        Observers::fill(&self.ground.means, heights, known);
    }

    /// What the prediction of frame `t` sees: poses up to it, and the heights of the frames before, the newest last.
    pub(crate) fn input(
        &self,
        conditioning: Conditioning,
        track: &PoseTrack,
        t: usize,
        heights: &[&[f32]],
    ) -> FrameInput {
        let history = self.config.history;
        let back = |count: usize| (0..count).map(move |i| (t + 1 + i) as isize - count as isize);
        let seen = if conditioning == Conditioning::PoseTcn { self.config.tcn_frames } else { 1 };
        let differences = conditioning.sees_differences().then(|| track.differences(back(history)));
        let carried = self.config.carried;
        let newest = heights.last().filter(|_| conditioning.sees_heights() && carried > 0.0);
        FrameInput {
            heights: if conditioning.sees_heights() { height_features(heights) } else { Vec::new() },
            carried: newest.map_or_else(Vec::new, |h| h.iter().map(|h| carried * h).collect()),
            poses: track.poses(back(seen)),
            differences: differences.unwrap_or_default(),
        }
    }

    /// Query points beside the observers of a frame.
    pub(crate) fn queries(
        &self,
        points: &[Vec3],
        tree: &PointTree,
        observers: &ObserverFrame,
        gradients: bool,
        device: &Device,
    ) -> Queries {
        let near = tree.nearest(points, self.config.neighbours);
        Queries::new(points, &near.indices, observers, self.config.encoding(), gradients, device)
    }

    /// Dynamic features and offsets, `[M, latents + 1]`, of a rollout's next frame. Those of face, hands and feet stay the
    /// first frame's (sec. 3.4), which `first` keeps from there on, without a gradient.
    pub(crate) fn features(
        &self,
        network: &AvatarNetwork,
        input: &FrameInput,
        first: &mut Option<Tensor<2>>,
    ) -> Tensor<2> {
        let features = network.features(input, &self.ground);
        if !self.config.frozen {
            return features;
        }
        match first {
            Some(first) => features.clone() - features * self.frozen.clone() + first.clone(),
            None => {
                *first = Some((features.clone() * self.frozen.clone()).detach());
                features
            }
        }
    }
}

/// The surface of one frame: a field that can be asked anywhere.
pub struct AvatarField<'a> {
    body: &'a AvatarBody,
    network: &'a AvatarNetwork,
    features: Tensor<2>,
    observers: &'a ObserverFrame,
    tree: PointTree,
    /// Read off once.
    heights: OnceCell<Vec<f32>>,
}

impl<'a> AvatarField<'a> {
    /// The field of dynamic features and offsets, `[M, latents + 1]`, which are without autodiff as the network is.
    pub fn new(
        body: &'a AvatarBody,
        network: &'a AvatarNetwork,
        features: Tensor<2>,
        observers: &'a ObserverFrame,
    ) -> Self {
        let tree = PointTree::new(&observers.positions);
        Self { body, network, features, observers, tree, heights: OnceCell::new() }
    }

    /// The observers of its frame.
    pub fn observers(&self) -> &ObserverFrame {
        self.observers
    }

    /// Its signed heights over the observers, `[M]`, metres, closed where it is not met: the state that the next frame is
    /// predicted from.
    pub fn heights(&self) -> &[f32] {
        self.heights.get_or_init(|| self.body.heights_of(self, self.observers))
    }

    /// Values and gradients at a few points.
    pub fn with_gradients(&self, points: &[Vec3]) -> (Vec<f32>, Vec<Vec3>) {
        let found = self.ask(points, true);
        let gradients = host(found.gradient.expect("asked for with gradients"));
        let gradients = gradients.as_chunks::<3>().0.iter().map(|g| Vec3::from_array(*g)).collect();
        (host(found.distance), gradients)
    }

    fn ask(&self, points: &[Vec3], gradients: bool) -> FieldValues {
        let queries = self.body.queries(points, &self.tree, self.observers, gradients, &self.features.device());
        self.network.field(self.features.clone(), &queries)
    }
}

impl SignedDistance for AvatarField<'_> {
    fn values(&self, points: &[Vec3], out: &mut [f32]) {
        for (points, out) in points.chunks(CHUNK).zip(out.chunks_mut(CHUNK)) {
            out.copy_from_slice(&host(self.ask(points, false).distance));
        }
    }

    fn normals(&self, points: &[Vec3], _step: f32) -> Vec<Vec3> {
        let chunks = points.chunks(CHUNK);
        chunks.flat_map(|points| self.with_gradients(points).1.into_iter().map(Vec3::normalize_or_zero)).collect()
    }
}

/// An avatar that plays: frame after frame from poses and its own heights.
pub struct Playback<'a> {
    body: &'a AvatarBody,
    network: &'a AvatarNetwork,
    conditioning: Conditioning,
    /// Of the last frames, the newest last.
    heights: VecDeque<Vec<f32>>,
    /// Features of face, hands and feet in the first frame.
    first: Option<Tensor<2>>,
}

impl<'a> Playback<'a> {
    /// Starts from the heights of the frames before, the newest last; networks that see none ignore them. `network` is
    /// without autodiff.
    ///
    /// # Errors
    /// Fewer frames of heights than the network sees.
    pub fn new(
        body: &'a AvatarBody,
        network: &'a AvatarNetwork,
        conditioning: Conditioning,
        heights: &[Vec<f32>],
    ) -> Result<Self> {
        let history = body.config.history;
        let missing = conditioning.sees_heights() && heights.len() < history;
        if missing || heights.iter().any(|h| h.len() != body.observers.len()) {
            return Err(AvatarError::Data(format!(
                "{} frames of heights were given; a prediction stands on {history} of {} observers each",
                heights.len(),
                body.observers.len()
            )));
        }
        let heights = heights[heights.len().saturating_sub(history)..].iter().cloned().collect();
        Ok(Self { body, network, conditioning, heights, first: None })
    }

    /// The surface of frame `t` of a motion, whose observers are given; its heights become part of the state.
    pub fn step<'b>(&'b mut self, track: &PoseTrack, t: usize, observers: &'b ObserverFrame) -> AvatarField<'b> {
        let heights: Vec<&[f32]> = self.heights.iter().map(Vec::as_slice).collect();
        let input = self.body.input(self.conditioning, track, t, &heights);
        let features = self.body.features(self.network, &input, &mut self.first);
        let field = AvatarField::new(self.body, self.network, features, observers);
        if self.conditioning.sees_heights() {
            self.heights.push_back(field.heights().to_vec());
            while self.heights.len() > self.body.config.history {
                self.heights.pop_front();
            }
        }
        field
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::checks::{ball, breathing, shaken};
    use softtissue_random::Draws;

    /// Observers of the ball that stand for a face.
    const STILL: usize = 20;

    /// Dynamic features of a rollout's first frame and of a later one.
    fn first_and_later(frozen: bool) -> [Vec<f32>; 2] {
        let device = Device::flex();
        let mut body = ball(&device);
        body.config.frozen = frozen;
        body.still[..STILL].fill(true);
        let column = body.still.iter().map(|still| if *still { 1.0 } else { 0.0 }).collect();
        body.frozen = tensor(column, [body.still.len(), 1], &device);
        let conditioning = Conditioning::Autoregressive;
        let mut draws = Draws::new(1, "network", 0, 0);
        let network = AvatarNetwork::new(&body.config, conditioning, 3, 64, &mut draws, &device);
        let network = shaken(network, 0.1, 3);
        let clip = breathing(9, 0.0);
        let mut play = Playback::new(&body, &network, conditioning, clip.history(3, 3)).expect("a history");
        let features: Vec<Vec<f32>> =
            (3..9).map(|t| host(play.step(&clip.track, t, &clip.observers[t]).features)).collect();
        [features[0].clone(), features[5].clone()]
    }

    #[test]
    fn face_hands_and_feet_keep_the_first_frames_features() {
        for frozen in [true, false] {
            let [first, later] = first_and_later(frozen);
            let of_still = STILL * first.len() / 64;
            assert_eq!(first[..of_still] == later[..of_still], frozen);
            assert!(first[of_still..].iter().zip(&later[of_still..]).any(|(a, b)| (a - b).abs() > 1e-4));
        }
    }
}
