use crate::LossWeights;
use crate::decoder::FieldValues;
use burn::tensor::Tensor;

/// Keeps the root of a squared length differentiable at zero.
const FLOOR: f64 = 1e-12;

/// What points of a batch are for, in this order: on the scan, near it, in its bounding box.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BatchShape {
    /// Points on the scan.
    pub surface: usize,
    /// Points near it.
    pub near: usize,
    /// Points of its bounding box.
    pub within: usize,
}

/// The loss and its terms, each a tensor of one number, before their factors.
#[derive(Clone, Debug)]
pub struct FieldLoss {
    /// Weighted sum (eq. 3).
    pub total: Tensor<1>,
    /// Mean `|f|` on the scan, metres.
    pub surface: Tensor<1>,
    /// Mean `|grad f - n|` on the scan.
    pub normal: Tensor<1>,
    /// Mean `(|grad f| - 1)^2` near the scan and in its box.
    pub eikonal: Tensor<1>,
    /// Mean `exp(-decay |f|)` in the box.
    pub off_surface: Tensor<1>,
}

fn lengths(vectors: Tensor<2>) -> Tensor<2> {
    vectors.square().sum_dim(1).add_scalar(FLOOR).sqrt()
}

/// The loss (eq. 3) of a field with its gradients; `normals [surface, 3]` are the scan's.
///
/// The paper writes the first two terms as sums and the others as expectations; all are means here, or the factors would
/// depend on how many points are drawn.
///
/// Panics if the field has no gradients or another count of points.
pub fn field_loss(field: FieldValues, shape: BatchShape, normals: Tensor<2>, weights: &LossWeights) -> FieldLoss {
    let gradient = field.gradient.expect("the loss needs gradients");
    let BatchShape { surface, near, within } = shape;
    let off = near + within;
    let on_scan = field.distance.clone().narrow(0, 0, surface).abs().mean();
    let normal = lengths(gradient.clone().narrow(0, 0, surface) - normals).mean();
    let eikonal = lengths(gradient.narrow(0, surface, off)).sub_scalar(1.0).square().mean();
    let in_box = field.distance.narrow(0, surface + near, within);
    let off_surface = in_box.abs().mul_scalar(-weights.decay).exp().mean();
    let total = on_scan.clone().mul_scalar(weights.surface)
        + normal.clone().mul_scalar(weights.normal)
        + eikonal.clone().mul_scalar(weights.eikonal)
        + off_surface.clone().mul_scalar(weights.off_surface);
    FieldLoss { total, surface: on_scan, normal, eikonal, off_surface }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::checks::directions;
    use crate::layer::tensor;
    use burn::tensor::Device;
    use softtissue_model::host;

    const RADIUS: f32 = 0.5;

    /// `scale (|q| - r)` at points `offset` metres outside a sphere.
    fn sphere(offset: f32, scale: f32, shape: BatchShape) -> FieldLoss {
        let device = Device::flex();
        let count = shape.surface + shape.near + shape.within;
        let directions = directions(count);
        let numbers = |scale: f32| directions.iter().flat_map(|d| (scale * *d).to_array()).collect::<Vec<f32>>();
        let radii = directions.iter().map(|d| scale * (((RADIUS + offset) * *d).length() - RADIUS));
        let field = FieldValues {
            distance: tensor(radii.collect(), [count, 1], &device),
            gradient: Some(tensor(numbers(scale), [count, 3], &device)),
        };
        let normals = tensor(numbers(1.0)[..3 * shape.surface].to_vec(), [shape.surface, 3], &device);
        field_loss(field, shape, normals, &LossWeights { surface: 1.0, ..LossWeights::default() })
    }

    fn terms(loss: &FieldLoss) -> [f32; 5] {
        [&loss.surface, &loss.normal, &loss.eikonal, &loss.off_surface, &loss.total].map(|t| host(t.clone())[0])
    }

    fn close(found: [f32; 5], wanted: [f32; 5]) {
        for (a, b) in found.iter().zip(wanted) {
            assert!((a - b).abs() < 2e-6, "{found:?} {wanted:?}");
        }
    }

    #[test]
    fn closed_forms_on_a_sphere() {
        let shape = BatchShape { surface: 20, near: 10, within: 10 };
        // on a true distance field only the off-surface term is left
        close(terms(&sphere(0.0, 1.0, shape)), [0.0, 0.0, 0.0, 1.0, 0.1]);
        // 2 f, 1 cm outside: |2 n - n| = 1, (2 - 1)^2 = 1, exp(-50 * 0.02) = 1/e
        let e = (-1.0f32).exp();
        close(terms(&sphere(0.01, 2.0, shape)), [0.02, 1.0, 1.0, e, 2.02 + 0.1 * e]);
    }
}
