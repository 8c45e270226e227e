use crate::{LeakMetrics, ProbeMetrics};
use faer::linalg::matmul::matmul;
use faer::linalg::solvers::Solve;
use faer::{Accum, Mat, Par, Side};
use rayon::prelude::*;
use softtissue_clips::ClipId;
use std::collections::BTreeMap;

/// A clip's motion descriptor, for a probe.
#[derive(Clone, Debug)]
pub struct ProbeClip {
    /// Who, what, which take.
    pub id: ClipId,
    /// Frames a second.
    pub fps: f32,
    /// `[T, D]`.
    pub features: Vec<f32>,
    /// Features a frame, `D`.
    pub width: usize,
}

/// Seconds at the start of a clip that are left out: everybody stands in the same pose there, whatever is to come.
const START_S: f32 = 1.0;
/// Seconds between two samples: neighbouring frames are all but equal.
const EVERY_S: f32 = 0.06;
/// Seconds between the two halves of a clip that are not used, where halves are held against each other.
const GAP_S: f32 = 0.25;
/// Penalties on squared weights that are tried, beside a mean log-likelihood of standardised features.
const STRENGTHS: [f64; 3] = [0.1, 0.01, 0.001];
/// Steps of a fit at most, ...
const STEPS: usize = 100;
/// ... which ends before where no entry of the gradient is greater.
const FLAT: f64 = 1e-4;

/// How well a linear probe (multinomial logistic regression on single frames) tells the subject and the motion from a
/// motion descriptor: what SoftSMPL sec. 5 wants to take out, and what it wants to keep.
///
/// The subject is told on motions that the probe has not seen: folds are blocked by motion. The motion is told on takes
/// that it has not seen or, where there is one take of each, on the other half of each clip. A figure is the mean over
/// classes of the part of their frames that is told right; of the penalties tried, the one that tells most counts.
/// What has fewer than two classes or folds is absent.
pub fn leak(clips: &[ProbeClip]) -> LeakMetrics {
    let takes = distinct(clips.iter().map(|c| c.id.take));
    let by_take = clips.iter().all(|c| takes.iter().all(|t| has(clips, &c.id.motion, *t))) && takes.len() > 1;
    let motion_fold = |c: &ProbeClip, t: usize| match by_take {
        true => Some(takes.iter().position(|k| *k == c.id.take).unwrap_or(0)),
        false => half(c, t),
    };
    let motions = distinct(clips.iter().map(|c| c.id.motion.as_str()));
    let subjects = distinct(clips.iter().map(|c| c.id.subject.as_str()));
    let index = |names: &[&str], name: &str| names.iter().position(|n| *n == name).unwrap_or(0);
    let of_motion = |c: &ProbeClip| index(&motions, &c.id.motion);
    let of_subject = |c: &ProbeClip| index(&subjects, &c.id.subject);
    LeakMetrics {
        subject: Samples::new(clips, of_subject, |c, _| Some(of_motion(c))).told(),
        motion: Samples::new(clips, of_motion, motion_fold).told(),
    }
}

fn distinct<T: Ord>(of: impl Iterator<Item = T>) -> Vec<T> {
    let mut all: Vec<T> = of.collect();
    all.sort();
    all.dedup();
    all
}

fn has(clips: &[ProbeClip], motion: &str, take: u32) -> bool {
    clips.iter().any(|c| c.id.motion == motion && c.id.take == take)
}

fn frames(clip: &ProbeClip) -> usize {
    clip.features.len() / clip.width.max(1)
}

/// First frame that is used.
fn start(clip: &ProbeClip) -> usize {
    ((START_S * clip.fps) as usize).min(frames(clip) / 2)
}

/// Which half of what is used a frame lies in; none near the middle.
fn half(clip: &ProbeClip, t: usize) -> Option<usize> {
    let middle = 0.5 * (start(clip) + frames(clip)) as f32;
    let off = t as f32 + 0.5 - middle;
    (off.abs() > 0.5 * GAP_S * clip.fps).then_some(usize::from(off > 0.0))
}

/// Frames with the class and the fold of each.
struct Samples<'a> {
    rows: Vec<&'a [f32]>,
    classes: Vec<usize>,
    folds: Vec<usize>,
}

impl<'a> Samples<'a> {
    fn new(
        clips: &'a [ProbeClip],
        class: impl Fn(&ProbeClip) -> usize,
        fold: impl Fn(&ProbeClip, usize) -> Option<usize>,
    ) -> Self {
        let mut samples = Self { rows: vec![], classes: vec![], folds: vec![] };
        for clip in clips {
            let stride = ((EVERY_S * clip.fps) as usize).max(1);
            for t in (start(clip)..frames(clip)).step_by(stride) {
                if let Some(fold) = fold(clip, t) {
                    samples.rows.push(&clip.features[t * clip.width..][..clip.width]);
                    samples.classes.push(class(clip));
                    samples.folds.push(fold);
                }
            }
        }
        samples
    }

