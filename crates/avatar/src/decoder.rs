use crate::layer::{linear, zero_linear};
use crate::queries::{Encoding, PER_METRE, Queries};
use burn::module::Module;
use burn::nn::Linear;
use burn::tensor::activation::{sigmoid, softmax, softplus};
use burn::tensor::{Device, Tensor};
use softtissue_random::Draws;

/// Sharpness of the rectifier (sec. 3.4).
const BETA: f64 = 100.0;
/// How fast the pooling's weights fall with distance before anything is learned, 1/m: by `e` in a centimetre. Neighbours
/// that come and go then hardly count, and the planes of those to the side do not bend the surface inwards.
const FALL: f64 = 100.0;

/// The field at query points.
#[derive(Clone, Debug)]
pub struct FieldValues {
    /// Signed distances, `[N, 1]`, metres, positive outside.
    pub distance: Tensor<2>,
    /// Their gradients by the query point, `[N, 3]`.
    pub gradient: Option<Tensor<2>>,
}

/// From the dynamic features of a query point's nearest vertices to a signed distance (sec. 3.3).
///
/// The paper's form, but that its network predicts what is left of the weighted distance from the neighbours' tangent
/// planes, each moved outwards by the observer's offset: `f = sum_i w_i (n_i.(q - v_i) - o_i) + g`, with the pooling's own
/// weights. The last layer starts as zero, so that the untrained field is the surface that the offsets give.
///
/// The gradient by the query point is carried forward beside the values, by first-order operations alone, so that
/// autodiff needs to differentiate once. A neighbour's part depends on the point through distance and cosine alone:
/// two tangents there, of which three are made when the neighbours are pooled.
#[derive(Module, Debug)]
pub struct Decoder {
    code: Linear,
    place: Linear,
    second: Linear,
    /// Pooled numbers and one weight.
    third: Linear,
    fourth: Linear,
    fifth: Linear,
    last: Linear,
}

/// A linear layer without its bias: what it does to a tangent.
fn slope(layer: &Linear, x: Tensor<2>) -> Tensor<2> {
    x.matmul(layer.weight.val())
}

/// The rectifier's derivative, which its tangents are multiplied by.
fn derivative<const D: usize>(x: Tensor<D>) -> Tensor<D> {
    sigmoid(x.mul_scalar(BETA))
}

impl Decoder {
    /// An untrained decoder of `latents` numbers a vertex.
    pub fn new(latents: usize, width: usize, encoding: Encoding, draws: &mut Draws, device: &Device) -> Self {
        let mut layer = |inputs, outputs| linear(inputs, outputs, draws, device);
        Self {
            code: layer(latents, width),
            place: layer(2 * encoding.width(), width),
            second: layer(width, width),
            third: layer(width, width + 1),
            fourth: layer(width, width),
            fifth: layer(width, width),
            last: zero_linear(width, 1, device),
        }
    }

    /// The field at `queries`, whose rows are those of `features [M, latents + 1]`: the last is how far each observer's
    /// plane is moved outwards, metres.
    pub fn forward(&self, features: Tensor<2>, queries: &Queries) -> FieldValues {
        let [n, k] = queries.shape;
        let width = self.second.weight.dims()[0];
        let latents = self.code.weight.dims()[0];
        let offsets = features.clone().narrow(1, latents, 1).select(0, queries.rows.clone()).reshape([n, k, 1]);
        let planes = queries.planes.clone() - offsets;
        let code = self.code.forward(features.narrow(1, 0, latents)).select(0, queries.rows.clone());
        let first = code + self.place.forward(queries.encoded.clone());
        let second = self.second.forward(softplus(first.clone(), BETA));
        let third = self.third.forward(softplus(second.clone(), BETA)).reshape([n, k, width + 1]);
        let numbers = third.clone().narrow(2, 0, width);
        let distances = queries.encoded.clone().narrow(1, 0, 1).reshape([n, k, 1]);
        let logits = third.narrow(2, width, 1) - distances.mul_scalar(FALL / f64::from(PER_METRE));
        let weights = softmax(logits, 1);
        let pooled = (weights.clone() * numbers.clone()).sum_dim(1).reshape([n, width]);
        let fourth = self.fourth.forward(pooled);
        let fifth = self.fifth.forward(softplus(fourth.clone(), BETA));
        let rest = self.last.forward(softplus(fifth.clone(), BETA));
        let plane = (weights.clone() * planes.clone()).sum_dim(1).reshape([n, 1]);
        let gradient = self.gradient(queries, planes, [first, second], numbers, weights, [fourth, fifth]);
        FieldValues { distance: plane + rest, gradient }
    }

