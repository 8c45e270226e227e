/// Symmetric positive definite `[n, n]` matrix whose entries farther than `width` from the diagonal are zero; the lower
/// triangle, row by row. Its Cholesky factor has the same shape.
pub(crate) struct Banded {
    n: usize,
    width: usize,
    /// `[n][width + 1]`, the diagonal last.
    rows: Vec<f64>,
}

impl Banded {
    pub fn zeros(n: usize, width: usize) -> Self {
        Self { n, width, rows: vec![0.0; n * (width + 1)] }
    }

    /// The entry of row `i` and column `j`, with `i - width <= j <= i`.
    pub fn at(&mut self, i: usize, j: usize) -> &mut f64 {
        assert!(j <= i && i - j <= self.width, "entry {i}, {j} outside the band");
        &mut self.rows[i * (self.width + 1) + self.width + j - i]
    }

    /// Factors in place. `None` if the matrix is not positive definite.
    pub fn cholesky(mut self) -> Option<BandedFactor> {
        let (n, w) = (self.n, self.width);
        for i in 0..n {
            let (above, row) = self.rows.split_at_mut(i * (w + 1));
            let row = &mut row[..=w];
            let first = i.saturating_sub(w);
            for j in first..i {
                let other = &above[j * (w + 1)..(j + 1) * (w + 1)];
                // columns from first to j - 1: the last of row j's before its diagonal
                let count = j - first;
                let sum = dot(&row[w + first - i..w + j - i], &other[w - count..w]);
                row[w + j - i] = (row[w + j - i] - sum) / other[w];
            }
            let sum: f64 = dot(&row[..w], &row[..w]);
            let rest = row[w] - sum;
            if !(rest > 0.0 && rest.is_finite()) {
                return None;
            }
            row[w] = rest.sqrt();
        }
        Some(BandedFactor(self))
    }
}

/// Lower Cholesky factor of a [`Banded`] matrix.
pub(crate) struct BandedFactor(Banded);

impl BandedFactor {
    /// Solves in place.
    pub fn solve(&self, x: &mut [f64]) {
        let Banded { n, width: w, rows } = &self.0;
        let (n, w) = (*n, *w);
        assert_eq!(x.len(), n, "unknowns");
        let row = |i: usize| &rows[i * (w + 1)..(i + 1) * (w + 1)];
        for i in 0..n {
            let first = i.saturating_sub(w);
            x[i] = (x[i] - dot(&row(i)[w + first - i..w], &x[first..i])) / row(i)[w];
        }
        for i in (0..n).rev() {
            let first = i.saturating_sub(w);
            x[i] /= row(i)[w];
            let solved = x[i];
            x[first..i].iter_mut().zip(&row(i)[w + first - i..w]).for_each(|(x, l)| *x -= l * solved);
        }
    }
}

/// Eight partial sums, so that the compiler can keep them in vector registers.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (a8, a_rest) = a.as_chunks::<8>();
    let (b8, b_rest) = b.as_chunks::<8>();
    let mut sums = [0.0; 8];
    for (x, y) in a8.iter().zip(b8) {
        for k in 0..8 {
            sums[k] += x[k] * y[k];
        }
    }
    sums.iter().sum::<f64>() + a_rest.iter().zip(b_rest).map(|(x, y)| x * y).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cholesky::Cholesky;

    #[test]
    fn agrees_with_the_dense_factor() {
        let (n, w) = (57, 12);
        let mut dense = vec![0.0; n * n];
        let mut banded = Banded::zeros(n, w);
        for i in 0..n {
            for j in i.saturating_sub(w)..=i {
                let x = if i == j { 20.0 } else { ((i * 31 + j * 17) % 13) as f64 / 13.0 - 0.5 };
                dense[i * n + j] = x;
                dense[j * n + i] = x;
                *banded.at(i, j) = x;
            }
        }
        let right: Vec<f64> = (0..n).map(|i| (i as f64 * 0.7).sin()).collect();
        let (mut a, mut b) = (right.clone(), right);
        Cholesky::new(dense, n).unwrap().solve(&mut a);
        banded.cholesky().unwrap().solve(&mut b);
        assert!(a.iter().zip(&b).all(|(x, y)| (x - y).abs() < 1e-12), "{a:?} {b:?}");
        let mut indefinite = Banded::zeros(3, 1);
        (0..3).for_each(|i| *indefinite.at(i, i) = 1.0);
        *indefinite.at(1, 0) = 2.0;
        assert!(indefinite.cholesky().is_none());
    }
}
