//! Times a bundle in every precision on one core, beside a read of the same bytes; then levels of detail and batches.
//!
//! ```text
//! cargo run --release -p softtissue-bundle --example speed -- runs/quick/bundle
//! ```

use glam::Vec3;
use softtissue_body::{Pose, Region};
use softtissue_bundle::{Batch, Bundle, Detail, Player, Precision, PrecisionLoss, StepPart};
use softtissue_geometry::Frames;
use std::error::Error;
use std::hint::black_box;
use std::path::Path;
use std::time::Instant;

/// Frames of the motion, played [`ROUNDS`] times.
const FRAMES: usize = 300;
const ROUNDS: usize = 2;
/// Bytes that put everything else out of the caches.
const BETWEEN: usize = 96 << 20;
/// Frames that are timed with all of the caches emptied before each.
const COLD: usize = 30;
const SHAPE: [f32; 2] = [0.3, -2.0];

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::args().nth(1).ok_or("name the folder of a bundle in f32")?;
    let whole = Bundle::read(Path::new(&folder))?;
    let (rotations, translations) = motion(whole.body.joint_count());
    println!(
        "{} vertices, {} frames; milliseconds, median (fastest tenth)",
        whole.body.vertex_count(),
        FRAMES * ROUNDS
    );
    for precision in Precision::ALL {
        let bundle = match whole.reduced(precision) {
            Ok(bundle) => bundle,
            Err(reason) => {
                println!("{}: {reason}", precision.name());
                continue;
            }
        };
        frames(&bundle, &rotations, &translations)?;
        let mut loss = PrecisionLoss::default();
        loss.add(&whole, &bundle, &SHAPE, &rotations, &translations)?;
        println!("  loss on soft vertices: mean {:.4} mm, at most {:.4} mm", loss.mean_mm(), loss.max_mm());
        if bundle.model.basis().is_some() {
            details(&bundle, &rotations, &translations)?;
        }
        batches(&bundle, &rotations, &translations)?;
    }
    Ok(())
}

/// Somebody who swings arms, legs and trunk and hops.
fn motion(joints: usize) -> (Frames, Vec<Vec3>) {
    let (mut rotations, mut translations) = (Frames::new(joints), vec![]);
    for frame in 0..FRAMES {
        let phase = 0.16 * frame as f32;
        let joint = |j: usize| {
            let lag = 0.8 * (j as f32).sin();
            Vec3::new(0.35 * (phase + lag).sin(), 0.15 * (phase - lag).cos(), 0.2 * (phase + 2.0 * lag).sin())
        };
        rotations.push(&(0..joints).map(joint).collect::<Vec<Vec3>>());
        translations.push(Vec3::new(0.1 * phase.sin(), 0.9 + 0.15 * (0.6 * phase).sin().abs(), 0.0));
    }
    (rotations, translations)
}

/// The parts of a frame and the whole, warm and cold, beside the reads.
fn frames(bundle: &Bundle, rotations: &Frames, translations: &[Vec3]) -> Result<(), Box<dyn Error>> {
    let mut player = Player::new(bundle, &SHAPE)?;
    let bytes = vec![1u64; player.weight_bytes() / 8];
    let between = vec![1u64; BETWEEN / 8];
    let pose = |t: usize| Pose { rotations: rotations.frame(t), translation: translations[t] };
    let (mut parts, mut whole, mut reads) = (vec![vec![]; StepPart::ALL.len()], vec![], vec![]);
    for t in 0..FRAMES * ROUNDS {
        let (_, times) = player.timed_step(pose(t % FRAMES));
        for (part, list) in StepPart::ALL.into_iter().zip(&mut parts) {
            list.extend(times.part(part).map(|time| 1e3 * time.as_secs_f64()));
        }
        whole.push(1e3 * times.whole.as_secs_f64());
    }
    (0..FRAMES).for_each(|_| reads.push(timed(|| sum(&bytes))));
    let (mut cold, mut cold_reads) = (vec![], vec![]);
    for t in 0..COLD {
        sum(&between);
        cold.push(1e3 * player.timed_step(pose(t)).1.whole.as_secs_f64());
        sum(&between);
        cold_reads.push(timed(|| sum(&bytes)));
    }
    println!("{}: {:.1} MB of weights a frame", bundle.model.precision().name(), player.weight_bytes() as f64 / 1e6);
    for (part, list) in StepPart::ALL.into_iter().zip(parts) {
        if !list.is_empty() {
            println!("  {:12} {}", part.name(), spread(list));
        }
    }
    println!("  whole frame  {}; reading the bytes once {}", spread(whole), spread(reads));
    println!("  out of cache {}; reading the bytes once {}", spread(cold), spread(cold_reads));
    Ok(())
}

