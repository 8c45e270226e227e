//! What a bundle computes, written out in f64 from the documentation, without any of the crate's code behind the features.

use softtissue_bundle::*;

fn wide(x: &[f32]) -> Vec<f64> {
    x.iter().map(|x| f64::from(*x)).collect()
}

fn times(matrix: &Matrix, x: &[f64]) -> Vec<f64> {
    assert_eq!(matrix.cols(), x.len());
    (0..matrix.rows()).map(|r| wide(&matrix.numbers_of_row(r)).iter().zip(x).map(|(a, b)| a * b).sum()).collect()
}

fn plus(a: &[f64], b: &[f64]) -> Vec<f64> {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| a + b).collect()
}

fn linear(layer: &Linear, x: &[f64]) -> Vec<f64> {
    plus(&times(&layer.weight, x), &wide(&layer.bias))
}

fn relu(x: &[f64]) -> Vec<f64> {
    x.iter().map(|x| x.max(0.0)).collect()
}

fn sigmoid(x: f64) -> f64 {
    1.0 / (1.0 + (-x).exp())
}

/// Pre-activation residual unit.
pub fn unit(unit: &ResidualUnit, x: &[f64]) -> Vec<f64> {
    plus(x, &linear(&unit.outer, &relu(&linear(&unit.inner, &relu(x)))))
}

/// PyTorch's equations of a GRU cell.
pub fn gru(gru: &Gru, x: &[f64], h: &[f64]) -> Vec<f64> {
    let n = h.len();
    let input = plus(&times(&gru.w_ih, x), &wide(&gru.b_ih));
    let state = plus(&times(&gru.w_hh, h), &wide(&gru.b_hh));
    (0..n)
        .map(|i| {
            let r = sigmoid(input[i] + state[i]);
            let z = sigmoid(input[n + i] + state[n + i]);
            let new = (input[2 * n + i] + r * state[2 * n + i]).tanh();
            (1.0 - z) * new + z * h[i]
        })
        .collect()
}

