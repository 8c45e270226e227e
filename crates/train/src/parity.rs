//! One small training on any device, so that backends can be held against each other.

use crate::{
    AdamConfig, Clips, DeltaFrames, DeltaSurface, MotionSequence, RegressorTrainee, RegressorTraining, Result, Stage,
    SubspaceTrainee, SubspaceTraining, Trainee,
};
use burn::tensor::Device;
use softtissue_model::{AutoencoderConfig, RegressorConfig, ShortcutStart};
use softtissue_random::Draws;
use std::sync::Arc;

/// Components, latent numbers, regressor inputs and vertices along a side of the test surface.
const COMPONENTS: usize = 12;
const LATENTS: usize = 4;
const INPUTS: usize = 7;
const SIDE: usize = 6;

/// Twenty steps of the autoencoder, then twenty of the regressor on it, from one seed on synthetic numbers. Returns
/// the losses of all forty steps followed by every weight.
pub fn twenty_steps(device: &Device) -> Result<Vec<f64>> {
    let stage = Stage { name: "parity".into(), seed: 11, device: device.clone() };
    let mut subspace = subspace(&stage)?;
    let mut record = run(&mut subspace)?;
    let directions = surface().directions;
    let autoencoder = subspace.into_network();
    let mut draws = Draws::new(stage.seed, "parity/shortcut", 0, 0);
    let mut weights = |n: usize| (0..n).map(|_| 0.01 * draws.normal() as f32).collect();
    let shortcut = ShortcutStart { weight: weights(INPUTS * LATENTS), bias: weights(LATENTS) };
    let config = RegressorTraining { network: RegressorConfig { width: 8 }, batch: 2, ..RegressorTraining::default() };
    let clips = Clips { train: vec![motion(0, 14), motion(1, 9), motion(2, 11)], validation: vec![motion(3, 10)] };
    let mut regressor = RegressorTrainee::new(config, &stage, &autoencoder, &directions, shortcut, clips)?;
    record.extend(run(&mut regressor)?);
    Ok(record)
}

fn run(trainee: &mut dyn Trainee) -> Result<Vec<f64>> {
    let mut record = Vec::new();
    for step in 0..20 {
        record.push(trainee.step(step)?.loss);
    }
    record.push(trainee.validate()?);
    for array in trainee.state().iter().filter(|a| !a.name.starts_with("adam.")) {
        record.extend(array.data.iter().map(|x| f64::from(*x)));
    }
    Ok(record)
}

/// The autoencoder's trainee on a small bumpy sheet.
pub(crate) fn subspace(stage: &Stage) -> Result<SubspaceTrainee> {
    let config = SubspaceTraining {
        network: AutoencoderConfig { width: 16, units: 2 },
        batch: 8,
        // Adam divides by the gradient's own size: where that is rounding noise, backends may differ by as much as
        // they please. An epsilon above the noise keeps the comparison one of arithmetic.
        adam: AdamConfig { epsilon: 1e-4, ..AdamConfig::default() },
        ..SubspaceTraining::default()
    };
    let frames = Clips { train: frames(0, 40), validation: frames(1, 12) };
    SubspaceTrainee::new(config, stage, LATENTS, surface(), frames)
}

/// A sheet of `SIDE` x `SIDE` vertices with cosines as orthonormal directions, two subjects.
fn surface() -> DeltaSurface {
    let count = SIDE * SIDE;
    let at = |v: usize| ((v % SIDE) as f32, (v / SIDE) as f32);
    let rest = |height: f32| -> Vec<f32> {
        (0..count).flat_map(|v| [0.05 * at(v).0, 0.05 * at(v).1, height * (at(v).0 * at(v).1).sin()]).collect()
    };
    let corner = |x: usize, y: usize| (y * SIDE + x) as u32;
    let faces = (0..SIDE - 1).flat_map(|y| {
        (0..SIDE - 1).flat_map(move |x| {
            let [a, b, c, d] = [corner(x, y), corner(x + 1, y), corner(x + 1, y + 1), corner(x, y + 1)];
            [[a, b, c], [a, c, d]]
        })
    });
    // Cosine transform vectors (type II) are orthonormal up to their length.
    let n = (3 * count) as f32;
    let wave = |k: usize, i: usize| (std::f32::consts::PI / n * (i as f32 + 0.5) * (k + 1) as f32).cos();
    let directions = (0..COMPONENTS).flat_map(|k| (0..3 * count).map(move |i| wave(k, i) * (2.0 / n).sqrt()));
    DeltaSurface {
        rest: vec![rest(0.01), rest(0.02)],
        mean: vec![0.001; 3 * count],
        directions: directions.collect(),
        faces: Arc::new(faces.collect()),
    }
}

/// Frames on a curved surface in coefficient space, so that there is something beyond linear to learn.
fn frames(epoch: u64, count: usize) -> DeltaFrames {
    let mut draws = Draws::new(5, "parity/frames", epoch, 0);
    let coefficients = (0..count).flat_map(|_| {
        let x: Vec<f64> = (0..LATENTS).map(|_| draws.normal()).collect();
        (0..COMPONENTS).map(move |k| coefficient(&x, k)).collect::<Vec<_>>()
    });
    DeltaFrames { coefficients: coefficients.collect(), subjects: (0..count).map(|n| n as u32 % 2).collect() }
}

fn coefficient(x: &[f64], k: usize) -> f32 {
    let value = if k < LATENTS { x[k] } else { x[k % LATENTS] * x[(k + 1) % LATENTS] };
    (0.02 / (k + 1) as f64 * value) as f32
}

fn motion(epoch: u64, frames: usize) -> MotionSequence {
    let mut draws = Draws::new(6, "parity/motion", epoch, 0);
    let input: Vec<f32> = (0..frames * INPUTS).map(|_| draws.normal() as f32).collect();
    let target = input.chunks_exact(INPUTS).flat_map(|row| {
        let x: Vec<f64> = row[..LATENTS].iter().map(|x| f64::from(*x)).collect();
        (0..COMPONENTS).map(|k| coefficient(&x, k)).collect::<Vec<_>>()
    });
    MotionSequence { input_width: INPUTS, target: target.collect(), amplitude: 1.0, input }
}
