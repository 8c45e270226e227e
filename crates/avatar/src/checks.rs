//! What tests share.

use crate::avatar::AvatarBody;
use crate::clip::AvatarClip;
use crate::features::PoseTrack;
use crate::network::Ground;
use crate::rows::WeightedRows;
use crate::trainee::AvatarTrainee;
use crate::{AvatarNetwork, Conditioning, LossWeights, NetworkConfig, StageConfig};
use burn::module::Module;
use burn::tensor::{Device, Tensor};
use glam::Vec3;
use softtissue_clips::{ClipId, MotionClip, RawFrame};
use softtissue_geometry::Frames;
use softtissue_implicit::{
    HeightConfig, Interpolation, ObserverFrame, Observers, RawSurface, RawSurfaceConfig, SampleConfig,
};
use softtissue_random::Draws;
use softtissue_train::{Clips, GradientMap, Stage, State, load_module, module_gradients, module_state};
use std::sync::Arc;

/// A module with every parameter drawn anew, so that none is zero.
pub fn shaken<M: Module>(module: M, size: f64, seed: u64) -> M {
    let mut state = state_of(&module);
    for (name, array) in &mut state {
        let mut draws = Draws::new(seed, name, 0, 0);
        array.data.iter_mut().for_each(|x| *x = (size * draws.normal()) as f32);
    }
    load_module(module, &state).expect("its own state")
}

fn state_of<M: Module>(module: &M) -> State {
    module_state(module).into_iter().map(|a| (a.name.clone(), a)).collect()
}

/// Holds a module's gradients against differences of its loss, array by array along the gradient itself.
pub fn check_gradients<M: Module>(module: &M, loss: impl Fn(&M) -> Tensor<1>, step: f64, tolerance: f64) {
    let mut found = loss(module).backward();
    let gradients: GradientMap = module_gradients(module, &mut found);
    let state = state_of(module);
    assert_eq!(gradients.len(), state.len(), "every parameter has a gradient: {:?}", gradients.keys());
    let value = |module: &M| f64::from(softtissue_model::host(loss(module))[0]);
    for (name, gradient) in &gradients {
        let length = gradient.iter().map(|g| f64::from(*g).powi(2)).sum::<f64>().sqrt();
        assert!(length > 0.0, "{name} has no gradient");
        let moved = |by: f64| {
            let mut state = state.clone();
            let array = state.get_mut(name).expect("a parameter");
            array.data.iter_mut().zip(gradient).for_each(|(x, g)| *x += (by * f64::from(*g) / length) as f32);
            value(&load_module(module.clone(), &state).expect("its own state"))
        };
        let difference = (moved(step) - moved(-step)) / (2.0 * step);
        let error = (difference - length).abs();
        assert!(error < tolerance * length.max(1e-3), "{name}: gradient {length}, differences {difference}");
    }
}

/// Directions spread evenly over a sphere (Fibonacci).
pub fn directions(count: usize) -> Vec<Vec3> {
    let golden = std::f32::consts::PI * (5.0f32.sqrt() - 1.0);
    let each = |i: usize| {
        let y = 1.0 - 2.0 * (i as f32 + 0.5) / count as f32;
        let (sin, cos) = (golden * i as f32).sin_cos();
        let r = (1.0 - y * y).sqrt();
        Vec3::new(r * cos, y, r * sin)
    };
    (0..count).map(each).collect()
}

/// A ball of 0.2 m in the place of a body: 64 observers with a texel each, three joints.
pub fn ball(device: &Device) -> AvatarBody {
    let config = NetworkConfig {
        observers: 64,
        atlas: 8,
        channels: vec![4, 6],
        latents: 4,
        decoder: 8,
        neighbours: 4,
        compressed: 3,
        ..NetworkConfig::default()
    };
    let rows: Vec<u32> = (0..64).collect();
    let once = WeightedRows::new(&rows, &[1.0; 64], 1, device);
    let ground = Ground {
        localisation: crate::layer::tensor(vec![0.5; 64 * 2], [64, 2], device),
        scatter: once.clone(),
        gather: once,
        means: Interpolation::from_rows(64, (0..64).map(|i| vec![((i + 1) % 64, 1.0)]).collect()),
    };
    AvatarBody::from_parts(config, Observers::all(64), 3, HeightConfig::default(), ground, vec![false; 64], device)
}

/// A scan of the ball with a radius that goes up and down by a centimetre, slower than its pose can tell.
pub fn breathing(frames: usize, phase: f32) -> AvatarClip {
    let directions_of_scan = directions(400);
    let observers =
        ObserverFrame { positions: directions(64).into_iter().map(|d| 0.2 * d).collect(), normals: directions(64) };
    let radius = |t: usize| 0.215 + 0.01 * (0.4 * t as f32 + phase).sin();
    let scan = |t: usize| {
        let points = directions_of_scan.iter().map(|d| radius(t) * *d).collect();
        let frame = RawFrame { points, normals: directions_of_scan.clone() };
        RawSurface::new(&frame, &RawSurfaceConfig::default()).expect("a scan")
    };
    let motion = MotionClip {
        id: ClipId::new("ball", "breathing", 0),
        fps: 60.0,
        rotations: Frames::zeros(3, frames),
        translations: vec![Vec3::ZERO; frames],
    };
    AvatarClip {
        id: motion.id.clone(),
        track: PoseTrack::new(&motion),
        observers: vec![observers; frames],
        heights: (0..frames).map(|t| vec![radius(t) - 0.2; 64]).collect(),
        known: vec![vec![true; 64]; frames],
        scans: (0..frames).map(|t| Some(scan(t))).collect(),
        frames: 0..frames,
    }
}

/// A stage with few points a frame and a learning rate for few steps.
pub fn short(whole: StageConfig, steps: u64) -> StageConfig {
    let sampling = SampleConfig { surface: 60, near: 40, within: 20, ..whole.sampling };
    StageConfig { steps, learning_rate: 3e-3, sampling, ..whole }
}

/// A trainee of one stage on half a second of breathing; it begins with `network`, or with an untrained one.
pub fn trainee(
    body: &Arc<AvatarBody>,
    conditioning: Conditioning,
    config: &StageConfig,
    network: Option<AvatarNetwork>,
    device: &Device,
) -> AvatarTrainee {
    let clips = Arc::new(Clips { train: vec![breathing(30, 0.0)], validation: vec![breathing(30, 1.7)] });
    let stage = Stage { name: "autoavatar/test".into(), seed: 1, device: device.clone() };
    let network = network.unwrap_or_else(|| AvatarTrainee::untrained(body, conditioning, &stage));
    AvatarTrainee::new(config, &LossWeights::default(), conditioning, stage, Arc::clone(body), network, clips)
        .expect("clips that are long enough")
}
