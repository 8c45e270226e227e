//! The analytic pose fit against Adam through autodiff, on the same frames, objective and starts:
//!
//! ```text
//! RAYON_NUM_THREADS=1 cargo run --release -p softtissue-train --example fit_against_adam
//! ```
//!
//! A generated clip at 6890 vertices (flesh, scanner noise and drift) is fitted as the pipeline does it, which gives
//! shape, subject template and weights. Then both solvers get the unposed objective without priors and the same start
//! for each frame. What counts is processor time to the first iteration within 1 % of the lowest objective that either
//! reaches, frame by frame: a frame is charged its share of the batch until then, as if it could leave the batch.

use softtissue_body::BodyModel;
use softtissue_clips::{FitSet, ScanClip, Split};
use softtissue_fit::{
    AdamFitConfig, FitConfig, LevenbergMarquardt, Objective, PackedBody, PoseProblem, PoseSolver, StartPoses,
    WeightedBody, fit_set,
};
use softtissue_monitor::{Monitor, Silent};
use softtissue_synth::dataset::{Bodies, SynthConfig, write_with};
use softtissue_train::{AdamFit, AdamPoseFit, device};
use std::sync::{Arc, Mutex, OnceLock};
use std::time::{Duration, Instant};

/// As the command has it: tensors come and go every iteration.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// Frames that are timed; before `FIRST` the person stands.
const FRAMES: usize = 16;
const FIRST: usize = 60;
const RATES: [f64; 3] = [0.01, 0.03, 0.09];
const ITERATIONS: u64 = 600;
const BATCHES: [usize; 4] = [2, 4, 8, 16];
/// Near enough to the lowest objective.
const NEAR: f64 = 1.01;
/// Evaluations a frame that the analytic fit gets at most.
const MOST: usize = 20;

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

fn main() -> Outcome<()> {
    let dir = tempfile::tempdir()?;
    let synth = SynthConfig {
        bmi: vec![27.0],
        motions: vec!["jumping_jacks".into()],
        frames: FIRST + FRAMES,
        level: 1,
        ..SynthConfig::default()
    };
    let bodies = Bodies::generate(&synth)?;
    let body = &bodies.scanned().model;
    let scans = write_with(&synth, &bodies, &dir.path().join("data"), &Silent)?;
    let split = Split { train: scans.ids(), validation: vec![], test: vec![] };
    let fit = fit_set(&scans, &split, body, &FitConfig::default(), &dir.path().join("fit"), &Silent)?;
    let whole = scans.scan(&split.train[0])?;
    let case = Case::new(body, &fit, &whole)?;
    println!(
        "{} vertices, frames {FIRST} to {} of {}, {} threads, processor time",
        body.vertex_count(),
        whole.vertices.len() - 1,
        whole.id,
        rayon::current_num_threads()
    );
    case.pipeline()?;
    case.race()
}

/// One subject's objective and the frames.
struct Case<'a> {
    body: &'a BodyModel,
    shaped: softtissue_body::ShapedBody,
    subject: softtissue_clips::FittedSubject,
    objective: Objective,
    scan: ScanClip,
    starts: StartPoses,
}

impl<'a> Case<'a> {
    fn new(body: &'a BodyModel, fit: &FitSet, whole: &ScanClip) -> Outcome<Self> {
        let subject = fit.subject(&whole.id.subject)?;
        let shaped = body.shaped(&subject.beta);
        let weighted = WeightedBody::new(Arc::new(PackedBody::new(body)), &subject.fit_weight);
        let kind = FitConfig::default().objective;
        let objective = Objective::new(weighted, kind, &shaped, Some(&subject.template));
        let scan = ScanClip { vertices: whole.vertices.slice(FIRST..whole.vertices.len()), ..whole.clone() };
        let starts = objective.start_poses(&scan)?;
        Ok(Self { body, shaped, subject, objective, scan, starts })
    }

