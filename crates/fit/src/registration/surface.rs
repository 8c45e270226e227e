//! The surface of a frame: displacements of the rest mesh that bring it onto the scan.

use super::model::{Pair, Posed, Registrar};
use glam::{Mat3A, Vec3, Vec3A};

/// Conjugate-gradient steps at most.
const STEPS: usize = 40;
/// Residual, as a share of the first, at which the displacements are found.
const ENOUGH: f32 = 1e-3;

/// Least squares in the rest displacements `d`, `[V]`:
///
/// `sum_p w_p (n_p . (x_p(d) - y_p))^2 + smoothing sum_edges |e_i - e_j|^2 + sum_v coupling_v |d_v - prior_v|^2`
///
/// with `e = d - detail`, scan points `y_p`, their places `x_p` on the body, and the `w_p` summing to about the number
/// of vertices. Solved by conjugate gradients with the blocks of the vertices inverted beforehand.
struct System<'a> {
    registrar: &'a Registrar<'a>,
    rows: Vec<Row>,
    inverse_blocks: Vec<Mat3A>,
}

/// A scan point: how its distance from the plane changes with the corners' displacements.
struct Row {
    corners: [u32; 3],
    slopes: [Vec3A; 3],
    weight: f32,
}

impl Registrar<'_> {
    /// The displacements `[V]` that pairs ask for, from `start`; `detail` is the subject's static one, `prior` what the
    /// model has where no point says otherwise.
    pub fn surface(&self, posed: &Posed, pairs: &[Pair], detail: &[Vec3], prior: &[Vec3], start: &[Vec3]) -> Vec<Vec3> {
        let count = start.len();
        let per_pair = count as f32 / pairs.len().max(1) as f32;
        let undisplaced: Vec<Vec3> =
            posed.posed_from_rest.iter().zip(&posed.rest).map(|(a, x)| a.transform_point3(*x)).collect();
        let mut right: Vec<Vec3A> = prior.iter().zip(&self.coupling).map(|(p, c)| Vec3A::from(*p) * *c).collect();
        self.add_edges(detail, &mut right);
        let mut rows = Vec::with_capacity(pairs.len());
        for pair in pairs {
            let normal = Vec3A::from(pair.normal);
            let slope = |i: usize| {
                let a = posed.posed_from_rest[pair.corners[i] as usize].matrix3;
                a.transpose() * normal * pair.weights[i]
            };
            let row =
                Row { corners: pair.corners, slopes: [slope(0), slope(1), slope(2)], weight: pair.weight * per_pair };
            let wanted = pair.normal.dot(pair.point - pair.interpolate(&undisplaced)) * row.weight;
            (0..3).for_each(|i| right[row.corners[i] as usize] += row.slopes[i] * wanted);
            rows.push(row);
        }
        let system = System { registrar: self, inverse_blocks: self.inverse_blocks(&rows, count), rows };
        system.solve(&right, start)
    }

    /// Adds `smoothing L field`, `L` the graph Laplacian.
    fn add_edges(&self, field: &[Vec3], out: &mut [Vec3A]) {
        let smoothing = self.config.smoothing;
        for (v, sum) in out.iter_mut().enumerate() {
            let near = self.adjacency.neighbours(v);
            let others: Vec3A = near.iter().map(|n| Vec3A::from(field[*n as usize])).sum();
            *sum += (Vec3A::from(field[v]) * near.len() as f32 - others) * smoothing;
        }
    }

    fn inverse_blocks(&self, rows: &[Row], count: usize) -> Vec<Mat3A> {
        let own = |v: usize| self.coupling[v] + self.config.smoothing * self.adjacency.neighbours(v).len() as f32;
        let mut blocks: Vec<Mat3A> = (0..count).map(|v| Mat3A::from_diagonal(Vec3::splat(own(v)))).collect();
        for row in rows {
            for (corner, slope) in row.corners.iter().zip(row.slopes) {
                let scaled = slope * row.weight;
                blocks[*corner as usize] += Mat3A::from_cols(scaled * slope.x, scaled * slope.y, scaled * slope.z);
            }
        }
        blocks.into_iter().map(|b| b.inverse()).collect()
    }
}

impl System<'_> {
    fn apply(&self, x: &[Vec3]) -> Vec<Vec3A> {
        let mut out: Vec<Vec3A> = x.iter().zip(&self.registrar.coupling).map(|(x, c)| Vec3A::from(*x) * *c).collect();
        self.registrar.add_edges(x, &mut out);
        for row in &self.rows {
            let moved: f32 = (0..3).map(|i| row.slopes[i].dot(x[row.corners[i] as usize].into())).sum();
            let force = moved * row.weight;
            (0..3).for_each(|i| out[row.corners[i] as usize] += row.slopes[i] * force);
        }
        out
    }

    fn solve(&self, right: &[Vec3A], start: &[Vec3]) -> Vec<Vec3> {
        let dot = |a: &[Vec3A], b: &[Vec3A]| a.iter().zip(b).map(|(a, b)| f64::from(a.dot(*b))).sum::<f64>();
        let precondition =
            |r: &[Vec3A]| -> Vec<Vec3A> { r.iter().zip(&self.inverse_blocks).map(|(r, m)| *m * *r).collect() };
        let mut x = start.to_vec();
        let mut residual: Vec<Vec3A> = right.iter().zip(self.apply(&x)).map(|(b, a)| *b - a).collect();
        let mut z = precondition(&residual);
        let mut direction: Vec<Vec3> = z.iter().map(|z| Vec3::from(*z)).collect();
        let mut energy = dot(&residual, &z);
        let enough = energy * f64::from(ENOUGH * ENOUGH);
        for _ in 0..STEPS {
            if energy <= enough {
                break;
            }
            let applied = self.apply(&direction);
            let curvature: f64 = direction.iter().zip(&applied).map(|(d, a)| f64::from(Vec3A::from(*d).dot(*a))).sum();
            if curvature <= 0.0 {
                break;
            }
            let length = (energy / curvature) as f32;
            x.iter_mut().zip(&direction).for_each(|(x, d)| *x += *d * length);
            residual.iter_mut().zip(&applied).for_each(|(r, a)| *r -= *a * length);
            z = precondition(&residual);
            let next = dot(&residual, &z);
            let share = (next / energy) as f32;
            direction.iter_mut().zip(&z).for_each(|(d, z)| *d = Vec3::from(*z) + *d * share);
            energy = next;
        }
        x
    }
}
