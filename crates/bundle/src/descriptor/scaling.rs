use crate::InputScaling;
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

/// A feature varies if its range exceeds this part of its block's root mean square.
const SMALLEST_RANGE: f32 = 1e-4;

impl InputScaling {
    /// Learns from the features `[T, D]` of the training clips, `D` being the end of the last block: what never varied
    /// is dropped, the rest is divided by **one** root mean square a block and clipped to the range seen.
    /// Features are not whitened: whitening blows up directions that hardly moved in training and explodes on
    /// unseen motions.
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
        let mut scaling = Self::default();
        for block in blocks {
            let count = (block.range.len() * frames).max(1) as f64;
            let rms = (squares[block.range.clone()].iter().sum::<f64>() / count).sqrt() as f32;
            for d in block.range.clone().filter(|d| upper[*d] - lower[*d] > SMALLEST_RANGE * rms) {
                scaling.keep.push(d as u32);
                scaling.scale.push(1.0 / rms);
                scaling.low.push(lower[d] / rms);
                scaling.high.push(upper[d] / rms);
            }
        }
        scaling
    }
    /// Scales a clip of `size` features a frame, `[T, size]` to `[T, D]`.
    pub fn apply_clip(&self, features: &[f32], size: usize) -> Vec<f32> {
        let mut out = vec![0.0; features.len() / size.max(1) * self.outputs()];
        if !out.is_empty() {
            for (x, y) in features.chunks_exact(size).zip(out.chunks_exact_mut(self.outputs())) {
                self.apply(x, y);
            }
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_scale_a_block_clipped_and_constant_features_dropped() {
        let blocks = FeatureBlock::in_a_row(&[("a", 2), ("b", 2)]);
        let a = [3.0, 5.0, 1.0, 10.0, -3.0, 5.0, 2.0, -10.0];
        let scaling = InputScaling::fit(&[&a], &blocks);
        assert_eq!(scaling.keep, [0, 2, 3]);
        let rms_a = ((9.0 + 25.0 + 9.0 + 25.0) / 4.0f32).sqrt();
        let rms_b = ((1.0 + 100.0 + 4.0 + 100.0) / 4.0f32).sqrt();
        let out = scaling.apply_clip(&[100.0, 5.0, 0.5, -5.0], 4);
        for (got, expected) in out.iter().zip([3.0 / rms_a, 1.0 / rms_b, -5.0 / rms_b]) {
            assert!((got - expected).abs() < 1e-6, "{got} {expected}");
        }
    }
}
