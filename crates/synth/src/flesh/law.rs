//! Stress of one element. `F` maps the posed rest edge vectors to the current ones, so `F = I` without
//! displacement in every pose.

use super::number::{Matrix, Number, generate, multiply, transpose_multiply};
#[cfg(test)]
use super::number::{cofactors, determinant};

/// Moduli of an element; `eta` is its viscosity.
#[derive(Clone, Copy, Debug)]
pub struct Moduli<N> {
    /// Shear modulus at rest, Pa.
    pub mu: N,
    /// Resistance to change of volume, Pa.
    pub lambda: N,
    /// Viscosity, Pa s.
    pub eta: N,
}

/// A hyperelastic energy per unit of rest volume and its derivative.
pub trait Law {
    /// Energy density, J / m^3; what the tests hold [`Law::stress`] against.
    #[cfg(test)]
    fn energy<N: Number>(f: &Matrix<N>, moduli: &Moduli<N>) -> N;
    /// First Piola-Kirchhoff stress of the elastic part, Pa, with `det F` and `cof F` given.
    fn stress<N: Number>(f: &Matrix<N>, cof: &Matrix<N>, j: N, moduli: &Moduli<N>) -> Matrix<N>;
}

/// Stable neo-Hookean (after Smith, De Goes and Kim 2018) whose shear modulus grows with stretch:
/// `P = mu (1 + 2 c clamp(Ic - 3, 0, 2)) F + (lambda (J - 1) - mu) cof F`, with a bounded barrier under `J = 0.4`.
#[derive(Clone, Copy, Debug)]
pub struct Stiffening;

/// `c` of [`Stiffening`].
const GROWTH: f32 = 2.0;
/// `Ic - 3` beyond which the modulus grows no more.
const GROWTH_END: f32 = 2.0;
/// Relative volume under which the barrier acts, and its modulus as a multiple of `lambda`.
const CRUSHED: f32 = 0.4;
const BARRIER: f32 = 3.0;

impl Law for Stiffening {
    #[cfg(test)]
    fn energy<N: Number>(f: &Matrix<N>, m: &Moduli<N>) -> N {
        let j = determinant(f, &cofactors(f));
        let excess = squared_norm(f) - N::splat(3.0);
        let y = excess.max(N::splat(0.0)).min(N::splat(GROWTH_END));
        let growing = y * y * N::splat(0.5 * GROWTH)
            + (excess - N::splat(GROWTH_END)).max(N::splat(0.0)) * N::splat(GROWTH * GROWTH_END);
        let one = N::splat(1.0);
        m.mu * (N::splat(0.5) * excess + growing - (j - one))
            + m.lambda * N::splat(0.5) * (j - one) * (j - one)
            + barrier_energy(j, m.lambda)
    }
    #[inline(always)]
    fn stress<N: Number>(f: &Matrix<N>, cof: &Matrix<N>, j: N, m: &Moduli<N>) -> Matrix<N> {
        let y = (squared_norm(f) - N::splat(3.0)).max(N::splat(0.0)).min(N::splat(GROWTH_END));
        let stretch = m.mu * (N::splat(1.0) + N::splat(2.0 * GROWTH) * y);
        let volume = m.lambda * (j - N::splat(1.0)) - m.mu + barrier_stress(j, m.lambda);
        generate(|r, c| stretch * f[r][c] + volume * cof[r][c])
    }
}

/// Gent's limiting-stretch energy (Gent 1996) with a logarithmic volume term, continued with constant slopes
/// where it would grow without bound. For tests that ask whether a method learns more than one law.
#[derive(Clone, Copy, Debug)]
pub struct Gent;

/// `Ic - 3` at which Gent's energy would be infinite, and the part of it at which it is continued.
const GENT_LIMIT: f32 = 0.9;
const GENT_END: f32 = 0.8;
/// Relative volume under which the logarithm is continued.
const GENT_CRUSHED: f32 = 0.3;

impl Law for Gent {
    #[cfg(test)]
    fn energy<N: Number>(f: &Matrix<N>, m: &Moduli<N>) -> N {
        let j = determinant(f, &cofactors(f));
        let (one, limit) = (N::splat(1.0), N::splat(GENT_LIMIT));
        let excess = squared_norm(f) - N::splat(3.0);
        let end = N::splat(GENT_END * GENT_LIMIT);
        let inside = excess.min(end);
        let slope = limit / (limit - end);
        let shear = N::splat(0.5) * m.mu * (-limit * (one - inside / limit).ln() + slope * (excess - inside));
        let low = N::splat(GENT_CRUSHED);
        let jc = j.max(low);
        let log = jc.ln();
        let volume = N::splat(0.5) * m.lambda * log * log + m.lambda * log / jc * (j - jc);
        let lost = m.mu * (jc.ln() + (j - jc) / jc);
        shear + volume - lost + barrier_energy(j, m.lambda)
    }
    #[inline(always)]
    fn stress<N: Number>(f: &Matrix<N>, cof: &Matrix<N>, j: N, m: &Moduli<N>) -> Matrix<N> {
        let limit = N::splat(GENT_LIMIT);
        let inside = (squared_norm(f) - N::splat(3.0)).min(N::splat(GENT_END * GENT_LIMIT));
        let stretch = m.mu * limit / (limit - inside);
        let jc = j.max(N::splat(GENT_CRUSHED));
        let volume = (m.lambda * jc.ln() - m.mu) / jc + barrier_stress(j, m.lambda);
        generate(|r, c| stretch * f[r][c] + volume * cof[r][c])
    }
}

