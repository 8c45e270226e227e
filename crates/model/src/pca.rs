//! Principal components by randomised subspace iteration with a Rayleigh-Ritz end (Halko, Martinsson and Tropp 2011,
//! algorithms 4.4 and 5.3 in the form that streams over the rows), so that a set of clips never lies in memory at once.

use crate::ModelError;
use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, MatMut, MatRef, Par, Side};
use glam::Vec3;
use serde::{Deserialize, Serialize};
use softtissue_bundle::{DeltaBasis, Matrix};
use softtissue_geometry::Frames;
use softtissue_monitor::Monitor;
use softtissue_random::Draws;

/// Frames that can be read several times, a chunk at a time.
pub trait FrameSource {
    /// Numbers a frame, `W = 3 V`.
    fn width(&self) -> usize;
    /// Chunks there are.
    fn chunk_count(&self) -> usize;
    /// Chunk `i`: `[n, W]`, frame after frame.
    fn chunk(&self, i: usize) -> Result<Vec<f32>, ModelError>;
}

impl FrameSource for [Frames] {
    fn width(&self) -> usize {
        self.first().map_or(0, |f| 3 * f.points_per_frame())
    }
    fn chunk_count(&self) -> usize {
        self.len()
    }
    fn chunk(&self, i: usize) -> Result<Vec<f32>, ModelError> {
        Ok(self[i].to_numbers())
    }
}

/// How components are found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PcaConfig {
    /// Components `K`. Default 300 (Dyna's number); fewer where the data have fewer.
    pub components: usize,
    /// Power iterations. Default 2: a third changes the explained variance by less than 0.1 %; each reads all frames.
    pub power_iterations: usize,
    /// Extra directions of the sketch. Default 16.
    pub oversampling: usize,
}

impl Default for PcaConfig {
    fn default() -> Self {
        Self { components: 300, power_iterations: 2, oversampling: 16 }
    }
}

/// Mean and principal components of deltas.
#[derive(Clone, Debug, PartialEq)]
pub struct Pca {
    /// Mean and orthonormal directions, most important first.
    pub basis: DeltaBasis,
    /// Variance along each direction, `[K]`, square metres (sums over a frame's vertices).
    pub variances: Vec<f64>,
    /// Variance of all, square metres.
    pub total_variance: f64,
    /// Frames it was learned from.
    pub frames: usize,
}

impl Pca {
    /// Finds components of all frames of a source. Deterministic: the same frames in the same chunks and the same
    /// draws give the same numbers.
    pub fn fit(
        source: &(impl FrameSource + ?Sized),
        config: &PcaConfig,
        draws: &mut Draws,
        monitor: &dyn Monitor,
    ) -> Result<Self, ModelError> {
        let width = source.width();
        monitor.begin(
            "principal components",
            (2 + config.power_iterations as u64) * source.chunk_count() as u64,
            "clips",
        );
        let (mean, frames) = mean_frame(source, monitor)?;
        if frames < 2 || width == 0 {
            return Err(ModelError::Data(format!("principal components need at least 2 frames, found {frames}")));
        }
        let sketch = (config.components + config.oversampling).min(width).min(frames);
        let mut basis = orthonormal(Mat::from_fn(width, sketch, |_, _| draws.normal()));
        for _ in 0..config.power_iterations {
            let mut next = Mat::<f32>::zeros(width, sketch);
            let narrow = to_f32(basis.as_ref());
            each_chunk(source, &mean, monitor, |x| {
                let mut y = Mat::<f32>::zeros(x.nrows(), sketch);
                matmul(&mut y, Accum::Replace, x, &narrow, 1.0, Par::rayon(0));
                matmul(&mut next, Accum::Add, x.transpose(), &y, 1.0, Par::rayon(0));
            })?;
            basis = orthonormal(Mat::from_fn(width, sketch, |i, j| f64::from(next[(i, j)])));
        }
        let (small, total) = small_covariance(source, &mean, &basis, monitor)?;
        let kept = config.components.min(sketch).min(frames - 1);
        let pca = rayleigh_ritz(&basis, &small, kept, mean, total, frames)?;
        monitor.end();
        Ok(pca)
    }

