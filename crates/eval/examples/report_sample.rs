//! Writes a sample report about a toy figure: `cargo run -p softtissue-eval --example report_sample -- FOLDER`.
//! Its clips, methods and figures are all measured on the toy; they say nothing about the real models.

#[path = "../tests/figure/mod.rs"]
mod figure;

use figure::{OnBody, Oscillator, World, body, motion, truth};
use softtissue_clips::MotionClip;
use softtissue_eval::report::{ReportInput, StageTime, TrainingCurve, write};
use softtissue_eval::viewer::playback;
use softtissue_eval::{
    Codec, CodecPair, LongRollout, Method, MethodError, StopProbe, Tally, acceptance, curves, judge, judge_bounded,
    judge_fit, judge_shapes, judge_stops, judge_subspace, training_peaks,
};
use softtissue_geometry::Frames;
use softtissue_monitor::Silent;
use std::path::PathBuf;
use std::time::Instant;

/// Loses a share of every displacement.
struct Lossy(f32);

impl Codec for Lossy {
    fn reconstruct(&self, _: &str, deltas: &Frames) -> Result<Frames, MethodError> {
        let mut out = deltas.clone();
        out.points_mut().iter_mut().for_each(|p| *p *= 1.0 - self.0);
        Ok(out)
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = PathBuf::from(std::env::args().nth(1).ok_or("name a folder to write into")?);
    let mut stages = Vec::new();
    let mut lap = Instant::now();
    let mut stage = |name: &str| {
        stages.push(StageTime { name: name.into(), seconds: lap.elapsed().as_secs_f64() });
        lap = Instant::now();
    };
    let motions: Vec<MotionClip> = [("s01", 1.6), ("s02", 2.1)]
        .into_iter()
        .flat_map(|(s, hz)| [motion(s, "one_leg_jump", hz, 150, 100), motion(s, "running_on_spot", hz * 1.3, 150, 150)])
        .collect();
    let w = World::make(&folder.join("data"), body(44, 38), &motions);
    stage("make the toy");
    let on = |name, hz, damping_ratio, gain| OnBody(&w.body, Oscillator { name, hz, damping_ratio, gain });
    let ladder = [
        on("mean", 14.0, 0.9, 0.4),
        on("ridge", 9.0, 0.8, 1.2),
        on("ar2-pooled", 3.6, 0.30, 0.7),
        on("ar2-subject", 3.4, 0.22, 0.8),
        on("resonators", 3.2, 0.18, 0.9),
        on("softtissue", 3.08, 0.17, 0.97),
    ];
    let methods: Vec<&dyn Method> = ladder.iter().map(|m| m as &dyn Method).collect();
    let mut tally = Tally::default();
    judge(&mut tally, &w.scene(), &methods, &w.clips, None, &Silent)?;
    let mut metrics = tally.metrics("held-out", 1);
    stage("judge");
    let stop_motion = motion("s01", "hop_then_stand", 1.6, 230, 100);
    let real = truth().deltas(&w.body, &stop_motion);
    let probe = StopProbe { beta: vec![0.5], motion: stop_motion, stop_frame: 103, truth: Some(real) };
    let decays = judge_stops(&mut metrics, &w.body, &methods, &[probe], &Silent)?;
    let training = training_peaks(&w.scene(), &w.clips)?;
    let long = LongRollout { subject: &w.clips[0], motions: &motions[..2], seconds: 20.0, training: &training };
    judge_bounded(&mut metrics, &w.scene(), &methods, &long, &Silent)?;
    let shapes = [-2.5, -1.5, -0.5, 0.5];
    judge_shapes(&mut metrics, &w.body, &methods, &[0.5], &motions[0], &shapes, &Silent)?;
    stage("rest, decay, bounds");
    let codecs = [(25, Lossy(0.30), Lossy(0.25)), (50, Lossy(0.20), Lossy(0.18)), (100, Lossy(0.12), Lossy(0.13))];
    let pairs: Vec<CodecPair> = codecs
        .iter()
        .map(|(latent, pca, ae)| CodecPair { latent: *latent, pca, autoencoder: Some(ae), residual_kept: Some(true) })
        .collect();
    let table = judge_subspace(&w.scene(), &pairs, &w.clips, &Silent)?;
    metrics.over_time = curves(&tally, &table, &["body", "ar2-subject", "softtissue"], |id| id.subject == "s01");
    (metrics.subspace, metrics.subspace_by_subject) = (table.pooled, table.by_subject);
    metrics.fit = judge_fit(&w.scene(), &w.clips, &Silent)?;
    metrics.gates = acceptance(&metrics);
    let clips = w.clips[..2].iter().map(|id| playback(&w.scene(), &ladder[5], id)).collect::<Result<Vec<_>, _>>()?;
    stage("fit, subspace, playback");
    let loss = |name: &str, floor: f64| TrainingCurve {
        stage: "toy".into(),
        name: name.into(),
        points: (0..60).map(|i| [f64::from(i) * 20.0, floor + (-f64::from(i) / 12.0).exp()]).collect(),
    };
    metrics.write(&folder.join("metrics.json"))?;
    let page = folder.join("report/index.html");
    write(
        &ReportInput {
            title: "A toy with a belly",
            metrics: &metrics,
            tally: Some(&tally),
            decays: &decays,
            facts: &[("Body", "a pear of revolution"), ("Flesh", "one oscillator a region")]
                .map(|(a, b)| (a.into(), b.into())),
            stages: &stages,
            training: &[loss("training", 0.1), loss("validation", 0.2)],
            body: &w.body,
            playback: &clips,
        },
        &page,
    )?;
    println!("{}", page.display());
    Ok(())
}
