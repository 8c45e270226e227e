use crate::descriptor::FeatureBlock;
use crate::model::fits;
use crate::{Limits, Model};

/// What training has seen, to tell how far a motion and a body lie from it.
///
/// ```text
/// q_b   = sqrt(mean over block b of ((x - mean) scale)^2)       each block of the descriptor's features x
/// q_s   = |beta - clip(beta)| / shape_reach                     the shape, clipped to the people of the training
/// q     = the largest of these
/// trust = clip((3 - q) / 2, 0, 1)
/// ```
///
/// The scales are such that `q_b = 1` is where a training motion lies from all others: 95 of 100 frames are nearer.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trust {
    /// Mean of each feature over the training clips, `[D]`.
    pub mean: Vec<f32>,
    /// What a departure from it is multiplied by, `[D]`.
    pub scale: Vec<f32>,
    /// Range of each shape coefficient among the training's people, `[S]`.
    pub shape: Limits,
    /// How far beyond these ranges one of them lies when the others alone count, at least [`LEAST_SHAPE_REACH`].
    pub shape_reach: f32,
}

/// A clip that training has seen.
#[derive(Clone, Copy, Debug)]
pub struct SeenClip<'a> {
    /// Which clips are left out together when distances are learned: those of one motion.
    pub motion: &'a str,
    /// The descriptor's features, `[T, D]`.
    pub features: &'a [f32],
}

/// Least value of [`Trust::shape_reach`], standard deviations of the shape space.
pub const LEAST_SHAPE_REACH: f32 = 1.0;
/// Where trust has fallen to zero.
const NO_TRUST: f32 = 3.0;
/// Part of the frames of left-out motions that lie within a reach.
const WITHIN_REACH: f64 = 0.95;
/// A feature's spread counts as at least this part of its block's: what hardly moved in training may move a little.
const LEAST_SPREAD: f64 = 0.2;

/// Sums over frames.
#[derive(Clone)]
struct Moments {
    frames: f64,
    sums: Vec<f64>,
    squares: Vec<f64>,
}

impl Trust {
    /// Learns the distances of motions from the training clips: each motion is left out in turn and measured by the mean
    /// and spread of the others, clip by clip where there is one motion only. `people` are the shapes `[S]` of the training's
    /// people. Panics if features fill no whole frames.
    pub fn fit(blocks: &[FeatureBlock], clips: &[SeenClip], people: &[&[f32]]) -> Self {
        let size = blocks.last().map_or(0, |b| b.range.end);
        let names: Vec<&str> = clips.iter().map(|c| c.motion).collect();
        let one_motion = names.iter().all(|n| *n == names[0]);
        let group = |i: usize| if one_motion { i } else { names.iter().position(|n| *n == names[i]).unwrap_or(i) };
        let mut all = Moments::none(size);
        let mut groups = vec![Moments::none(size); clips.len()];
        for (i, clip) in clips.iter().enumerate() {
            assert!(clip.features.len().is_multiple_of(size.max(1)), "features fill whole frames");
            for frame in clip.features.chunks_exact(size.max(1)) {
                all.add(frame);
                groups[group(i)].add(frame);
            }
        }
        let mut distances = vec![vec![]; blocks.len()];
        for (i, clip) in clips.iter().enumerate() {
            // Without another clip there is none to be measured by but itself.
            let others = all.without(&groups[group(i)]).unwrap_or_else(|| all.clone());
            let (mean, scale) = others.mean_and_scale(blocks);
            for frame in clip.features.chunks_exact(size.max(1)) {
                for (block, distances) in blocks.iter().zip(&mut distances) {
                    distances.push(block_distance(block, frame, &mean, &scale));
                }
            }
        }
        let (mean, mut scale) = all.mean_and_scale(blocks);
        for (block, distances) in blocks.iter().zip(&mut distances) {
            let reach = quantile(distances, WITHIN_REACH);
            let factor = if reach > 0.0 { 1.0 / reach } else { 1.0 };
            scale[block.range.clone()].iter_mut().for_each(|s| *s *= factor);
        }
        let count = people.iter().map(|p| p.len()).min().unwrap_or(0);
        let among = |left_out: Option<usize>| {
            let mut limits = Limits::nothing(count);
            let others = people.iter().enumerate().filter(|(i, _)| Some(*i) != left_out);
            others.for_each(|(_, p)| limits.widen(&p[..count]));
            limits
        };
        let beyond = |(i, person): (usize, &&[f32])| beyond(&among(Some(i)), person);
        let farthest = people.iter().enumerate().map(beyond).filter(|d| d.is_finite()).fold(0.0, f32::max);
        Self { mean, scale, shape: among(None), shape_reach: farthest.max(LEAST_SHAPE_REACH) }
    }

