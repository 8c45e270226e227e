use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::linalg::cholesky::{LltRef, SymbolicCholesky, SymmetricOrdering, factorize_symbolic_cholesky};
use faer::sparse::{SparseColMat, Triplet};
use faer::{Conj, MatMut, Par, Side};

/// Lower Cholesky factor of a large sparse symmetric positive definite matrix, fill reduced by approximate minimum
/// degree. Factored once; a right side then costs two passes over the factor. One thread, so that the sums keep
/// their order; frames are what is run in parallel.
pub(crate) struct SparseCholesky {
    symbolic: SymbolicCholesky<usize>,
    values: Vec<f64>,
}

impl SparseCholesky {
    /// Factors the `[n, n]` matrix whose lower triangle is the sum of `entries` (row, column, value). `None` if it is not
    /// positive definite, or too large for the memory.
    pub fn new(n: usize, entries: &[(usize, usize, f64)]) -> Option<Self> {
        let triplets: Vec<_> = entries.iter().map(|(i, j, x)| Triplet::new(*i, *j, *x)).collect();
        let matrix = SparseColMat::try_new_from_triplets(n, n, &triplets).ok()?;
        let (side, ordering) = (Side::Lower, SymmetricOrdering::Amd);
        let symbolic = factorize_symbolic_cholesky(matrix.symbolic(), side, ordering, Default::default()).ok()?;
        let mut values = vec![0.0; symbolic.len_val()];
        let scratch = symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default());
        let mut memory = MemBuffer::try_new(scratch).ok()?;
        let stack = MemStack::new(&mut memory);
        let (whole, plain) = (Default::default(), Default::default());
        symbolic.factorize_numeric_llt(&mut values, matrix.as_ref(), side, whole, Par::Seq, stack, plain).ok()?;
        values.iter().all(|x| x.is_finite()).then_some(Self { symbolic, values })
    }

    /// Unknowns `n`.
    pub fn len(&self) -> usize {
        self.symbolic.nrows()
    }

    /// Solves for `columns` right sides in place, `[columns, n]`.
    pub fn solve(&self, sides: &mut [f64], columns: usize) {
        assert_eq!(sides.len(), columns * self.len(), "right sides of a sparse system");
        let mut memory = MemBuffer::new(self.symbolic.solve_in_place_scratch::<f64>(columns, Par::Seq));
        let sides = MatMut::from_column_major_slice_mut(sides, self.len(), columns);
        let factor = LltRef::new(&self.symbolic, &self.values);
        factor.solve_in_place_with_conj(Conj::No, sides, Par::Seq, MemStack::new(&mut memory));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A chain of springs, grounded at one end, and a spring from its first to its last node.
    #[test]
    fn solves_what_it_factored_and_refuses_the_indefinite() {
        let n = 50;
        let mut entries: Vec<(usize, usize, f64)> = (0..n).map(|i| (i, i, 2.0 + 0.01 * i as f64)).collect();
        entries.extend((1..n).map(|i| (i, i - 1, -1.0)));
        entries.extend([(0, 0, 0.5), (n - 1, n - 1, 0.5), (n - 1, 0, -0.5)]);
        let x: Vec<f64> = (0..2 * n).map(|i| ((i * 37) % 23) as f64 - 11.0).collect();
        let mut y = vec![0.0; 2 * n];
        for column in 0..2 {
            for (i, j, a) in &entries {
                y[column * n + i] += a * x[column * n + j];
                if i != j {
                    y[column * n + j] += a * x[column * n + i];
                }
            }
        }
        let factor = SparseCholesky::new(n, &entries).unwrap();
        factor.solve(&mut y, 2);
        let worst = x.iter().zip(&y).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(factor.len() == n && worst < 1e-10, "{worst}");
        entries.push((7, 7, -9.0));
        assert!(SparseCholesky::new(n, &entries).is_none());
    }
}
