//! A start from nothing: each bone's vertices, held rigid, are laid onto the scan.

use crate::objective::Objective;
use crate::pose_state::PoseState;
use glam::{DMat3, DQuat, DVec3, Quat, Vec3};

/// Weighted sums of two sets of points that belong together.
#[derive(Clone, Copy)]
struct Cluster {
    weight: f64,
    rest: DVec3,
    scan: DVec3,
    cross: DMat3,
    rest_spread: DMat3,
}

impl Cluster {
    const EMPTY: Self =
        Self { weight: 0.0, rest: DVec3::ZERO, scan: DVec3::ZERO, cross: DMat3::ZERO, rest_spread: DMat3::ZERO };

    fn add(&mut self, w: f64, rest: DVec3, scan: DVec3) {
        self.weight += w;
        self.rest += w * rest;
        self.scan += w * scan;
        self.cross += outer(w * scan, rest);
        self.rest_spread += outer(w * rest, rest);
    }

    /// Second moments about the means: scan x rest, rest x rest.
    fn centred(&self) -> (DMat3, DMat3) {
        let w = self.weight.max(f64::MIN_POSITIVE);
        (
            self.cross - outer(self.scan, self.rest) * (1.0 / w),
            self.rest_spread - outer(self.rest, self.rest) * (1.0 / w),
        )
    }

    /// The rotation that best takes rest to scan (Horn 1987), if the points span a plane at least.
    fn rotation(&self) -> Option<DQuat> {
        let (cross, spread) = self.centred();
        // sum of the principal 2 x 2 minors: zero for points on a line
        let minors = spread.x_axis.x * spread.y_axis.y - spread.x_axis.y * spread.y_axis.x
            + spread.x_axis.x * spread.z_axis.z
            - spread.x_axis.z * spread.z_axis.x
            + spread.y_axis.y * spread.z_axis.z
            - spread.y_axis.z * spread.z_axis.y;
        let trace = spread.x_axis.x + spread.y_axis.y + spread.z_axis.z;
        let plane = minors > 1e-3 * trace * trace;
        (self.weight > 0.0 && plane && cross.is_finite()).then(|| horn(cross)).flatten()
    }
}

impl Objective {
    /// A pose from a single frame, whatever the motion: the rotation of each bone by Procrustes on the vertices that
    /// it moves most, the chain from the root down, a bone with too few vertices following its parent.
    /// `scan` sorted, `[V]`.
    pub(crate) fn start(&self, scan: &[Vec3]) -> PoseState {
        let packed = &self.body.packed;
        let mut clusters = vec![Cluster::EMPTY; packed.joint_count];
        for (v, bones) in packed.influences.iter().enumerate() {
            for (k, b) in bones.iter().filter(|(_, b)| *b > 0.3) {
                let w = f64::from(b * b * b * b) * f64::from(self.body.weights[v]);
                clusters[k].add(w, self.rest[v].as_dvec3(), scan[v].as_dvec3());
            }
        }
        let mut world: Vec<DQuat> = Vec::with_capacity(clusters.len());
        let mut rotations = Vec::with_capacity(clusters.len());
        for (j, cluster) in clusters.iter().enumerate() {
            let above = packed.parents[j].map_or(DQuat::IDENTITY, |p| world[p]);
            let own = cluster.rotation().unwrap_or(above);
            rotations.push((above.inverse() * own).normalize().as_quat());
            world.push(own);
        }
        let translation = self.root_translation(&clusters, world[0]);
        let finite = rotations.iter().all(|q: &Quat| q.is_finite()) && translation.is_finite();
        if finite { PoseState { rotations, translation } } else { self.at_rest() }
    }

    /// The translation that brings the root's vertices, or all if it has none, onto the scan.
    fn root_translation(&self, clusters: &[Cluster], root: DQuat) -> Vec3 {
        let joint = self.joints[0].as_dvec3();
        let mut all = Cluster::EMPTY;
        for c in clusters {
            all.weight += c.weight;
            all.rest += c.rest;
            all.scan += c.scan;
        }
        let used = if clusters[0].weight > 0.0 { &clusters[0] } else { &all };
        let (rest, scan) = (used.rest / used.weight, used.scan / used.weight);
        (scan - (root * (rest - joint) + joint)).as_vec3()
    }

