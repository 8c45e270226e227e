use crate::Precision;
use crate::blocks::{BLOCK, Blocks};
use crate::half::Half;
use crate::matrix::add_combination;
use softtissue_body::BodyModel;
use std::ops::Range;

/// The pose correctives of a body as a player reads them every frame: what a joint does not move costs nothing, and in a
/// bundle of fewer bits they have sixteen.
#[derive(Clone, Debug)]
pub(crate) enum Correctives {
    /// Few zeros among them: the body's own array.
    Body,
    Whole(Blocks<f32>),
    Half(Blocks<Half>),
}

/// A denser matrix is streamed faster as it is.
const DENSEST: f32 = 0.5;

impl Correctives {
    pub(crate) fn new(body: &BodyModel, precision: Precision) -> Self {
        let (rows, cols) = (9 * (body.joint_count() - 1), 3 * body.vertex_count());
        let numbers = bytemuck::cast_slice(&body.pose_directions);
        if precision != Precision::F32 {
            return Self::Half(Blocks::halved(rows, cols, numbers));
        }
        let whole = Blocks::whole(rows, cols, numbers);
        if whole.density() > DENSEST { Self::Body } else { Self::Whole(whole) }
    }

    /// Bytes that a frame reads.
    pub(crate) fn bytes(&self, body: &BodyModel) -> usize {
        match self {
            Self::Body => size_of_val(&body.pose_directions[..]),
            Self::Whole(whole) => whole.bytes(),
            Self::Half(half) => half.bytes(),
        }
    }

    /// Adds the offsets of `features [9 (J - 1)]` to some blocks of `offsets [V * 3]`.
    pub(crate) fn add(&self, body: &BodyModel, features: &[f32], offsets: &mut [f32], blocks: Range<usize>) {
        match self {
            Self::Body => {
                let columns = blocks.start * BLOCK..(blocks.end * BLOCK).min(offsets.len());
                add_combination(bytemuck::cast_slice(&body.pose_directions), features, offsets, columns);
            }
            Self::Whole(whole) => blocks.for_each(|b| whole.add(b, features, offsets)),
            Self::Half(half) => blocks.for_each(|b| half.add(b, features, offsets)),
        }
    }
}
