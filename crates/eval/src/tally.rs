use crate::measures::{
    ErrorSums, REPORTED, STILL_MM_S, Spectrum, lag_s, members, peak_hz, region_mean, spectral_distance, spectrum,
};
use crate::people::people;
use crate::{ClipMetrics, DataMetrics, MethodMetrics, Metrics, RegionMetrics, SCHEMA};
use softtissue_body::{Region, RegionMap};
use softtissue_clips::ClipId;
use softtissue_geometry::Frames;
use std::collections::{BTreeMap, BTreeSet};

/// Regions whose mean motion is looked at in frequency and time: those that move.
pub const MOVING: [Region; 6] =
    [Region::Belly, Region::Chest, Region::Buttocks, Region::Thighs, Region::UpperArms, Region::Calves];

/// Longest lag searched, seconds either way.
const LAG_WINDOW_S: f64 = 0.2;

/// What a method's deltas are compared with on one clip.
pub(crate) struct Reference<'a> {
    pub regions: &'a RegionMap,
    pub fps: f32,
    /// Truth, or the scans' deltas where there is none.
    pub deltas: &'a Frames,
    pub scan: &'a Frames,
    /// Mean motion and spectrum of [`MOVING`]; absent where the region does not move.
    pub means: BTreeMap<Region, (Vec<glam::DVec3>, Spectrum)>,
}

impl<'a> Reference<'a> {
    pub(crate) fn new(regions: &'a RegionMap, fps: f32, deltas: &'a Frames, scan: &'a Frames) -> Self {
        let own = ErrorSums::of(deltas, deltas, regions, fps);
        let means = MOVING
            .into_iter()
            .filter(|r| own.region(*r).reference_speed.rms().is_some_and(|v| v > STILL_MM_S))
            .map(|r| {
                let mean = region_mean(deltas, &regions.vertices(r));
                let s = spectrum(&mean, f64::from(fps));
                (r, (mean, s))
            })
            .collect();
        Self { regions, fps, deltas, scan, means }
    }
}

/// Frequency and time of one region's mean, predicted against reference.
#[derive(Clone, Debug, PartialEq)]
pub struct RegionSignal {
    /// Spectrum of the prediction.
    pub spectrum: Spectrum,
    /// Distance to the reference's spectrum, decibels.
    pub spectral_distance: Option<f64>,
    /// Error of the highest peak's frequency, hertz.
    pub peak_hz_error: Option<f64>,
    /// Seconds that the prediction is late.
    pub lag_s: Option<f64>,
}

/// One method on one clip.
#[derive(Clone, Debug, PartialEq)]
pub struct MethodTally {
    /// Against the reference.
    pub reference: ErrorSums,
    /// Against the scans' deltas.
    pub scan: ErrorSums,
    /// Moving regions.
    pub signals: BTreeMap<Region, RegionSignal>,
}

impl MethodTally {
    /// Absent if the prediction left the finite numbers.
    pub(crate) fn of(predicted: &Frames, reference: &Reference) -> Option<Self> {
        if predicted.points().iter().any(|p| !p.is_finite()) {
            return None;
        }
        let fps = f64::from(reference.fps);
        let signals = reference.means.iter().map(|(region, (mean, power))| {
            let own = region_mean(predicted, &reference.regions.vertices(*region));
            let own_power = spectrum(&own, fps);
            let peak_hz_error = peak_hz(&own_power).zip(peak_hz(power)).map(|(a, b)| (a - b).abs());
            let signal = RegionSignal {
                spectral_distance: spectral_distance(&own_power, power),
                peak_hz_error,
                lag_s: lag_s(&own, mean, fps, LAG_WINDOW_S),
                spectrum: own_power,
            };
            (*region, signal)
        });
        Some(Self {
            signals: signals.collect(),
            reference: ErrorSums::of(predicted, reference.deltas, reference.regions, reference.fps),
            scan: ErrorSums::of(predicted, reference.scan, reference.regions, reference.fps),
        })
    }
}

/// All methods on one clip.
#[derive(Clone, Debug, PartialEq)]
pub struct ClipTally {
    /// Which clip.
    pub id: ClipId,
    /// Which fold judged it.
    pub fold: Option<String>,
    /// The shape coefficient that falls as mass rises.
    pub beta_1: Option<f32>,
    /// Frames a second.
    pub fps: f32,
    /// Frames.
    pub frames: usize,
    /// Spectra of the reference's moving regions.
    pub spectra: BTreeMap<Region, Spectrum>,
    /// By method; `None` where the rollout diverged.
    pub methods: BTreeMap<String, Option<MethodTally>>,
}

/// What has been judged so far, clip by clip: folds of a protocol add to the same tally.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tally {
    /// Whether the reference was truth.
    pub truth: bool,
    /// Vertices of the mesh.
    pub vertices: usize,
    /// In the order in which they were judged.
    pub clips: Vec<ClipTally>,
    /// Rollout speed by method, frames a second.
    pub speeds: BTreeMap<String, f64>,
}

