use crate::model::fits;
use std::cmp::Ordering;

/// Least and greatest value of each of a few numbers.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Limits {
    /// Least.
    pub lower: Vec<f32>,
    /// Greatest.
    pub upper: Vec<f32>,
}

impl Limits {
    /// Of no number yet: everything widens it.
    pub fn nothing(len: usize) -> Self {
        Self { lower: vec![f32::INFINITY; len], upper: vec![f32::NEG_INFINITY; len] }
    }
    /// Widens the range by a frame's numbers.
    pub fn widen(&mut self, numbers: &[f32]) {
        self.lower.iter_mut().zip(numbers).for_each(|(l, x)| *l = l.min(*x));
        self.upper.iter_mut().zip(numbers).for_each(|(u, x)| *u = u.max(*x));
    }
    /// Numbers that it limits.
    pub fn len(&self) -> usize {
        self.lower.len()
    }
    /// Whether it limits none.
    pub fn is_empty(&self) -> bool {
        self.lower.is_empty()
    }
    /// Clips numbers to the range, no number to its middle; returns how many were changed.
    pub fn clip(&self, numbers: &mut [f32]) -> usize {
        let mut changed = 0;
        for ((x, low), high) in numbers.iter_mut().zip(&self.lower).zip(&self.upper) {
            if !(*low..=*high).contains(x) {
                *x = if x.is_nan() { 0.5 * (low + high) } else { x.clamp(*low, *high) };
                changed += 1;
            }
        }
        changed
    }
    /// Whether there are `count` ranges, none of them empty; the sentence says what does not fit.
    pub(crate) fn check(&self, what: &str, count: usize) -> Result<(), String> {
        fits(what, &[self.lower.len(), self.upper.len()], &[count, count])?;
        let empty = |(low, high): (&f32, &f32)| low.partial_cmp(high).is_none_or(Ordering::is_gt);
        match self.lower.iter().zip(&self.upper).position(empty) {
            Some(i) => Err(format!("its {what} are empty at place {i}; export it again")),
            None => Ok(()),
        }
    }
}
