use crate::matrix::widest;
use half::f16;
use pulp::NullaryFnOnce;

/// The bits of a 16-bit float (IEEE 754 binary16), never one that is not finite.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Half(u16);

/// [`Half::widened`] leaves this factor to its caller: the exponents of the two formats are that far apart.
pub(crate) const WIDENED: f32 = f32::from_bits((127 + 112) << 23);

/// Exponent that the largest number of a row is brought to: two below the largest there is, and small numbers as far above
/// the denormal ones, which processors are slow with, as can be.
const HIGHEST: i32 = 14;
/// Exponents that rows are moved by: their factors, [`WIDENED`] included, stay ordinary f32 numbers.
const SHIFTS: (i32, i32) = (-14, 100);

impl Half {
    /// The nearest one. Numbers beyond its range become the largest.
    pub(crate) fn nearest(x: f32) -> Self {
        let largest = f16::MAX.to_f32();
        Self(f16::from_f32(x.clamp(-largest, largest)).to_bits())
    }
    /// The number over [`WIDENED`]: sign, exponent and mantissa put in their places in an f32, which is what every
    /// processor does at speed.
    #[inline(always)]
    pub(crate) fn widened(self) -> f32 {
        f32::from_bits(((self.0 as i16 as i32) << 13) as u32 & 0x8fff_ffff)
    }
}

/// The numbers of a file, `bits` little-endian pairs of bytes; `None` where one is not finite.
pub(crate) fn from_bytes(bytes: &[u8]) -> Option<Vec<f32>> {
    let number = |pair: &[u8; 2]| Some(f16::from_le_bytes(*pair)).filter(|h| h.is_finite()).map(f16::to_f32);
    bytes.as_chunks::<2>().0.iter().map(number).collect()
}

/// The bytes of a file, each number rounded to the nearest.
pub(crate) fn to_bytes(numbers: &[f32]) -> Vec<u8> {
    numbers.iter().flat_map(|x| f16::from_f32(*x).to_le_bytes()).collect()
}

/// Numbers as a file of 16-bit floats keeps them; the first one that it cannot is the error.
pub(crate) fn rounded(numbers: &[f32]) -> Result<Vec<f32>, f32> {
    let round = |x: &f32| Some(f16::from_f32(*x)).filter(|h| h.is_finite()).map(f16::to_f32).ok_or(*x);
    numbers.iter().map(round).collect()
}

/// Factor, a power of two, that brings a row of numbers to where [`Half`] is finest.
pub(crate) fn factor(row: &[f32]) -> f32 {
    let largest = row.iter().fold(0.0f32, |m, x| m.max(x.abs()));
    // The biased exponent is the logarithm, rounded down; of zero, anything will do.
    let exponent = (largest.to_bits() >> 23) as i32 - 127;
    let shift = if largest == 0.0 { 0 } else { (HIGHEST - exponent).clamp(SHIFTS.0, SHIFTS.1) };
    f32::from_bits(((127 + shift) as u32) << 23)
}

/// A row-major matrix of 16-bit floats, each row with a factor of its own; for products with its rows.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct HalfRows {
    cols: usize,
    data: Vec<Half>,
    /// What a row's numbers are multiplied by, `[rows]`.
    scale: Vec<f32>,
}

/// Partial sums of a product; the order of additions is fixed by the number, not by the machine.
const LANES: usize = 32;

impl HalfRows {
    /// Of `[rows, cols]` numbers. What fits 16-bit floats is kept exactly.
    pub(crate) fn new(rows: usize, cols: usize, numbers: &[f32]) -> Self {
        let factors: Vec<f32> = (0..rows).map(|r| factor(&numbers[r * cols..][..cols])).collect();
        let scaled = |(i, x): (usize, &f32)| Half::nearest(x * factors[i / cols.max(1)]);
        let data = numbers.iter().enumerate().map(scaled).collect();
        Self { cols, data, scale: factors.iter().map(|f| 1.0 / f).collect() }
    }
    /// Bytes that a product reads.
    pub(crate) fn bytes(&self) -> usize {
        size_of_val(&self.data[..]) + size_of_val(&self.scale[..])
    }
    /// Row `r`, `[cols]`.
    pub(crate) fn row(&self, r: usize) -> impl Iterator<Item = f32> {
        let scale = self.scale[r];
        self.data[r * self.cols..][..self.cols].iter().map(move |h| h.widened() * WIDENED * scale)
    }
    /// `y = M x`.
    pub(crate) fn times(&self, x: &[f32], y: &mut [f32]) {
        widest(Products { rows: self, x, y });
    }
}

