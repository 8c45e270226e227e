use crate::ModelError;
use faer::linalg::matmul::matmul;
use faer::linalg::matmul::triangular::{BlockStructure, matmul as triangular_matmul};
use faer::linalg::solvers::Solve;
use faer::{Accum, Mat, MatRef, Par, Side};

/// One clip's equations `[phi_0 m_t, phi_1 m_t, ..., e] -> y_t`: a memory that changes in time, multiplied by
/// shape terms `phi` that do not, and static columns `e`.
pub(super) struct Equations {
    /// `[T, A]`.
    pub memory: Vec<f32>,
    /// `[K]`.
    pub factors: Vec<f32>,
    /// What targets are to be multiplied by to be metres.
    pub amplitude: f32,
    /// `[B]`.
    pub statics: Vec<f32>,
    /// `[T, L]`.
    pub targets: Vec<f32>,
    /// Rows `T`.
    pub rows: usize,
}

/// Weights of a ridge regression.
#[derive(Clone, Debug)]
pub(super) struct Readout {
    /// `[L, K A + B]`, row-major.
    pub weight: Vec<f32>,
    /// `[L]`.
    pub bias: Vec<f32>,
}

/// A centred ridge problem with its Gram matrix, ready to be solved at several strengths:
/// `min sum |y - W f - b|^2 + strength * trace(F^T F) |W|^2`, `b` free. The strength has no unit: it does not
/// change with the features' scale nor with the number of frames.
pub(super) struct Ridge<'a> {
    clips: &'a [Equations],
    memory: usize,
    outputs: usize,
    rows: usize,
    factors: usize,
    statics: usize,
    mean_target: Vec<f64>,
    mean_feature: Vec<f64>,
    gram: Gram,
}

enum Gram {
    /// Between rows, `[N, N]`: fewer rows than features.
    Dual { kernel: Mat<f64>, targets: Mat<f64>, trace: f64 },
    /// Between features, `[P, P]`, and features against targets, `[P, L]`.
    Primal { covariance: Mat<f64>, cross: Mat<f64>, trace: f64 },
}

impl<'a> Ridge<'a> {
    pub fn new(clips: &'a [Equations]) -> Result<Self, ModelError> {
        let first = clips.first().ok_or_else(|| ModelError::Data("a ridge fit needs at least one clip".into()))?;
        let rows = clips.iter().map(|c| c.rows).sum();
        if rows < 2 {
            return Err(ModelError::Data(format!("a ridge fit needs at least 2 frames, found {rows}")));
        }
        let mut problem = Self {
            clips,
            memory: first.memory.len() / first.rows.max(1),
            outputs: first.targets.len() / first.rows.max(1),
            rows,
            factors: first.factors.len(),
            statics: first.statics.len(),
            mean_target: vec![],
            mean_feature: vec![],
            gram: Gram::Dual { kernel: Mat::new(), targets: Mat::new(), trace: 0.0 },
        };
        problem.find_means();
        problem.gram = if rows <= problem.features() { problem.dual() } else { problem.primal() };
        Ok(problem)
    }

    /// `P = K A + B`.
    fn features(&self) -> usize {
        self.factors * self.memory + self.statics
    }

    fn find_means(&mut self) {
        let mut targets = vec![0.0f64; self.outputs];
        let mut features = vec![0.0f64; self.features()];
        let a = self.memory;
        for clip in self.clips {
            let mut memory = vec![0.0f64; a];
            for row in clip.memory.chunks_exact(a.max(1)) {
                memory.iter_mut().zip(row).for_each(|(s, x)| *s += f64::from(*x));
            }
            for row in clip.targets.chunks_exact(self.outputs.max(1)) {
                targets.iter_mut().zip(row).for_each(|(s, x)| *s += f64::from(*x));
            }
            for (k, factor) in clip.factors.iter().enumerate() {
                features[k * a..(k + 1) * a].iter_mut().zip(&memory).for_each(|(s, m)| *s += f64::from(*factor) * m);
            }
            let statics = &mut features[self.factors * a..];
            statics.iter_mut().zip(&clip.statics).for_each(|(s, x)| *s += clip.rows as f64 * f64::from(*x));
        }
        let scale = 1.0 / self.rows as f64;
        self.mean_target = targets.iter().map(|x| x * scale).collect();
        self.mean_feature = features.iter().map(|x| x * scale).collect();
    }

