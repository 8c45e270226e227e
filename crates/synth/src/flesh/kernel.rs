use super::assembly::{Chunk, SpringChunk};
use super::law::{Law, Moduli, add_viscous};
use super::number::{LANES, Lanes, Matrix, Number, cofactors, determinant, generate, multiply, multiply_transpose};

/// What elements read of a node; the fourth numbers are padding.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C, align(16))]
pub struct NodeState {
    /// Displacement from the skinned position, m.
    pub u: [f32; 4],
    /// Velocity relative to the skinned body, its turning taken out, m/s.
    pub w: [f32; 4],
    /// Skinned position, m.
    pub x: [f32; 4],
}

/// What one interval between frames knows of a chunk.
#[derive(Clone, Debug)]
pub struct ChunkState {
    /// Factor on all moduli where the posed element is flat.
    pub softening: Lanes,
    /// Added to the skinned edge matrix where skinning crushes the element: its value at the interval's start and
    /// its change to the end.
    pub correction: Option<Box<[Matrix<Lanes>; 2]>>,
}

const ZERO: Matrix<Lanes> = [[Lanes([0.0; LANES]); 3]; 3];

/// Adds the elastic and viscous forces of a chunk, `f_k = -V P Dm^-T e_k`; returns six times the signed
/// volume of the deformed elements. `s` in `[0, 1]` is the place in the interval.
#[inline(always)]
pub fn add_element_forces<L: Law>(
    chunk: &Chunk,
    state: &ChunkState,
    s: f32,
    nodes: &[NodeState],
    forces: &mut [[f32; 4]],
) -> Lanes {
    let (mut du, mut dw, mut dm) = (ZERO, ZERO, ZERO);
    for lane in 0..LANES {
        let [a, b, c, d] = [0, 1, 2, 3].map(|k| &nodes[chunk.nodes[k][lane] as usize]);
        for (column, n) in [b, c, d].into_iter().enumerate() {
            for r in 0..3 {
                du[r][column].0[lane] = n.u[r] - a.u[r];
                dw[r][column].0[lane] = n.w[r] - a.w[r];
                dm[r][column].0[lane] = n.x[r] - a.x[r];
            }
        }
    }
    let mut crushed_volume = None;
    if let Some(correction) = &state.correction {
        let current = generate(|r, c| dm[r][c] + du[r][c]);
        crushed_volume = Some(determinant(&current, &cofactors(&current)));
        let s = Lanes::splat(s);
        dm = generate(|r, c| dm[r][c] + correction[0][r][c] + s * correction[1][r][c]);
    }
    let dm_cof = cofactors(&dm);
    let dm_volume = determinant(&dm, &dm_cof);
    let inverse = Lanes::splat(1.0) / dm_volume;
    let one = Lanes::splat(1.0);
    let g = multiply_transpose(&du, &dm_cof);
    let f = generate(|r, c| if r == c { one + g[r][c] * inverse } else { g[r][c] * inverse });
    let rate = multiply_transpose(&dw, &dm_cof);
    let g_dot = generate(|r, c| rate[r][c] * inverse);
    let moduli = Moduli { mu: chunk.mu, lambda: chunk.lambda, eta: chunk.eta };
    let cof = cofactors(&f);
    let j = determinant(&f, &cof);
    let mut stress = L::stress(&f, &cof, j, &moduli);
    add_viscous(&mut stress, &f, &g_dot, moduli.eta);
    let scale = chunk.volume * state.softening * inverse;
    let h = multiply(&stress, &dm_cof);
    for lane in 0..LANES {
        let mut sum = [0.0f32; 3];
        for corner in 1..4 {
            let force = &mut forces[chunk.nodes[corner][lane] as usize];
            for r in 0..3 {
                let p = h[r][corner - 1].0[lane] * scale.0[lane];
                sum[r] += p;
                force[r] -= p;
            }
        }
        let force = &mut forces[chunk.nodes[0][lane] as usize];
        for r in 0..3 {
            force[r] += sum[r];
        }
    }
    crushed_volume.unwrap_or(j * dm_volume)
}

/// Strain beyond which the skin stiffens no more.
const SKIN_STRAIN_END: f32 = 0.35;