    fn at_rest(&self) -> PoseState {
        PoseState { rotations: vec![Quat::IDENTITY; self.joints.len()], translation: Vec3::ZERO }
    }
}

fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

/// The unit quaternion of the rotation `R` with the largest trace of `R^T cross`, `cross = sum scan rest^T`: the
/// eigenvector of Horn's symmetric 4 x 4 matrix with the largest eigenvalue.
fn horn(cross: DMat3) -> Option<DQuat> {
    // s(a, b): rest component a, scan component b
    let s = |a: usize, b: usize| cross.col(a)[b];
    let mut m = [
        [s(0, 0) + s(1, 1) + s(2, 2), s(1, 2) - s(2, 1), s(2, 0) - s(0, 2), s(0, 1) - s(1, 0)],
        [0.0, s(0, 0) - s(1, 1) - s(2, 2), s(0, 1) + s(1, 0), s(2, 0) + s(0, 2)],
        [0.0, 0.0, -s(0, 0) + s(1, 1) - s(2, 2), s(1, 2) + s(2, 1)],
        [0.0, 0.0, 0.0, -s(0, 0) - s(1, 1) + s(2, 2)],
    ];
    for i in 0..4 {
        for j in 0..i {
            m[i][j] = m[j][i];
        }
    }
    let vectors = jacobi(&mut m);
    let best = (0..4).max_by(|&a, &b| m[a][a].total_cmp(&m[b][b]))?;
    let q = DQuat::from_xyzw(vectors[1][best], vectors[2][best], vectors[3][best], vectors[0][best]);
    (q.is_finite() && q.length_squared() > 0.5).then(|| q.normalize())
}

/// Cyclic Jacobi: makes a symmetric matrix diagonal and returns its eigenvectors as columns.
fn jacobi(m: &mut [[f64; 4]; 4]) -> [[f64; 4]; 4] {
    let mut vectors: [[f64; 4]; 4] = std::array::from_fn(|i| std::array::from_fn(|j| if i == j { 1.0 } else { 0.0 }));
    for _ in 0..16 {
        for p in 0..3 {
            for q in p + 1..4 {
                if m[p][q].abs() <= 1e-300 {
                    continue;
                }
                let theta = (m[q][q] - m[p][p]) / (2.0 * m[p][q]);
                let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
                let c = 1.0 / (t * t + 1.0).sqrt();
                let s = t * c;
                for k in 0..4 {
                    (m[k][p], m[k][q]) = (c * m[k][p] - s * m[k][q], s * m[k][p] + c * m[k][q]);
                }
                for k in 0..4 {
                    (m[p][k], m[q][k]) = (c * m[p][k] - s * m[q][k], s * m[p][k] + c * m[q][k]);
                    (vectors[k][p], vectors[k][q]) =
                        (c * vectors[k][p] - s * vectors[k][q], s * vectors[k][p] + c * vectors[k][q]);
                }
            }
        }
    }
    vectors
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn procrustes_finds_the_rotation_of_a_few_points() {
        let rest = [
            DVec3::new(0.1, 0.0, 0.3),
            DVec3::new(-0.4, 0.2, 0.0),
            DVec3::new(0.0, 0.5, 0.1),
            DVec3::new(0.3, 0.3, -0.2),
        ];
        for w in [DVec3::new(0.3, -2.0, 1.0), DVec3::new(3.1, 0.0, 0.0), DVec3::ZERO, DVec3::new(0.0, 0.0, -1.5)] {
            let truth = DQuat::from_scaled_axis(w);
            let mut cluster = Cluster::EMPTY;
            for (i, p) in rest.iter().enumerate() {
                cluster.add(1.0 + i as f64, *p, truth * *p + DVec3::new(2.0, -1.0, 0.5));
            }
            let found = cluster.rotation().unwrap();
            assert!(found.dot(truth).abs() > 1.0 - 1e-10, "{found} for {truth}");
        }
    }

    #[test]
    fn points_on_a_line_give_no_rotation() {
        let mut cluster = Cluster::EMPTY;
        for i in 0..5 {
            cluster.add(1.0, DVec3::X * f64::from(i), DVec3::Y * f64::from(i));
        }
        assert!(cluster.rotation().is_none());
        assert!(Cluster::EMPTY.rotation().is_none());
    }
}