impl Tally {
    /// Takes what was judged in another fold.
    pub fn merge(&mut self, other: Self) {
        self.truth = other.truth;
        self.vertices = other.vertices;
        self.clips.extend(other.clips);
        for (name, speed) in other.speeds {
            self.speeds.entry(name).or_insert(speed);
        }
    }

    /// The subject of the judged clips with the least `beta[1]`.
    pub fn heaviest(&self) -> Option<&str> {
        let known = self.clips.iter().filter_map(|c| Some((c.beta_1?, c.id.subject.as_str())));
        known.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, subject)| subject)
    }

    /// Methods seen, sorted.
    pub fn methods(&self) -> BTreeSet<String> {
        self.clips.iter().flat_map(|c| c.methods.keys().cloned()).collect()
    }

    /// The figures of all clips pooled, and of each alone.
    pub fn metrics(&self, protocol: &str, seed: u64) -> Metrics {
        let subjects: BTreeSet<&String> = self.clips.iter().map(|c| &c.id.subject).collect();
        let methods = self.methods().into_iter().map(|name| {
            let tallies: Vec<&Option<MethodTally>> = self.clips.iter().filter_map(|c| c.methods.get(&name)).collect();
            let frames_per_second = self.speeds.get(&name).copied();
            (name, MethodMetrics { frames_per_second, ..method_metrics(&tallies) })
        });
        Metrics {
            schema: SCHEMA,
            protocol: protocol.to_owned(),
            seed,
            truth: self.truth,
            data: DataMetrics {
                vertices: self.vertices,
                subjects: subjects.into_iter().cloned().collect(),
                frames: self.clips.iter().map(|c| c.frames).sum(),
            },
            methods: methods.collect(),
            people: people(&self.clips),
            clips: self.clips.iter().map(clip_metrics).collect(),
            ..Default::default()
        }
    }

    /// Mean power of a region over the clips in which it moves: the reference's (`None`) or a method's.
    pub fn mean_spectrum(&self, method: Option<&str>, region: Region) -> Option<Spectrum> {
        let mut sum: Option<(Spectrum, usize)> = None;
        for clip in &self.clips {
            let spectrum = match method {
                None => clip.spectra.get(&region),
                Some(name) => clip
                    .methods
                    .get(name)
                    .and_then(Option::as_ref)
                    .and_then(|m| m.signals.get(&region))
                    .map(|s| &s.spectrum),
            };
            let Some(s) = spectrum else { continue };
            match &mut sum {
                Some((total, n)) if total.hz == s.hz => {
                    total.power.iter_mut().zip(&s.power).for_each(|(a, b)| *a += b);
                    *n += 1;
                }
                Some(_) => {}
                None => sum = Some((s.clone(), 1)),
            }
        }
        sum.map(|(mut s, n)| {
            s.power.iter_mut().for_each(|p| *p /= n as f64);
            s
        })
    }
}

fn clip_metrics(clip: &ClipTally) -> ClipMetrics {
    let ClipId { subject, motion, take } = clip.id.clone();
    let methods = clip.methods.iter().map(|(name, tally)| (name.clone(), method_metrics(&[tally]))).collect();
    ClipMetrics { subject, motion, take, fold: clip.fold.clone(), methods }
}

pub(crate) fn method_metrics(tallies: &[&Option<MethodTally>]) -> MethodMetrics {
    let diverged = tallies.iter().filter(|t| t.is_none()).count() as u32;
    if diverged > 0 {
        return MethodMetrics { diverged_clips: Some(diverged), ..Default::default() };
    }
    let tallies: Vec<&MethodTally> = tallies.iter().filter_map(|t| t.as_ref()).collect();
    let (mut reference, mut scan) = (ErrorSums::default(), ErrorSums::default());
    for t in &tallies {
        reference.merge(&t.reference);
        scan.merge(&t.scan);
    }
    let regions = REPORTED.iter().filter_map(|name| {
        let (mean_mm, std_mm) = reference.error_mm(name)?;
        let scan_error = scan.error_mm(name);
        let signals = |part: fn(&RegionSignal) -> Option<f64>| mean_of_signals(&tallies, name, part);
        let region = RegionMetrics {
            mean_mm: Some(mean_mm),
            std_mm: Some(std_mm),
            frame_std_mm: reference.frame_std_mm(name),
            scan_mean_mm: scan_error.map(|e| e.0),
            scan_std_mm: scan_error.map(|e| e.1),
            energy_ratio: reference.energy_ratio(name),
            peak_hz_error: signals(|s| s.peak_hz_error),
            spectral_distance: signals(|s| s.spectral_distance),
            lag_ms: signals(|s| s.lag_s).map(|s| s * 1e3),
        };
        Some(((*name).to_owned(), region))
    });
    MethodMetrics { regions: regions.collect(), soft_ratio: reference.soft_ratio(), ..Default::default() }
}

/// Mean over clips and over a name's moving regions. `rigid` has none.
fn mean_of_signals(tallies: &[&MethodTally], name: &str, part: fn(&RegionSignal) -> Option<f64>) -> Option<f64> {
    let members = members(name);
    let values: Vec<f64> =
        tallies.iter().flat_map(|t| members.iter().filter_map(|r| t.signals.get(r))).filter_map(part).collect();
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}
