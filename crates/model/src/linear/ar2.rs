use super::readout::{Selected, select};
use super::score::{Score, SoftScore};
use crate::{ModelError, TrainingClip};
use faer::linalg::matmul::matmul;
use faer::linalg::solvers::Solve;
use faer::{Accum, Mat, Par, Side};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use softtissue_bundle::Matrix;
use softtissue_bundle::descriptor::FeatureScaling;

/// Second-order linear autoregression with exogenous input (Dyna, Pons-Moll et al. 2015, eq. 20): each coefficient by
/// itself, `c_t = a_1 c_{t-1} + a_2 c_{t-2} + w . x_t + b`.
#[derive(Clone, Debug, PartialEq)]
pub struct Ar2 {
    /// `a_1, a_2` of each coefficient, `[K, 2]`.
    pub lags: Matrix,
    /// `w`, `[K, D]`, on scaled features.
    pub weight: Matrix,
    /// `b`, `[K]`.
    pub bias: Vec<f32>,
}

/// How autoregressions are fitted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Ar2Config {
    /// Ridge strengths tried on validation, as parts of the features' total variance. Default six from 1e-6 to 1e-1.
    pub strengths: Vec<f64>,
    /// Poles outside this radius are moved onto it, so that a rollout cannot grow. Default 0.995.
    pub pole_radius: f64,
}

impl Default for Ar2Config {
    fn default() -> Self {
        Self { strengths: vec![1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1], pole_radius: 0.995 }
    }
}

/// Fits one autoregression to `train` and chooses the ridge strength by the soft ratio of free rollouts on `validation`.
/// `rest` are the coefficients of a zero delta, where rollouts start.
pub fn fit_ar2(
    config: &Ar2Config,
    scaling: &FeatureScaling,
    rest: &[f32],
    train: &[&TrainingClip],
    validation: &[&TrainingClip],
    score: &SoftScore,
) -> Result<Selected<Ar2>, ModelError> {
    if !(config.pole_radius > 0.0 && config.pole_radius < 1.0) {
        return Err(ModelError::Config(format!("pole_radius is {}, expected between 0 and 1", config.pole_radius)));
    }
    let moments = Moments::new(scaling, train)?;
    let held: Vec<Vec<f32>> = validation.par_iter().map(|c| scaling.apply_clip(&c.features)).collect();
    let (model, strength, score, tried) = select(&config.strengths, |strength| {
        let model = moments.solve(strength, config.pole_radius)?;
        let clips: Vec<Score> = validation
            .par_iter()
            .zip(&held)
            .map(|(clip, x)| score.clip(&model.rollout(x, rest), &clip.coefficients))
            .collect();
        Ok((model, clips))
    })?;
    Ok(Selected { model, strength, score, tried })
}

impl Ar2 {
    /// Free rollout over scaled features `[T, D]` from `rest`, to coefficients `[T, K]`.
    pub fn rollout(&self, scaled: &[f32], rest: &[f32]) -> Vec<f32> {
        let (k, d) = (self.bias.len(), self.weight.cols());
        let frames = scaled.len() / d.max(1);
        let mut out = vec![0.0; frames * k];
        let (mut last, mut before) = (rest.to_vec(), rest.to_vec());
        let mut driven = vec![0.0; k];
        for (x, y) in scaled.chunks_exact(d.max(1)).zip(out.chunks_exact_mut(k.max(1))) {
            self.weight.times(x, &mut driven);
            for i in 0..k {
                let a = self.lags.row(i);
                y[i] = a[0] * last[i] + a[1] * before[i] + driven[i] + self.bias[i];
            }
            before.copy_from_slice(&last);
            last.copy_from_slice(y);
        }
        out
    }
}

/// Sums over the training frames from which every strength is solved: features against features and against the
/// coefficients now, one and two frames before; all centred.
struct Moments {
    features: Mat<f64>,
    /// `[D, 3 K]`: now, one before, two before.
    cross: Mat<f64>,
    /// `[K]`: `c_i . c_j` for lags `i, j` in 0..3.
    own: Vec<[[f64; 3]; 3]>,
    mean_feature: Vec<f64>,
    /// `[3 K]`.
    mean_target: Vec<f64>,
}

