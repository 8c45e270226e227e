use crate::half::{self, Half, WIDENED};
use crate::matrix::widest;
use pulp::NullaryFnOnce;
use std::ops::Range;

/// Columns of a block: three numbers of 32 vertices.
pub(crate) const BLOCK: usize = 96;

/// A number of a strip.
pub(crate) trait Element: Copy + Default + PartialEq {
    /// As f32, but for the strip's factor.
    fn wide(self) -> f32;
}

impl Element for f32 {
    #[inline(always)]
    fn wide(self) -> f32 {
        self
    }
}

impl Element for Half {
    #[inline(always)]
    fn wide(self) -> f32 {
        self.widened()
    }
}

impl Element for i8 {
    #[inline(always)]
    fn wide(self) -> f32 {
        self as f32
    }
}

/// A matrix `[rows, cols]` cut into blocks of [`BLOCK`] columns, for sums of its rows: what one block takes lies in one
/// piece. A row's part in a block is a strip with a factor of its own; strips of zeros are left out, and a row may have two,
/// the second with what the first one's rounding left.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Blocks<T> {
    rows: usize,
    cols: usize,
    /// First strip of each block, and their number: `[blocks + 1]`.
    starts: Vec<usize>,
    /// Row of each strip, ascending within a block.
    row: Vec<u32>,
    /// Factor of each strip.
    scale: Vec<f32>,
    strips: Vec<[T; BLOCK]>,
}

impl<T: Element> Blocks<T> {
    /// `strips(row, numbers)` appends the strips of one row's part in a block.
    fn build(rows: usize, cols: usize, mut strips: impl FnMut(usize, usize, &mut Vec<(f32, [T; BLOCK])>)) -> Self {
        let blocks = cols.div_ceil(BLOCK);
        let mut built =
            Self { rows, cols, starts: vec![0], row: vec![], scale: vec![], strips: Vec::with_capacity(rows * blocks) };
        let mut made = vec![];
        for block in 0..blocks {
            for row in 0..rows {
                strips(block, row, &mut made);
                for (scale, strip) in made.drain(..).filter(|(_, s)| s.iter().any(|x| x.wide() != 0.0)) {
                    built.row.push(row as u32);
                    built.scale.push(scale);
                    built.strips.push(strip);
                }
            }
            built.starts.push(built.strips.len());
        }
        built.strips.shrink_to_fit();
        built
    }

    /// Blocks of columns.
    pub(crate) fn len(&self) -> usize {
        self.starts.len() - 1
    }
    /// Whether a block has anything but zeros.
    pub(crate) fn moves(&self, block: usize) -> bool {
        self.starts[block] < self.starts[block + 1]
    }
    /// Bytes that a sum of all rows reads.
    pub(crate) fn bytes(&self) -> usize {
        size_of_val(&self.strips[..]) + size_of_val(&self.scale[..]) + size_of_val(&self.row[..])
    }
    /// Strips that are kept, of as many as there would be without zeros.
    pub(crate) fn density(&self) -> f32 {
        self.strips.len() as f32 / (self.rows * self.len()).max(1) as f32
    }

    /// `y += sum_r x_r row_r` in one block; `y [cols]`. Of `x` shorter than the rows the others count as zero.
    pub(crate) fn add(&self, block: usize, x: &[f32], y: &mut [f32]) {
        let (first, mut last) = (self.starts[block], self.starts[block + 1]);
        if x.len() < self.rows {
            last = first + self.row[first..last].partition_point(|r| (*r as usize) < x.len());
        }
        let y = &mut y[block * BLOCK..];
        let width = y.len().min(BLOCK);
        let mut sum = [0.0; BLOCK];
        let (row, scale, strips) = (&self.row[first..last], &self.scale[first..last], &self.strips[first..last]);
        widest(Sum { x, row, scale, strips, sum: &mut sum });
        y[..width].iter_mut().zip(&sum).for_each(|(y, s)| *y += s);
    }

    /// Row `r` in f32, `[cols]`.
    pub(crate) fn row(&self, r: usize) -> Vec<f32> {
        self.to_f32(r..r + 1)
    }
    /// Some rows in f32, `[rows, cols]`.
    pub(crate) fn to_f32(&self, rows: Range<usize>) -> Vec<f32> {
        let mut out = vec![0.0; rows.len() * self.cols];
        for block in 0..self.len() {
            for s in self.starts[block]..self.starts[block + 1] {
                let row = self.row[s] as usize;
                if rows.contains(&row) {
                    let at = row - rows.start;
                    let to = &mut out[at * self.cols + block * BLOCK..(at + 1) * self.cols];
                    to.iter_mut().zip(&self.strips[s]).for_each(|(o, a)| *o += self.scale[s] * a.wide());
                }
            }
        }
        out
    }
}