/// Latents `[T][L]` of features `[T, D]`.
pub fn regress(regressor: &Regressor, features: &[f32], beta: &[f32]) -> Vec<Vec<f64>> {
    let scale = |scaling: &descriptor::FeatureScaling, x: &[f32]| -> Vec<f64> {
        (0..scaling.kept.len())
            .map(|i| {
                let x = f64::from(x[scaling.kept[i] as usize]);
                x.clamp(scaling.lower[i].into(), scaling.upper[i].into()) * f64::from(scaling.scale[i])
            })
            .collect()
    };
    let mut beta = beta.to_vec();
    beta.resize(regressor.shape.input_size, 0.0);
    let b = scale(&regressor.shape, &beta);
    let law = &regressor.mass;
    let mass = f64::from(beta[1].clamp(law.range[0], law.range[1])) - f64::from(law.centre);
    let (faster, farther) = ((f64::from(law.frequency) * mass).exp(), (f64::from(law.amplitude) * mass).exp());
    let resonators = regressor.bank.as_ref().map_or(&[][..], |bank| bank.resonators());
    let channels = regressor.bank.as_ref().map_or(0, |bank| bank.channels());
    let mut bank = vec![vec![(0.0f64, 0.0f64); channels]; resonators.len()];
    let law = regressor.bank.as_ref().and_then(|bank| bank.hardening());
    let mut drive = 0.0f64;
    let mut hidden = vec![0.0; regressor.recurrent.as_ref().map_or(0, |r| r.gru.w_hh.cols())];
    let mut latents = vec![];
    for frame in features.chunks_exact(regressor.input.input_size) {
        let x = scale(&regressor.input, frame);
        let mut a = vec![];
        let fps = regressor.bank.as_ref().map_or(0.0, |bank| f64::from(bank.fps()));
        let harder = law.map_or(1.0, |law| {
            let (floor, kept) = (f64::from(law.floor), (-1.0 / (fps * f64::from(law.seconds))).exp());
            let square = x[..channels].iter().map(|u| u * u).sum::<f64>() / channels as f64;
            drive = kept * drive + (1.0 - kept) * square;
            ((drive + floor) / (1.0 + floor)).powf(0.5 * f64::from(law.exponent))
        });
        for (resonator, states) in resonators.iter().zip(&mut bank) {
            let (f, d) = (f64::from(resonator.frequency), f64::from(resonator.damping));
            let w = std::f64::consts::TAU * (harder * (faster * f).min(0.47 * fps)).min(0.47 * fps);
            let (radius, angle) = ((-d * w / fps).exp(), (1.0 - d * d).sqrt() * w / fps);
            let (p, q) = (radius * angle.cos(), radius * angle.sin());
            for (state, u) in states.iter_mut().zip(&x) {
                let u = u / harder;
                // (p + iq) s + (1 - p - iq) u
                *state = (p * state.0 - q * state.1 + (1.0 - p) * u, p * state.1 + q * state.0 - q * u);
            }
            a.extend(states.iter().map(|s| s.0));
            a.extend(states.iter().map(|s| s.1));
        }
        if regressor.bank.is_none() || regressor.direct {
            a.extend(&x);
        }
        let mut input = vec![];
        for powers in &regressor.shape_terms {
            let phi: f64 = powers.iter().zip(&b).map(|(p, b)| b.powi(i32::from(*p))).product();
            input.extend(a.iter().map(|a| phi * a));
        }
        input.extend(&b);
        let mut z = linear(&regressor.shortcut, &input);
        if let Some(recurrent) = &regressor.recurrent {
            hidden = gru(&recurrent.gru, &[x.clone(), b.clone()].concat(), &hidden);
            let read = linear(&recurrent.readout, &hidden);
            z = match &regressor.acquaintance {
                None => plus(&z, &read),
                Some(known) => {
                    let network = plus(&linear(&known.around, &[x, b.clone()].concat()), &read);
                    let s = share(known, &beta);
                    z.iter().zip(network).map(|(z, n)| (1.0 - s) * z + s * n).collect()
                }
            };
        }
        latents.push(z.iter().map(|z| farther * z).collect());
    }
    latents
}

/// The network's share of a body.
fn share(known: &Acquaintance, beta: &[f32]) -> f64 {
    let distance2 = |p: usize| -> f64 {
        known.people.row(p).iter().zip(beta).map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2)).sum()
    };
    let nearest = (0..known.people.rows()).map(distance2).fold(f64::INFINITY, f64::min);
    let stranger = f64::from(known.stranger);
    f64::from(known.share) * (stranger + (1.0 - stranger) * (-nearest).exp())
}

/// Delta `[3 V]` of a latent.
pub fn decode(subspace: &Subspace, latent: &[f64]) -> Vec<f64> {
    let mut c = linear(&subspace.decoder.lift, latent);
    for u in &subspace.decoder.units {
        c = unit(u, &c);
    }
    let c = plus(&c, &wide(&subspace.basis.coefficient_mean));
    let mut delta = wide(&subspace.basis.mean);
    for (k, c) in c.iter().enumerate() {
        for (d, m) in delta.iter_mut().zip(&*subspace.basis.directions.numbers_of_row(k)) {
            *d += c * f64::from(*m);
        }
    }
    delta
}

/// Latent of a delta `[3 V]`.
pub fn encode(subspace: &Subspace, delta: &[f32]) -> Vec<f64> {
    let centred: Vec<f64> = wide(delta).iter().zip(&subspace.basis.mean).map(|(d, m)| d - f64::from(*m)).collect();
    let c = times(&subspace.basis.directions, &centred);
    let mut c: Vec<f64> = c.iter().zip(&subspace.basis.coefficient_mean).map(|(c, m)| c - f64::from(*m)).collect();
    for u in &subspace.encoder.units {
        c = unit(u, &c);
    }
    linear(&subspace.encoder.project, &c)
}
