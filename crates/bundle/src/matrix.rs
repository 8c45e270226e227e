use crate::Precision;
use crate::blocks::{BLOCK, Blocks, ByteRows};
use crate::half::{Half, HalfRows};
use pulp::NullaryFnOnce;
use std::borrow::Cow;
use std::ops::Range;

/// A matrix of f32, or of fewer bits: then what is read of it for a product is that much less, and its numbers are those
/// that the fewer bits stand for.
#[derive(Clone, Debug, PartialEq)]
pub struct Matrix {
    rows: usize,
    cols: usize,
    store: Store,
}

/// How the numbers lie in memory.
#[derive(Clone, Debug, PartialEq)]
enum Store {
    /// f32, row after row.
    Whole(Vec<f32>),
    /// For products with rows.
    Half(HalfRows),
    /// For sums of rows.
    HalfBlocks(Blocks<Half>),
    /// For sums of rows.
    Bytes(Blocks<i8>),
}

impl Default for Matrix {
    fn default() -> Self {
        Self::zeros(0, 0)
    }
}

/// Sums are kept in this many lanes, so that the compiler may use vector registers; the order of additions is
/// fixed by the number, not by the machine.
const LANES: usize = 8;

/// Rows that [`add_combination`] streams together; a power of two. Sixteen are too many for the compiler to make vector code
/// of for WebAssembly, which takes three times as long without.
const TOGETHER: usize = if cfg!(target_family = "wasm") { 4 } else { 16 };

