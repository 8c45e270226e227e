//! Skin weights by diffusion of hard labels over the mesh.

use super::figure::Figure;
use super::relax::{Net, bone_end};
use super::skeleton::JOINTS;
use crate::SkinWeights;
use glam::Vec3;

/// Spread of a label over the surface: two implicit steps of this diffusion time, square metres.
const SPREAD: f32 = 0.034 * 0.034;

/// Dense weights `[V]` of 24, mirrored exactly, rows sum to one.
pub fn dense_weights(figure: &Figure, net: &Net, positions: &[Vec3]) -> Vec<[f32; JOINTS]> {
    let labels: Vec<usize> = positions.iter().map(|p| nearest_bone(figure, *p)).collect();
    let mut weights = vec![[0.0f32; JOINTS]; positions.len()];
    for j in 0..JOINTS {
        let hard: Vec<f32> = labels.iter().map(|l| if *l == j { 1.0 } else { 0.0 }).collect();
        if hard.iter().all(|x| *x == 0.0) {
            continue;
        }
        let soft = diffuse(net, positions, &diffuse(net, positions, &hard, SPREAD), SPREAD);
        for (row, x) in weights.iter_mut().zip(soft) {
            row[j] = x.max(0.0);
        }
    }
    symmetrise(net, &mut weights);
    weights
}

/// `(M + t L) x = M b` with inverse-length edge weights and lumped masses, by conjugate gradients.
pub fn diffuse(net: &Net, positions: &[Vec3], b: &[f32], time: f32) -> Vec<f32> {
    let n = positions.len();
    let mass: Vec<f32> = (0..n)
        .map(|v| {
            let near = net.neighbours(v);
            let mean = near.iter().map(|i| positions[*i as usize].distance_squared(positions[v])).sum::<f32>();
            mean / near.len() as f32
        })
        .collect();
    let mean_squared = |v: usize, i: usize| 0.5 * (mass[v] + mass[i]);
    let edge = |v: usize, i: usize| mean_squared(v, i) / positions[v].distance_squared(positions[i]).max(1e-8);
    let apply = |x: &[f32]| -> Vec<f32> {
        (0..n)
            .map(|v| {
                let flow: f32 = net.neighbours(v).iter().map(|i| edge(v, *i as usize) * (x[v] - x[*i as usize])).sum();
                mass[v] * x[v] + time * flow
            })
            .collect()
    };
    let dot = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(x, y)| f64::from(*x) * f64::from(*y)).sum::<f64>();
    let mut x = b.to_vec();
    let mut r: Vec<f32> = b.iter().zip(&mass).zip(apply(&x)).map(|((b, m), ax)| b * m - ax).collect();
    let mut p = r.clone();
    let mut rr = dot(&r, &r);
    let stop = rr * 1e-10;
    for _ in 0..200 {
        if rr <= stop || rr == 0.0 {
            break;
        }
        let ap = apply(&p);
        let a = (rr / dot(&p, &ap)) as f32;
        for v in 0..n {
            x[v] += a * p[v];
            r[v] -= a * ap[v];
        }
        let next = dot(&r, &r);
        let beta = (next / rr) as f32;
        rr = next;
        for v in 0..n {
            p[v] = r[v] + beta * p[v];
        }
    }
    x
}