    fn told(&self) -> Option<ProbeMetrics> {
        let folds = distinct(self.folds.iter().copied());
        let classes = distinct(self.classes.iter().copied()).len();
        if folds.len() < 2 || classes < 2 {
            return None;
        }
        // [folds][strengths][samples of the fold], in parallel over folds
        let guesses: Vec<Vec<Vec<(usize, usize)>>> = folds.par_iter().map(|fold| self.fold(*fold)).collect();
        let accuracy = |strength: usize| {
            let mut right: BTreeMap<usize, (usize, usize)> = BTreeMap::new();
            for (class, guess) in guesses.iter().flat_map(|f| &f[strength]) {
                let entry = right.entry(*class).or_default();
                *entry = (entry.0 + usize::from(class == guess), entry.1 + 1);
            }
            right.values().map(|(right, of)| *right as f64 / *of as f64).sum::<f64>() / right.len() as f64
        };
        let best = (0..STRENGTHS.len()).map(accuracy).fold(0.0, f64::max);
        Some(ProbeMetrics { accuracy: best, chance: 1.0 / classes as f64 })
    }

    /// Class and guess of every sample of a fold, by a probe that was fitted to the others, for each strength.
    fn fold(&self, fold: usize) -> Vec<Vec<(usize, usize)>> {
        let part = |inside: bool| (0..self.rows.len()).filter(|i| (self.folds[*i] == fold) == inside).collect();
        let (judged, fitted): (Vec<usize>, Vec<usize>) = (part(true), part(false));
        let scaling = Standard::new(fitted.iter().map(|i| self.rows[*i]));
        let classes = self.classes.iter().max().map_or(0, |c| c + 1);
        let wanted: Vec<usize> = fitted.iter().map(|i| self.classes[*i]).collect();
        let input = |rows: &[usize]| scaling.apply(&rows.iter().map(|i| self.rows[*i]).collect::<Vec<_>>());
        let (x, judged_x) = (input(&fitted), input(&judged));
        let mut weight = Mat::zeros(x.ncols(), classes);
        let mut guesses = vec![];
        for strength in STRENGTHS {
            weight = logistic(&x, &wanted, weight, strength);
            let mut scores = Mat::<f64>::zeros(judged_x.nrows(), classes);
            matmul(&mut scores, Accum::Replace, &judged_x, &weight, 1.0, Par::Seq);
            let guess =
                |n: usize| (0..classes).reduce(|a, b| if scores[(n, b)] > scores[(n, a)] { b } else { a }).unwrap_or(0);
            guesses.push(judged.iter().enumerate().map(|(n, i)| (self.classes[*i], guess(n))).collect());
        }
        guesses
    }
}

/// Mean and standard deviation of each feature.
struct Standard {
    mean: Vec<f64>,
    scale: Vec<f64>,
}

impl Standard {
    fn new<'a>(rows: impl Iterator<Item = &'a [f32]> + Clone) -> Self {
        let count = rows.clone().count().max(1) as f64;
        let width = rows.clone().next().map_or(0, <[f32]>::len);
        let mut mean = vec![0.0; width];
        rows.clone().for_each(|row| mean.iter_mut().zip(row).for_each(|(m, x)| *m += f64::from(*x) / count));
        let mut variance = vec![0.0; width];
        rows.for_each(|row| {
            variance.iter_mut().zip(row).zip(&mean).for_each(|((v, x), m)| *v += (f64::from(*x) - m).powi(2) / count);
        });
        // what never varied tells nothing
        let scale = variance.iter().map(|v| if *v > 1e-12 { v.sqrt().recip() } else { 0.0 }).collect();
        Self { mean, scale }
    }

    /// `[N, D + 1]`, a one at the end of each row.
    fn apply(&self, rows: &[&[f32]]) -> Mat<f64> {
        let width = self.mean.len();
        Mat::from_fn(rows.len(), width + 1, |n, d| match d {
            d if d == width => 1.0,
            d => (f64::from(rows[n][d]) - self.mean[d]) * self.scale[d],
        })
    }
}

/// Weights `[D, C]` of multinomial logistic regression from a start, by Newton steps with Boehning's (1992) fixed bound
/// of the curvature, one factorisation for all of them: every step lowers the loss.
fn logistic(x: &Mat<f64>, classes: &[usize], start: Mat<f64>, strength: f64) -> Mat<f64> {
    let (n, c) = (x.nrows(), start.ncols());
    let mut bound = Mat::<f64>::zeros(x.ncols(), x.ncols());
    matmul(&mut bound, Accum::Replace, x.transpose(), x, 0.5 / n as f64, Par::Seq);
    (0..x.ncols()).for_each(|d| bound[(d, d)] += strength);
    let mut weight = start;
    // The penalty makes it positive definite unless a feature is not finite.
    let Ok(factor) = bound.llt(Side::Lower) else { return weight };
    let mut error = Mat::<f64>::zeros(n, c);
    for _ in 0..STEPS {
        matmul(&mut error, Accum::Replace, x, &weight, 1.0, Par::Seq);
        for i in 0..n {
            let most = (0..c).map(|k| error[(i, k)]).fold(f64::NEG_INFINITY, f64::max);
            let sum: f64 = (0..c).map(|k| (error[(i, k)] - most).exp()).sum();
            for k in 0..c {
                let probability = (error[(i, k)] - most).exp() / sum;
                error[(i, k)] = probability - f64::from(u8::from(classes[i] == k));
            }
        }
        let mut gradient = &weight * faer::Scale(strength);
        matmul(&mut gradient, Accum::Add, x.transpose(), &error, 1.0 / n as f64, Par::Seq);
        let steepest = gradient.col_iter().flat_map(|col| col.iter().map(|g| g.abs())).fold(0.0, f64::max);
        if steepest < FLAT {
            break;
        }
        weight -= factor.solve(&gradient);
    }
    weight
}

