//! Times a training step at the sizes of `quick`: `cargo run --release -p softtissue-train --example step_time`.

use softtissue_model::{Autoencoder, AutoencoderConfig, ShortcutStart};
use softtissue_random::Draws;
use softtissue_train::{
    Clips, DeltaFrames, DeltaSurface, MotionSequence, RegressorTrainee, RegressorTraining, Result, Stage,
    SubspaceTrainee, SubspaceTraining, Trainee, device,
};
use std::sync::Arc;
use std::time::Instant;

const COMPONENTS: usize = 256;
const LATENTS: usize = 100;
const INPUTS: usize = 90;
const STEPS: u64 = 20;

fn main() -> Result<()> {
    let stage = Stage { name: "timing".into(), seed: 1, device: device::parse("flex")? };
    for (vertices, normal_weight) in [(1724, 1000.0), (1724, 0.0), (6890, 1000.0)] {
        let config = SubspaceTraining { normal_weight, ..SubspaceTraining::default() };
        let frames = Clips { train: frames(2000), validation: frames(100) };
        let mut trainee = SubspaceTrainee::new(config, &stage, LATENTS, surface(vertices), frames)?;
        report(&format!("autoencoder, {vertices} vertices, normal weight {normal_weight}"), &mut trainee)?;
    }
    let mut draws = Draws::new(1, "timing", 0, 0);
    let network = AutoencoderConfig::default();
    let subspace = Autoencoder::new(&network, COMPONENTS, LATENTS, 0.1, &mut draws, &stage.device);
    for frames in [150, 210] {
        let clips = Clips { train: (0..20).map(|_| sequence(frames)).collect(), validation: vec![sequence(frames)] };
        let directions = surface(1724).directions;
        let config = RegressorTraining::default();
        let shortcut = ShortcutStart { weight: numbers(INPUTS * LATENTS, 0.01), bias: vec![0.0; LATENTS] };
        let mut trainee = RegressorTrainee::new(config, &stage, &subspace, &directions, shortcut, clips)?;
        report(&format!("regressor, 10 clips of {frames} frames"), &mut trainee)?;
    }
    Ok(())
}

fn report(what: &str, trainee: &mut dyn Trainee) -> Result<()> {
    (0..3).try_for_each(|step| trainee.step(step).map(drop))?;
    let mut times = Vec::new();
    for step in 3..3 + STEPS {
        let start = Instant::now();
        trainee.step(step)?;
        times.push(start.elapsed().as_secs_f64() * 1000.0);
    }
    times.sort_by(f64::total_cmp);
    println!("{what}: median {:.1} ms, least {:.1} ms a step", times[times.len() / 2], times[0]);
    Ok(())
}

/// Any numbers of the right size: time does not depend on them.
fn numbers(count: usize, size: f32) -> Vec<f32> {
    (0..count).map(|i| size * ((i * 7919) as f32 * 0.37).sin()).collect()
}

fn surface(vertices: usize) -> DeltaSurface {
    let face = |f: usize| [f % vertices, (f + 1) % vertices, (f + 41) % vertices].map(|i| i as u32);
    DeltaSurface {
        rest: vec![numbers(vertices * 3, 1.0)],
        mean: numbers(vertices * 3, 0.01),
        directions: numbers(COMPONENTS * vertices * 3, 0.02),
        faces: Arc::new((0..2 * vertices - 4).map(face).collect()),
    }
}

fn frames(count: usize) -> DeltaFrames {
    DeltaFrames { coefficients: numbers(count * COMPONENTS, 0.1), subjects: vec![0; count] }
}

fn sequence(frames: usize) -> MotionSequence {
    MotionSequence {
        input: numbers(frames * INPUTS, 1.0),
        input_width: INPUTS,
        target: numbers(frames * COMPONENTS, 0.1),
        amplitude: 1.0,
    }
}
