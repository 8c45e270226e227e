//! What of a person's flesh one clip tells: a few numbers a region, on top of a finished bundle.

use crate::ModelError;
use glam::Vec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use softtissue_body::Region;
use softtissue_bundle::{Bundle, Control, Controls, Player};
use softtissue_clips::{DeltaClip, MotionClip};
use softtissue_geometry::Frames;
use softtissue_monitor::Monitor;

/// How a person's flesh is fitted to a clip.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TuningConfig {
    /// Masses that are tried ([`Control::mass`]): stiffness as the model has learned it from people. 0 always is.
    pub masses: Vec<f32>,
    /// Factors on the damping ratio that are tried, where the model has resonators. 1 always is.
    pub dampings: Vec<f32>,
    /// Seconds at the start of the clip that do not count: the model begins at rest, the person need not.
    pub settle_s: f32,
    /// Frames of a gain of 1 that count beside the clip's own, as a part of them.
    pub gain_prior: f32,
    /// Part of the clip's motion that a mass of one unit, or a damping of double or half, has to explain to be believed.
    pub change_cost: f32,
}

impl Default for TuningConfig {
    fn default() -> Self {
        Self {
            masses: vec![-2.0, -1.5, -1.0, -0.5, 0.5, 1.0, 1.5, 2.0],
            dampings: vec![0.5, 0.7, 1.4, 2.0],
            settle_s: 0.5,
            gain_prior: 0.1,
            change_cost: 0.01,
        }
    }
}

impl TuningConfig {
    /// Whether the settings can be worked with.
    ///
    /// # Errors
    /// One that cannot, by name.
    pub fn check(&self) -> Result<(), ModelError> {
        let sound = |x: f32| x.is_finite() && x >= 0.0;
        let wrong = |name: &str, remedy: &str| Err(ModelError::Config(format!("tuning.{name}: {remedy}")));
        if !self.masses.iter().all(|m| m.abs() <= 3.0) || self.masses.len() > MOST_TRIED {
            return wrong("masses", "give up to 64 numbers between -3 and 3");
        }
        if !self.dampings.iter().all(|d| (0.1..=10.0).contains(d)) || self.dampings.len() > MOST_TRIED {
            return wrong("dampings", "give up to 64 numbers between 0.1 and 10");
        }
        if !sound(self.settle_s) {
            return wrong("settle_s", "give seconds, at least 0");
        }
        if !sound(self.gain_prior) || !sound(self.change_cost) {
            return wrong("gain_prior and change_cost", "give numbers of at least 0");
        }
        Ok(())
    }
}

const MOST_TRIED: usize = 64;
/// Gains beyond which a clip is not believed.
const GAINS: std::ops::RangeInclusive<f64> = 0.25..=4.0;
/// Frames of which no gain could be told.
const FEWEST_FRAMES: usize = 10;

/// A person's flesh beside the model's own.
#[derive(Clone, Debug, PartialEq)]
pub struct Tuning {
    /// What to play the bundle with.
    pub controls: Controls,
    /// The regions that move, in order.
    pub regions: Vec<RegionTuning>,
}

/// A region's part of a [`Tuning`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RegionTuning {
    /// Which.
    pub region: Region,
    /// Mass, damping and gain.
    pub control: Control,
    /// Root mean squared error of the region's motion about its mean over that of the body alone: the bundle as it is.
    pub ratio_before: f32,
    /// The same with the control.
    pub ratio_after: f32,
}