    /// Knows whatever there is, of so many features: for a model that has learned nothing.
    pub fn of_everything(features: usize) -> Self {
        Self { mean: vec![0.0; features], scale: vec![0.0; features], shape: Limits::default(), shape_reach: 1.0 }
    }

    /// Distance `q` of a frame's features, in reaches.
    pub fn of_features(&self, blocks: &[FeatureBlock], features: &[f32]) -> f32 {
        let distance = |block| block_distance(block, features, &self.mean, &self.scale);
        blocks.iter().map(distance).fold(0.0, |most, d| if d > most || d.is_nan() { d } else { most })
    }
    /// Distance `q` of a body, in reaches. Missing coefficients count as zero, surplus ones are ignored.
    pub fn of_shape(&self, beta: &[f32]) -> f32 {
        beyond(&self.shape, beta) / self.shape_reach
    }
    /// Trust in what lies at a distance.
    pub fn at(distance: f32) -> f32 {
        if distance.is_nan() { 0.0 } else { ((NO_TRUST - distance) / (NO_TRUST - 1.0)).clamp(0.0, 1.0) }
    }

    /// Whether it is of this model's features; the sentence says what is not.
    pub(crate) fn check(&self, model: &Model) -> Result<(), String> {
        let features = model.feature_count();
        fits("trust", &[self.mean.len(), self.scale.len()], &[features, features])?;
        self.shape.check("trusted shapes", self.shape.lower.len())?;
        match self.scale.iter().all(|s| *s >= 0.0) && self.shape_reach > 0.0 {
            true => Ok(()),
            false => Err("its trust has a scale or reach below zero; export it again".into()),
        }
    }
}

impl Moments {
    fn none(size: usize) -> Self {
        Self { frames: 0.0, sums: vec![0.0; size], squares: vec![0.0; size] }
    }
    fn add(&mut self, frame: &[f32]) {
        self.frames += 1.0;
        for ((sum, square), x) in self.sums.iter_mut().zip(&mut self.squares).zip(frame) {
            let x = f64::from(*x);
            (*sum, *square) = (*sum + x, *square + x * x);
        }
    }
    /// Of the other frames, if there are any.
    fn without(&self, part: &Self) -> Option<Self> {
        let less = |all: &[f64], part: &[f64]| all.iter().zip(part).map(|(a, p)| a - p).collect();
        (self.frames > part.frames).then(|| Self {
            frames: self.frames - part.frames,
            sums: less(&self.sums, &part.sums),
            squares: less(&self.squares, &part.squares),
        })
    }
    /// Mean of each feature and one over its spread, the latter never small beside its block's.
    fn mean_and_scale(&self, blocks: &[FeatureBlock]) -> (Vec<f32>, Vec<f32>) {
        let n = self.frames.max(1.0);
        let variance = |k: usize| (self.squares[k] / n - (self.sums[k] / n).powi(2)).max(0.0);
        let mut scale = vec![0.0; self.sums.len()];
        for block in blocks {
            let usual = block.range.clone().map(variance).sum::<f64>() / block.range.len().max(1) as f64;
            // What never moved at all is measured in its unit.
            let least = if usual > 0.0 { LEAST_SPREAD.powi(2) * usual } else { 1.0 };
            for k in block.range.clone() {
                scale[k] = (1.0 / variance(k).max(least).sqrt()) as f32;
            }
        }
        (self.sums.iter().map(|s| (s / n) as f32).collect(), scale)
    }
}

