/// Lower Cholesky factor of a symmetric positive definite `[n, n]` matrix, row-major.
///
/// Systems here have about 75 unknowns: too small for a library's blocked and threaded factorisation to pay.
pub(crate) struct Cholesky {
    n: usize,
    lower: Vec<f64>,
}

impl Cholesky {
    /// Factors a matrix, of which the lower triangle is read. `None` if it is not positive definite.
    pub fn new(mut matrix: Vec<f64>, n: usize) -> Option<Self> {
        assert_eq!(matrix.len(), n * n, "entries of a square matrix");
        for i in 0..n {
            let (above, row) = matrix.split_at_mut(i * n);
            for j in 0..=i {
                let other = if j < i { &above[j * n..j * n + j] } else { &[] };
                let sum: f64 = if j < i {
                    row[..j].iter().zip(other).map(|(a, b)| a * b).sum()
                } else {
                    row[..i].iter().map(|a| a * a).sum()
                };
                let rest = row[j] - sum;
                row[j] = if j < i {
                    rest / above[j * n + j]
                } else if rest > 0.0 && rest.is_finite() {
                    rest.sqrt()
                } else {
                    return None;
                };
            }
        }
        Some(Self { n, lower: matrix })
    }

    /// Solves in place.
    pub fn solve(&self, x: &mut [f64]) {
        let (n, l) = (self.n, &self.lower);
        assert_eq!(x.len(), n, "unknowns");
        for i in 0..n {
            let sum: f64 = l[i * n..i * n + i].iter().zip(&*x).map(|(a, b)| a * b).sum();
            x[i] = (x[i] - sum) / l[i * n + i];
        }
        for i in (0..n).rev() {
            let sum: f64 = (i + 1..n).map(|k| l[k * n + i] * x[k]).sum();
            x[i] = (x[i] - sum) / l[i * n + i];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solves_what_it_factored_and_refuses_the_indefinite() {
        let n = 7;
        let b: Vec<f64> = (0..n * n).map(|i| ((i * 37 % 11) as f64 - 5.0) / 3.0).collect();
        let mut a = vec![0.0; n * n];
        for i in 0..n {
            for j in 0..n {
                a[i * n + j] =
                    (0..n).map(|k| b[k * n + i] * b[k * n + j]).sum::<f64>() + if i == j { 0.5 } else { 0.0 };
            }
        }
        let x: Vec<f64> = (0..n).map(|i| i as f64 - 2.0).collect();
        let mut y: Vec<f64> = (0..n).map(|i| (0..n).map(|k| a[i * n + k] * x[k]).sum()).collect();
        Cholesky::new(a.clone(), n).unwrap().solve(&mut y);
        assert!(x.iter().zip(&y).all(|(a, b)| (a - b).abs() < 1e-9), "{y:?}");
        a[8] = -1.0;
        assert!(Cholesky::new(a, n).is_none());
        assert!(Cholesky::new(vec![f64::NAN], 1).is_none());
    }
}