fn details(bundle: &Bundle, rotations: &Frames, translations: &[Vec3]) -> Result<(), Box<dyn Error>> {
    let all = bundle.model.basis().map_or(0, |b| b.directions.rows());
    let stiff: Vec<Region> = Region::ALL.into_iter().filter(|r| !r.is_soft()).collect();
    let details = [
        Detail { components: Some(all / 3), ..Default::default() },
        Detail { components: Some(all / 10), ..Default::default() },
        Detail { components: None, still: stiff.clone() },
        Detail { components: Some(all / 3), still: stiff },
    ];
    let expected = Player::new(bundle, &SHAPE)?.rollout(rotations, translations)?;
    let soft = bundle.body.regions.soft();
    for detail in details {
        let mut player = Player::new(bundle, &SHAPE)?;
        player.set_detail(&detail)?;
        let (mut sum, mut size) = (0.0, 0.0);
        player.play(rotations, translations, |t, player| {
            for v in soft.iter().map(|v| *v as usize) {
                sum += f64::from(player.deltas()[v].distance(expected.frame(t)[v]));
                size += f64::from(expected.frame(t)[v].length());
            }
            Ok(())
        })?;
        let mut times = vec![];
        for (t, root) in translations.iter().enumerate() {
            let (_, time) = player.timed_step(Pose { rotations: rotations.frame(t), translation: *root });
            times.push(1e3 * time.whole.as_secs_f64());
        }
        let (still, components) = (detail.still.len(), detail.components.unwrap_or(all));
        let per_vertex = 1e3 / (FRAMES * soft.len()).max(1) as f64;
        println!(
            "  detail: {components} components, {still} regions still: {}; {:.3} mm off on soft vertices that move {:.3} mm",
            spread(times),
            sum * per_vertex,
            size * per_vertex
        );
    }
    Ok(())
}

fn batches(bundle: &Bundle, rotations: &Frames, translations: &[Vec3]) -> Result<(), Box<dyn Error>> {
    for count in [1, 16, 100] {
        for threads in [1, 2] {
            let mut batch = Batch::new(bundle, &vec![&SHAPE[..]; count], threads)?;
            let mut times = vec![];
            for t in 0..(600 / count).clamp(12, 100) {
                let pose = |i: usize| {
                    let t = (t + 13 * i) % FRAMES;
                    Pose { rotations: rotations.frame(t), translation: translations[t] }
                };
                let poses: Vec<Pose> = (0..count).map(pose).collect();
                let begun = Instant::now();
                batch.step(&poses)?;
                times.push(1e3 * begun.elapsed().as_secs_f64() / count as f64);
            }
            println!("  batch of {count:3}, {threads} threads, a character: {}", spread(times));
        }
    }
    Ok(())
}

/// A read of all numbers, in the registers that the player takes.
fn sum(numbers: &[u64]) -> u64 {
    black_box(pulp::Arch::new().dispatch(Sum(numbers)))
}

struct Sum<'a>(&'a [u64]);

impl pulp::NullaryFnOnce for Sum<'_> {
    type Output = u64;
    #[inline(always)]
    fn call(self) -> u64 {
        let mut lanes = [0u64; 64];
        let (blocks, rest) = self.0.as_chunks::<64>();
        for block in blocks {
            for i in 0..64 {
                lanes[i] = lanes[i].wrapping_add(block[i]);
            }
        }
        lanes.iter().chain(rest).fold(0, |s, x| s.wrapping_add(*x))
    }
}

fn timed(work: impl FnOnce() -> u64) -> f64 {
    let begun = Instant::now();
    black_box(work());
    1e3 * begun.elapsed().as_secs_f64()
}

/// Median and fastest tenth.
fn spread(mut times: Vec<f64>) -> String {
    times.sort_unstable_by(f64::total_cmp);
    format!("{:.3} ({:.3})", times[times.len() / 2], times[times.len() / 10])
}