impl Matrix {
    /// Takes `rows * cols` numbers, row after row. Panics if the length differs (a programming error).
    pub fn new(rows: usize, cols: usize, data: Vec<f32>) -> Self {
        assert_eq!(data.len(), rows * cols, "numbers of a {rows} x {cols} matrix");
        Self { rows, cols, store: Store::Whole(data) }
    }
    /// All zeros.
    pub fn zeros(rows: usize, cols: usize) -> Self {
        Self::new(rows, cols, vec![0.0; rows * cols])
    }
    /// The same in 16-bit floats, for [`times`](Self::times).
    pub(crate) fn halved(&self) -> Self {
        Self { store: Store::Half(HalfRows::new(self.rows, self.cols, &self.numbers())), ..*self }
    }
    /// The same in 16-bit floats, for [`add_transposed_times`](Self::add_transposed_times).
    pub(crate) fn halved_blocks(&self) -> Self {
        Self { store: Store::HalfBlocks(Blocks::halved(self.rows, self.cols, &self.numbers())), ..*self }
    }
    /// The same in bytes, the first `refined` rows in two each, for [`add_transposed_times`](Self::add_transposed_times).
    pub(crate) fn quantised(&self, refined: usize) -> Self {
        Self { store: Store::Bytes(Blocks::quantised(self.rows, self.cols, &self.numbers(), refined)), ..*self }
    }
    /// From the rows of a file.
    pub(crate) fn from_byte_rows(rows: usize, cols: usize, file: &ByteRows) -> Self {
        Self { rows, cols, store: Store::Bytes(Blocks::from_rows(rows, cols, file)) }
    }
    /// Rows for a file, where the numbers are bytes.
    pub(crate) fn byte_rows(&self) -> Option<ByteRows> {
        match &self.store {
            Store::Bytes(blocks) => Some(blocks.to_rows()),
            _ => None,
        }
    }
    /// What its numbers are kept in.
    pub fn precision(&self) -> Precision {
        match self.store {
            Store::Whole(_) => Precision::F32,
            Store::Half(_) | Store::HalfBlocks(_) => Precision::F16,
            Store::Bytes(_) => Precision::I8,
        }
    }
    /// Bytes that a product reads of it.
    pub(crate) fn bytes(&self) -> usize {
        match &self.store {
            Store::Whole(data) => size_of_val(&data[..]),
            Store::Half(half) => half.bytes(),
            Store::HalfBlocks(blocks) => blocks.bytes(),
            Store::Bytes(blocks) => blocks.bytes(),
        }
    }
    /// Whether a block of columns has anything but zeros.
    pub(crate) fn moves(&self, block: usize) -> bool {
        match &self.store {
            Store::Whole(data) => {
                let columns = block * BLOCK..((block + 1) * BLOCK).min(self.cols);
                data.chunks_exact(self.cols).any(|row| row[columns.clone()].iter().any(|x| *x != 0.0))
            }
            Store::Half(_) => true,
            Store::HalfBlocks(blocks) => blocks.moves(block),
            Store::Bytes(blocks) => blocks.moves(block),
        }
    }
    /// Bytes that a sum of its rows reads, blocks of zeros left out.
    pub(crate) fn bytes_of_sums(&self) -> usize {
        let Store::Whole(_) = &self.store else { return self.bytes() };
        let columns = |block: usize| (self.cols - block * BLOCK).min(BLOCK);
        let moving = (0..self.blocks()).filter(|b| self.moves(*b));
        moving.map(columns).sum::<usize>() * self.rows * size_of::<f32>()
    }
    /// Rows.
    pub fn rows(&self) -> usize {
        self.rows
    }
    /// Columns.
    pub fn cols(&self) -> usize {
        self.cols
    }
    /// All numbers of a matrix of f32, row after row. Panics if it has fewer bits, as only those of bundles can
    /// ([`numbers`](Self::numbers) takes any).
    pub fn data(&self) -> &[f32] {
        self.whole().expect("a matrix of f32")
    }
    /// Row `r`, `[cols]`, of a matrix of f32. Panics if it has fewer bits.
    pub fn row(&self, r: usize) -> &[f32] {
        &self.data()[r * self.cols..(r + 1) * self.cols]
    }
    /// All numbers of any matrix, row after row.
    pub fn numbers(&self) -> Cow<'_, [f32]> {
        match &self.store {
            Store::Whole(data) => Cow::Borrowed(data),
            Store::Half(half) => Cow::Owned((0..self.rows).flat_map(|r| half.row(r)).collect()),
            Store::HalfBlocks(blocks) => Cow::Owned(blocks.to_f32(0..self.rows)),
            Store::Bytes(blocks) => Cow::Owned(blocks.to_f32(0..self.rows)),
        }
    }
    /// All numbers where they are f32, to borrow for long.
    pub(crate) fn whole(&self) -> Option<&[f32]> {
        match &self.store {
            Store::Whole(data) => Some(data),
            _ => None,
        }
    }
    /// All numbers, to change; from then on in f32.
    pub fn data_mut(&mut self) -> &mut [f32] {
        if self.whole().is_none() {
            self.store = Store::Whole(self.numbers().into_owned());
        }
        match &mut self.store {
            Store::Whole(data) => data,
            _ => unreachable!("it has just been made whole"),
        }
    }
    /// Row `r` of any matrix, `[cols]`.
    pub fn numbers_of_row(&self, r: usize) -> Cow<'_, [f32]> {
        match &self.store {
            Store::Whole(data) => Cow::Borrowed(&data[r * self.cols..(r + 1) * self.cols]),
            Store::Half(half) => Cow::Owned(half.row(r).collect()),
            Store::HalfBlocks(blocks) => Cow::Owned(blocks.row(r)),
            Store::Bytes(blocks) => Cow::Owned(blocks.row(r)),
        }
    }
    /// Row `r`, to change; from then on in f32.
    pub fn row_mut(&mut self, r: usize) -> &mut [f32] {
        let cols = self.cols;
        &mut self.data_mut()[r * cols..(r + 1) * cols]
    }

    /// `y = M x`; `x [cols]`, `y [rows]`. Allocates nothing unless the numbers are in blocks, for sums.
    pub fn times(&self, x: &[f32], y: &mut [f32]) {
        assert_eq!((x.len(), y.len()), (self.cols, self.rows), "matrix times vector");
        match &self.store {
            Store::Whole(rows) => widest(Products { rows, x, y }),
            Store::Half(half) => half.times(x, y),
            Store::HalfBlocks(_) | Store::Bytes(_) => {
                y.iter_mut().enumerate().for_each(|(r, y)| *y = dot(&self.numbers_of_row(r), x));
            }
        }
    }

    /// `y += M^T x`; `x [rows]`, `y [cols]`. Allocates nothing unless the numbers are in half rows, for products.
    pub fn add_transposed_times(&self, x: &[f32], y: &mut [f32]) {
        assert_eq!((x.len(), y.len()), (self.rows, self.cols), "transposed matrix times vector");
        self.add_transposed_blocks(x, y, 0..self.blocks());
    }

    /// Parts that the columns are cut into, [`BLOCK`] in each.
    pub(crate) fn blocks(&self) -> usize {
        self.cols.div_ceil(BLOCK)
    }

    /// The same in some of the blocks of columns, and of the first rows only: as many as `x` has. The numbers are the same to
    /// the bit, however columns are dealt out to calls.
    pub(crate) fn add_transposed_blocks(&self, x: &[f32], y: &mut [f32], blocks: Range<usize>) {
        let columns = blocks.start * BLOCK..(blocks.end * BLOCK).min(self.cols);
        match &self.store {
            Store::Whole(data) => add_combination(&data[..x.len() * self.cols], x, y, columns),
            Store::HalfBlocks(half) => blocks.for_each(|b| half.add(b, x, y)),
            Store::Bytes(bytes) => blocks.for_each(|b| bytes.add(b, x, y)),
            Store::Half(_) => add_combination(&self.numbers()[..x.len() * self.cols], x, y, columns),
        }
    }
}