    /// The fit as shipped: the first frame from nothing, the others warm-started, with its priors.
    fn pipeline(&self) -> Outcome<()> {
        let config = FitConfig::default();
        let objective = self.objective.clone().with_priors(config.pose_prior, config.smoothness);
        let (template, fit_weight) = (&self.subject.template, &self.subject.fit_weight);
        let problem =
            PoseProblem { body: self.body, shaped: &self.shaped, template, fit_weight, objective: &objective };
        let clock = Clock::start();
        let fitted = LevenbergMarquardt(&config).solve_clip(&problem, &self.scan, &Silent)?;
        let frames = FRAMES as f64;
        println!(
            "as shipped (warm starts, priors): {:.1} frames/s on one core, {:.1} evaluations a frame",
            frames / clock.seconds(),
            fitted.evaluations.iter().sum::<usize>() as f64 / frames
        );
        Ok(())
    }

    fn race(&self) -> Outcome<()> {
        let analytic = self.analytic()?;
        let batch = self.best_batch()?;
        let mut runs = vec![];
        for learning_rate in RATES {
            for final_share in [1.0, 0.0] {
                let config = AdamFitConfig { learning_rate, final_share, iterations: ITERATIONS, batch };
                runs.push((config.clone(), self.adam(&config)?));
            }
        }
        let reached = runs.iter().flat_map(|(_, run)| run.values.iter()).chain(analytic.iter().map(|(v, _)| v));
        let lowest = (0..FRAMES).map(|t| reached.clone().map(|v| v[t]).fold(f64::INFINITY, f64::min));
        let lowest: Vec<f64> = lowest.collect();
        let rms = |v: &[f64]| 1e3 * (v.iter().sum::<f64>() / FRAMES as f64).sqrt();
        println!("start {:.2} mm rms, lowest {:.2} mm rms", rms(&analytic[0].0), rms(&lowest));

        let mut own = (0.0, 0);
        for t in 0..FRAMES {
            let near = analytic.iter().position(|(v, _)| v[t] <= NEAR * lowest[t]);
            let near = near.ok_or("Levenberg-Marquardt came near the lowest objective in no frame")?;
            own = (own.0 + analytic[near].1[t], own.1 + near + 1);
        }
        let count = FRAMES as f64;
        let own_ms = 1e3 * own.0 / count;
        println!("levenberg-marquardt: {own_ms:.1} ms a frame, {:.1} evaluations", own.1 as f64 / count);
        let mut best = f64::INFINITY;
        for (config, run) in &runs {
            let arrivals = (0..FRAMES).map(|t| run.values.iter().position(|v| v[t] <= NEAR * lowest[t]));
            let arrivals: Vec<Option<usize>> = arrivals.collect();
            let there = arrivals.iter().flatten().count();
            let iterations: f64 = arrivals.iter().map(|i| i.map_or(ITERATIONS as f64, |i| i as f64 + 1.0)).sum();
            let ms = 1e3 * run.seconds_an_iteration * iterations / count;
            best = best.min(ms);
            let above = |v: &[f64]| v.iter().zip(&lowest).map(|(v, low)| v / low - 1.0).sum::<f64>() / count;
            let least = run.values.iter().map(|v| above(v)).fold(f64::INFINITY, f64::min);
            println!(
                "adam, rate {} {}: {}{ms:.0} ms a frame, {:.0} iterations, {there} of {FRAMES} frames came there, least {:.1} % above on average",
                config.learning_rate,
                if config.final_share == 1.0 { "kept" } else { "falling to 0" },
                if there < FRAMES { "at least " } else { "" },
                iterations / count,
                100.0 * least,
            );
        }
        println!("adam at its best takes at least {:.1} times as long", best / own_ms);
        Ok(())
    }

    /// For 1, 2, ... evaluations a frame: the objective reached and the time taken, frame by frame.
    fn analytic(&self) -> Outcome<Vec<(Vec<f64>, Vec<f64>)>> {
        let run = |max_iterations| {
            let config = FitConfig { max_iterations, tolerance: 1e-6, least_gain: 0.0, ..FitConfig::default() };
            let times = Laps { clock: Clock::start(), ends: Mutex::new(vec![0.0]) };
            let fitted = self.objective.solve_each(&self.scan, &self.starts, &config, &times)?;
            let ends = times.ends.into_inner()?;
            Ok((fitted.values, ends.windows(2).map(|w| w[1] - w[0]).collect()))
        };
        (1..=MOST).map(run).collect()
    }