    fn centred_targets(&self) -> Mat<f64> {
        let all: Vec<f32> = self.clips.iter().flat_map(|c| c.targets.iter().copied()).collect();
        Mat::from_fn(self.rows, self.outputs, |t, l| f64::from(all[t * self.outputs + l]) - self.mean_target[l])
    }

    /// `F F^T` with features as a product of memory and shape: `(m . m') (phi . phi') + e . e'`.
    fn dual(&self) -> Gram {
        let (n, a) = (self.rows, self.memory);
        let memory: Vec<f64> = self.clips.iter().flat_map(|c| c.memory.iter().map(|x| f64::from(*x))).collect();
        let memory = MatRef::from_row_major_slice(&memory, n, a);
        let mut kernel = Mat::<f64>::zeros(n, n);
        let (lower, full) = (BlockStructure::TriangularLower, BlockStructure::Rectangular);
        triangular_matmul(
            &mut kernel,
            lower,
            Accum::Replace,
            memory,
            full,
            memory.transpose(),
            full,
            1.0,
            Par::rayon(0),
        );
        let owner: Vec<usize> =
            self.clips.iter().enumerate().flat_map(|(i, c)| std::iter::repeat_n(i, c.rows)).collect();
        let dot = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(x, y)| f64::from(*x) * f64::from(*y)).sum::<f64>();
        let pairs: Vec<Vec<(f64, f64)>> = self
            .clips
            .iter()
            .map(|x| self.clips.iter().map(|y| (dot(&x.factors, &y.factors), dot(&x.statics, &y.statics))).collect())
            .collect();
        for j in 0..n {
            for i in j..n {
                let (factor, offset) = pairs[owner[i]][owner[j]];
                let value = kernel[(i, j)] * factor + offset;
                kernel[(i, j)] = value;
                kernel[(j, i)] = value;
            }
        }
        // Centre rows and columns, as if each feature's mean had been taken off.
        let means: Vec<f64> = (0..n).map(|j| kernel.col(j).iter().sum::<f64>() / n as f64).collect();
        let mean = means.iter().sum::<f64>() / n as f64;
        for j in 0..n {
            for i in 0..n {
                kernel[(i, j)] += mean - means[i] - means[j];
            }
        }
        let trace = (0..n).map(|i| kernel[(i, i)]).sum();
        Gram::Dual { kernel, targets: self.centred_targets(), trace }
    }

    fn primal(&self) -> Gram {
        let (p, a, l) = (self.features(), self.memory, self.outputs);
        let mut covariance = Mat::<f64>::zeros(p, p);
        let mut cross = Mat::<f64>::zeros(p, l);
        for clip in self.clips {
            let t = clip.rows;
            let mut block = Mat::<f64>::zeros(t, p);
            for i in 0..t {
                for (k, factor) in clip.factors.iter().enumerate() {
                    for j in 0..a {
                        block[(i, k * a + j)] = f64::from(*factor) * f64::from(clip.memory[i * a + j]);
                    }
                }
                for (j, x) in clip.statics.iter().enumerate() {
                    block[(i, self.factors * a + j)] = f64::from(*x);
                }
                for j in 0..p {
                    block[(i, j)] -= self.mean_feature[j];
                }
            }
            let targets = Mat::from_fn(t, l, |i, j| f64::from(clip.targets[i * l + j]) - self.mean_target[j]);
            let (lower, full) = (BlockStructure::TriangularLower, BlockStructure::Rectangular);
            triangular_matmul(
                &mut covariance,
                lower,
                Accum::Add,
                block.transpose(),
                full,
                &block,
                full,
                1.0,
                Par::rayon(0),
            );
            matmul(&mut cross, Accum::Add, block.transpose(), &targets, 1.0, Par::rayon(0));
        }
        let trace = (0..p).map(|i| covariance[(i, i)]).sum();
        Gram::Primal { covariance, cross, trace }
    }

    /// Solves at one strength.
    pub fn solve(&self, strength: f64) -> Result<Readout, ModelError> {
        let singular = || {
            ModelError::Data(format!(
                "the ridge fit is singular at strength {strength}: raise it, or is a number not finite?"
            ))
        };
        let (p, a, l) = (self.features(), self.memory, self.outputs);
        let mut weight = Mat::<f64>::zeros(p, l);
        match &self.gram {
            Gram::Dual { kernel, targets, trace } => {
                let damped = with_diagonal(kernel, strength * trace);
                let alpha = damped.llt(Side::Lower).map_err(|_| singular())?.solve(targets);
                let mut row = 0;
                for clip in self.clips {
                    let memory = Mat::from_fn(clip.rows, a, |i, j| f64::from(clip.memory[i * a + j]));
                    let alpha = alpha.subrows(row, clip.rows);
                    row += clip.rows;
                    for (k, factor) in clip.factors.iter().enumerate() {
                        let block = weight.as_mut().subrows_mut(k * a, a);
                        matmul(block, Accum::Add, memory.transpose(), alpha, f64::from(*factor), Par::rayon(0));
                    }
                    for (j, x) in clip.statics.iter().enumerate() {
                        for o in 0..l {
                            weight[(self.factors * a + j, o)] += f64::from(*x) * alpha.col(o).iter().sum::<f64>();
                        }
                    }
                }
            }
            Gram::Primal { covariance, cross, trace } => {
                let damped = with_diagonal(covariance, strength * trace);
                weight = damped.llt(Side::Lower).map_err(|_| singular())?.solve(cross);
            }
        }
        let bias = (0..l).map(|o| {
            let used: f64 = weight.col(o).iter().zip(&self.mean_feature).map(|(w, f)| w * f).sum();
            (self.mean_target[o] - used) as f32
        });
        let bias: Vec<f32> = bias.collect();
        let weight: Vec<f32> =
            (0..l).flat_map(|o| weight.col(o).iter().map(|w| *w as f32).collect::<Vec<_>>()).collect();
        if weight.iter().chain(&bias).any(|w| !w.is_finite()) {
            return Err(singular());
        }
        Ok(Readout { weight, bias })
    }
}

