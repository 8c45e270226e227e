use crate::judge::rollout;
use crate::measures::{RegionPeaks, fit_decay, looped, region_mean, rest_ratio};
use crate::tally::MOVING;
use crate::{DecayFigures, DecayMetrics, EvalError, Method, MethodMetrics, Metrics, Result, Scene};
use softtissue_body::{BodyModel, Region};
use softtissue_clips::{ClipId, MotionClip};
use softtissue_geometry::Frames;
use softtissue_monitor::Monitor;
use std::collections::BTreeMap;

/// A motion that ends in standing still, with the truth's flesh where it is known.
#[derive(Clone, Debug)]
pub struct StopProbe {
    /// Shape.
    pub beta: Vec<f32>,
    /// The motion, its subject in its name; at least 2 s of stillness at its end.
    pub motion: MotionClip,
    /// First frame of the stillness.
    pub stop_frame: usize,
    /// True deltas `[T, V, 3]`, metres.
    pub truth: Option<Frames>,
}

/// A region's motion after the stop, for the report: `[T]` displacement in mm along its main axis.
#[derive(Clone, Debug, PartialEq)]
pub struct DecayTrace {
    /// Who.
    pub subject: String,
    /// Which region.
    pub region: Region,
    /// Frames a second.
    pub fps: f32,
    /// By method; the truth's under `truth`.
    pub curves: BTreeMap<String, Vec<f32>>,
}

/// The truth's fit must explain this share of the variance to count as a damped sinusoid at all.
const RINGING: f64 = 0.9;
/// Least rms of a region's mean over the stillness that is worth a fit, metres: some 2 mm when it begins. What moves
/// less has no swing of its own but follows its neighbours'.
const AUDIBLE_M: f64 = 5e-4;

/// Runs the stop probes: rest after 2 s, and free decay against the truth's. Fills `metrics`, returns curves.
pub fn judge_stops(
    metrics: &mut Metrics,
    body: &BodyModel,
    methods: &[&dyn Method],
    probes: &[StopProbe],
    monitor: &dyn Monitor,
) -> Result<Vec<DecayTrace>> {
    monitor.begin("judge rest and decay", probes.len() as u64, "probes");
    let mut traces = Vec::new();
    let soft = body.regions.soft();
    for probe in probes {
        if monitor.should_stop() {
            return Err(EvalError::Stopped);
        }
        let id = &probe.motion.id;
        let mut predictions = BTreeMap::new();
        for method in methods {
            let p = rollout(*method, id, &probe.beta, &probe.motion, probe.motion.len(), body.vertex_count())?;
            let rest = rest_ratio(&p, &soft, probe.motion.fps, probe.stop_frame);
            let entry = metrics.methods.entry(method.name().to_owned()).or_default();
            match p.points().iter().all(|x| x.is_finite()) {
                true => entry.rest_ratio = greater(entry.rest_ratio, rest),
                false => entry.diverged_clips = Some(entry.diverged_clips.unwrap_or(0) + 1),
            }
            predictions.insert(method.name().to_owned(), p);
        }
        if let Some(truth) = &probe.truth {
            crate::judge::check_size(id, "the true deltas", truth, probe.motion.len(), body.vertex_count())?;
            let rest = rest_ratio(truth, &soft, probe.motion.fps, probe.stop_frame);
            metrics.rest_truth = greater(metrics.rest_truth, rest);
            traces.extend(decays(metrics, body, probe, truth, &predictions));
        }
        monitor.advance(1, &id.to_string());
    }
    monitor.end();
    Ok(traces)
}

fn decays(
    metrics: &mut Metrics,
    body: &BodyModel,
    probe: &StopProbe,
    truth: &Frames,
    predictions: &BTreeMap<String, Frames>,
) -> Vec<DecayTrace> {
    let fps = f64::from(probe.motion.fps);
    let mut traces = Vec::new();
    for region in MOVING {
        let vertices = body.regions.vertices(region);
        let after_stop = |deltas: &Frames| region_mean(deltas, &vertices).split_off(probe.stop_frame);
        let true_mean = after_stop(truth);
        let Some(fit) = fit_decay(&true_mean, fps).filter(|f| f.explained >= RINGING && f.rms_m >= AUDIBLE_M) else {
            continue;
        };
        let axis = main_axis(&true_mean);
        let project = |mean: &[glam::DVec3]| mean.iter().map(|x| (x.dot(axis) * 1e3) as f32).collect::<Vec<f32>>();
        let mut curves: BTreeMap<String, Vec<f32>> = [("truth".to_owned(), project(&true_mean))].into();
        let mut figures = BTreeMap::new();
        for (name, deltas) in predictions {
            let mean = after_stop(deltas);
            curves.insert(name.clone(), project(&mean));
            let own = fit_decay(&mean, fps).filter(|f| f.rms_m >= 0.1 * AUDIBLE_M);
            let entry = metrics.methods.entry(name.clone()).or_default();
            match own {
                Some(own) => {
                    entry.decay_hz_error = greater(entry.decay_hz_error, Some((own.hz - fit.hz).abs()));
                    let damping = (own.damping_ratio - fit.damping_ratio).abs();
                    entry.decay_damping_error = greater(entry.decay_damping_error, Some(damping));
                    figures.insert(name.clone(), DecayFigures::from(own));
                }
                None => entry.decay_missing = Some(entry.decay_missing.unwrap_or(0) + 1),
            }
        }
        let subject = probe.motion.id.subject.clone();
        metrics.decays.push(DecayMetrics {
            subject: subject.clone(),
            region: region.name().to_owned(),
            truth: fit.into(),
            methods: figures,
        });
        traces.push(DecayTrace { subject, region, fps: probe.motion.fps, curves });
    }
    traces
}

