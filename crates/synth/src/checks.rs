use crate::{Result, SynthError};
use std::ops::RangeInclusive;

/// Refuses numbers outside their range, naming the field and the range. A value that is not a number is outside.
pub(crate) fn within<const N: usize>(numbers: [(&'static str, f32, RangeInclusive<f32>); N]) -> Result<()> {
    match numbers.into_iter().find(|(_, value, range)| !range.contains(value)) {
        None => Ok(()),
        Some((field, value, range)) => {
            let reason = format!("{value} is out of range; write {} to {}", range.start(), range.end());
            Err(SynthError::Config { field, reason })
        }
    }
}