    /// Components `K`.
    pub fn components(&self) -> usize {
        self.variances.len()
    }
    /// Part of the variance that the first `components` hold.
    pub fn explained(&self, components: usize) -> f64 {
        let held: f64 = self.variances.iter().take(components).sum();
        if self.total_variance > 0.0 { held / self.total_variance } else { 1.0 }
    }
    /// Components that hold `part` of the variance; `None` if all `K` hold less.
    pub fn components_for(&self, part: f64) -> Option<usize> {
        (1..=self.components()).find(|k| self.explained(*k) >= part)
    }
    /// The first `components` alone.
    pub fn truncated(&self, components: usize) -> Self {
        Self {
            basis: truncated(&self.basis, components),
            variances: self.variances[..components.min(self.components())].to_vec(),
            ..self.clone()
        }
    }
}

/// The first `components` directions of a basis.
pub fn truncated(basis: &DeltaBasis, components: usize) -> DeltaBasis {
    let (kept, width) = (components.min(basis.directions.rows()), basis.directions.cols());
    DeltaBasis {
        mean: basis.mean.clone(),
        directions: Matrix::new(kept, width, basis.directions.data()[..kept * width].to_vec()),
        coefficient_mean: basis.coefficient_mean[..kept].to_vec(),
    }
}

/// Coefficients `[T, K]` of deltas `[T, V, 3]`.
pub fn coefficients_of(basis: &DeltaBasis, deltas: &Frames) -> Vec<f32> {
    let (k, width) = (basis.directions.rows(), basis.directions.cols());
    assert_eq!(deltas.points_per_frame() * 3, width, "vertices of the deltas");
    let mut numbers = deltas.to_numbers();
    for frame in numbers.chunks_exact_mut(width) {
        frame.iter_mut().zip(&basis.mean).for_each(|(x, m)| *x -= m);
    }
    let mut coefficients = vec![0.0; deltas.len() * k];
    matmul(
        MatMut::from_row_major_slice_mut(&mut coefficients, deltas.len(), k),
        Accum::Replace,
        MatRef::from_row_major_slice(&numbers, deltas.len(), width),
        rows(&basis.directions).transpose(),
        1.0,
        Par::rayon(0),
    );
    for frame in coefficients.chunks_exact_mut(k.max(1)) {
        frame.iter_mut().zip(&basis.coefficient_mean).for_each(|(c, m)| *c -= m);
    }
    coefficients
}

/// Deltas `[T, V, 3]` of coefficients `[T, K]`.
pub fn deltas_of(basis: &DeltaBasis, coefficients: &[f32]) -> Frames {
    let (k, width) = (basis.directions.rows(), basis.directions.cols());
    let frames = coefficients.len() / k.max(1);
    let mut centred = coefficients.to_vec();
    for frame in centred.chunks_exact_mut(k.max(1)) {
        frame.iter_mut().zip(&basis.coefficient_mean).for_each(|(c, m)| *c += m);
    }
    let mut numbers: Vec<f32> = (0..frames).flat_map(|_| basis.mean.iter().copied()).collect();
    matmul(
        MatMut::from_row_major_slice_mut(&mut numbers, frames, width),
        Accum::Add,
        MatRef::from_row_major_slice(&centred, frames, k),
        rows(&basis.directions),
        1.0,
        Par::rayon(0),
    );
    let points: Vec<Vec3> = numbers.as_chunks::<3>().0.iter().map(|p| Vec3::from_array(*p)).collect();
    Frames::from_points(width / 3, points)
}

fn rows(matrix: &Matrix) -> MatRef<'_, f32> {
    MatRef::from_row_major_slice(matrix.data(), matrix.rows(), matrix.cols())
}

/// Mean frame, summed in f64, and the number of frames.
fn mean_frame(source: &(impl FrameSource + ?Sized), monitor: &dyn Monitor) -> Result<(Vec<f32>, usize), ModelError> {
    let width = source.width();
    let mut sum = vec![0.0f64; width];
    let mut frames = 0;
    for i in 0..source.chunk_count() {
        for frame in source.chunk(i)?.chunks_exact(width) {
            sum.iter_mut().zip(frame).for_each(|(s, x)| *s += f64::from(*x));
            frames += 1;
        }
        monitor.advance(1, "");
        if monitor.should_stop() {
            return Err(ModelError::Stopped);
        }
    }
    Ok((sum.iter().map(|s| (s / frames.max(1) as f64) as f32).collect(), frames))
}

