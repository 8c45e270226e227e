use crate::blocks::BLOCK;
use crate::controls::region_shares;
use crate::{BundleError, Model, Result};
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

/// The part of the deltas that a [`Detail`] leaves.
#[derive(Clone, Debug)]
pub(crate) struct Part {
    /// Components that are added up.
    pub(crate) components: usize,
    /// Blocks of columns in which something moves.
    pub(crate) blocks: Vec<Range<usize>>,
    /// Delta of the components at their mean; zero where nothing moves. `[V * 3]`.
    pub(crate) mean: Vec<f32>,
    /// Factor on each vertex, `[V]`.
    shares: Vec<f32>,
}

impl Part {
    /// `None` where all is wanted.
    pub(crate) fn new(detail: &Detail, model: &Model, body: &BodyModel) -> Result<Option<Self>> {
        if *detail == Detail::default() {
            return Ok(None);
        }
        let Some(basis) = model.basis() else {
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
        let blocks = (0..basis.directions.blocks()).filter(|b| {
            let vertices = b * BLOCK / 3..((b + 1) * BLOCK / 3).min(shares.len());
            shares[vertices].iter().any(|s| *s > 0.0)
        });
        let mut ranges: Vec<Range<usize>> = vec![];
        for block in blocks {
            match ranges.last_mut().filter(|r| r.end == block) {
                Some(range) => range.end += 1,
                None => ranges.push(block..block + 1),
            }
        }
        Ok(Some(Self { components, blocks: ranges, mean, shares }))
    }

    /// Deltas `[V]` to those that are left of them.
    pub(crate) fn hold(&self, deltas: &mut [Vec3]) {
        deltas.iter_mut().zip(&self.shares).for_each(|(delta, share)| *delta *= *share);
    }
}