fn with_diagonal(m: &Mat<f64>, add: f64) -> Mat<f64> {
    let mut m = m.clone();
    for i in 0..m.nrows() {
        m[(i, i)] += add;
    }
    m
}

#[cfg(test)]
mod tests {
    use super::*;
    use softtissue_random::Draws;

    fn clips(rows: usize, memory: usize) -> Vec<Equations> {
        let mut draws = Draws::new(3, "ridge", 0, 0);
        (0..3)
            .map(|i| Equations {
                memory: (0..rows * memory).map(|_| draws.normal() as f32 + 0.5).collect(),
                factors: vec![1.0, i as f32 - 0.7],
                amplitude: 1.0,
                statics: vec![i as f32],
                targets: (0..rows * 2).map(|_| draws.normal() as f32 + 2.0).collect(),
                rows,
            })
            .collect()
    }

    /// The gradient of the penalised squared error vanishes at the solution, whichever side it was solved on.
    #[test]
    fn both_sides_satisfy_the_normal_equations() {
        for (rows, memory) in [(40, 6), (7, 30)] {
            let clips = clips(rows, memory);
            let strength = 1e-3;
            let problem = Ridge::new(&clips).unwrap();
            assert_eq!(matches!(problem.gram, Gram::Dual { .. }), rows == 7);
            let solution = problem.solve(strength).unwrap();
            let p = problem.features();
            let features: Vec<Vec<f64>> = clips
                .iter()
                .flat_map(|c| {
                    c.memory.chunks_exact(memory).map(|m| {
                        let scaled = c.factors.iter().flat_map(|f| m.iter().map(|x| f64::from(*x) * f64::from(*f)));
                        scaled.chain(c.statics.iter().map(|x| f64::from(*x))).collect()
                    })
                })
                .collect();
            let targets: Vec<f32> = clips.iter().flat_map(|c| c.targets.iter().copied()).collect();
            let n = features.len() as f64;
            let mean = |j: usize| features.iter().map(|f| f[j]).sum::<f64>() / n;
            let penalty =
                strength * (0..p).map(|j| features.iter().map(|f| (f[j] - mean(j)).powi(2)).sum::<f64>()).sum::<f64>();
            for o in 0..2 {
                let w = &solution.weight[o * p..(o + 1) * p];
                let residual: Vec<f64> = features
                    .iter()
                    .enumerate()
                    .map(|(t, f)| {
                        let y: f64 = f.iter().zip(w).map(|(x, w)| x * f64::from(*w)).sum();
                        y + f64::from(solution.bias[o]) - f64::from(targets[2 * t + o])
                    })
                    .collect();
                assert!(residual.iter().sum::<f64>().abs() < 1e-3, "the bias is free");
                for j in 0..p {
                    let slope: f64 = features.iter().zip(&residual).map(|(f, r)| f[j] * r).sum();
                    let gradient = slope + penalty * f64::from(w[j]);
                    assert!(gradient.abs() < 2e-3, "rows {rows}, feature {j}: {gradient}");
                }
            }
        }
    }
}