/// Fits mass (stiffness), damping and gain of every soft region to the `deltas` of one clip. The bundle is rolled out over
/// `motion` once for each mass and damping; regions choose apart, and their gains are least squares. Displacements count
/// about their mean over time, so that what a scan and a body differ by without any motion is no flesh.
///
/// # Errors
/// Settings out of range, a clip that does not match, one that is too short, and what the player refuses.
pub fn tune_flesh(
    bundle: &Bundle,
    beta: &[f32],
    motion: &MotionClip,
    deltas: &DeltaClip,
    config: &TuningConfig,
    monitor: &dyn Monitor,
) -> Result<Tuning, ModelError> {
    config.check()?;
    let (first, frames) = ((config.settle_s * motion.fps).ceil() as usize, deltas.deltas.len());
    let refuse = |reason: String| Err(ModelError::Data(format!("clip {}: {reason}", motion.id)));
    if motion.len() != frames || deltas.deltas.points_per_frame() != bundle.body.vertex_count() {
        return refuse(format!(
            "{} frames of motion and {frames} of {} vertices, where the bundle has {}; fit the clip on the bundle's body",
            motion.len(),
            deltas.deltas.points_per_frame(),
            bundle.body.vertex_count()
        ));
    }
    if motion.fps != bundle.descriptor.fps {
        let (found, expected) = (motion.fps, bundle.descriptor.fps);
        return refuse(format!("{found} frames a second, where the bundle has {expected}; import it at that rate"));
    }
    if frames < first + FEWEST_FRAMES {
        return refuse(format!("{frames} frames are too few to fit flesh to; give {} or more", first + FEWEST_FRAMES));
    }
    let regions: Vec<(Region, Vec<usize>)> = Region::ALL
        .into_iter()
        .filter(|r| r.is_soft())
        .map(|region| {
            let of = bundle.body.regions.0.iter().enumerate().filter(|(_, r)| **r == region);
            (region, of.map(|(v, _)| v).collect())
        })
        .collect();
    let wanted = Swing::of(&deltas.deltas, first);
    let tried = candidates(bundle, config);
    monitor.begin("tuning", tried.len() as u64, "rollouts");
    let scores: Vec<Vec<Fit>> = tried
        .par_iter()
        .map(|control| {
            if monitor.should_stop() {
                return Err(ModelError::Stopped);
            }
            let rollout = rollout(bundle, beta, motion, *control)?;
            let swing = Swing::of(&rollout, first);
            monitor.advance(1, "");
            Ok(regions.iter().map(|(_, of)| Fit::of(&swing, &wanted, of, config.gain_prior)).collect())
        })
        .collect::<Result<_, ModelError>>()?;
    monitor.end();
    let chosen = regions.iter().enumerate().map(|(r, (region, _))| {
        let cost =
            |i: usize| scores[i][r].error + f64::from(config.change_cost * change(&tried[i])) * scores[i][r].moved;
        let best = (0..tried.len()).min_by(|a, b| cost(*a).total_cmp(&cost(*b))).unwrap_or(0);
        let Fit { gain, error, moved, .. } = scores[best][r];
        let ratio = |error: f64| (error / moved.max(f64::MIN_POSITIVE)).sqrt() as f32;
        RegionTuning {
            region: *region,
            control: Control { gain: gain as f32, ..tried[best] },
            ratio_before: ratio(scores[0][r].unchanged),
            ratio_after: ratio(error),
        }
    });
    let regions: Vec<RegionTuning> = chosen.collect();
    let controls = Controls { regions: regions.iter().map(|r| (r.region, r.control)).collect(), ..Default::default() };
    Ok(Tuning { controls, regions })
}

/// The bundle as it is, then all that is tried.
fn candidates(bundle: &Bundle, config: &TuningConfig) -> Vec<Control> {
    let resonates = bundle.model.recurrent().is_some_and(|m| m.regressor.bank.is_some());
    let dampings: &[f32] = if resonates { &config.dampings } else { &[] };
    let mut tried = vec![Control::default()];
    for mass in std::iter::once(&0.0).chain(&config.masses) {
        for damping in std::iter::once(&1.0).chain(dampings) {
            let control = Control { mass: *mass, damping: *damping, ..Default::default() };
            if !tried.contains(&control) {
                tried.push(control);
            }
        }
    }
    tried
}

/// How far a control lies from what was learned: units of mass and doublings of the damping, squared.
fn change(control: &Control) -> f32 {
    control.mass.powi(2) + control.damping.log2().powi(2)
}

fn rollout(bundle: &Bundle, beta: &[f32], motion: &MotionClip, everywhere: Control) -> Result<Frames, ModelError> {
    let refused = |e: softtissue_bundle::BundleError| ModelError::Data(e.to_string());
    let mut player = Player::new(bundle, beta).map_err(refused)?;
    player.set_controls(&Controls { everywhere, ..Default::default() }).map_err(refused)?;
    player.rollout(&motion.rotations, &motion.translations).map_err(refused)
}

/// Displacements about their mean over time.
struct Swing<'a> {
    frames: &'a Frames,
    first: usize,
    /// `[V]`.
    mean: Vec<Vec3>,
}

impl<'a> Swing<'a> {
    fn of(frames: &'a Frames, first: usize) -> Self {
        let mut mean = vec![Vec3::ZERO; frames.points_per_frame()];
        for t in first..frames.len() {
            mean.iter_mut().zip(frames.frame(t)).for_each(|(m, d)| *m += *d);
        }
        let count = (frames.len() - first).max(1) as f32;
        mean.iter_mut().for_each(|m| *m /= count);
        Self { frames, first, mean }
    }
    fn at(&self, t: usize, v: usize) -> Vec3 {
        self.frames.frame(t)[v] - self.mean[v]
    }
}

/// A region of a rollout beside the clip, sums over its vertices and the frames that count, square metres.
struct Fit {
    gain: f64,
    /// With that gain.
    error: f64,
    /// With a gain of 1.
    unchanged: f64,
    /// Of the body alone.
    moved: f64,
}

impl Fit {
    fn of(rollout: &Swing, wanted: &Swing, vertices: &[usize], gain_prior: f32) -> Self {
        let [mut own, mut both, mut moved] = [0.0f64; 3];
        for t in wanted.first..wanted.frames.len() {
            for v in vertices {
                let (m, y) = (rollout.at(t, *v), wanted.at(t, *v));
                own += f64::from(m.length_squared());
                both += f64::from(m.dot(y));
                moved += f64::from(y.length_squared());
            }
        }
        let prior = f64::from(gain_prior) * own;
        let best = if own > 0.0 { (both + prior) / (own + prior) } else { 1.0 };
        let gain = best.clamp(*GAINS.start(), *GAINS.end());
        let error = |g: f64| (moved - 2.0 * g * both + g * g * own).max(0.0);
        Self { gain, error: error(gain), unchanged: error(1.0), moved }
    }
}
