use super::solve::{Equations, Readout};
use crate::ModelError;
use faer::linalg::solvers::Solve;
use faer::{Mat, Side};
use rayon::prelude::*;

/// A first fit in which output `o` answers to the bank's outputs of channel `o` alone: the force on a mode moves that mode,
/// and only what is left is looked for in all forces. It lets the ridge on the rest be strong.
pub(super) struct OwnResponse {
    /// Of each output that has a channel: weights `[K P]`, for shape term after shape term the bank's outputs of the channel.
    weights: Vec<Vec<f32>>,
    bank: BankLayout,
}

/// Where a bank's outputs lie at the beginning of a memory: pole after pole, real and imaginary parts of all channels in
/// turn.
#[derive(Clone, Copy, Debug)]
pub(super) struct BankLayout {
    /// Channels `C`.
    pub channels: usize,
    /// Outputs a channel, `P`.
    pub outputs: usize,
    /// Length `A` of the memory.
    pub memory: usize,
}

impl OwnResponse {
    /// Fits on whitened equations; `strength` is a part of the variance of all that the memory and shape terms hold. Without
    /// channels or strength nothing answers.
    pub fn fit(clips: &[Equations], bank: BankLayout, strength: f64) -> Result<Self, ModelError> {
        let latents = clips.iter().find(|c| c.rows > 0).map_or(0, |c| c.targets.len() / c.rows);
        if strength == 0.0 || bank.outputs == 0 {
            return Ok(Self { weights: vec![], bank });
        }
        let penalty = strength * variance(clips, bank.memory);
        let weights: Option<Vec<_>> =
            (0..latents.min(bank.channels)).into_par_iter().map(|o| fit_one(clips, bank, o, penalty)).collect();
        let singular = || ModelError::Data("the first fit of the readout is singular: raise own_strength".into());
        Ok(Self { weights: weights.ok_or_else(singular)?, bank })
    }

    /// Takes its answer off a clip's targets.
    pub fn take_from(&self, clip: &mut Equations) {
        if clip.rows == 0 {
            return;
        }
        let latents = clip.targets.len() / clip.rows;
        let folded: Vec<Vec<f32>> = self.weights.iter().map(|w| self.folded(w, &clip.factors)).collect();
        for (row, y) in clip.memory.chunks_exact(self.bank.memory).zip(clip.targets.chunks_exact_mut(latents)) {
            for (o, w) in folded.iter().enumerate() {
                y[o] -= w.iter().enumerate().map(|(p, w)| w * row[p * self.bank.channels + o]).sum::<f32>();
            }
        }
    }

    /// Adds its weights to those of a readout of the same memory.
    pub fn add_to(&self, readout: &mut Readout) {
        let BankLayout { channels, outputs, memory } = self.bank;
        let inputs = readout.weight.len() / readout.bias.len().max(1);
        for (o, weights) in self.weights.iter().enumerate() {
            let row = &mut readout.weight[o * inputs..(o + 1) * inputs];
            for (term, weights) in row.chunks_exact_mut(memory).zip(weights.chunks_exact(outputs)) {
                weights.iter().enumerate().for_each(|(p, w)| term[p * channels + o] += w);
            }
        }
    }

    fn folded(&self, weights: &[f32], factors: &[f32]) -> Vec<f32> {
        let mut sum = vec![0.0; self.bank.outputs];
        for (factor, part) in factors.iter().zip(weights.chunks_exact(self.bank.outputs)) {
            sum.iter_mut().zip(part).for_each(|(s, w)| *s += factor * w);
        }
        sum
    }
}

/// Summed variance of all products of memory and shape terms, times the number of rows.
fn variance(clips: &[Equations], memory: usize) -> f64 {
    let terms = clips.first().map_or(0, |c| c.factors.len());
    let rows: usize = clips.iter().map(|c| c.rows).sum();
    let (mut squares, mut sums) = (0.0, vec![0.0f64; terms * memory]);
    for clip in clips {
        let mut sum = vec![0.0f64; memory];
        let mut square = 0.0;
        for row in clip.memory.chunks_exact(memory) {
            for (s, x) in sum.iter_mut().zip(row) {
                *s += f64::from(*x);
                square += f64::from(*x).powi(2);
            }
        }
        for (factor, sums) in clip.factors.iter().zip(sums.chunks_exact_mut(memory)) {
            squares += f64::from(*factor).powi(2) * square;
            sums.iter_mut().zip(&sum).for_each(|(s, x)| *s += f64::from(*factor) * x);
        }
    }
    squares - sums.iter().map(|s| s * s).sum::<f64>() / rows.max(1) as f64
}