/// Adds the skin's tension `k e + c e^3`, a quarter of `k e` in compression, along its edges; `e` is the strain
/// against the skinned length.
#[inline(always)]
pub fn add_spring_forces(chunk: &SpringChunk, nodes: &[NodeState], forces: &mut [[f32; 4]]) {
    let zero = Lanes::splat(0.0);
    let (mut du, mut dx) = ([zero; 3], [zero; 3]);
    for lane in 0..LANES {
        let [a, b] = [0, 1].map(|k| &nodes[chunk.nodes[k][lane] as usize]);
        for r in 0..3 {
            du[r].0[lane] = b.u[r] - a.u[r];
            dx[r].0[lane] = b.x[r] - a.x[r];
        }
    }
    let dot = |p: &[Lanes; 3], q: &[Lanes; 3]| p[0] * q[0] + p[1] * q[1] + p[2] * q[2];
    let (xx, xu, uu) = (dot(&dx, &dx), dot(&dx, &du), dot(&du, &du));
    let rest = Lanes(xx.0.map(f32::sqrt)).max(Lanes::splat(1e-4));
    let change = xu + xu + uu;
    let length = Lanes((xx + change).max(Lanes::splat(1e-8)).0.map(f32::sqrt));
    // (L^2 - L0^2) / (L + L0): no digits are lost where the strain is small
    let e = change / ((length + rest) * rest);
    let pulled = e.max(zero);
    let capped = pulled.min(Lanes::splat(SKIN_STRAIN_END));
    let tension =
        pulled * (chunk.linear + chunk.cubic * capped * capped) + e.min(zero) * chunk.linear * Lanes::splat(0.25);
    let per_length = tension / length;
    for lane in 0..LANES {
        for r in 0..3 {
            let p = (dx[r].0[lane] + du[r].0[lane]) * per_length.0[lane];
            forces[chunk.nodes[0][lane] as usize][r] += p;
            forces[chunk.nodes[1][lane] as usize][r] -= p;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::law::Stiffening;
    use super::*;
    use softtissue_random::Draws;

    fn setup(draws: &mut Draws) -> (Chunk, ChunkState, Vec<NodeState>) {
        let mut chunk_nodes = [[0; LANES]; 4];
        let mut nodes = Vec::new();
        for lane in 0..LANES {
            for (corner, base) in
                [[0.0, 0.0, 0.0], [0.02, 0.0, 0.0], [0.0, 0.02, 0.0], [0.0, 0.0, 0.02]].iter().enumerate()
            {
                chunk_nodes[corner][lane] = nodes.len() as u32;
                let mut n = NodeState::default();
                for r in 0..3 {
                    n.x[r] = base[r] + 0.002 * draws.range(-1.0, 1.0) as f32;
                    n.u[r] = 0.004 * draws.range(-1.0, 1.0) as f32;
                }
                nodes.push(n);
            }
        }
        let chunk = Chunk {
            nodes: chunk_nodes,
            count: LANES,
            mu: Lanes::splat(650.0),
            lambda: Lanes::splat(30_000.0),
            eta: Lanes::splat(3.0),
            volume: Lanes::splat(1.3e-6),
            surface: [true; LANES],
            rest: ZERO,
        };
        (chunk, ChunkState { softening: Lanes::splat(1.0), correction: None }, nodes)
    }

    /// Energy of every element in f64, by the law's own formula.
    fn energy(chunk: &Chunk, nodes: &[NodeState]) -> f64 {
        (0..LANES)
            .map(|lane| {
                let at = |k: usize, r: usize, x: bool| {
                    let n = &nodes[chunk.nodes[k][lane] as usize];
                    f64::from(if x { n.x[r] } else { n.u[r] })
                };
                let edge = |x: bool| generate(|r, c| at(c + 1, r, x) - at(0, r, x));
                let (dm, du): (Matrix<f64>, Matrix<f64>) = (edge(true), edge(false));
                let cof = cofactors(&dm);
                let g = multiply_transpose(&du, &cof);
                let det = determinant(&dm, &cof);
                let f = generate(|r, c| f64::from(u8::from(r == c)) + g[r][c] / det);
                Stiffening::energy(&f, &Moduli { mu: 650.0, lambda: 30_000.0, eta: 0.0 }) * 1.3e-6
            })
            .sum()
    }

    #[test]
    fn forces_are_minus_the_slope_of_the_energy_and_sum_to_nothing() {
        let (chunk, state, nodes) = setup(&mut Draws::new(1, "kernel", 0, 0));
        let mut forces = vec![[0.0; 4]; nodes.len()];
        add_element_forces::<Stiffening>(&chunk, &state, 0.0, &nodes, &mut forces);
        for n in 0..nodes.len() {
            for r in 0..3 {
                let at = |h: f32| {
                    let mut moved = nodes.clone();
                    moved[n].u[r] += h;
                    (energy(&chunk, &moved), f64::from(moved[n].u[r]))
                };
                let ((high, x1), (low, x0)) = (at(2e-6), at(-2e-6));
                let slope = (high - low) / (x1 - x0);
                let scale = forces[n].iter().fold(0.05f32, |m, f| m.max(f.abs()));
                assert!((slope as f32 + forces[n][r]).abs() < 2e-3 * scale, "{n} {r}: {slope} {:?}", forces[n]);
            }
        }
        for element in forces.chunks_exact(4) {
            for r in 0..3 {
                let sum: f32 = element.iter().map(|f| f[r]).sum();
                assert!(sum.abs() < 1e-5, "{element:?}");
            }
        }
    }

    #[test]
    fn skin_pulls_its_ends_together_and_resists_less_when_slack() {
        let force = |stretch: f32| {
            let mut nodes = vec![NodeState::default(); 2];
            nodes[1].x[0] = 0.02;
            nodes[1].u[0] = 0.02 * stretch;
            let only_first = |x: f32| Lanes(std::array::from_fn(|l| if l == 0 { x } else { 0.0 }));
            let chunk =
                SpringChunk { nodes: [[0; LANES], [1; LANES]], linear: only_first(60.0), cubic: only_first(1500.0) };
            let mut forces = vec![[0.0; 4]; 2];
            add_spring_forces(&chunk, &nodes, &mut forces);
            assert!((forces[0][0] + forces[1][0]).abs() < 1e-6);
            forces[0][0]
        };
        assert!((force(0.1) - 60.0 * (0.1 + 25.0 * 0.001)).abs() < 1e-2);
        assert!((force(-0.1) + 1.5).abs() < 1e-2);
    }
}
