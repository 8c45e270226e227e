use glam::Vec3;
use rayon::prelude::*;
use std::sync::Arc;

/// Twice the area of a face, in square metres, under which it has no normal and counts as equal.
const SMALLEST_DOUBLE_AREA: f32 = 1e-12;

/// The normal term of SoftSMPL eq. 6, `weight * mean_f (1 - N_f(target) . N_f(output))`, with forward and backward
/// written by hand: one pass over the faces of each sample.
#[derive(Clone, Debug)]
pub struct NormalLoss {
    /// Triangles `[F, 3]`.
    pub faces: Arc<Vec<[u32; 3]>>,
    /// Factor before the mean over faces.
    pub weight: f64,
}

impl NormalLoss {
    /// `target` and `output` are `[B, V * 3]` positions in metres. Returns the loss, meaned over the batch, and its
    /// gradient with respect to `output`, `[B, V * 3]`, per metre.
    pub fn value_and_gradient(&self, target: &[f32], output: &[f32], batch: usize) -> (f64, Vec<f32>) {
        assert_eq!(target.len(), output.len(), "vertices of a normal loss");
        let row = output.len() / batch.max(1);
        let mut gradient = vec![0.0f32; output.len()];
        let factor = self.weight / batch as f64;
        let losses: Vec<f64> = gradient
            .par_chunks_mut(row)
            .zip(target.par_chunks(row).zip(output.par_chunks(row)))
            .map(|(gradient, (target, output))| face_normal_loss(&self.faces, target, output, factor, gradient))
            .collect();
        // Summed in the order of the samples, whatever the number of threads.
        (losses.iter().sum(), gradient)
    }
}

/// `factor * mean_f (1 - N_f(target) . N_f(output))` of one mesh, `[V * 3]` each; adds its gradient with respect to
/// `output` to `gradient`.
///
/// `1 - n . m` is computed as `|n - m|^2 / 2`, which keeps its digits for small angles. With `e1 = b - a`,
/// `e2 = c - a`, `N = e1 x e2`, `n = N / |N|` and `d = n - m`: `dL/dN = (d - n (n . d)) / |N|`,
/// `dL/db = e2 x dL/dN`, `dL/dc = dL/dN x e1`, `dL/da = -dL/db - dL/dc`.
pub fn face_normal_loss(faces: &[[u32; 3]], target: &[f32], output: &[f32], factor: f64, gradient: &mut [f32]) -> f64 {
    let (target, _) = target.as_chunks::<3>();
    let (output, _) = output.as_chunks::<3>();
    let (gradient, _) = gradient.as_chunks_mut::<3>();
    let weight = factor / faces.len().max(1) as f64;
    let slope = weight as f32;
    let at = |p: &[[f32; 3]], i: u32| Vec3::from_array(p[i as usize]);
    let mut sum = 0.0f64;
    for &[i, j, k] in faces {
        let a = at(target, i);
        let wanted = (at(target, j) - a).cross(at(target, k) - a);
        let a = at(output, i);
        let (e1, e2) = (at(output, j) - a, at(output, k) - a);
        let normal = e1.cross(e2);
        let (wanted_length, length) = (wanted.length(), normal.length());
        if wanted_length < SMALLEST_DOUBLE_AREA || length < SMALLEST_DOUBLE_AREA {
            continue;
        }
        let n = normal / length;
        let d = n - wanted / wanted_length;
        sum += f64::from(d.length_squared());
        let slope = (d - n * n.dot(d)) * (slope / length);
        let (to_b, to_c) = (e2.cross(slope), slope.cross(e1));
        for (vertex, force) in [(i, -to_b - to_c), (j, to_b), (k, to_c)] {
            let g = &mut gradient[vertex as usize];
            *g = (Vec3::from_array(*g) + force).to_array();
        }
    }
    0.5 * weight * sum
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An octahedron with a bump, off centre, and a distorted copy of it.
    fn meshes() -> (Vec<[u32; 3]>, Vec<f32>, Vec<f32>) {
        let faces = vec![[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
        let target: Vec<f32> =
            vec![1.0, 0.0, 0.1, -1.0, 0.2, 0.0, 0.0, 1.1, 0.0, 0.1, -0.9, 0.0, 0.0, 0.3, 1.0, 0.0, 0.0, -1.2];
        let output = target.iter().enumerate().map(|(i, x)| x + 0.2 * ((i * 7 + 3) as f32).sin()).collect();
        (faces, target, output)
    }

    #[test]
    fn gradient_matches_finite_differences() {
        let (faces, target, output) = meshes();
        let mut gradient = vec![0.0; output.len()];
        let value = face_normal_loss(&faces, &target, &output, 3.0, &mut gradient);
        assert!(value > 0.01, "{value}");
        for i in 0..output.len() {
            let at = |step: f32| {
                let mut moved = output.clone();
                moved[i] += step;
                face_normal_loss(&faces, &target, &moved, 3.0, &mut vec![0.0; moved.len()])
            };
            let step = 2e-3;
            let numeric = (at(step) - at(-step)) / (2.0 * f64::from(step));
            assert!((numeric - f64::from(gradient[i])).abs() < 2e-4, "{i}: {numeric} {}", gradient[i]);
        }
    }

    #[test]
    fn equal_meshes_and_scaled_ones_cost_nothing() {
        let (faces, target, _) = meshes();
        let doubled: Vec<f32> = target.iter().map(|x| 2.0 * x).collect();
        for output in [&target, &doubled] {
            let mut gradient = vec![0.0; target.len()];
            assert!(face_normal_loss(&faces, &target, output, 1000.0, &mut gradient) < 1e-9);
            assert!(gradient.iter().all(|g| g.abs() < 1e-3), "{gradient:?}");
        }
    }

    #[test]
    fn a_turned_face_costs_one_minus_the_cosine_and_a_flat_one_nothing() {
        let target = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
        let angle = 0.3f32;
        let turned = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, angle.cos(), angle.sin()];
        let value = face_normal_loss(&[[0, 1, 2]], &target, &turned, 1.0, &mut [0.0; 9]);
        assert!((value - (1.0 - f64::from(angle).cos())).abs() < 1e-7, "{value}");
        let flat = [0.0; 9];
        let mut gradient = [0.0; 9];
        assert_eq!(face_normal_loss(&[[0, 1, 2]], &target, &flat, 1.0, &mut gradient), 0.0);
        assert_eq!(gradient, [0.0; 9]);
    }

    #[test]
    fn a_batch_is_the_mean_of_its_samples() {
        let (faces, target, output) = meshes();
        let loss = NormalLoss { faces: Arc::new(faces.clone()), weight: 1000.0 };
        let batch = |a: &[f32], b: &[f32]| [a, b].concat();
        let (value, gradient) = loss.value_and_gradient(&batch(&target, &target), &batch(&output, &target), 2);
        let mut single = vec![0.0; output.len()];
        let first = face_normal_loss(&faces, &target, &output, 500.0, &mut single);
        assert!((value - first).abs() < 1e-9 * first);
        assert_eq!(gradient[..output.len()], single);
    }
}
