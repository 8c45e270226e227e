use softtissue_body::BodyModel;
use softtissue_bundle::{DeltaBasis, Matrix};

/// How well predicted coefficients move the soft regions, for model selection: deltas are compared inside the
/// subspace, so no scan is opened.
#[derive(Clone, Debug)]
pub struct SoftScore {
    /// `[K, 3 S]`: the basis at the soft vertices.
    directions: Matrix,
    /// `[3 S]`.
    mean: Vec<f32>,
}

/// Sums over clips behind two ratios.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Score {
    /// Sum of distances between predicted and true deltas, metres.
    pub error: f64,
    /// Sum of lengths of true deltas: what the body alone errs.
    pub body_alone: f64,
    /// Sum of squared frame-to-frame changes of predicted deltas.
    pub predicted_motion: f64,
    /// The same of true ones.
    pub true_motion: f64,
}

impl Score {
    /// Error over that of the body alone (the soft ratio of the measures).
    pub fn ratio(&self) -> f64 {
        self.error / self.body_alone
    }
    /// Root-mean-square speed of predicted over true deltas.
    pub fn energy(&self) -> f64 {
        (self.predicted_motion / self.true_motion).sqrt()
    }
    /// Adds another clip's sums.
    pub fn add(&mut self, other: Self) {
        self.error += other.error;
        self.body_alone += other.body_alone;
        self.predicted_motion += other.predicted_motion;
        self.true_motion += other.true_motion;
    }
}

impl SoftScore {
    /// For the soft regions of a body and a basis of its deltas.
    pub fn new(basis: &DeltaBasis, body: &BodyModel) -> Self {
        let soft = body.regions.soft();
        let pick = |row: &[f32]| soft.iter().flat_map(|v| row[3 * *v as usize..][..3].to_vec()).collect::<Vec<f32>>();
        let (k, d) = (basis.directions.rows(), &basis.directions);
        let data: Vec<f32> = (0..k).flat_map(|r| pick(d.row(r))).collect();
        let mut mean = pick(&basis.mean);
        let directions = Matrix::new(k, 3 * soft.len(), data);
        directions.add_transposed_times(&basis.coefficient_mean, &mut mean);
        Self { directions, mean }
    }

    /// Compares one clip's coefficients, both `[T, K]`.
    pub fn clip(&self, predicted: &[f32], truth: &[f32]) -> Score {
        assert_eq!(predicted.len(), truth.len(), "coefficients of a clip");
        let (k, width) = (self.directions.rows(), self.mean.len());
        let mut score = Score::default();
        let mut before: Option<(Vec<f32>, Vec<f32>)> = None;
        let decode = |c: &[f32]| {
            let mut d = self.mean.clone();
            self.directions.add_transposed_times(c, &mut d);
            d
        };
        let square = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>();
        let still = vec![0.0; width];
        for (p, t) in predicted.chunks_exact(k).zip(truth.chunks_exact(k)) {
            let (p, t) = (decode(p), decode(t));
            for (p, t) in p.as_chunks::<3>().0.iter().zip(t.as_chunks::<3>().0) {
                score.error += square(p, t).sqrt();
                score.body_alone += square(t, &still[..3]).sqrt();
            }
            if let Some((p0, t0)) = &before {
                score.predicted_motion += square(&p, p0);
                score.true_motion += square(&t, t0);
            }
            before = Some((p, t));
        }
        score
    }
}