/// `y += sum_r x_r row_r` in some columns, for rows of the length of `y` that stand one after the other. Every row is
/// streamed once, [`TOGETHER`] at a time, so that a sum is loaded and stored once for all of them; with the widest vector
/// registers that the processor has, in the same order of additions on every one.
pub(crate) fn add_combination(rows: &[f32], x: &[f32], y: &mut [f32], columns: Range<usize>) {
    assert_eq!(rows.len(), y.len() * x.len(), "rows of a combination");
    widest(Combination { rows, x, y, columns });
}

/// Runs work in the widest registers that the processor has. A type and not a closure: the compiler does not always put the
/// body of a closure where it may use them.
pub(crate) fn widest<W: NullaryFnOnce>(work: W) -> W::Output {
    pulp::Arch::new().dispatch(work)
}

/// See [`add_combination`].
struct Combination<'a> {
    rows: &'a [f32],
    x: &'a [f32],
    y: &'a mut [f32],
    columns: Range<usize>,
}

impl NullaryFnOnce for Combination<'_> {
    type Output = ();
    #[inline(always)]
    fn call(self) {
        let Self { rows, x, y, columns } = self;
        let cols = y.len();
        let y = &mut y[columns.clone()];
        let (groups, rest) = x.as_chunks::<TOGETHER>();
        for (g, x) in groups.iter().enumerate() {
            let mut of_group: [&[f32]; TOGETHER] = [&[]; TOGETHER];
            for (k, row) in of_group.iter_mut().enumerate() {
                *row = &rows[(TOGETHER * g + k) * cols..][columns.start..columns.end];
            }
            for (i, y) in y.iter_mut().enumerate() {
                let mut sums = [0.0; TOGETHER];
                for k in 0..TOGETHER {
                    sums[k] = x[k] * of_group[k][i];
                }
                *y += folded(sums);
            }
        }
        for (k, x) in rest.iter().enumerate() {
            let row = &rows[(TOGETHER * groups.len() + k) * cols..][columns.start..columns.end];
            for (y, a) in y.iter_mut().zip(row) {
                *y += x * a;
            }
        }
    }
}

/// The sum of all, halves onto each other.
#[inline(always)]
fn folded(mut sums: [f32; TOGETHER]) -> f32 {
    let mut count = TOGETHER / 2;
    while count > 0 {
        for k in 0..count {
            sums[k] += sums[k + count];
        }
        count /= 2;
    }
    sums[0]
}

/// `y = M x` for rows of the length of `x` that stand one after the other.
struct Products<'a> {
    rows: &'a [f32],
    x: &'a [f32],
    y: &'a mut [f32],
}

impl NullaryFnOnce for Products<'_> {
    type Output = ();
    #[inline(always)]
    fn call(self) {
        let cols = self.x.len();
        for (r, y) in self.y.iter_mut().enumerate() {
            *y = dot(&self.rows[r * cols..(r + 1) * cols], self.x);
        }
    }
}

