use crate::plain;

/// Mean and standard deviation of each of a frame's numbers: `x' = (x - mean) / deviation`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Standardisation {
    /// Means.
    pub mean: Vec<f32>,
    /// Standard deviations, floored.
    pub deviation: Vec<f32>,
}

/// Least deviation, as a part of the rms deviation of the numbers of one kind: what never moves must not explode, and
/// what hardly moves is noise.
const FLOOR: f64 = 0.05;

impl Standardisation {
    /// Of the frames of all `clips`, each `[T, D]`. `kinds` are the lengths of the parts of a frame that are of one
    /// kind and unit; they add up to `D`. Where nothing moves at all the deviation is 1.
    pub fn fit<'a>(clips: impl Iterator<Item = &'a [f32]> + Clone, kinds: &[usize]) -> Self {
        let width: usize = kinds.iter().sum();
        let frames = || clips.clone().flat_map(|clip| clip.chunks_exact(width.max(1)));
        let count = frames().count().max(1) as f64;
        let average = |value: &dyn Fn(usize, f32) -> f64| {
            let mut sums = vec![0.0f64; width];
            frames()
                .for_each(|frame| sums.iter_mut().zip(frame).enumerate().for_each(|(i, (s, x))| *s += value(i, *x)));
            sums.iter_mut().for_each(|s| *s /= count);
            sums
        };
        let mean = average(&|_, x| f64::from(x));
        let mut variance = average(&|i, x| (f64::from(x) - mean[i]).powi(2));
        let mut at = 0;
        for kind in kinds {
            let part = &mut variance[at..at + kind];
            let floor = FLOOR * FLOOR * part.iter().sum::<f64>() / (*kind).max(1) as f64;
            part.iter_mut().for_each(|v| *v = if floor > 0.0 { v.max(floor) } else { 1.0 });
            at += kind;
        }
        Self {
            mean: mean.iter().map(|m| *m as f32).collect(),
            deviation: variance.iter().map(|v| v.sqrt() as f32).collect(),
        }
    }

    /// Numbers of a frame.
    pub fn len(&self) -> usize {
        self.mean.len()
    }
    /// Whether a frame has no numbers.
    pub fn is_empty(&self) -> bool {
        self.mean.is_empty()
    }
    /// Standardised frames, `[T, D]`.
    pub fn apply(&self, frames: &[f32]) -> Vec<f32> {
        let places = (0..self.len().max(1)).cycle();
        frames.iter().zip(places).map(|(x, i)| (x - self.mean[i]) / self.deviation[i]).collect()
    }
    /// The standardisation of several frames side by side.
    pub fn beside(parts: &[&Self]) -> Self {
        Self {
            mean: parts.iter().flat_map(|p| p.mean.iter().copied()).collect(),
            deviation: parts.iter().flat_map(|p| p.deviation.iter().copied()).collect(),
        }
    }

    /// `layer` on numbers that are not standardised yet.
    pub fn before(&self, mut layer: plain::Linear) -> plain::Linear {
        for row in 0..layer.outputs() {
            let mut shift = 0.0f64;
            for ((w, mean), deviation) in layer.weight.row_mut(row).iter_mut().zip(&self.mean).zip(&self.deviation) {
                *w /= deviation;
                shift += f64::from(*w) * f64::from(*mean);
            }
            layer.bias[row] = (f64::from(layer.bias[row]) - shift) as f32;
        }
        layer
    }
    /// `layer`, whose outputs are standardised, with outputs that are not.
    pub fn after(&self, mut layer: plain::Linear) -> plain::Linear {
        for (row, (mean, deviation)) in self.mean.iter().zip(&self.deviation).enumerate() {
            layer.weight.row_mut(row).iter_mut().for_each(|w| *w *= deviation);
            layer.bias[row] = layer.bias[row] * deviation + mean;
        }
        layer
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_number_has_mean_zero_and_deviation_one_unless_it_hardly_moves() {
        let clips = [vec![1.0f32, 5.0, 0.0, 7.0, 3.0, 5.0, 0.0, 7.0], vec![5.0, 5.0, 1e-3, 7.0]];
        let s = Standardisation::fit(clips.iter().map(Vec::as_slice), &[3, 1]);
        let spread = (8.0f32 / 3.0).sqrt();
        assert_eq!(s.mean[..2], [3.0, 5.0]);
        assert!((s.deviation[0] - spread).abs() < 1e-6);
        // A twentieth of the rms deviation of its kind; 1 where the whole kind stands still.
        assert!((s.deviation[1] - 0.05 * spread / 3.0f32.sqrt()).abs() < 1e-6, "{:?}", s.deviation);
        assert_eq!((s.deviation[2], s.deviation[3]), (s.deviation[1], 1.0));
        let all = s.apply(&clips.concat());
        assert!(all.iter().skip(3).step_by(4).all(|x| *x == 0.0));
        let squares: f32 = all.iter().step_by(4).map(|x| x * x).sum();
        assert!((squares / 3.0 - 1.0).abs() < 1e-5);
    }

    #[test]
    fn folded_into_a_layer_it_computes_the_same() {
        let s = Standardisation { mean: vec![0.3, -2.0], deviation: vec![0.1, 4.0] };
        let weight = plain::Matrix::new(2, 2, vec![1.0, -0.5, 0.25, 2.0]);
        let layer = plain::Linear { weight, bias: vec![0.1, -0.2] };
        let x = [0.7, 1.0];
        let (mut wanted, mut found) = ([0.0; 2], [0.0; 2]);
        layer.apply(&s.apply(&x), &mut wanted);
        s.before(layer.clone()).apply(&x, &mut found);
        assert!(wanted.iter().zip(&found).all(|(a, b)| (a - b).abs() < 1e-5), "{wanted:?} {found:?}");
        s.after(layer.clone()).apply(&x, &mut found);
        layer.apply(&x, &mut wanted);
        assert_eq!(found, [0, 1].map(|i| wanted[i] * s.deviation[i] + s.mean[i]));
    }
}
