use super::readout::{Selected, select};
use super::score::{Score, SoftScore};
use crate::{ModelError, TrainingClip};
use faer::linalg::matmul::matmul;
use faer::linalg::solvers::Solve;
use faer::{Accum, Mat, Par, Side};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use softtissue_bundle::Ar2;
use softtissue_bundle::descriptor::FeatureScaling;

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

impl Ar2Config {
    /// # Errors
    /// Names the setting that is out of range.
    pub fn check(&self) -> Result<(), ModelError> {
        if self.pole_radius > 0.0 && self.pole_radius < 1.0 {
            return Ok(());
        }
        Err(ModelError::Config(format!("pole_radius is {}, expected between 0 and 1", self.pole_radius)))
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
    config.check()?;
    let moments = Moments::new(scaling, train)?;
    let held: Vec<Vec<f32>> = validation.par_iter().map(|c| scaling.apply_clip(&c.features)).collect();
    let (model, strength, score, tried) = select(&config.strengths, |strength| {
        let model = moments.solve(strength, Lags::Two { radius: config.pole_radius })?;
        let clips: Vec<Score> = validation
            .par_iter()
            .zip(&held)
            .map(|(clip, x)| score.clip(&model.rollout(x, rest), &clip.coefficients))
            .collect();
        Ok((model, clips))
    })?;
    Ok(Selected { model, strength, score, tried })
}

/// Sums over the training frames from which every strength is solved: features against features and against the
/// coefficients now, one and two frames before; all centred.
pub(super) struct Moments {
    features: Mat<f64>,
    /// `[D, 3 K]`: now, one before, two before.
    cross: Mat<f64>,
    /// `[K]`: `c_i . c_j` for lags `i, j` in 0..3.
    own: Vec<[[f64; 3]; 3]>,
    mean_feature: Vec<f64>,
    /// `[3 K]`.
    mean_target: Vec<f64>,
    /// Frames, or their weights summed.
    frames: f64,
}

/// What a solved model remembers of its own output.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Lags {
    /// Nothing: order zero.
    None,
    /// Two frames, poles within a radius.
    Two {
        /// Below 1.
        radius: f64,
    },
}

impl Moments {
    pub(super) fn new(scaling: &FeatureScaling, clips: &[&TrainingClip]) -> Result<Self, ModelError> {
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
        Ok(Self { features: gram, cross, own, mean_feature, mean_target, frames: rows as f64 })
    }

    /// Frames behind the sums.
    pub(super) fn frames(&self) -> f64 {
        self.frames
    }

    /// The sums over several data sets, every frame of a set weighed by its factor. Panics without a set.
    pub(super) fn weighted(parts: &[(f64, &Self)]) -> Self {
        let (d, k) = (parts[0].1.mean_feature.len(), parts[0].1.own.len());
        let frames: f64 = parts.iter().map(|(factor, m)| factor * m.frames).sum();
        let mut sum = Self {
            features: Mat::zeros(d, d),
            cross: Mat::zeros(d, 3 * k),
            own: vec![[[0.0; 3]; 3]; k],
            mean_feature: vec![0.0; d],
            mean_target: vec![0.0; 3 * k],
            frames,
        };
        for (factor, part) in parts {
            let share = factor * part.frames / frames;
            sum.mean_feature.iter_mut().zip(&part.mean_feature).for_each(|(s, m)| *s += share * m);
            sum.mean_target.iter_mut().zip(&part.mean_target).for_each(|(s, m)| *s += share * m);
        }
        for (factor, part) in parts {
            sum.add_about_mean(*factor, part);
        }
        sum
    }

    /// Adds another's sums, `factor` times, moved from its own mean to this one's.
    fn add_about_mean(&mut self, factor: f64, part: &Self) {
        let offset = |own: &[f64], other: &[f64]| own.iter().zip(other).map(|(m, p)| p - m).collect::<Vec<f64>>();
        let x = offset(&self.mean_feature, &part.mean_feature);
        let c = offset(&self.mean_target, &part.mean_target);
        let (k, n) = (self.own.len(), part.frames);
        for j in 0..x.len() {
            for i in 0..x.len() {
                self.features[(i, j)] += factor * (part.features[(i, j)] + n * x[i] * x[j]);
            }
        }
        for j in 0..c.len() {
            for i in 0..x.len() {
                self.cross[(i, j)] += factor * (part.cross[(i, j)] + n * x[i] * c[j]);
            }
        }
        for o in 0..k {
            for i in 0..3 {
                for j in 0..3 {
                    self.own[o][i][j] += factor * (part.own[o][i][j] + n * c[i * k + o] * c[j * k + o]);
                }
            }
        }
    }

    /// Eliminates the weights from each coefficient's normal equations, solves the two lags, moves their poles inside
    /// the radius and puts the weights back for the lags as they then are.
    pub(super) fn solve(&self, strength: f64, lags: Lags) -> Result<Ar2, ModelError> {
        let (d, k) = (self.mean_feature.len(), self.own.len());
        let trace: f64 = (0..d).map(|i| self.features[(i, i)]).sum();
        let mut damped = self.features.clone();
        (0..d).for_each(|i| damped[(i, i)] += strength * trace);
        let solved = damped
            .llt(Side::Lower)
            .map_err(|_| ModelError::Data(format!("the autoregression is singular at strength {strength}: raise it")))?
            .solve(&self.cross);
        let mut model = Ar2::zeros(k, d);
        for o in 0..k {
            let column = |lag: usize| lag * k + o;
            let (a1, a2) = match lags {
                Lags::None => (0.0, 0.0),
                Lags::Two { radius } => self.lags(o, &solved, radius),
            };
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

    /// The two lags of coefficient `o`; `solved` are the weights that explain each lag by the features alone.
    fn lags(&self, o: usize, solved: &Mat<f64>, radius: f64) -> (f64, f64) {
        let column = |lag: usize| lag * self.own.len() + o;
        let left = |i: usize, j: usize| {
            let pairs = self.cross.col(column(i)).iter().zip(solved.col(column(j)).iter());
            self.own[o][i][j] - pairs.map(|(p, s)| p * s).sum::<f64>()
        };
        let (m11, m12, m22, r1, r2) = (left(1, 1), left(1, 2), left(2, 2), left(0, 1), left(0, 2));
        // A coefficient that never moved has no lags to learn.
        let floor = 1e-9 * (m11 + m22) + f64::MIN_POSITIVE;
        let (m11, m22) = (m11 + floor, m22 + floor);
        let determinant = m11 * m22 - m12 * m12;
        if determinant <= 0.0 {
            return (0.0, 0.0);
        }
        stable((m22 * r1 - m12 * r2) / determinant, (m11 * r2 - m12 * r1) / determinant, radius)
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
        let model = Moments::new(&scaling, &references).unwrap().solve(1e-9, Lags::Two { radius: 0.995 }).unwrap();
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
