//! How many principal components hold 95 % of the variance of true deltas, with scatter and mismatch on.

use crate::Settings;
use crate::people::{FIRST_FRAME, simulate};
use glam::Vec3;
use softtissue_body::procedural::ProceduralBody;
use softtissue_synth::dataset::SynthConfig;
use softtissue_synth::motion::{self, Request};
use softtissue_synth::subject::{Subject, SubjectConfig};

/// Every how many frames one is taken.
const STRIDE: usize = 8;

/// Components of a sample of frames of four people, and the size of the sample.
pub fn components(body: &ProceduralBody, settings: &Settings) -> (usize, usize) {
    let mut frames: Vec<Vec<Vec3>> = Vec::new();
    for (index, bmi) in SynthConfig::default().bmi.into_iter().enumerate() {
        let config = SubjectConfig::default();
        let person = Subject::draw(&body.model, &body.anatomy, &settings.material, &config, 1, index, bmi)
            .expect("a BMI in range");
        let shaped = body.model.shaped(&person.beta);
        for motion in &settings.motions {
            let request =
                Request { subject: &person.name, motion, take: 0, frames: settings.frames, fps: 60.0, seed: 1 };
            let clip = motion::generate(&request, &shaped, &person.style).expect("a known motion");
            let run = simulate(body, &person.beta, &person.material, &settings.config, &clip);
            for t in (FIRST_FRAME..clip.len()).step_by(STRIDE) {
                let mut delta = run.deltas.frame(t).to_vec();
                person.mismatch.add(clip.rotations.frame(t), &mut delta);
                frames.push(delta);
            }
        }
    }
    (count(&frames, 0.95), frames.len())
}

/// Eigenvalues of the centred Gram matrix of the frames, largest first, until they hold `share` of the trace.
fn count(frames: &[Vec<Vec3>], share: f64) -> usize {
    let n = frames.len();
    let mut gram = vec![vec![0.0f64; n]; n];
    for i in 0..n {
        for j in 0..=i {
            let dot: f64 = frames[i].iter().zip(&frames[j]).map(|(a, b)| f64::from(a.dot(*b))).sum();
            gram[i][j] = dot;
            gram[j][i] = dot;
        }
    }
    let rows: Vec<f64> = gram.iter().map(|r| r.iter().sum::<f64>() / n as f64).collect();
    let all = rows.iter().sum::<f64>() / n as f64;
    for i in 0..n {
        for j in 0..n {
            gram[i][j] += all - rows[i] - rows[j];
        }
    }
    let mut values = jacobi(gram);
    values.sort_by(|a, b| b.total_cmp(a));
    let wanted = share * values.iter().sum::<f64>();
    let mut sum = 0.0;
    1 + values
        .iter()
        .take_while(|v| {
            sum += **v;
            sum < wanted
        })
        .count()
}

/// Eigenvalues of a symmetric matrix by cyclic Jacobi rotations.
fn jacobi(mut a: Vec<Vec<f64>>) -> Vec<f64> {
    let n = a.len();
    let trace: f64 = (0..n).map(|i| a[i][i]).sum();
    for _ in 0..12 {
        let mut off = 0.0f64;
        for p in 0..n {
            for q in p + 1..n {
                off = off.max(a[p][q].abs());
                if a[p][q].abs() < 1e-9 * trace {
                    continue;
                }
                let theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
                let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
                let c = 1.0 / (t * t + 1.0).sqrt();
                let s = t * c;
                for k in 0..n {
                    let (x, y) = (a[k][p], a[k][q]);
                    a[k][p] = c * x - s * y;
                    a[k][q] = s * x + c * y;
                }
                for k in 0..n {
                    let (x, y) = (a[p][k], a[q][k]);
                    a[p][k] = c * x - s * y;
                    a[q][k] = s * x + c * y;
                }
            }
        }
        if off < 1e-8 * trace {
            break;
        }
    }
    (0..n).map(|i| a[i][i]).collect()
}
