//! Principal components of sampled bodies. The scores come from the coarse level; any level's directions follow
//! by regression on them, so that one `beta` means the same body at both levels.

use glam::Vec3;

/// Scores of the samples on the leading components.
#[derive(Clone, Debug)]
pub struct Scores {
    /// `[N, S]`: each column has mean zero and unit variance; columns are uncorrelated.
    pub values: Vec<Vec<f64>>,
}

/// PCA of `samples` (`[N]` of `[V]`) through the Gram matrix, `count` components.
pub fn principal_scores(samples: &[Vec<Vec3>], count: usize) -> Scores {
    let n = samples.len();
    let mean = mean(samples);
    let centred: Vec<Vec<Vec3>> = samples.iter().map(|s| s.iter().zip(&mean).map(|(x, m)| *x - *m).collect()).collect();
    let mut gram = vec![vec![0.0; n]; n];
    for i in 0..n {
        for j in i..n {
            let dot: f64 = centred[i].iter().zip(&centred[j]).map(|(a, b)| f64::from(a.dot(*b))).sum();
            gram[i][j] = dot;
            gram[j][i] = dot;
        }
    }
    let (values, vectors) = symmetric_eigen(gram);
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|a, b| values[*b].total_cmp(&values[*a]));
    order.truncate(count);
    let root = (n as f64).sqrt();
    Scores { values: (0..n).map(|i| order.iter().map(|k| vectors[i][*k] * root).collect()).collect() }
}

/// Vertex by vertex mean.
pub fn mean(samples: &[Vec<Vec3>]) -> Vec<Vec3> {
    let mut mean = vec![Vec3::ZERO; samples[0].len()];
    for s in samples {
        mean.iter_mut().zip(s).for_each(|(m, x)| *m += *x);
    }
    mean.iter_mut().for_each(|m| *m /= samples.len() as f32);
    mean
}

/// `[S, V]` displacement for a unit of each score.
pub fn directions(samples: &[Vec<Vec3>], scores: &Scores) -> Vec<Vec3> {
    let mean = mean(samples);
    let v = mean.len();
    let count = scores.values[0].len();
    let mut out = vec![Vec3::ZERO; count * v];
    for (sample, row) in samples.iter().zip(&scores.values) {
        for (k, score) in row.iter().enumerate() {
            let w = (*score / samples.len() as f64) as f32;
            for i in 0..v {
                out[k * v + i] += (sample[i] - mean[i]) * w;
            }
        }
    }
    out
}

/// Eigenvalues and vectors (columns) of a symmetric matrix by cyclic Jacobi rotations.
pub fn symmetric_eigen(mut a: Vec<Vec<f64>>) -> (Vec<f64>, Vec<Vec<f64>>) {
    let n = a.len();
    let mut v: Vec<Vec<f64>> = (0..n).map(|i| (0..n).map(|j| if i == j { 1.0 } else { 0.0 }).collect()).collect();
    for _ in 0..30 {
        let off: f64 = (0..n).flat_map(|i| (0..i).map(move |j| (i, j))).map(|(i, j)| a[i][j] * a[i][j]).sum();
        let scale: f64 = (0..n).map(|i| a[i][i] * a[i][i]).sum();
        if off <= 1e-22 * scale {
            break;
        }
        for p in 0..n {
            for q in p + 1..n {
                if a[p][q].abs() < 1e-300 {
                    continue;
                }
                let theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
                let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
                let t = if theta == 0.0 { 1.0 } else { t };
                let c = 1.0 / (t * t + 1.0).sqrt();
                let s = t * c;
                for row in a.iter_mut().chain(v.iter_mut()) {
                    let (x, y) = (row[p], row[q]);
                    row[p] = c * x - s * y;
                    row[q] = s * x + c * y;
                }
                for k in 0..n {
                    let (x, y) = (a[p][k], a[q][k]);
                    a[p][k] = c * x - s * y;
                    a[q][k] = s * x + c * y;
                }
            }
        }
    }
    ((0..n).map(|i| a[i][i]).collect(), v)
}
