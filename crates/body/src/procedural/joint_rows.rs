//! The joint regressor: sparse affine combinations of rest vertices fitted over the sampled people.

use super::relax::Net;
use super::skeleton::JOINTS;
use super::weights::mirrored_joint;
use crate::JointRegressor;
use glam::Vec3;

/// Vertices a joint looks at in each octant round it, so that what thickness does on one side the other cancels.
const SUPPORT: usize = 5;
/// Vertices farther than this are not looked at, metres.
const REACH: f32 = 0.25;
/// Pull of each weight towards the even share, square metres.
const PULL: f64 = 2e-5;

/// Fits every joint of sampled people (`[N]` of 24) to the vertices of `samples` (same order). Rows sum to one.
pub fn joint_rows(net: &Net, template: &[Vec3], samples: &[Vec<Vec3>], people: &[[Vec3; JOINTS]]) -> JointRegressor {
    let mut rows: Vec<Vec<(u32, f32)>> = vec![Vec::new(); JOINTS];
    for j in 0..JOINTS {
        let other = mirrored_joint(j);
        if other < j {
            rows[j] = rows[other].iter().map(|(v, w)| (net.mirror[*v as usize], *w)).collect();
            rows[j].sort_unstable_by_key(|(v, _)| *v);
            continue;
        }
        let support = support(net, template, people, j, other == j);
        let mut w = solve_row(&support, samples, people, j);
        if other == j {
            let of = |v: u32| support.iter().position(|s| *s == v).expect("the support is symmetric");
            w = support.iter().map(|v| 0.5 * (w[of(*v)] + w[of(net.mirror[*v as usize])])).collect();
        }
        let sum: f64 = w.iter().sum();
        rows[j] = support.iter().zip(w).map(|(v, w)| (*v, (w / sum) as f32)).collect();
    }
    JointRegressor { rows }
}

/// The vertices nearest to the mean joint in each octant, closed under mirroring for a middle joint; ascending.
fn support(net: &Net, template: &[Vec3], people: &[[Vec3; JOINTS]], joint: usize, middle: bool) -> Vec<u32> {
    let at = people.iter().map(|joints| joints[joint]).sum::<Vec3>() / people.len() as f32;
    let distance = |v: &u32| template[*v as usize].distance_squared(at);
    let mut octants = vec![Vec::new(); 8];
    for (v, p) in template.iter().enumerate() {
        let d = *p - at;
        let octant = usize::from(d.x > 0.0) + 2 * usize::from(d.y > 0.0) + 4 * usize::from(d.z > 0.0);
        if d.length() < REACH {
            octants[octant].push(v as u32);
        }
    }
    let mut chosen = Vec::new();
    for octant in &mut octants {
        octant.sort_by(|a, b| distance(a).total_cmp(&distance(b)).then(a.cmp(b)));
        chosen.extend(octant.iter().take(SUPPORT));
    }
    if middle {
        let mirrored: Vec<u32> = chosen.iter().map(|v| net.mirror[*v as usize]).collect();
        chosen.extend(mirrored);
    }
    chosen.sort_unstable();
    chosen.dedup();
    chosen
}

fn solve_row(support: &[u32], samples: &[Vec<Vec3>], people: &[[Vec3; JOINTS]], joint: usize) -> Vec<f64> {
    let n = support.len();
    let even = 1.0 / n as f64;
    let mut a = vec![vec![0.0; n]; n];
    let mut b = vec![0.0; n];
    // the unknown is the departure from even shares; its sum is held near zero
    for i in 0..n {
        for k in 0..n {
            a[i][k] = 10.0;
        }
        a[i][i] += PULL;
    }
    for (sample, joints) in samples.iter().zip(people) {
        let target = joints[joint].as_dvec3();
        let local: Vec<_> = support.iter().map(|v| sample[*v as usize].as_dvec3() - target).collect();
        let residual = -local.iter().copied().sum::<glam::DVec3>() * even;
        for i in 0..n {
            b[i] += local[i].dot(residual);
            for k in 0..n {
                a[i][k] += local[i].dot(local[k]);
            }
        }
    }
    solve_symmetric(a, b).iter().map(|x| x + even).collect()
}

/// Solves `A x = b` for a positive definite `A` (Cholesky).
pub fn solve_symmetric(mut a: Vec<Vec<f64>>, mut b: Vec<f64>) -> Vec<f64> {
    let n = b.len();
    for i in 0..n {
        for j in 0..=i {
            let dot: f64 = (0..j).map(|k| a[i][k] * a[j][k]).sum();
            a[i][j] = if i == j { (a[i][i] - dot).max(1e-18).sqrt() } else { (a[i][j] - dot) / a[j][j] };
        }
    }
    for i in 0..n {
        let dot: f64 = (0..i).map(|k| a[i][k] * b[k]).sum();
        b[i] = (b[i] - dot) / a[i][i];
    }
    for i in (0..n).rev() {
        let dot: f64 = (i + 1..n).map(|k| a[k][i] * b[k]).sum();
        b[i] = (b[i] - dot) / a[i][i];
    }
    b
}