/// The sum of strips. One after the other: all sums of a block stay in registers, or next to them.
struct Sum<'a, T> {
    x: &'a [f32],
    /// Place in `x` of each strip.
    row: &'a [u32],
    scale: &'a [f32],
    strips: &'a [[T; BLOCK]],
    sum: &'a mut [f32; BLOCK],
}

impl<T: Element> NullaryFnOnce for Sum<'_, T> {
    type Output = ();
    #[inline(always)]
    fn call(self) {
        let mut sum = [0.0f32; BLOCK];
        for (strip, (row, scale)) in self.strips.iter().zip(self.row.iter().zip(self.scale)) {
            let factor = self.x[*row as usize] * scale;
            for i in 0..BLOCK {
                sum[i] += factor * strip[i].wide();
            }
        }
        *self.sum = sum;
    }
}

/// A row's part in a block, with zeros behind the last column.
fn part<T: Copy + Default>(numbers: &[T], cols: usize, row: usize, block: usize) -> [T; BLOCK] {
    let from = &numbers[row * cols + block * BLOCK..(row + 1) * cols];
    let mut out = [T::default(); BLOCK];
    out.iter_mut().zip(from).for_each(|(o, x)| *o = *x);
    out
}

impl Blocks<f32> {
    /// Of `[rows, cols]` numbers as they are.
    pub(crate) fn whole(rows: usize, cols: usize, numbers: &[f32]) -> Self {
        Self::build(rows, cols, |block, row, made| made.push((1.0, part(numbers, cols, row, block))))
    }
}

impl Blocks<Half> {
    /// Of `[rows, cols]` numbers in 16-bit floats; those that fit are kept exactly.
    pub(crate) fn halved(rows: usize, cols: usize, numbers: &[f32]) -> Self {
        Self::build(rows, cols, |block, row, made| {
            let part = part(numbers, cols, row, block);
            let factor = half::factor(&part);
            made.push((WIDENED / factor, part.map(|x| Half::nearest(x * factor))));
        })
    }
}

/// Rows of bytes as a file has them: those of the matrix, then the second ones of the first few.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ByteRows {
    /// Rows, the second ones included.
    pub(crate) lines: usize,
    /// `[lines, cols]`.
    pub(crate) bytes: Vec<i8>,
    /// `[lines, blocks]`, above zero.
    pub(crate) scale: Vec<f32>,
}

impl Blocks<i8> {
    /// Of `[rows, cols]` numbers in bytes. The first `refined` rows have second strips for what rounding leaves.
    pub(crate) fn quantised(rows: usize, cols: usize, numbers: &[f32], refined: usize) -> Self {
        Self::build(rows, cols, |block, row, made| {
            let mut left = part(numbers, cols, row, block);
            for _ in 0..if row < refined { 2 } else { 1 } {
                let Some(scale) = step(&left) else { break };
                let strip = left.map(|x| (x / scale).round() as i8);
                left.iter_mut().zip(&strip).for_each(|(x, q)| *x -= scale * f32::from(*q));
                made.push((scale, strip));
            }
        })
    }

    /// Of a file's rows, the first `rows` of which are the matrix's. There are as many numbers as it says.
    pub(crate) fn from_rows(rows: usize, cols: usize, file: &ByteRows) -> Self {
        let blocks = cols.div_ceil(BLOCK);
        Self::build(rows, cols, |block, row, made| {
            for line in [row, rows + row].into_iter().filter(|line| *line < file.lines) {
                made.push((file.scale[line * blocks + block], part(&file.bytes, cols, line, block)));
            }
        })
    }

    /// As a file has them: strips that were left out are zeros with a factor of one.
    pub(crate) fn to_rows(&self) -> ByteRows {
        let (rows, cols, blocks) = (self.rows, self.cols, self.len());
        let second = |s: usize, block: usize| s > self.starts[block] && self.row[s - 1] == self.row[s];
        let strips =
            || (0..blocks).flat_map(|block| (self.starts[block]..self.starts[block + 1]).map(move |s| (block, s)));
        let refined = strips().filter(|(b, s)| second(*s, *b)).map(|(_, s)| self.row[s] as usize + 1).max();
        let lines = rows + refined.unwrap_or(0);
        let mut out = ByteRows { lines, bytes: vec![0; lines * cols], scale: vec![1.0; lines * blocks] };
        for (block, s) in strips() {
            let line = self.row[s] as usize + if second(s, block) { rows } else { 0 };
            out.scale[line * blocks + block] = self.scale[s];
            let to = &mut out.bytes[line * cols + block * BLOCK..(line + 1) * cols];
            to.iter_mut().zip(&self.strips[s]).for_each(|(o, q)| *o = *q);
        }
        out
    }
}