    /// The tangents' way through the same layers; `neighbours` and `pooled` are the arguments of the rectifiers before
    /// and after the pooling.
    fn gradient(
        &self,
        queries: &Queries,
        planes: Tensor<3>,
        neighbours: [Tensor<2>; 2],
        numbers: Tensor<3>,
        weights: Tensor<3>,
        pooled: [Tensor<2>; 2],
    ) -> Option<Tensor<2>> {
        let tangents = queries.tangents.as_ref()?;
        let [n, k] = queries.shape;
        let width = self.second.weight.dims()[0];
        let half = self.place.weight.dims()[0] / 2;
        let [by_distance, by_cosine] = &tangents.rates;
        let place = self.place.weight.val();
        let [first, second] = neighbours.map(derivative);
        let through = |x: Tensor<2>| {
            let x = slope(&self.second, first.clone() * x);
            slope(&self.third, second.clone() * x).reshape([n, k, width + 1])
        };
        let by_distance = through(by_distance.clone().matmul(place.clone().narrow(0, 0, half)));
        let by_cosine = through(by_cosine.clone().matmul(place.narrow(0, half, half)));
        let [distance, cosine] = &tangents.gradients;
        // [N, k, 3]: of the logits, then of the weights
        let logits = by_distance.clone().narrow(2, width, 1).sub_scalar(FALL) * distance.clone()
            + by_cosine.clone().narrow(2, width, 1) * cosine.clone();
        let mean = (weights.clone() * logits.clone()).sum_dim(1);
        let weight_rates = weights.clone() * (logits - mean);
        // [N, 3 k, 3] and [N, 3 k, width]
        let left = Tensor::cat(
            vec![weight_rates.clone(), weights.clone() * distance.clone(), weights.clone() * cosine.clone()],
            1,
        );
        let right = Tensor::cat(vec![numbers, by_distance.narrow(2, 0, width), by_cosine.narrow(2, 0, width)], 1);
        let mut x = left.swap_dims(1, 2).matmul(right).reshape([3 * n, width]);
        for (layer, argument) in [&self.fourth, &self.fifth].into_iter().zip(pooled) {
            let derivative = derivative(argument).unsqueeze_dim::<3>(1);
            x = (slope(layer, x).reshape([n, 3, width]) * derivative).reshape([3 * n, width]);
        }
        let rest = slope(&self.last, x).reshape([n, 3]);
        let planes = (weight_rates * planes + weights * tangents.normals.clone()).sum_dim(1);
        Some(rest + planes.reshape([n, 3]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::LossWeights;
    use crate::checks::{check_gradients, directions, shaken};
    use crate::layer::tensor;
    use crate::loss::{BatchShape, field_loss};
    use glam::Vec3;
    use softtissue_implicit::{ObserverFrame, PointTree};
    use softtissue_model::host;

    const ENCODING: Encoding = Encoding { frequencies: 2, softening: 0.02 };

    fn ball() -> ObserverFrame {
        ObserverFrame { positions: directions(30).into_iter().map(|d| 0.2 * d).collect(), normals: directions(30) }
    }

    fn points(count: usize) -> Vec<Vec3> {
        let mut draws = Draws::new(3, "points", 0, 0);
        (0..count).map(|_| Vec3::from_array(std::array::from_fn(|_| draws.range(-0.3, 0.3) as f32))).collect()
    }

    fn features(device: &Device) -> Tensor<2> {
        let mut draws = Draws::new(4, "features", 0, 0);
        tensor((0..30 * 4).map(|i| [0.5, 0.5, 0.5, 0.01][i % 4] * draws.normal() as f32).collect(), [30, 4], device)
    }

    fn decoder(device: &Device) -> Decoder {
        shaken(Decoder::new(3, 6, ENCODING, &mut Draws::new(1, "decoder", 0, 0), device), 0.4, 5)
    }

    /// The neighbours of `points` stay those of `near`.
    fn queries(points: &[Vec3], near: &[Vec3], gradients: bool, device: &Device) -> Queries {
        let observers = ball();
        let rows = PointTree::new(&observers.positions).nearest(near, 5).indices;
        Queries::new(points, &rows, &observers, ENCODING, gradients, device)
    }

    #[test]
    fn tangents_are_differences_of_the_field() {
        let device = Device::flex();
        let (decoder, features, near) = (decoder(&device), features(&device), points(40));
        let ask = |by: Vec3, gradients| {
            let moved: Vec<Vec3> = near.iter().map(|p| *p + by).collect();
            decoder.forward(features.clone(), &queries(&moved, &near, gradients, &device))
        };
        let found = host(ask(Vec3::ZERO, true).gradient.expect("asked for"));
        let step = 2e-4;
        let mut largest = 0.0f32;
        for (axis, by) in [Vec3::X, Vec3::Y, Vec3::Z].into_iter().enumerate() {
            let (above, below) = (host(ask(step * by, false).distance), host(ask(-step * by, false).distance));
            for i in 0..near.len() {
                let difference = (above[i] - below[i]) / (2.0 * step);
                let (found, size) =
                    (found[3 * i + axis], found[3 * i..3 * i + 3].iter().map(|x| x * x).sum::<f32>().sqrt());
                largest = largest.max((found - difference).abs() / size.max(1.0));
            }
        }
        // rounding of values near 1 over a step of 4e-4, and a rectifier that bends within 1e-2 of its input
        assert!(largest < 2e-2, "{largest}");
    }

    #[test]
    fn parameters_gradients_are_differences_of_the_loss() {
        let device = Device::flex();
        let shape = BatchShape { surface: 8, near: 6, within: 4 };
        let near = points(18);
        let queries = queries(&near, &near, true, &device);
        let normals = tensor(directions(8).iter().flat_map(|n| n.to_array()).collect(), [8, 3], &device);
        let features = features(&device);
        let loss = |decoder: &Decoder| {
            let field = decoder.forward(features.clone(), &queries);
            field_loss(field, shape, normals.clone(), &LossWeights::default()).total
        };
        check_gradients(&decoder(&device.clone().autodiff()), loss, 2e-3, 0.05);
    }

    #[test]
    fn an_untrained_field_is_the_distance_from_the_nearest_plane() {
        let device = Device::flex();
        let decoder = Decoder::new(3, 6, ENCODING, &mut Draws::new(1, "decoder", 0, 0), &device);
        let observers = ball();
        let near: Vec<Vec3> = observers.normals.iter().map(|n| 0.25 * *n).collect();
        let rows: Vec<u32> = (0..30).collect();
        let queries = Queries::new(&near, &rows, &observers, ENCODING, true, &device);
        let features = tensor((0..30 * 4).map(|i| [0.3, -0.2, 0.1, 0.02][i % 4]).collect(), [30, 4], &device);
        let found = decoder.forward(features, &queries);
        assert!(host(found.distance).iter().all(|f| (f - 0.03).abs() < 1e-6));
        let gradients = host(found.gradient.expect("asked for"));
        let wanted = observers.normals.iter().flat_map(|n| n.to_array());
        assert!(gradients.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-6));
    }
}