/// Inner product in [`LANES`] partial sums.
#[inline(always)]
pub(crate) fn dot(a: &[f32], b: &[f32]) -> f32 {
    debug_assert_eq!(a.len(), b.len(), "inner product");
    let (a_blocks, a_rest) = a.as_chunks::<LANES>();
    let (b_blocks, b_rest) = b.as_chunks::<LANES>();
    let mut lanes = [0.0f32; LANES];
    for (a, b) in a_blocks.iter().zip(b_blocks) {
        for i in 0..LANES {
            lanes[i] += a[i] * b[i];
        }
    }
    let mut rest = 0.0;
    for (a, b) in a_rest.iter().zip(b_rest) {
        rest += a * b;
    }
    ((lanes[0] + lanes[4]) + (lanes[1] + lanes[5])) + ((lanes[2] + lanes[6]) + (lanes[3] + lanes[7])) + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_match_sums_in_f64() {
        let (rows, cols) = (TOGETHER + 7, 4109);
        let value = |i: usize| ((i * 7919 + 13) % 1009) as f32 / 1009.0 - 0.5;
        let m = Matrix::new(rows, cols, (0..rows * cols).map(value).collect());
        let x: Vec<f32> = (0..cols).map(|i| value(i + 5)).collect();
        let mut y = vec![0.0; rows];
        m.times(&x, &mut y);
        for r in 0..rows {
            let exact: f64 = m.row(r).iter().zip(&x).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum();
            assert!((f64::from(y[r]) - exact).abs() < 1e-4, "{} {exact}", y[r]);
        }
        let mut back = vec![1.0; cols];
        let weights: Vec<f32> = (0..rows).map(|r| value(3 * r)).collect();
        m.add_transposed_times(&weights, &mut back);
        for c in 0..cols {
            let exact = 1.0 + (0..rows).map(|r| f64::from(m.row(r)[c]) * f64::from(weights[r])).sum::<f64>();
            assert!((f64::from(back[c]) - exact).abs() < 1e-5, "{} {exact}", back[c]);
        }
        for kept in [m.clone(), m.halved(), m.halved_blocks(), m.quantised(3)] {
            let mut whole = vec![1.0; cols];
            kept.add_transposed_times(&weights, &mut whole);
            let mut parts = vec![1.0; cols];
            for blocks in [0..7, 7..8, 8..kept.blocks()] {
                kept.add_transposed_blocks(&weights, &mut parts, blocks);
            }
            assert_eq!(parts, whole, "{:?}", kept.precision());
        }
    }

    #[test]
    fn numbers_of_fewer_bits_are_those_that_products_use() {
        let (rows, cols) = (TOGETHER + 3, 2 * BLOCK + 5);
        let value = |i: usize| ((i * 7919 + 13) % 1009) as f32 / 1009.0 - 0.5;
        let m = Matrix::new(rows, cols, (0..rows * cols).map(value).collect());
        let (x, weights): (Vec<f32>, Vec<f32>) = ((0..cols).map(value).collect(), (0..rows).map(value).collect());
        for kept in [m.halved(), m.halved_blocks(), m.quantised(0), m.quantised(4)] {
            assert_ne!(kept.numbers(), m.numbers());
            let mut plain = kept.clone();
            plain.data_mut();
            assert_eq!((plain.precision(), plain.data()), (Precision::F32, &*kept.numbers()));
            assert!((0..rows).all(|r| kept.numbers_of_row(r) == plain.row(r)));
            let close = |a: Vec<f32>, b: Vec<f32>| a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 1e-4);
            let times = |m: &Matrix| {
                let mut y = vec![0.0; rows];
                m.times(&x, &mut y);
                y
            };
            assert!(close(times(&kept), times(&plain)), "{:?}", kept.precision());
            let back = |m: &Matrix| {
                let mut y = vec![0.0; cols];
                m.add_transposed_times(&weights, &mut y);
                y
            };
            assert!(close(back(&kept), back(&plain)), "{:?}", kept.precision());
        }
    }
}