/// Visits centred chunks `[n, W]` in order.
fn each_chunk(
    source: &(impl FrameSource + ?Sized),
    mean: &[f32],
    monitor: &dyn Monitor,
    mut visit: impl FnMut(MatRef<f32>),
) -> Result<(), ModelError> {
    for i in 0..source.chunk_count() {
        let mut numbers = source.chunk(i)?;
        for frame in numbers.chunks_exact_mut(mean.len()) {
            frame.iter_mut().zip(mean).for_each(|(x, m)| *x -= m);
        }
        visit(MatRef::from_row_major_slice(&numbers, numbers.len() / mean.len(), mean.len()));
        monitor.advance(1, "");
        if monitor.should_stop() {
            return Err(ModelError::Stopped);
        }
    }
    Ok(())
}

/// Covariance inside the sketch, `Q^T X^T X Q / N` in f64, and the total variance.
fn small_covariance(
    source: &(impl FrameSource + ?Sized),
    mean: &[f32],
    basis: &Mat<f64>,
    monitor: &dyn Monitor,
) -> Result<(Mat<f64>, f64), ModelError> {
    let sketch = basis.ncols();
    let narrow = to_f32(basis.as_ref());
    let mut small = Mat::<f64>::zeros(sketch, sketch);
    let (mut total, mut frames) = (0.0f64, 0usize);
    each_chunk(source, mean, monitor, |x| {
        let mut y = Mat::<f32>::zeros(x.nrows(), sketch);
        matmul(&mut y, Accum::Replace, x, &narrow, 1.0, Par::rayon(0));
        let y = Mat::<f64>::from_fn(y.nrows(), sketch, |i, j| f64::from(y[(i, j)]));
        matmul(&mut small, Accum::Add, y.transpose(), &y, 1.0, Par::rayon(0));
        for i in 0..x.nrows() {
            total += x.row(i).iter().map(|v| f64::from(*v).powi(2)).sum::<f64>();
        }
        frames += x.nrows();
    })?;
    let scale = 1.0 / frames.max(1) as f64;
    Ok((Mat::from_fn(sketch, sketch, |i, j| small[(i, j)] * scale), total * scale))
}

/// Eigenvectors of the small covariance, carried back to frames. The sign makes each direction's largest entry
/// positive, so that a basis does not depend on the sketch's.
fn rayleigh_ritz(
    basis: &Mat<f64>,
    small: &Mat<f64>,
    kept: usize,
    mean: Vec<f32>,
    total_variance: f64,
    frames: usize,
) -> Result<Pca, ModelError> {
    let eigen = small
        .self_adjoint_eigen(Side::Lower)
        .map_err(|_| ModelError::Data("the deltas have no principal components: is every number finite?".into()))?;
    let (width, sketch) = (basis.nrows(), basis.ncols());
    // faer gives eigenvalues in rising order.
    let top = Mat::from_fn(sketch, kept, |i, j| eigen.U()[(i, sketch - 1 - j)]);
    let variances = (0..kept).map(|j| eigen.S()[sketch - 1 - j].max(0.0)).collect();
    let mut directions = Mat::<f64>::zeros(width, kept);
    matmul(&mut directions, Accum::Replace, basis, &top, 1.0, Par::rayon(0));
    let mut data = Vec::with_capacity(width * kept);
    for j in 0..kept {
        let column = directions.col(j);
        let largest = column.iter().copied().fold(0.0f64, |m, x| if x.abs() > m.abs() { x } else { m });
        let sign = if largest < 0.0 { -1.0 } else { 1.0 };
        data.extend(column.iter().map(|x| (sign * x) as f32));
    }
    let basis = DeltaBasis { mean, directions: Matrix::new(kept, width, data), coefficient_mean: vec![0.0; kept] };
    Ok(Pca { basis, variances, total_variance, frames })
}

fn to_f32(m: MatRef<f64>) -> Mat<f32> {
    Mat::from_fn(m.nrows(), m.ncols(), |i, j| m[(i, j)] as f32)
}

fn orthonormal(m: Mat<f64>) -> Mat<f64> {
    m.qr().compute_thin_Q()
}

#[cfg(test)]
mod tests {
    use super::*;
    use softtissue_monitor::Silent;