fn block_distance(block: &FeatureBlock, features: &[f32], mean: &[f32], scale: &[f32]) -> f32 {
    let square = |k: usize| ((features[k] - mean[k]) * scale[k]).powi(2);
    (block.range.clone().map(square).sum::<f32>() / block.range.len().max(1) as f32).sqrt()
}

/// How far a shape lies beyond ranges.
fn beyond(limits: &Limits, beta: &[f32]) -> f32 {
    let outside = |i: usize| {
        let b = beta.get(i).copied().unwrap_or(0.0);
        (limits.lower[i] - b).max(b - limits.upper[i]).max(0.0)
    };
    (0..limits.len()).map(|i| outside(i).powi(2)).sum::<f32>().sqrt()
}

/// The least number that at least this part of them does not exceed.
fn quantile(numbers: &mut [f32], part: f64) -> f32 {
    if numbers.is_empty() {
        return 0.0;
    }
    let place = ((part * numbers.len() as f64).ceil() as usize).clamp(1, numbers.len()) - 1;
    *numbers.select_nth_unstable_by(place, f32::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A motion of two blocks: `size` in the first, one in the second.
    fn clip(size: f32) -> Vec<f32> {
        (0..100).flat_map(|t| [size * (0.3 * t as f32).sin(), size * (0.7 * t as f32).cos(), 1.0]).collect()
    }

    #[test]
    fn a_reach_is_where_a_motion_lies_from_the_others() {
        let blocks = FeatureBlock::in_a_row(&[("moving", 2), ("constant", 1)]);
        let (small, large) = (clip(1.0), clip(3.0));
        let seen = |features| [SeenClip { motion: "small", features: &small }, SeenClip { motion: "large", features }];
        let trust = Trust::fit(&blocks, &seen(&large), &[&[0.0, -2.0], &[1.0, 1.0], &[0.5, 0.5]]);
        // By the small one's spread, sqrt 0.5, the large one reaches to 3 / sqrt 0.5; once both are known the spread is sqrt 2.5.
        let of = |features: &[f32]| trust.of_features(&blocks, features);
        let farthest = large.chunks_exact(3).map(of).fold(0.0, f32::max);
        let wanted = 0.5f32.sqrt() / 2.5f32.sqrt();
        assert!((farthest - wanted).abs() < 0.06, "{farthest} {wanted}");
        assert!(small.chunks_exact(3).map(of).all(|d| d < 0.5));
        assert!(of(&[30.0, 0.0, 1.0]) > 3.0 && Trust::at(of(&[30.0, 0.0, 1.0])) == 0.0);
        // What never moved counts in its own unit.
        assert!((of(&[0.0, 0.0, 3.0]) - 2.0).abs() < 1e-5);
        assert!(of(&[f32::NAN, 0.0, 1.0]).is_nan() && Trust::at(f32::NAN) == 0.0);
        // Left out, the first person lies 2.5 and 0.5 beyond the others.
        assert!((trust.shape_reach - 2.5f32.hypot(0.5)).abs() < 1e-6, "{}", trust.shape_reach);
        assert_eq!((trust.of_shape(&[0.2, -1.0]), trust.of_shape(&[])), (0.0, 0.0));
        assert!((trust.of_shape(&[0.0, -4.0]) - 2.0 / trust.shape_reach).abs() < 1e-6);
    }

    #[test]
    fn trust_is_whole_within_reach_and_gone_at_three_times_it() {
        for (distance, trust) in [(0.0, 1.0), (1.0, 1.0), (2.0, 0.5), (3.0, 0.0), (f32::INFINITY, 0.0)] {
            assert!((Trust::at(distance) - trust).abs() < 1e-6, "{distance}");
        }
    }

    #[test]
    fn a_single_clip_is_measured_by_itself() {
        let blocks = FeatureBlock::in_a_row(&[("moving", 2), ("constant", 1)]);
        let clip = clip(1.0);
        let trust = Trust::fit(&blocks, &[SeenClip { motion: "one", features: &clip }], &[&[0.3]]);
        let within = clip.chunks_exact(3).filter(|f| trust.of_features(&blocks, f) <= 1.0 + 1e-6).count();
        assert!((95..97).contains(&within), "{within}");
        assert_eq!(trust.shape_reach, LEAST_SHAPE_REACH);
    }
}