/// See [`HalfRows::times`].
struct Products<'a> {
    rows: &'a HalfRows,
    x: &'a [f32],
    y: &'a mut [f32],
}

impl NullaryFnOnce for Products<'_> {
    type Output = ();
    #[inline(always)]
    fn call(self) {
        let HalfRows { cols, data, scale } = self.rows;
        for (r, y) in self.y.iter_mut().enumerate() {
            *y = scale[r] * dot(&data[r * cols..(r + 1) * cols], self.x);
        }
    }
}

#[inline(always)]
fn dot(a: &[Half], b: &[f32]) -> f32 {
    let (a_blocks, a_rest) = a.as_chunks::<LANES>();
    let (b_blocks, b_rest) = b.as_chunks::<LANES>();
    let mut lanes = [0.0f32; LANES];
    for (a, b) in a_blocks.iter().zip(b_blocks) {
        for i in 0..LANES {
            lanes[i] += a[i].widened() * WIDENED * b[i];
        }
    }
    for (i, (a, b)) in a_rest.iter().zip(b_rest).enumerate() {
        lanes[i] += a.widened() * WIDENED * b;
    }
    let mut count = LANES / 2;
    while count > 0 {
        for i in 0..count {
            lanes[i] += lanes[i + count];
        }
        count /= 2;
    }
    lanes[0]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_number_widens_exactly() {
        for bits in 0..=u16::MAX {
            let number = f16::from_bits(bits);
            if number.is_finite() {
                let wide = Half(bits).widened() * WIDENED;
                assert_eq!(wide.to_bits(), number.to_f32().to_bits(), "{bits:#06x}");
                assert_eq!(Half::nearest(number.to_f32()), Half(bits));
            }
        }
        assert_eq!(Half::nearest(1e9).widened() * WIDENED, 65504.0);
    }

    #[test]
    fn rows_of_any_size_keep_eleven_bits() {
        for size in [1e-30f32, 1e-7, 1e-3, 1.0, 6e4, 1e7] {
            let numbers: Vec<f32> = (0..33).map(|i| size * (0.1 + ((i * 37) % 19) as f32 / 19.0)).collect();
            let kept: Vec<f32> = HalfRows::new(3, 11, &numbers).row(1).collect();
            for (kept, exact) in kept.iter().zip(&numbers[11..]) {
                assert!((kept - exact).abs() <= exact * 2f32.powi(-11), "{kept} {exact}");
            }
        }
        assert_eq!(HalfRows::new(1, 3, &[0.0; 3]).row(0).collect::<Vec<_>>(), [0.0; 3]);
    }

    #[test]
    fn products_match_sums_in_f64() {
        let (rows, cols) = (5, 1003);
        let value = |i: usize| ((i * 7919 + 13) % 1009) as f32 / 1009.0 - 0.5;
        let numbers: Vec<f32> = (0..rows * cols).map(value).collect();
        let half = HalfRows::new(rows, cols, &numbers);
        let x: Vec<f32> = (0..cols).map(|i| value(i + 5)).collect();
        let mut y = vec![0.0; rows];
        half.times(&x, &mut y);
        for r in 0..rows {
            let kept: f64 = half.row(r).zip(&x).map(|(a, b)| f64::from(a) * f64::from(*b)).sum();
            assert!((f64::from(y[r]) - kept).abs() < 1e-4, "{} {kept}", y[r]);
            // Rounding is at most 2^-12 of a number below one half, which a thousand random ones add up by its root.
            let exact: f64 = numbers[r * cols..].iter().zip(&x).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum();
            assert!((kept - exact).abs() < 1e-2 && kept != exact, "{kept} {exact}");
        }
    }
}
