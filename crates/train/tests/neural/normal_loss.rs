use super::{normals, relative_difference, tensor};
use burn::tensor::{Device, Int, Tensor, TensorData};
use softtissue_model::host;
use softtissue_train::losses::NormalLoss;
use std::sync::Arc;

const SIDE: usize = 7;

fn sheet() -> (Vec<[u32; 3]>, Vec<f32>) {
    let corner = |x: usize, y: usize| (y * SIDE + x) as u32;
    let mut faces = Vec::new();
    for (x, y) in (0..SIDE - 1).flat_map(|y| (0..SIDE - 1).map(move |x| (x, y))) {
        let [a, b, c, d] = [corner(x, y), corner(x + 1, y), corner(x + 1, y + 1), corner(x, y + 1)];
        faces.extend([[a, b, c], [a, c, d]]);
    }
    let positions = (0..SIDE * SIDE).flat_map(|v| [0.03 * (v % SIDE) as f32, 0.03 * (v / SIDE) as f32, 0.0]);
    (faces, positions.collect())
}

/// The same term by plain tensor operations, `[B, V, 3]`.
fn by_operations(faces: &[[u32; 3]], target: Tensor<3>, output: Tensor<3>, weight: f64) -> Tensor<1> {
    let device = output.device();
    let corner = |k: usize| {
        let indices: Vec<i32> = faces.iter().map(|f| f[k] as i32).collect();
        Tensor::<1, Int>::from_data(TensorData::new(indices, [faces.len()]), &device)
    };
    let unit = |x: Tensor<3>| {
        let [a, b, c] = [0, 1, 2].map(|k| x.clone().select(1, corner(k)));
        let (u, v) = (b - a.clone(), c - a);
        let axis = |x: &Tensor<3>, i: usize| x.clone().narrow(2, i % 3, 1);
        let normal = (0..3).map(|i| axis(&u, i + 1) * axis(&v, i + 2) - axis(&u, i + 2) * axis(&v, i + 1));
        let normal = Tensor::cat(normal.collect(), 2);
        let length = normal.clone().square().sum_dim(2).sqrt();
        normal / length
    };
    let cosine = (unit(target) * unit(output)).sum_dim(2);
    (cosine.neg() + 1.0).mean() * weight
}

#[test]
fn value_and_gradient_equal_the_plain_operations() {
    let (faces, flat) = sheet();
    let (batch, row) = (3, flat.len());
    let moved = |name: &str| -> Vec<f32> {
        normals(name, batch * row).iter().enumerate().map(|(i, n)| flat[i % row] + 0.004 * n).collect()
    };
    let (target, output) = (moved("target"), moved("output"));
    let loss = NormalLoss { faces: Arc::new(faces.clone()), weight: 1000.0 };
    let (value, gradient) = loss.value_and_gradient(&target, &output, batch);

    let device = Device::flex().autodiff();
    let shape = [batch, row / 3, 3];
    let leaf = tensor(output, shape, &device).require_grad();
    let plain = by_operations(&faces, tensor(target, shape, &device), leaf.clone(), 1000.0);
    let mut gradients = plain.backward();
    let plain = f64::from(host(plain)[0]);
    assert!((value - plain).abs() < 1e-4 * plain, "{value} {plain}");
    let wanted = host(leaf.grad_remove(&mut gradients).expect("a gradient"));
    let difference = relative_difference(&gradient, &wanted);
    assert!(difference < 1e-4, "{difference}");
}