/// Weights `[K P]` of output `o` on its own channel; `None` where they cannot be told.
fn fit_one(clips: &[Equations], bank: BankLayout, o: usize, penalty: f64) -> Option<Vec<f32>> {
    let p = bank.outputs;
    let terms = clips.first()?.factors.len();
    let n = terms * p;
    let (mut gram, mut cross) = (Mat::<f64>::zeros(n, n), Mat::<f64>::zeros(n, 1));
    let (mut mean, mut mean_target, mut rows) = (vec![0.0f64; n], 0.0f64, 0usize);
    for clip in clips.iter().filter(|c| c.rows > 0) {
        let latents = clip.targets.len() / clip.rows;
        let x = Mat::from_fn(clip.rows, p, |t, i| f64::from(clip.memory[t * bank.memory + i * bank.channels + o]));
        let y = Mat::from_fn(clip.rows, 1, |t, _| f64::from(clip.targets[t * latents + o]));
        let (own, answer) = (x.transpose() * &x, x.transpose() * &y);
        for k in 0..terms {
            let factor = f64::from(clip.factors[k]);
            for i in 0..p {
                mean[k * p + i] += factor * x.col(i).iter().sum::<f64>();
                cross[(k * p + i, 0)] += factor * answer[(i, 0)];
                for l in 0..terms {
                    let both = factor * f64::from(clip.factors[l]);
                    (0..p).for_each(|j| gram[(k * p + i, l * p + j)] += both * own[(i, j)]);
                }
            }
        }
        mean_target += y.col(0).iter().sum::<f64>();
        rows += clip.rows;
    }
    for i in 0..n {
        cross[(i, 0)] -= mean[i] * mean_target / rows as f64;
        (0..n).for_each(|j| gram[(i, j)] -= mean[i] * mean[j] / rows as f64);
        gram[(i, i)] += penalty;
    }
    let weights = gram.llt(Side::Lower).ok()?.solve(&cross);
    let weights: Vec<f32> = weights.col(0).iter().map(|w| *w as f32).collect();
    weights.iter().all(|w| w.is_finite()).then_some(weights)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linear::solve::Ridge;
    use softtissue_random::Draws;

    const BANK: BankLayout = BankLayout { channels: 2, outputs: 4, memory: 11 };

    /// Three outputs; each of the first two follows its own channel by weights that the shape bends, the third all.
    fn clips(noise: f64) -> Vec<Equations> {
        let mut draws = Draws::new(5, "own response", 0, 0);
        let clip = |shape: f32, draws: &mut Draws| {
            let memory: Vec<f32> = (0..80 * BANK.memory).map(|_| draws.normal() as f32 + 0.3).collect();
            let mut targets = vec![];
            for m in memory.chunks_exact(BANK.memory) {
                let own = |o: usize| (0..4).map(|p| (1.0 + shape * p as f32) * m[2 * p + o]).sum::<f32>() + 1.5;
                targets.extend([own(0), own(1), m.iter().sum()].map(|y| y + (noise * draws.normal()) as f32));
            }
            Equations { memory, factors: vec![1.0, shape], amplitude: 1.0, statics: vec![shape], targets, rows: 80 }
        };
        [-1.0, 0.2, 0.9].map(|shape| clip(shape, &mut draws)).into()
    }

    #[test]
    fn what_follows_its_own_channel_is_found_and_taken_off() {
        let mut clips = clips(0.0);
        let own = OwnResponse::fit(&clips, BANK, 1e-12).unwrap();
        assert_eq!(own.weights.len(), 2);
        for weights in &own.weights {
            for (i, w) in weights.iter().enumerate() {
                let wanted = if i < 4 { 1.0 } else { (i - 4) as f32 };
                assert!((w - wanted).abs() < 1e-4, "{weights:?}");
            }
        }
        clips.iter_mut().for_each(|c| own.take_from(c));
        let left =
            clips.iter().flat_map(|c| c.targets.chunks_exact(3)).map(|y| (y[0] - 1.5).abs().max((y[1] - 1.5).abs()));
        assert!(left.fold(0.0, f32::max) < 1e-3, "only the constant is left");
    }

    /// Where little is known, the own channel explains what a ridge on everything spreads over all channels.
    #[test]
    fn the_sum_of_both_fits_predicts_better_than_the_ridge_alone() {
        let (known, mut fresh) = (clips(2.0), clips(0.0));
        let error = |strength: f64| -> f32 {
            let mut known: Vec<Equations> = known
                .iter()
                .map(|c| Equations {
                    memory: c.memory.clone(),
                    factors: c.factors.clone(),
                    statics: c.statics.clone(),
                    targets: c.targets.clone(),
                    ..*c
                })
                .collect();
            let own = OwnResponse::fit(&known, BANK, strength).unwrap();
            known.iter_mut().for_each(|c| own.take_from(c));
            let mut readout = Ridge::new(&known).unwrap().solve(0.1).unwrap();
            own.add_to(&mut readout);
            fresh
                .iter()
                .map(|c| {
                    let inputs = readout.weight.len() / 3;
                    c.memory
                        .chunks_exact(BANK.memory)
                        .zip(c.targets.chunks_exact(3))
                        .map(|(m, y)| {
                            let x: Vec<f32> = c
                                .factors
                                .iter()
                                .flat_map(|f| m.iter().map(move |m| f * m))
                                .chain(c.statics.clone())
                                .collect();
                            let found = |o: usize| {
                                readout.weight[o * inputs..][..inputs].iter().zip(&x).map(|(w, x)| w * x).sum::<f32>()
                                    + readout.bias[o]
                            };
                            (found(0) - y[0]).powi(2) + (found(1) - y[1]).powi(2)
                        })
                        .sum::<f32>()
                })
                .sum()
        };
        let (with, without) = (error(1e-3), error(0.0));
        fresh.clear();
        assert!(with < 0.5 * without, "{with} {without}");
    }
}