/// The bone that a rest vertex belongs to: least distance to a segment beyond that bone's own reach.
fn nearest_bone(figure: &Figure, p: Vec3) -> usize {
    let j = &figure.joints;
    let s = figure.scale;
    let left = p.x >= 0.0;
    let mut best = (f32::INFINITY, 0);
    for joint in 0..JOINTS {
        let side = NEUTRAL_SIDE[joint];
        if (side > 0 && !left) || (side < 0 && left) {
            continue;
        }
        // the head's own bone starts above the joint, or it would take the neck
        let a = if joint == 15 { j[15] + Vec3::Y * 0.035 * s } else { j[joint] };
        let (b, reach) = match joint {
            0 => (Vec3::new(if left { 0.06 } else { -0.06 } * s, a.y - 0.02 * s, a.z), 0.105),
            3 | 6 => (j[bone_end(joint).expect("spine")], 0.10),
            9 => (j[12] - Vec3::Y * 0.085 * s, 0.11),
            12 => (j[15], 0.062),
            13 | 14 => (j[bone_end(joint).expect("collar")], 0.045),
            15 => (a + Vec3::Y * 0.16 * s, 0.072),
            1 | 2 => (j[joint + 3], 0.075),
            10 | 11 => (a + Vec3::new(0.0, -0.005, 0.07) * s, 0.03),
            22 | 23 => (a + (a - j[joint - 2]).normalize() * 0.09 * s, 0.03),
            _ => (j[bone_end(joint).expect("limb")], 0.04),
        };
        let ab = b - a;
        let t = ((p - a).dot(ab) / ab.length_squared()).clamp(0.0, 1.0);
        let d = p.distance(a + ab * t) - reach * s;
        if d < best.0 {
            best = (d, joint);
        }
    }
    best.1
}

/// 1 left, -1 right, 0 middle.
const NEUTRAL_SIDE: [i8; JOINTS] = [0, 1, -1, 0, 1, -1, 0, 1, -1, 0, 1, -1, 0, 1, -1, 0, 1, -1, 1, -1, 1, -1, 1, -1];

/// The joint on the other side.
pub fn mirrored_joint(joint: usize) -> usize {
    match NEUTRAL_SIDE[joint] {
        1 => joint + 1,
        -1 => joint - 1,
        _ => joint,
    }
}

/// Makes the right half the exact mirror image of the left, rows summing to one.
fn symmetrise(net: &Net, weights: &mut [[f32; JOINTS]]) {
    for &v in net.left() {
        let (v, m) = (v as usize, net.mirror[v as usize] as usize);
        let mut row = weights[v];
        if v == m {
            for j in 0..JOINTS {
                row[j] = 0.5 * (weights[v][j] + weights[v][mirrored_joint(j)]);
            }
        }
        let sum: f32 = row.iter().sum();
        row.iter_mut().for_each(|x| *x /= sum);
        weights[v] = row;
        weights[m] = std::array::from_fn(|j| row[mirrored_joint(j)]);
    }
}

/// The four largest weights of each row, exactly mirrored.
pub fn skin_weights(net: &Net, dense: &[[f32; JOINTS]]) -> Vec<SkinWeights> {
    let empty = SkinWeights { joints: [0; 4], weights: [0.0; 4] };
    let mut skin = vec![empty; dense.len()];
    for &v in net.left() {
        let (v, m) = (v as usize, net.mirror[v as usize] as usize);
        let own = top_four(&dense[v], v == m);
        skin[v] = own;
        if v != m {
            let mut other = own;
            for (j, w) in other.joints.iter_mut().zip(own.weights) {
                if w > 0.0 {
                    *j = mirrored_joint(*j as usize) as u8;
                }
            }
            skin[m] = other;
        }
    }
    skin
}

/// Weights under this share are dropped.
const LEAST: f32 = 0.01;

fn top_four(row: &[f32; JOINTS], middle: bool) -> SkinWeights {
    let mut order: Vec<usize> = (0..JOINTS).filter(|j| row[*j] > LEAST).collect();
    order.sort_by(|a, b| row[*b].total_cmp(&row[*a]).then(a.cmp(b)));
    let mut count = order.len().min(4);
    // a middle vertex keeps both joints of a pair or none
    while middle && count > 0 && order[..count].iter().any(|j| !order[..count].contains(&mirrored_joint(*j))) {
        count -= 1;
    }
    order.truncate(count);
    let sum: f32 = order.iter().map(|j| row[*j]).sum();
    let mut skin = SkinWeights { joints: [0; 4], weights: [0.0; 4] };
    for (slot, j) in order.iter().enumerate() {
        skin.joints[slot] = *j as u8;
        skin.weights[slot] = row[*j] / sum;
    }
    skin
}
