use crate::{ExportError, Result};
use glam::Vec3;
use rayon::prelude::*;
use softtissue_geometry::Frames;
use softtissue_monitor::Monitor;

/// A moving mesh as `x_t = origin_t + base + sum_k w_tk target_k`, exact at the first frame.
#[derive(Clone, Debug)]
pub(crate) struct MorphAnimation {
    /// Centre of each frame's vertices, `[T]`.
    pub(crate) origins: Vec<Vec3>,
    /// First frame about its centre, `[V]`.
    pub(crate) base: Vec<Vec3>,
    /// Displacements, `[K, V]`; the largest weight of each is one.
    pub(crate) targets: Frames,
    /// `[T, K]`, frame after frame.
    pub(crate) weights: Vec<f32>,
    /// Largest distance of a vertex from where it should be, metres.
    pub(crate) max_error_m: f32,
}

impl MorphAnimation {
    /// Finds targets until no vertex of any frame is further off than `tolerance_m`.
    ///
    /// The frame with the worst vertex gives the next target: what is left of it once all earlier targets are taken out
    /// (the greedy reduced basis, i.e. Gram-Schmidt with pivoting). It needs few more targets than principal components
    /// would, and unlike these bounds the largest error rather than the mean. With as many targets as frames it is exact.
    pub(crate) fn new(vertices: &Frames, tolerance_m: f32, monitor: &dyn Monitor) -> Result<Self> {
        let (frames, v) = (vertices.len(), vertices.points_per_frame());
        let origins: Vec<Vec3> = vertices.iter().map(centre).collect();
        let base: Vec<Vec3> = vertices.frame(0).iter().map(|p| *p - origins[0]).collect();
        let mut left = vertices.clone();
        for (t, origin) in origins.iter().enumerate() {
            left.frame_mut(t).iter_mut().zip(&base).for_each(|(x, b)| *x -= *origin + *b);
        }
        let mut targets = Frames::new(v);
        let mut columns: Vec<Vec<f32>> = vec![];
        loop {
            let errors: Vec<f32> = left
                .points()
                .par_chunks(v)
                .map(|f| f.iter().fold(0.0, |m: f32, d| m.max(d.length_squared())).sqrt())
                .collect();
            let (worst, error) =
                errors.iter().enumerate().fold((0, 0.0), |best, (t, e)| if *e > best.1 { (t, *e) } else { best });
            if error <= tolerance_m || columns.len() == frames {
                let count = columns.len();
                let weights = (0..frames * count).map(|i| columns[i % count][i / count]).collect();
                return Ok(Self { origins, base, targets, weights, max_error_m: error });
            }
            if monitor.should_stop() {
                return Err(ExportError::Stopped);
            }
            let (target, weights) = take_out(&mut left, worst);
            targets.push(&target);
            columns.push(weights);
            monitor.advance(1, &format!("{} targets, {:.2} mm", columns.len(), error * 1e3));
        }
    }

    /// Targets `K`.
    pub(crate) fn target_count(&self) -> usize {
        self.targets.len()
    }
    /// Weights of a frame, `[K]`.
    pub(crate) fn frame_weights(&self, t: usize) -> &[f32] {
        let k = self.target_count();
        &self.weights[t * k..(t + 1) * k]
    }

    /// Displacements `[K, V]` that best follow another per-vertex quantity (normals) with the same weights: least squares
    /// over the frames, about the first one.
    pub(crate) fn follow(&self, quantity: &Frames) -> Frames {
        let (k, v) = (self.target_count(), quantity.points_per_frame());
        let frames = quantity.len();
        let mut normal = vec![0.0f64; k * k];
        for t in 0..frames {
            let w = self.frame_weights(t);
            for i in 0..k {
                for j in 0..=i {
                    normal[i * k + j] += f64::from(w[i]) * f64::from(w[j]);
                }
            }
        }
        let trace: f64 = (0..k).map(|i| normal[i * k + i]).sum();
        (0..k).for_each(|i| normal[i * k + i] += 1e-6 * trace / k as f64);
        cholesky(&mut normal, k);
        let base = quantity.frame(0);
        let columns: Vec<Vec<Vec3>> = (0..v)
            .into_par_iter()
            .map(|p| {
                let mut right = vec![glam::DVec3::ZERO; k];
                for t in 0..frames {
                    let change = (quantity.frame(t)[p] - base[p]).as_dvec3();
                    right.iter_mut().zip(self.frame_weights(t)).for_each(|(r, w)| *r += change * f64::from(*w));
                }
                solve(&normal, k, &mut right);
                right.iter().map(|r| r.as_vec3()).collect()
            })
            .collect();
        let points = (0..k * v).map(|i| columns[i % v][i / v]).collect();
        if k == 0 { Frames::new(v) } else { Frames::from_points(v, points) }
    }
}

