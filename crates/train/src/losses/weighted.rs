/// Squared distances of standardised deltas (Casas and Otaduy 2018 eq. 6): what each of the `V * 3` numbers of a frame
/// weighs, and what it measures.
#[derive(Clone, Debug)]
pub struct WeightedDistance {
    /// Standard deviations that the deltas are divided by, `[V * 3]`, metres.
    deviation: Vec<f32>,
    /// Weight of each vertex in sums, `[V]`.
    vertex_weights: Vec<f32>,
    /// Factor of each squared difference in the loss, `[V * 3]`.
    factors: Vec<f32>,
}

impl WeightedDistance {
    /// Between vertices, in mm^2 and mm, each weighted by `vertex_weights [V]`.
    pub fn of_vertices(deviation: &[f32], vertex_weights: &[f32]) -> Self {
        let factor = |(i, s): (usize, &f32)| vertex_weights[i / 3] * (1000.0 * s).powi(2);
        let factors = deviation.iter().enumerate().map(factor).collect();
        Self { deviation: deviation.to_vec(), vertex_weights: vertex_weights.to_vec(), factors }
    }
    /// Between standardised numbers in the loss, where what hardly moves counts as much as what moves most; summed
    /// distances are those of the vertices, each of weight 1.
    pub fn of_standardised(deviation: &[f32]) -> Self {
        let vertices = deviation.len() / 3;
        let factors = vec![1.0; deviation.len()];
        Self { deviation: deviation.to_vec(), vertex_weights: vec![1.0; vertices], factors }
    }
    /// Vertices `V`.
    pub fn vertex_count(&self) -> usize {
        self.vertex_weights.len()
    }

    /// The loss of `found [B, V * 3]` against `wanted`, meaned over frames and vertices, and its gradient with respect
    /// to `found`.
    pub fn value_and_gradient(&self, found: &[f32], wanted: &[f32]) -> (f64, Vec<f32>) {
        let scale = 3.0 / found.len().max(1) as f64;
        let slope = (2.0 * scale) as f32;
        let width = self.factors.len().max(1);
        let mut sum = 0.0;
        let mut gradient = Vec::with_capacity(found.len());
        for (found, wanted) in found.chunks_exact(width).zip(wanted.chunks_exact(width)) {
            let mut frame = 0.0f32;
            for ((found, wanted), factor) in found.iter().zip(wanted).zip(&self.factors) {
                let error = found - wanted;
                frame += factor * error * error;
                gradient.push(slope * factor * error);
            }
            sum += f64::from(frame);
        }
        (scale * sum, gradient)
    }

    /// Sum of the weighted distances of frames, in metres.
    pub fn summed(&self, found: &[f32], wanted: &[f32]) -> f64 {
        let width = self.factors.len().max(1);
        let mut sum = 0.0;
        for (found, wanted) in found.chunks_exact(width).zip(wanted.chunks_exact(width)) {
            for (v, weight) in self.vertex_weights.iter().enumerate() {
                let squared = |i: usize| ((found[i] - wanted[i]) * self.deviation[i]).powi(2);
                let distance = (squared(3 * v) + squared(3 * v + 1) + squared(3 * v + 2)).sqrt();
                sum += f64::from(weight * distance);
            }
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DEVIATION: [f32; 6] = [0.001, 0.002, 0.004, 0.001, 0.001, 0.001];

    #[test]
    fn a_millimetre_on_a_vertex_of_weight_two_counts_two() {
        let distance = WeightedDistance::of_vertices(&DEVIATION, &[2.0, 0.5]);
        // 1, 2 and 2 mm on the first vertex: 3 mm; nothing on the second. Two frames, one of them right.
        let found = [1.0, 1.0, 0.5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 7.0, 0.0, 0.0];
        let wanted = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 7.0, 0.0, 0.0];
        let (loss, _) = distance.value_and_gradient(&found, &wanted);
        assert!((loss - 2.0 * 9.0 / 4.0).abs() < 1e-6, "{loss}");
        assert!((distance.summed(&found, &wanted) - 2.0 * 0.003).abs() < 1e-9);
        let standardised = WeightedDistance::of_standardised(&DEVIATION);
        assert!((standardised.value_and_gradient(&found, &wanted).0 - 2.25 / 4.0).abs() < 1e-6);
        assert!((standardised.summed(&found, &wanted) - 0.003).abs() < 1e-9);
    }

    #[test]
    fn the_gradient_is_the_loss_s() {
        let distance = WeightedDistance::of_vertices(&DEVIATION, &[2.0, 0.5]);
        let wanted = [0.3, -0.2, 0.1, 0.0, 0.5, -0.5, 1.0, 0.0, 0.2, 0.1, -0.3, 0.4];
        let mut found: Vec<f32> = wanted.iter().enumerate().map(|(i, w)| w + (i as f32).sin()).collect();
        let (_, gradient) = distance.value_and_gradient(&found, &wanted);
        for i in 0..found.len() {
            let kept = found[i];
            let mut at = |x: f32| {
                found[i] = x;
                distance.value_and_gradient(&found, &wanted).0
            };
            let slope = (at(kept + 0.05) - at(kept - 0.05)) / 0.1;
            found[i] = kept;
            assert!((slope - f64::from(gradient[i])).abs() < 1e-3 * slope.abs().max(0.1), "{i}: {slope}");
        }
    }
}
