use serde::{Deserialize, Serialize};
use std::ops::Range;

/// Neighbouring features of one physical quantity.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct FeatureBlock {
    /// What they are.
    pub name: String,
    /// Where they stand in a frame's features.
    pub range: Range<usize>,
}

impl FeatureBlock {
    /// Blocks of the given sizes, one after the other.
    pub fn in_a_row(sizes: &[(&str, usize)]) -> Vec<Self> {
        let mut at = 0;
        sizes
            .iter()
            .map(|(name, size)| {
                at += size;
                Self { name: (*name).to_owned(), range: at - size..at }
            })
            .collect()
    }
}

/// Limits and scales learned from the training clips: what never varied is dropped, the rest is clipped to the range
/// seen in training and divided by **one** root mean square a block. Features are not whitened: whitening blows
/// up directions that hardly moved in training and explodes on unseen motions.
#[derive(Clone, Debug, PartialEq, Default, Serialize, Deserialize)]
pub struct FeatureScaling {
    /// Features in, `D`.
    pub input_size: usize,
    /// Which of them are kept, ascending, `[K]`.
    pub kept: Vec<u32>,
    /// Smallest value in training of each kept feature, in the units of the input.
    pub lower: Vec<f32>,
    /// Largest value in training.
    pub upper: Vec<f32>,
    /// What a kept feature is multiplied by; equal within a block.
    pub scale: Vec<f32>,
}

/// A feature varies if its range exceeds this part of its block's root mean square.
const SMALLEST_RANGE: f32 = 1e-4;

impl FeatureScaling {
    /// Index, smallest and largest value in training of each kept feature.
    pub fn limits(&self) -> Vec<(u32, f32, f32)> {
        (0..self.len()).map(|i| (self.kept[i], self.lower[i], self.upper[i])).collect()
    }

    /// Learns from clips of features, each `[T, D]`, where `D` is the end of the last block.
    pub fn fit(clips: &[&[f32]], blocks: &[FeatureBlock]) -> Self {
        let size = blocks.last().map_or(0, |b| b.range.end);
        let mut lower = vec![f32::INFINITY; size];
        let mut upper = vec![f32::NEG_INFINITY; size];
        let mut squares = vec![0.0f64; size];
        let mut frames = 0usize;
        for clip in clips {
            assert!(clip.len().is_multiple_of(size.max(1)), "features fill whole frames");
            for frame in clip.chunks_exact(size.max(1)) {
                frames += 1;
                for (d, x) in frame.iter().enumerate() {
                    lower[d] = lower[d].min(*x);
                    upper[d] = upper[d].max(*x);
                    squares[d] += f64::from(*x).powi(2);
                }
            }
        }
        let mut scaling = Self { input_size: size, ..Self::default() };
        for block in blocks {
            let count = (block.range.len() * frames).max(1) as f64;
            let rms = (squares[block.range.clone()].iter().sum::<f64>() / count).sqrt() as f32;
            for d in block.range.clone().filter(|d| upper[*d] - lower[*d] > SMALLEST_RANGE * rms) {
                scaling.kept.push(d as u32);
                scaling.lower.push(lower[d]);
                scaling.upper.push(upper[d]);
                scaling.scale.push(1.0 / rms);
            }
        }
        scaling
    }
    /// Features out, `K`.
    pub fn len(&self) -> usize {
        self.kept.len()
    }
    /// Whether nothing varied.
    pub fn is_empty(&self) -> bool {
        self.kept.is_empty()
    }
    /// Scales one frame, `[D]` to `[K]`. A value that is no number becomes the middle of its range.
    pub fn apply(&self, features: &[f32], out: &mut [f32]) {
        assert_eq!(features.len(), self.input_size, "features of a frame");
        assert_eq!(out.len(), self.len(), "scaled features of a frame");
        for (k, y) in out.iter_mut().enumerate() {
            let x = features[self.kept[k] as usize];
            let x = if x.is_nan() { 0.5 * (self.lower[k] + self.upper[k]) } else { x };
            *y = x.clamp(self.lower[k], self.upper[k]) * self.scale[k];
        }
    }
    /// How many kept features of a frame lie outside their range in training.
    pub fn outside(&self, features: &[f32]) -> usize {
        let limits = self.kept.iter().zip(&self.lower).zip(&self.upper);
        limits.filter(|((d, low), high)| !(**low..=**high).contains(&features[**d as usize])).count()
    }
    /// Scales a clip, `[T, D]` to `[T, K]`.
    pub fn apply_clip(&self, features: &[f32]) -> Vec<f32> {
        let frames = features.len() / self.input_size.max(1);
        let mut out = vec![0.0; frames * self.len()];
        if !self.is_empty() {
            for (x, y) in features.chunks_exact(self.input_size).zip(out.chunks_exact_mut(self.len())) {
                self.apply(x, y);
            }
        }
        out
    }
    /// Whether the numbers fit together and are finite; the sentence says what does not.
    pub fn check(&self) -> Result<(), String> {
        let k = self.len();
        if [self.lower.len(), self.upper.len(), self.scale.len()] != [k; 3] {
            return Err("feature scaling has lists of unequal length".into());
        }
        if self.kept.iter().any(|d| *d as usize >= self.input_size) || self.kept.windows(2).any(|w| w[0] >= w[1]) {
            return Err(format!("feature scaling keeps features that are not among the {}", self.input_size));
        }
        let fine = |i: usize| self.lower[i] <= self.upper[i] && self.scale[i].is_finite() && self.scale[i] > 0.0;
        match (0..k).find(|i| !(fine(*i) && self.lower[*i].is_finite() && self.upper[*i].is_finite())) {
            Some(i) => Err(format!("feature scaling has a bad range or scale for feature {}", self.kept[i])),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_scale_a_block_clipped_and_constant_features_dropped() {
        let blocks = FeatureBlock::in_a_row(&[("a", 2), ("b", 2)]);
        let a = [3.0, 5.0, 1.0, 10.0, -3.0, 5.0, 2.0, -10.0];
        let scaling = FeatureScaling::fit(&[&a], &blocks);
        assert_eq!(scaling.kept, [0, 2, 3]);
        scaling.check().unwrap();
        let rms_a = ((9.0 + 25.0 + 9.0 + 25.0) / 4.0f32).sqrt();
        let rms_b = ((1.0 + 100.0 + 4.0 + 100.0) / 4.0f32).sqrt();
        let mut out = [0.0; 3];
        scaling.apply(&[100.0, 5.0, f32::NAN, -5.0], &mut out);
        for (got, expected) in out.iter().zip([3.0 / rms_a, 1.5 / rms_b, -5.0 / rms_b]) {
            assert!((got - expected).abs() < 1e-6, "{got} {expected}");
        }
        assert_eq!(scaling.apply_clip(&a).len(), 6);
    }
}