impl Moments {
    fn new(scaling: &FeatureScaling, clips: &[&TrainingClip]) -> Result<Self, ModelError> {
        let first =
            clips.first().ok_or_else(|| ModelError::Data("an autoregression needs at least one clip".into()))?;
        let (d, k) = (scaling.len(), first.coefficient_count());
        let (mut features, mut targets, mut rows) = (Vec::<f64>::new(), Vec::<f64>::new(), 0);
        for clip in clips {
            let x = scaling.apply_clip(&clip.features);
            for t in 2..clip.frames {
                features.extend(x[t * d..(t + 1) * d].iter().map(|x| f64::from(*x)));
                for lag in 0..3 {
                    targets.extend(clip.coefficients[(t - lag) * k..][..k].iter().map(|c| f64::from(*c)));
                }
                rows += 1;
            }
        }
        if rows < 3 {
            return Err(ModelError::Data(format!(
                "an autoregression needs at least 3 frames with two before them, found {rows}"
            )));
        }
        let mean_feature = centre(&mut features, d);
        let mean_target = centre(&mut targets, 3 * k);
        let x = faer::MatRef::from_row_major_slice(&features, rows, d);
        let c = faer::MatRef::from_row_major_slice(&targets, rows, 3 * k);
        let mut gram = Mat::zeros(d, d);
        matmul(&mut gram, Accum::Replace, x.transpose(), x, 1.0, Par::rayon(0));
        let mut cross = Mat::zeros(d, 3 * k);
        matmul(&mut cross, Accum::Replace, x.transpose(), c, 1.0, Par::rayon(0));
        let mut own = vec![[[0.0; 3]; 3]; k];
        for row in targets.chunks_exact((3 * k).max(1)) {
            for (o, own) in own.iter_mut().enumerate() {
                for i in 0..3 {
                    for j in 0..3 {
                        own[i][j] += row[i * k + o] * row[j * k + o];
                    }
                }
            }
        }
        Ok(Self { features: gram, cross, own, mean_feature, mean_target })
    }

    /// Eliminates the weights from each coefficient's normal equations, solves the two lags, moves their poles inside
    /// the radius and puts the weights back for the lags as they then are.
    fn solve(&self, strength: f64, radius: f64) -> Result<Ar2, ModelError> {
        let (d, k) = (self.mean_feature.len(), self.own.len());
        let trace: f64 = (0..d).map(|i| self.features[(i, i)]).sum();
        let mut damped = self.features.clone();
        (0..d).for_each(|i| damped[(i, i)] += strength * trace);
        let solved = damped
            .llt(Side::Lower)
            .map_err(|_| ModelError::Data(format!("the autoregression is singular at strength {strength}: raise it")))?
            .solve(&self.cross);
        let mut model = Ar2 { lags: Matrix::zeros(k, 2), weight: Matrix::zeros(k, d), bias: vec![0.0; k] };
        for o in 0..k {
            let column = |lag: usize| lag * k + o;
            let left = |i: usize, j: usize| {
                let explained: f64 =
                    self.cross.col(column(i)).iter().zip(solved.col(column(j)).iter()).map(|(p, s)| p * s).sum();
                self.own[o][i][j] - explained
            };
            let (m11, m12, m22, r1, r2) = (left(1, 1), left(1, 2), left(2, 2), left(0, 1), left(0, 2));
            // A coefficient that never moved has no lags to learn.
            let floor = 1e-9 * (m11 + m22) + f64::MIN_POSITIVE;
            let (m11, m22) = (m11 + floor, m22 + floor);
            let determinant = m11 * m22 - m12 * m12;
            let (a1, a2) = if determinant > 0.0 {
                ((m22 * r1 - m12 * r2) / determinant, (m11 * r2 - m12 * r1) / determinant)
            } else {
                (0.0, 0.0)
            };
            let (a1, a2) = stable(a1, a2, radius);
            let mut bias =
                self.mean_target[column(0)] - a1 * self.mean_target[column(1)] - a2 * self.mean_target[column(2)];
            for i in 0..d {
                let w = solved[(i, column(0))] - a1 * solved[(i, column(1))] - a2 * solved[(i, column(2))];
                bias -= w * self.mean_feature[i];
                model.weight.row_mut(o)[i] = w as f32;
            }
            model.lags.row_mut(o).copy_from_slice(&[a1 as f32, a2 as f32]);
            model.bias[o] = bias as f32;
        }
        Ok(model)
    }
}