    /// Frames whose decomposition is known: `x_t = mean + sum_k s_k u_k(t) v_k` with `u_k` cosines (orthonormal and
    /// without mean over whole periods) and `v_k` unit vectors, plus the singular values.
    fn known(frames: usize, points: usize, count: usize) -> (Frames, Vec<f64>) {
        let sizes: Vec<f64> = (0..count).map(|k| 0.8f64.powi(k as i32)).collect();
        let mut numbers = vec![0.0f32; frames * points * 3];
        for t in 0..frames {
            let row = &mut numbers[t * points * 3..][..points * 3];
            row.iter_mut().enumerate().for_each(|(i, x)| *x = 0.01 * i as f32);
            for (k, s) in sizes.iter().enumerate() {
                let angle = std::f64::consts::PI * (t as f64 + 0.5) * (k + 1) as f64 / frames as f64;
                row[(7 * k) % (points * 3)] += (s * (2.0 / frames as f64).sqrt() * angle.cos()) as f32;
            }
        }
        (Frames::from_numbers(points, &numbers), sizes)
    }

    fn fit(source: &[Frames], components: usize) -> Pca {
        let config = PcaConfig { components, oversampling: 6, ..PcaConfig::default() };
        Pca::fit(source, &config, &mut Draws::new(1, "pca", 0, 0), &Silent).unwrap()
    }

    #[test]
    fn known_components_are_found_in_order() {
        let (frames, sizes) = known(200, 40, 20);
        let pca = fit(std::slice::from_ref(&frames), 8);
        let total: f64 = sizes.iter().map(|s| s * s / 200.0).sum();
        assert!((pca.total_variance / total - 1.0).abs() < 1e-5);
        for k in 0..8 {
            let expected = sizes[k] * sizes[k] / 200.0;
            assert!((pca.variances[k] / expected - 1.0).abs() < 1e-3, "{k}: {} {expected}", pca.variances[k]);
            let held = pca.basis.directions.row(k)[(7 * k) % 120];
            assert!(held > 0.98, "direction {k} holds {held} of its own, and its sign is positive");
        }
        assert!((pca.basis.mean[5] - 0.05).abs() < 1e-5);
        assert_eq!([0.5, 0.95, 0.99].map(|part| pca.components_for(part)), [Some(2), Some(7), None]);
    }

    #[test]
    fn agrees_with_a_dense_decomposition_of_noise_free_rank_and_streams() {
        let mut draws = Draws::new(9, "dense", 0, 0);
        let (t, w, rank) = (90, 48, 10);
        let left = Mat::<f64>::from_fn(t, rank, |_, _| draws.normal());
        let right = Mat::<f64>::from_fn(rank, w, |k, _| draws.normal() * 0.6f64.powi(k as i32));
        let x = &left * &right;
        let numbers: Vec<f32> = (0..t * w).map(|i| x[(i / w, i % w)] as f32).collect();
        let whole = Frames::from_numbers(w / 3, &numbers);
        let parts = [whole.slice(0..17), whole.slice(17..60), whole.slice(60..90)];
        let pca = fit(&parts, 5);
        let centred = Mat::from_fn(t, w, |i, j| x[(i, j)] - x.col(j).iter().sum::<f64>() / t as f64);
        let dense = centred.thin_svd().unwrap();
        for k in 0..5 {
            let s = dense.S()[k];
            assert!((pca.variances[k] / (s * s / t as f64) - 1.0).abs() < 1e-4, "{k}");
            let dot: f64 = (0..w).map(|j| dense.V()[(j, k)] * f64::from(pca.basis.directions.row(k)[j])).sum();
            assert!((dot.abs() - 1.0).abs() < 1e-4, "{k}: {dot}");
        }
        let again = fit(&parts, 5);
        assert_eq!(pca, again);
    }

    #[test]
    fn coefficients_and_deltas_are_inverse_inside_the_subspace() {
        let (frames, _) = known(60, 10, 4);
        let pca = fit(std::slice::from_ref(&frames), 4);
        let coefficients = coefficients_of(&pca.basis, &frames);
        let back = deltas_of(&pca.basis, &coefficients);
        let worst = back.points().iter().zip(frames.points()).map(|(a, b)| a.distance(*b)).fold(0.0, f32::max);
        assert!(worst < 1e-5, "{worst}");
        let two = pca.truncated(2);
        let short = coefficients_of(&two.basis, &frames);
        assert!((short[2] - coefficients[4]).abs() < 1e-6 && two.components() == 2);
    }

    #[test]
    fn one_frame_is_refused() {
        let error = Pca::fit(
            std::slice::from_ref(&Frames::zeros(4, 1)),
            &PcaConfig::default(),
            &mut Draws::new(1, "pca", 0, 0),
            &Silent,
        );
        assert!(matches!(error, Err(ModelError::Data(_))));
    }
}