/// Takes the direction of frame `worst` out of every frame; returns it as a target with its weights, `[T]`.
fn take_out(left: &mut Frames, worst: usize) -> (Vec<Vec3>, Vec<f32>) {
    let v = left.points_per_frame();
    let length = left.frame(worst).iter().map(|d| f64::from(d.length_squared())).sum::<f64>().sqrt() as f32;
    let mut direction: Vec<Vec3> = left.frame(worst).iter().map(|d| *d / length).collect();
    let mut weights: Vec<f32> = left
        .points_mut()
        .par_chunks_mut(v)
        .map(|frame| {
            let w = frame.iter().zip(&direction).map(|(d, q)| f64::from(d.dot(*q))).sum::<f64>() as f32;
            frame.iter_mut().zip(&direction).for_each(|(d, q)| *d -= *q * w);
            w
        })
        .collect();
    let scale = weights.iter().fold(0.0, |m: f32, w| m.max(w.abs()));
    direction.iter_mut().for_each(|q| *q *= scale);
    weights.iter_mut().for_each(|w| *w /= scale);
    (direction, weights)
}

/// Mean of the vertices, in f64.
fn centre(frame: &[Vec3]) -> Vec3 {
    (frame.iter().map(|p| p.as_dvec3()).sum::<glam::DVec3>() / frame.len() as f64).as_vec3()
}

/// Lower Cholesky factor in place, row-major `[n, n]`; the matrix is positive definite by its ridge.
fn cholesky(a: &mut [f64], n: usize) {
    for i in 0..n {
        for j in 0..=i {
            let sum: f64 = (0..j).map(|k| a[i * n + k] * a[j * n + k]).sum();
            let rest = a[i * n + j] - sum;
            a[i * n + j] = if i == j { rest.max(f64::MIN_POSITIVE).sqrt() } else { rest / a[j * n + j] };
        }
    }
}

/// Solves with the factor, in place.
fn solve(l: &[f64], n: usize, x: &mut [glam::DVec3]) {
    for i in 0..n {
        let sum: glam::DVec3 = (0..i).map(|k| x[k] * l[i * n + k]).sum();
        x[i] = (x[i] - sum) / l[i * n + i];
    }
    for i in (0..n).rev() {
        let sum: glam::DVec3 = (i + 1..n).map(|k| x[k] * l[k * n + i]).sum();
        x[i] = (x[i] - sum) / l[i * n + i];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use softtissue_monitor::Silent;

    #[test]
    fn rank_two_motion_needs_two_targets_and_normals_follow() {
        let mut frames = Frames::new(3);
        let mut other = Frames::new(3);
        for t in 0..20 {
            let (a, b) = ((t as f32 * 0.4).sin(), (t as f32 * 0.9).sin());
            let travel = Vec3::new(t as f32, 0.0, 0.0);
            frames.push(&[Vec3::X * a + travel, Vec3::Y * b + travel, Vec3::NEG_X * a + Vec3::NEG_Y * b + travel]);
            other.push(&[Vec3::Y * a, Vec3::Z, Vec3::X * b]);
        }
        let morph = MorphAnimation::new(&frames, 1e-6, &Silent).unwrap();
        assert_eq!(morph.target_count(), 2);
        let follow = morph.follow(&other);
        for t in 0..20 {
            for p in 0..3 {
                let w = morph.frame_weights(t);
                let x = morph.origins[t]
                    + morph.base[p]
                    + morph.targets.frame(0)[p] * w[0]
                    + morph.targets.frame(1)[p] * w[1];
                assert!(x.distance(frames.frame(t)[p]) < 4e-6);
                let y = other.frame(0)[p] + follow.frame(0)[p] * w[0] + follow.frame(1)[p] * w[1];
                assert!(y.distance(other.frame(t)[p]) < 1e-4, "{y} {}", other.frame(t)[p]);
            }
        }
    }

    #[test]
    fn standing_still_needs_no_target() {
        let morph = MorphAnimation::new(&Frames::zeros(5, 4), 0.0, &Silent).unwrap();
        assert_eq!((morph.target_count(), morph.max_error_m), (0, 0.0));
    }
}