#[inline(always)]
fn squared_norm<N: Number>(f: &Matrix<N>) -> N {
    let row = |r: usize| f[r][0] * f[r][0] + f[r][1] * f[r][1] + f[r][2] * f[r][2];
    row(0) + row(1) + row(2)
}

#[cfg(test)]
fn barrier_energy<N: Number>(j: N, lambda: N) -> N {
    let under = (j - N::splat(CRUSHED)).min(N::splat(0.0));
    N::splat(0.5 * BARRIER) * lambda * under * under
}

#[inline(always)]
fn barrier_stress<N: Number>(j: N, lambda: N) -> N {
    N::splat(BARRIER) * lambda * (j - N::splat(CRUSHED)).min(N::splat(0.0))
}

/// Adds the viscous stress `eta F (F^T Gdot + Gdot^T F)`: twice `eta` times the rate of Green's strain, pulled
/// forward, which always takes energy out. `g_dot` is the gradient of the velocity relative to the skinned body.
#[inline(always)]
pub fn add_viscous<N: Number>(stress: &mut Matrix<N>, f: &Matrix<N>, g_dot: &Matrix<N>, eta: N) {
    let a = transpose_multiply(f, g_dot);
    let rate = generate(|r, c| a[r][c] + a[c][r]);
    let p = multiply(f, &rate);
    *stress = generate(|r, c| stress[r][c] + eta * p[r][c]);
}

#[cfg(test)]
mod tests {
    use super::*;
    use softtissue_random::Draws;

    fn random_f(draws: &mut Draws, size: f64) -> Matrix<f64> {
        let mut m = [[0.0; 3]; 3];
        for (r, row) in m.iter_mut().enumerate() {
            for (c, x) in row.iter_mut().enumerate() {
                *x = f64::from(u8::from(r == c)) + size * draws.range(-1.0, 1.0);
            }
        }
        m
    }

    fn check_gradient<L: Law>(name: &str) {
        let moduli = Moduli { mu: 650.0, lambda: 30_000.0, eta: 0.0 };
        for (i, size) in [0.02, 0.2, 0.4, 0.7, 0.9].into_iter().cycle().take(60).enumerate() {
            let mut draws = Draws::new(3, name, i as u64, 0);
            let f = random_f(&mut draws, size);
            let cof = cofactors(&f);
            let p = L::stress(&f, &cof, determinant(&f, &cof), &moduli);
            let scale = p.iter().flatten().fold(100.0f64, |s, x| s.max(x.abs()));
            for r in 0..3 {
                for c in 0..3 {
                    let at = |h: f64| {
                        let mut g = f;
                        g[r][c] += h;
                        L::energy(&g, &moduli)
                    };
                    let h = 1e-6;
                    let numeric = (at(h) - at(-h)) / (2.0 * h);
                    assert!((numeric - p[r][c]).abs() < 2e-5 * scale, "{name} {i} [{r}][{c}] {numeric} {}", p[r][c]);
                }
            }
        }
    }

    #[test]
    fn stresses_are_the_derivatives_of_their_energies() {
        check_gradient::<Stiffening>("stiffening");
        check_gradient::<Gent>("gent");
    }

    #[test]
    fn both_laws_rest_at_the_identity_with_the_same_small_shear_modulus() {
        let moduli = Moduli { mu: 650.0, lambda: 30_000.0, eta: 0.0 };
        let identity = generate(|r, c| f64::from(u8::from(r == c)));
        for law in [stress_of::<Stiffening>, stress_of::<Gent>] {
            assert!(law(&identity, &moduli).iter().flatten().all(|x| x.abs() < 1e-9));
            let mut sheared = identity;
            sheared[0][1] = 1e-4;
            assert!((law(&sheared, &moduli)[0][1] / 1e-4 - 650.0).abs() < 0.1);
        }
    }

    fn stress_of<L: Law>(f: &Matrix<f64>, moduli: &Moduli<f64>) -> Matrix<f64> {
        let cof = cofactors(f);
        L::stress(f, &cof, determinant(f, &cof), moduli)
    }

    #[test]
    fn the_first_law_stiffens() {
        let moduli = Moduli { mu: 650.0, lambda: 30_000.0, eta: 0.0 };
        let shear = |g: f64| {
            let f = generate(|r, c| {
                if r == c {
                    1.0
                } else if (r, c) == (0, 1) {
                    g
                } else {
                    0.0
                }
            });
            stress_of::<Stiffening>(&f, &moduli)[0][1] / g
        };
        assert!(shear(0.7) > 2.5 * shear(0.01));
    }

    #[test]
    fn viscosity_always_takes_energy_and_ignores_spin() {
        let mut draws = Draws::new(5, "viscous", 0, 0);
        for _ in 0..50 {
            let f = random_f(&mut draws, 0.5);
            let g_dot = random_f(&mut draws, 3.0);
            let mut p = [[0.0; 3]; 3];
            add_viscous(&mut p, &f, &g_dot, 2.0);
            let power: f64 = (0..9).map(|k| p[k / 3][k % 3] * g_dot[k / 3][k % 3]).sum();
            assert!(power >= 0.0);
            // a spin of the deformed element: Gdot = Omega F
            let spin = [[0.0, -2.0, 1.0], [2.0, 0.0, -0.5], [-1.0, 0.5, 0.0]];
            let mut q = [[0.0; 3]; 3];
            add_viscous(&mut q, &f, &multiply(&spin, &f), 2.0);
            assert!(q.iter().flatten().all(|x| x.abs() < 1e-12));
        }
    }
}