    fn reference(&self) -> Outcome<AdamPoseFit> {
        let (template, kind) = (Some(self.subject.template.as_slice()), self.objective.kind());
        let device = device::parse("flex")?;
        Ok(AdamPoseFit::new(self.body, &self.shaped, template, &self.subject.fit_weight, kind, &device))
    }

    /// The batch with the shortest time a frame.
    fn best_batch(&self) -> Outcome<usize> {
        let mut best = (f64::INFINITY, 0);
        for batch in BATCHES {
            let config = AdamFitConfig { iterations: 3, batch, ..AdamFitConfig::default() };
            let fit = self.reference()?;
            self.part(&fit, &config, 0)?;
            let clock = Clock::start();
            self.part(&fit, &config, 0)?;
            let ms = 1e3 * clock.seconds() / (config.iterations as f64 * batch as f64);
            println!("adam, batch {batch}: {ms:.2} ms an iteration and frame");
            if ms < best.0 {
                best = (ms, batch);
            }
        }
        Ok(best.1)
    }

    fn adam(&self, config: &AdamFitConfig) -> Outcome<AdamRun> {
        let fit = self.reference()?;
        let clock = Clock::start();
        let parts = (0..FRAMES).step_by(config.batch).map(|first| self.part(&fit, config, first));
        let parts: Vec<AdamFit> = parts.collect::<Outcome<_>>()?;
        let share = clock.seconds() / (FRAMES as f64 * config.iterations as f64);
        let values = (0..=config.iterations as usize).map(|i| parts.iter().flat_map(|p| p.values[i].clone()).collect());
        Ok(AdamRun { values: values.collect(), seconds_an_iteration: share })
    }

    fn part(&self, fit: &AdamPoseFit, config: &AdamFitConfig, first: usize) -> Outcome<AdamFit> {
        let range = first..(first + config.batch).min(FRAMES);
        let (turns, moves) = (self.starts.rotations.slice(range.clone()), &self.starts.translations[range.clone()]);
        Ok(fit.fit(config, None, &turns, moves, &self.scan.vertices.slice(range), &Silent)?)
    }
}

/// Objective `[iterations + 1][frames]` and a frame's share of an iteration's time.
struct AdamRun {
    values: Vec<Vec<f64>>,
    seconds_an_iteration: f64,
}

/// Notes when each frame is done.
struct Laps {
    clock: Clock,
    ends: Mutex<Vec<f64>>,
}

impl Monitor for Laps {
    fn begin(&self, _: &str, _: u64, _: &'static str) {}
    fn advance(&self, _: u64, _: &str) {
        if let Ok(mut ends) = self.ends.lock() {
            ends.push(self.clock.seconds());
        }
    }
    fn end(&self) {}
    fn say(&self, _: &str) {}
    fn should_stop(&self) -> bool {
        false
    }
}

/// Time that this process's threads have run, so that a busy machine does not distort the figure; where the system
/// does not tell, the time that has passed.
struct Clock(Duration);

impl Clock {
    fn start() -> Self {
        Self(busy())
    }
    fn seconds(&self) -> f64 {
        (busy() - self.0).as_secs_f64()
    }
}

fn busy() -> Duration {
    static START: OnceLock<Instant> = OnceLock::new();
    let of_thread = |task: std::fs::DirEntry| {
        let text = std::fs::read_to_string(task.path().join("schedstat")).ok()?;
        text.split(' ').next()?.parse::<u64>().ok()
    };
    let told: Option<u64> =
        std::fs::read_dir("/proc/self/task").ok().and_then(|tasks| tasks.flatten().map(of_thread).sum());
    told.map_or_else(|| START.get_or_init(Instant::now).elapsed(), Duration::from_nanos)
}