/// What one of 127 steps stands for; `None` where all is zero, or as good as.
fn step(numbers: &[f32]) -> Option<f32> {
    let scale = numbers.iter().fold(0.0f32, |m, x| m.max(x.abs())) / 127.0;
    scale.is_normal().then_some(scale)
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROWS: usize = 21;
    const COLS: usize = 2 * BLOCK + 31;

    /// Row 3 is zero in the first block, rows get smaller towards the last.
    fn numbers() -> Vec<f32> {
        let value = |i: usize| ((i * 7919 + 13) % 1009) as f32 / 1009.0 - 0.5;
        let zero = |r: usize, c: usize| r == 3 && c < BLOCK;
        let at = |r: usize, c: usize| if zero(r, c) { 0.0 } else { value(r * COLS + c) / (1 + r) as f32 };
        (0..ROWS).flat_map(|r| (0..COLS).map(move |c| at(r, c))).collect()
    }

    fn weights() -> Vec<f32> {
        (0..ROWS).map(|r| ((r * 31 + 7) % 17) as f32 / 17.0 - 0.4).collect()
    }

    fn sum<T: Element>(blocks: &Blocks<T>, x: &[f32]) -> Vec<f32> {
        let mut y = vec![1.0; COLS];
        (0..blocks.len()).for_each(|b| blocks.add(b, x, &mut y));
        y
    }

    /// The sum in f64 and how far a rounding of `part` of each strip's largest number may take it.
    fn exact(x: &[f32], part: f64) -> Vec<(f64, f64)> {
        let all = numbers();
        let number = |r: usize, c: usize| f64::from(all[r * COLS + c]);
        let largest =
            |r: usize, b: usize| (b * BLOCK..COLS.min((b + 1) * BLOCK)).map(|c| number(r, c).abs()).fold(0.0, f64::max);
        let of = |c: usize| {
            let rows = x.iter().enumerate();
            rows.fold((1.0, 2e-6), |(sum, bound), (r, x)| {
                let x = f64::from(*x);
                (sum + x * number(r, c), bound + part * x.abs() * largest(r, c / BLOCK))
            })
        };
        (0..COLS).map(of).collect()
    }

    #[track_caller]
    fn close(found: &[f32], exact: &[(f64, f64)], beats: bool) {
        let mut worst = 0.0f64;
        for (c, (found, (sum, bound))) in found.iter().zip(exact).enumerate() {
            let off = (f64::from(*found) - sum).abs();
            assert!(off <= *bound, "column {c}: {found} {sum}, allowed {bound}");
            worst = worst.max(off / bound);
        }
        assert!(!beats || worst > 0.05, "the bound is {worst} of what it could be");
    }

    #[test]
    fn sums_in_every_precision_are_those_in_f64_within_their_rounding() {
        let x = weights();
        let all = numbers();
        let whole = Blocks::whole(ROWS, COLS, &all);
        close(&sum(&whole, &x), &exact(&x, 0.0), false);
        close(&sum(&Blocks::halved(ROWS, COLS, &all), &x), &exact(&x, 0.5f64.powi(11)), true);
        close(&sum(&Blocks::quantised(ROWS, COLS, &all, 0), &x), &exact(&x, 0.5 / 127.0), true);
        let refined = Blocks::quantised(ROWS, COLS, &all, ROWS);
        close(&sum(&refined, &x), &exact(&x, 0.51 / 127.0 / 254.0), false);
        // Half of the rows alone.
        let few = &x[..18];
        close(&sum(&whole, few), &exact(few, 0.0), false);
        close(&sum(&refined, few), &exact(few, 0.51 / 127.0 / 254.0), false);
    }

    #[test]
    fn zeros_cost_nothing() {
        let all = numbers();
        let whole = Blocks::whole(ROWS, COLS, &all);
        assert_eq!(whole.strips.len(), 3 * ROWS - 1);
        assert!(whole.density() < 1.0);
        assert_eq!(whole.to_f32(0..ROWS), all);
        assert_eq!(Blocks::quantised(2, 3, &[0.0; 6], 2).strips.len(), 0);
        assert_eq!(sum(&Blocks::halved(ROWS, COLS, &vec![0.0; ROWS * COLS]), &weights()), vec![1.0; COLS]);
    }

    #[test]
    fn bytes_come_back_from_the_rows_of_a_file() {
        for refined in [0, 4, ROWS] {
            let blocks = Blocks::quantised(ROWS, COLS, &numbers(), refined);
            let rows = blocks.to_rows();
            assert_eq!(rows.lines, ROWS + refined);
            assert!(rows.scale.iter().all(|s| *s > 0.0));
            assert_eq!(Blocks::from_rows(ROWS, COLS, &rows), blocks);
        }
    }
}
