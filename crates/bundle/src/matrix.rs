/// A row-major matrix of f32.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Matrix {
    rows: usize,
    cols: usize,
    data: Vec<f32>,
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
        Self { rows, cols, data }
    }
    /// All zeros.
    pub fn zeros(rows: usize, cols: usize) -> Self {
        Self { rows, cols, data: vec![0.0; rows * cols] }
    }
    /// Rows.
    pub fn rows(&self) -> usize {
        self.rows
    }
    /// Columns.
    pub fn cols(&self) -> usize {
        self.cols
    }
    /// All numbers, row after row.
    pub fn data(&self) -> &[f32] {
        &self.data
    }
    /// All numbers, to change.
    pub fn data_mut(&mut self) -> &mut [f32] {
        &mut self.data
    }
    /// Row `r`, `[cols]`.
    pub fn row(&self, r: usize) -> &[f32] {
        &self.data[r * self.cols..(r + 1) * self.cols]
    }
    /// Row `r`, to change.
    pub fn row_mut(&mut self, r: usize) -> &mut [f32] {
        &mut self.data[r * self.cols..(r + 1) * self.cols]
    }

    /// `y = M x`; `x [cols]`, `y [rows]`.
    pub fn times(&self, x: &[f32], y: &mut [f32]) {
        assert_eq!((x.len(), y.len()), (self.cols, self.rows), "matrix times vector");
        for (r, y) in y.iter_mut().enumerate() {
            *y = dot(self.row(r), x);
        }
    }

    /// `y += M^T x`; `x [rows]`, `y [cols]`.
    pub fn add_transposed_times(&self, x: &[f32], y: &mut [f32]) {
        assert_eq!((x.len(), y.len()), (self.rows, self.cols), "transposed matrix times vector");
        add_combination(&self.data, x, y);
    }
}

/// `y += sum_r x_r row_r` for rows of the length of `y` that stand one after the other. Every row is streamed once,
/// [`TOGETHER`] at a time, so that a sum is loaded and stored once for all of them; with the widest vector registers that
/// the processor has, in the same order of additions on every one.
pub(crate) fn add_combination(rows: &[f32], x: &[f32], y: &mut [f32]) {
    assert_eq!(rows.len(), y.len() * x.len(), "rows of a combination");
    pulp::Arch::new().dispatch(
        #[inline(always)]
        || {
            let cols = y.len();
            let (groups, rest) = x.as_chunks::<TOGETHER>();
            for (g, x) in groups.iter().enumerate() {
                let row = |k: usize| &rows[(TOGETHER * g + k) * cols..][..cols];
                let rows: [&[f32]; TOGETHER] = std::array::from_fn(row);
                for (i, y) in y.iter_mut().enumerate() {
                    let mut sums: [f32; TOGETHER] = std::array::from_fn(|k| x[k] * rows[k][i]);
                    let mut count = TOGETHER / 2;
                    while count > 0 {
                        (0..count).for_each(|k| sums[k] += sums[k + count]);
                        count /= 2;
                    }
                    *y += sums[0];
                }
            }
            for (k, x) in rest.iter().enumerate() {
                let row = &rows[(TOGETHER * groups.len() + k) * cols..][..cols];
                y.iter_mut().zip(row).for_each(|(y, a)| *y += x * a);
            }
        },
    );
}

/// Inner product in [`LANES`] partial sums.
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
    let rest: f32 = a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum();
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
    }
}
