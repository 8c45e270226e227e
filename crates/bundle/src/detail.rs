use crate::blocks::BLOCK;
use crate::controls::region_shares;
use crate::{BundleError, DeltaBasis, Model, Result};
use glam::Vec3;
use softtissue_body::{BodyModel, Region};
use std::ops::Range;

/// How much of a character's flesh is computed: far ones need less. The motion that is felt and what the networks make of
/// it are the same in every detail, so that a change of detail never starts a motion over.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Detail {
    /// Components of the basis that deltas are made of, the most important first; `None` is all of them. The others stay at
    /// their mean.
    pub components: Option<usize>,
    /// Regions that are left rigid; their edges are blended into what moves.
    pub still: Vec<Region>,
}

/// The part of the deltas that is computed: what moves at all, or what a [`Detail`] leaves of it.
#[derive(Clone, Debug)]
pub(crate) struct Part {
    /// Components that are added up.
    pub(crate) components: usize,
    /// Blocks of columns in which something moves.
    pub(crate) blocks: Vec<Range<usize>>,
    /// Delta of the components at their mean. `[V * 3]`.
    pub(crate) mean: Vec<f32>,
    /// Factor on each vertex, `[V]`; none where all stay as they are.
    shares: Option<Vec<f32>>,
}

/// Numbers, ascending, as ranges.
fn ranges(blocks: impl Iterator<Item = usize>) -> Vec<Range<usize>> {
    let mut ranges: Vec<Range<usize>> = vec![];
    for block in blocks {
        match ranges.last_mut().filter(|r| r.end == block) {
            Some(range) => range.end += 1,
            None => ranges.push(block..block + 1),
        }
    }
    ranges
}

impl Part {
    /// All that moves: rigid vertices have no directions.
    pub(crate) fn whole(basis: &DeltaBasis) -> Self {
        let directions = &basis.directions;
        Self {
            components: directions.rows(),
            blocks: ranges((0..directions.blocks()).filter(|b| directions.moves(*b))),
            mean: basis.mean.clone(),
            shares: None,
        }
    }

    /// What a detail leaves of the `whole`, which is there where the model has a basis.
    pub(crate) fn of(detail: &Detail, whole: Option<&Self>, model: &Model, body: &BodyModel) -> Result<Self> {
        let (Some(basis), Some(whole)) = (model.basis(), whole) else {
            let message =
                "a detail for a model without a basis of deltas; play it whole, or use a bundle of another method";
            return Err(BundleError::Input(message.into()));
        };
        let all = basis.directions.rows();
        let components = detail.components.unwrap_or(all);
        if !(1..=all).contains(&components) {
            return Err(BundleError::Input(format!("a detail of {components} components; give 1 to {all}")));
        }
        let moving = Region::ALL.into_iter().zip(region_shares(body)).filter(|(r, _)| !detail.still.contains(r));
        let mut shares = vec![0.0; body.vertex_count()];
        for (_, share) in moving {
            shares.iter_mut().zip(share).for_each(|(sum, s)| *sum += s);
        }
        let mut resting = basis.coefficient_mean.clone();
        resting[..components].fill(0.0);
        let mut mean = basis.mean.clone();
        basis.directions.add_transposed_times(&resting, &mut mean);
        let left = |b: &usize| {
            let vertices = b * BLOCK / 3..((b + 1) * BLOCK / 3).min(shares.len());
            shares[vertices].iter().any(|s| *s > 0.0)
        };
        let blocks = ranges(whole.blocks.iter().cloned().flatten().filter(left));
        Ok(Self { components, blocks, mean, shares: Some(shares) })
    }

    /// Deltas `[V]` to those that are left of them.
    pub(crate) fn hold(&self, deltas: &mut [Vec3]) {
        let shares = self.shares.iter().flatten();
        deltas.iter_mut().zip(shares).for_each(|(delta, share)| *delta *= *share);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Matrix;

    /// Directions of five blocks, the last a short one, of which the second and the fourth are zero.
    fn basis(kept: fn(&Matrix) -> Matrix) -> DeltaBasis {
        let (rows, cols) = (9, 4 * BLOCK + 30);
        let value = |i: usize| ((i * 7919 + 13) % 1009) as f32 / 1009.0 - 0.5;
        let zero = |c: usize| c / BLOCK == 1 || c / BLOCK == 3;
        let all = (0..rows).flat_map(|r| (0..cols).map(move |c| if zero(c) { 0.0 } else { value(r * cols + c) }));
        DeltaBasis {
            mean: (0..cols).map(|c| value(5 * c)).collect(),
            directions: kept(&Matrix::new(rows, cols, all.collect())),
            coefficient_mean: vec![0.0; rows],
        }
    }

    #[test]
    fn what_never_moves_is_not_read_and_nothing_changes() {
        let kinds: [fn(&Matrix) -> Matrix; 3] = [Matrix::clone, Matrix::halved_blocks, |m| m.quantised(2)];
        for kept in kinds {
            let basis = basis(kept);
            let whole = Part::whole(&basis);
            assert_eq!(whole.blocks, [0..1, 2..3, 4..5], "{:?}", basis.directions.precision());
            let coefficients: Vec<f32> = (0..9).map(|k| 0.3 - 0.1 * k as f32).collect();
            let sum = |part| {
                let mut delta = vec![0.0; basis.mean.len()];
                basis.sum(&coefficients, &mut delta, part);
                delta
            };
            assert_eq!(sum(Some(&whole)), sum(None));
        }
        let whole = basis(Matrix::clone).directions;
        assert_eq!(whole.bytes_of_sums(), 4 * 9 * (2 * BLOCK + 30));
        assert_eq!(whole.bytes(), 4 * 9 * (4 * BLOCK + 30));
    }
}