impl From<crate::measures::Decay> for DecayFigures {
    fn from(d: crate::measures::Decay) -> Self {
        Self { hz: d.hz, damping_ratio: d.damping_ratio, explained: d.explained }
    }
}

/// Direction of greatest variance round the last value, by power iteration.
fn main_axis(signal: &[glam::DVec3]) -> glam::DVec3 {
    let mean = signal.iter().sum::<glam::DVec3>() / signal.len().max(1) as f64;
    let mut axis = glam::DVec3::new(0.3, 0.8, 0.5);
    for _ in 0..64 {
        let next: glam::DVec3 = signal.iter().map(|x| (*x - mean) * (*x - mean).dot(axis)).sum();
        axis = next.try_normalize().unwrap_or(glam::DVec3::Y);
    }
    axis
}

fn greater(a: Option<f64>, b: Option<f64>) -> Option<f64> {
    match (a, b) {
        (Some(a), Some(b)) => Some(a.max(b)),
        (a, b) => a.or(b),
    }
}

/// The greatest rms that each region reaches in the scan deltas of the training clips.
pub fn training_peaks(scene: &Scene, training: &[ClipId]) -> Result<RegionPeaks> {
    let mut peaks = RegionPeaks::default();
    for id in training {
        peaks = peaks.max(&RegionPeaks::of(&scene.fit.deltas(id)?.deltas, &scene.body.regions));
    }
    Ok(peaks)
}

/// A rollout long enough to show whether energy gathers.
pub struct LongRollout<'a> {
    /// A clip of the subject whose shape it runs with.
    pub subject: &'a ClipId,
    /// The motions to run in turn, see [`looped`].
    pub motions: &'a [MotionClip],
    /// How long; 600 is the gate's.
    pub seconds: f32,
    /// What training reached, see [`training_peaks`].
    pub training: &'a RegionPeaks,
}

/// The long rollout: the greatest regional rms against the training's. Fills `metrics`. A method that streams
/// ([`Method::rollout_each`]) needs no memory for it; another keeps the whole rollout.
pub fn judge_bounded(
    metrics: &mut Metrics,
    scene: &Scene,
    methods: &[&dyn Method],
    long: &LongRollout,
    monitor: &dyn Monitor,
) -> Result<()> {
    if long.motions.is_empty() {
        return Err(EvalError::Refused("no motion to loop for the long rollout; name at least one clip".into()));
    }
    let (subject, seconds) = (long.subject, long.seconds);
    let mut motion = looped(long.motions, seconds);
    motion.id = subject.clone();
    let beta = scene.beta(subject)?;
    monitor.begin("long rollout", methods.len() as u64, "methods");
    for method in methods {
        if monitor.should_stop() {
            return Err(EvalError::Stopped);
        }
        let mut peaks = RegionPeaks::default();
        method
            .rollout_each(&subject.subject, &beta, &motion, &mut |frame| peaks.include(frame, &scene.body.regions))
            .map_err(|source| EvalError::Method { method: method.name().to_owned(), clip: subject.clone(), source })?;
        let entry: &mut MethodMetrics = metrics.methods.entry(method.name().to_owned()).or_default();
        match peaks.worst_ratio(long.training) {
            Some((_, ratio)) if ratio.is_finite() => {
                entry.bounded_ratio = greater(entry.bounded_ratio, Some(ratio));
                entry.bounded_seconds = Some(f64::from(seconds));
            }
            Some(_) => entry.diverged_clips = Some(entry.diverged_clips.unwrap_or(0) + 1),
            None => {}
        }
        monitor.advance(1, method.name());
    }
    monitor.end();
    Ok(())
}