/// Takes column means off rows of `width` numbers and returns them.
fn centre(numbers: &mut [f64], width: usize) -> Vec<f64> {
    let mut mean = vec![0.0; width];
    let rows = (numbers.len() / width.max(1)).max(1) as f64;
    for row in numbers.chunks_exact(width.max(1)) {
        mean.iter_mut().zip(row).for_each(|(m, x)| *m += x / rows);
    }
    for row in numbers.chunks_exact_mut(width.max(1)) {
        row.iter_mut().zip(&mean).for_each(|(x, m)| *x -= m);
    }
    mean
}

/// Moves the roots of `z^2 - a1 z - a2` inside a radius.
fn stable(a1: f64, a2: f64, radius: f64) -> (f64, f64) {
    let discriminant = a1 * a1 + 4.0 * a2;
    if discriminant < 0.0 {
        let size = (-a2).sqrt();
        return if size > radius { (a1 * radius / size, -radius * radius) } else { (a1, a2) };
    }
    let root = |sign: f64| (0.5 * (a1 + sign * discriminant.sqrt())).clamp(-radius, radius);
    (root(1.0) + root(-1.0), -root(1.0) * root(-1.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use softtissue_clips::ClipId;
    use softtissue_random::Draws;

    #[test]
    fn poles_end_inside_the_radius_and_stable_ones_stay() {
        for (a1, a2) in [(1.9, -0.95), (0.5, 0.2), (2.2, -1.5), (1.5, 0.4), (-2.5, 0.1), (0.0, 0.0)] {
            let (b1, b2) = stable(a1, a2, 0.995);
            let d = b1 * b1 + 4.0 * b2;
            let size = if d < 0.0 { (-b2).sqrt() } else { (0.5 * (b1.abs() + d.sqrt())).abs() };
            assert!(size <= 0.995 + 1e-12, "{a1} {a2} {size}");
        }
        assert_eq!(stable(1.9, -0.95, 0.995), (1.9, -0.95));
    }

    /// Data made by a known recursion give its numbers back.
    #[test]
    fn a_known_recursion_is_recovered() {
        let mut draws = Draws::new(5, "ar2", 0, 0);
        let (d, k) = (3, 2);
        let lags = [[1.6, -0.8], [0.9, -0.5]];
        let weight = [[0.3, -0.2, 0.5], [-0.1, 0.4, 0.2]];
        let clips: Vec<TrainingClip> = (0..4)
            .map(|i| {
                let frames = 80;
                let features: Vec<f32> = (0..frames * d).map(|_| draws.normal() as f32).collect();
                let mut c = vec![[0.0f32; 2]; 2];
                for t in 0..frames {
                    let n = c.len();
                    let mut next = [0.1f32, -0.2];
                    for o in 0..k {
                        next[o] += lags[o][0] * c[n - 1][o] + lags[o][1] * c[n - 2][o];
                        next[o] += (0..d).map(|j| weight[o][j] * features[t * d + j]).sum::<f32>();
                    }
                    c.push(next);
                }
                TrainingClip {
                    id: ClipId::new("a", "m", i),
                    beta: vec![],
                    features,
                    coefficients: c[2..].iter().flatten().copied().collect(),
                    frames,
                }
            })
            .collect();
        let scaling = FeatureScaling {
            input_size: d,
            kept: vec![0, 1, 2],
            lower: vec![-10.0; 3],
            upper: vec![10.0; 3],
            scale: vec![1.0; 3],
        };
        let references: Vec<&TrainingClip> = clips.iter().collect();
        let model = Moments::new(&scaling, &references).unwrap().solve(1e-9, 0.995).unwrap();
        for o in 0..k {
            for i in 0..2 {
                assert!((model.lags.row(o)[i] - lags[o][i]).abs() < 1e-3, "{:?}", model.lags);
            }
            for j in 0..d {
                assert!((model.weight.row(o)[j] - weight[o][j]).abs() < 1e-3);
            }
        }
        let rolled = model.rollout(&clips[0].features, &[0.0, 0.0]);
        let worst = rolled.iter().zip(&clips[0].coefficients).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(worst < 0.02, "{worst}");
    }
}