#[cfg(test)]
mod tests {
    use super::*;
    use softtissue_random::Draws;

    const WIDTH: usize = 6;
    const FRAMES: usize = 180;

    /// Clips of 3 subjects, 4 motions and some takes whose every feature is a signal, made for the clip, and noise.
    fn clips(takes: u32, noise: f64, signal: impl Fn(usize, usize, u32) -> [f64; WIDTH]) -> Vec<ProbeClip> {
        let mut draws = Draws::new(2, "leak", 0, 0);
        let mut clips = vec![];
        for (s, m, take) in (0..3).flat_map(|s| (0..4).flat_map(move |m| (0..takes).map(move |t| (s, m, t)))) {
            let signal = signal(s, m, take);
            let numbers = (0..FRAMES * WIDTH).map(|i| (signal[i % WIDTH] + noise * draws.normal()) as f32);
            let id = ClipId::new(format!("s{s}"), format!("m{m}"), take);
            clips.push(ProbeClip { id, fps: 60.0, features: numbers.collect(), width: WIDTH });
        }
        clips
    }

    fn figures(clips: &[ProbeClip]) -> [f64; 2] {
        let found = leak(clips);
        let (subject, motion) = (found.subject.unwrap(), found.motion.unwrap());
        assert!((subject.chance - 1.0 / 3.0).abs() < 1e-12 && (motion.chance - 0.25).abs() < 1e-12);
        [subject.accuracy, motion.accuracy]
    }

    #[test]
    fn what_is_there_is_told_and_what_is_not_is_not() {
        // The subject stands on one axis in the middle of the others too: one against the rest could not tell it.
        let both = clips(1, 0.1, |s, m, _| [s as f64, m as f64, 0.0, 0.0, 0.0, 0.0]);
        let [subject, motion] = figures(&both);
        assert!(subject > 0.98 && motion > 0.98, "{subject} {motion}");
        let neither = clips(1, 1.0, |_, _, _| [0.0; WIDTH]);
        let [subject, motion] = figures(&neither);
        assert!((subject - 1.0 / 3.0).abs() < 0.1 && (motion - 0.25).abs() < 0.1, "{subject} {motion}");
    }

    #[test]
    fn accuracy_is_that_of_the_best_guess_on_overlapping_classes() {
        // Two subjects a distance of 2 standard deviations apart: the best guess is right in 84.1 % of the frames.
        let far = clips(1, 1.0, |s, _, _| [2.0 * s as f64, 0.0, 0.0, 0.0, 0.0, 0.0]);
        let two: Vec<ProbeClip> = far.into_iter().filter(|c| c.id.subject != "s2").collect();
        let told = leak(&two).subject.unwrap();
        assert!((told.accuracy - 0.841).abs() < 0.05 && told.chance == 0.5, "{told:?}");
    }

    #[test]
    fn a_mark_of_the_clip_is_no_mark_of_the_subject() {
        // Every clip has a place of its own: frames of the same clip would give the subject away, other motions do not.
        let mut draws = Draws::new(4, "marks", 0, 0);
        let marks: Vec<f64> = (0..24 * WIDTH).map(|_| 3.0 * draws.normal()).collect();
        let mark = |s: usize, m: usize, take: u32| -> [f64; WIDTH] {
            std::array::from_fn(|d| marks[((s * 4 + m) * 2 + take as usize) * WIDTH + d])
        };
        let [subject, motion] = figures(&clips(1, 0.1, mark));
        assert!(subject < 0.6, "{subject}");
        assert!(motion > 0.95, "the other half of a clip gives its motion away: {motion}");
        let [_, motion] = figures(&clips(2, 0.1, mark));
        assert!(motion < 0.6, "another take does not: {motion}");
    }

    #[test]
    fn one_class_or_one_fold_gives_no_figure() {
        let all = clips(1, 1.0, |_, _, _| [0.0; WIDTH]);
        let one: Vec<ProbeClip> = all.iter().filter(|c| c.id.subject == "s0").cloned().collect();
        assert!(leak(&one).subject.is_none() && leak(&one).motion.is_some());
        let one: Vec<ProbeClip> = all.into_iter().filter(|c| c.id.motion == "m0").collect();
        assert!(leak(&one).subject.is_none() && leak(&one).motion.is_none());
    }
}
