//! From sums over bones to normal equations in joint angles, translation and shape.

use crate::accumulate::{Sums, pair};
use crate::cross::Cross;
use crate::pose_state::Kinematics;
use glam::{Mat3A, Vec3A};

/// Value, half gradient and Gauss-Newton matrix. Parameters: `3 J` turns of joints about world axes, 3 of the
/// translation, `S` of the shape.
pub(crate) struct Normal {
    pub value: f64,
    pub gradient: Vec<f64>,
    /// `[n, n]`, symmetric.
    pub hessian: Vec<f64>,
}

type Twist = [f64; 6];
type Block = [[f64; 6]; 6];
/// `[3][9]`: three world axes, nine features.
type Slope = [[f64; 9]; 3];

/// Change of every bone's translation by each shape coefficient at a pose, `[S][J]`.
pub(crate) type ShapeTranslations = Vec<Vec<Vec3A>>;

/// Joints `[S][J]` that each shape coefficient moves at rest, carried to the pose.
pub(crate) fn shape_translations(
    parents: &[Option<usize>],
    kinematics: &Kinematics,
    moved: &[Vec<Vec3A>],
) -> ShapeTranslations {
    let carry = |joints: &Vec<Vec3A>| {
        // A_j = A_p (R_j, J_j - R_j J_j), so dt_j = dt_p + (A_p - A_j) dJ_j with A the rotation parts
        let mut translations: Vec<Vec3A> = Vec::with_capacity(joints.len());
        for (j, joint) in joints.iter().enumerate() {
            let above = parents[j].map_or(Vec3A::ZERO, |p| translations[p]);
            translations.push(above + (kinematics.parent_rotations[j] - kinematics.transforms[j].matrix3) * *joint);
        }
        translations
    };
    moved.iter().map(carry).collect()
}

/// The parts of the Gauss-Newton matrix that come from pose correctives.
#[derive(Clone, Copy)]
pub(crate) struct Correctives<'a> {
    /// `Dt W D` of the pose blendshapes, `[P, P]`: exact for the unposed objective; for the posed one it takes blended
    /// matrices for rotations.
    pub gram: &'a [f64],
    /// Between bones and pose blendshapes.
    pub cross: &'a Cross,
    /// `Dt W B` of pose and shape blendshapes, `[S][P]`.
    pub with_shape: &'a [Vec<f32>],
}

/// Applies the kinematic chain to the sums.
pub(crate) fn reduce(
    parents: &[Option<usize>],
    kinematics: &Kinematics,
    sums: &Sums,
    correctives: Correctives,
    shape_translations: &ShapeTranslations,
) -> Normal {
    let joints = parents.len();
    let shapes = shape_translations.len();
    let n = 3 * joints + 3 + shapes;
    let mut normal = Normal { value: sums.value, gradient: vec![0.0; n], hessian: vec![0.0; n * n] };
    let bones = full_blocks(joints, sums);
    let mut chained = bones.clone();
    chain_rows(parents, &mut chained);
    chain_columns(parents, &mut chained);
    let mut forces = sums.bones.clone();
    for k in (1..joints).rev() {
        if let Some(p) = parents[k] {
            let below = forces[k];
            add(&mut forces[p], &below);
        }
    }
    let twists: Vec<[Twist; 3]> = kinematics.centres.iter().map(|c| turn_twists(*c)).collect();
    let translation: [Twist; 3] = std::array::from_fn(|a| std::array::from_fn(|i| f64::from(u8::from(i == 3 + a))));
    let axis = |parameter: usize| {
        let joint = parameter / 3;
        if joint < joints { (joint, twists[joint][parameter % 3]) } else { (0, translation[parameter % 3]) }
    };
    for a in 0..3 * joints + 3 {
        let (j, x) = axis(a);
        normal.gradient[a] = dot(&forces[j], &x);
        for b in 0..=a {
            let (i, y) = axis(b);
            normal.hessian[a * n + b] = dot(&apply(&chained[i * joints + j], &x), &y);
        }
    }
    let slopes = feature_slopes(kinematics);
    add_correctives(sums, correctives.gram, &slopes, n, &mut normal);
    let mut crossed = correctives.cross.world(kinematics);
    add_shape_correctives(&crossed, correctives.with_shape, shape_translations, &slopes, joints, &mut normal);
    chain_crossed(parents, &mut crossed);
    add_cross(&crossed, &slopes, joints, n, &axis, &mut normal);
    add_shape(parents, sums, &bones, shape_translations, &axis, &mut normal);
    for a in 0..n {
        for b in 0..a {
            normal.hessian[b * n + a] = normal.hessian[a * n + b];
        }
    }
    normal
}

/// The twists, about the origin, of unit turns about world axes through a centre: `(e, centre x e)`.
fn turn_twists(centre: Vec3A) -> [Twist; 3] {
    [Vec3A::X, Vec3A::Y, Vec3A::Z].map(|e| {
        let v = centre.cross(e);
        [e.x, e.y, e.z, v.x, v.y, v.z].map(f64::from)
    })
}

/// `[J, J]` blocks from the pairs `k <= l`.
fn full_blocks(joints: usize, sums: &Sums) -> Vec<Block> {
    let mut blocks = vec![[[0.0; 6]; 6]; joints * joints];
    for k in 0..joints {
        for l in k..joints {
            let block = &sums.pairs[pair(joints, k, l)];
            for i in 0..6 {
                for j in 0..6 {
                    let x = f64::from(block[i][j]);
                    blocks[k * joints + l][i][j] = x;
                    blocks[l * joints + k][j][i] = x;
                }
            }
        }
    }
    blocks
}

/// Adds every bone's row to its parent's, leaves first.
fn chain_rows(parents: &[Option<usize>], blocks: &mut [Block]) {
    let joints = parents.len();
    for k in (1..joints).rev() {
        let Some(p) = parents[k] else { continue };
        for l in 0..joints {
            let below = blocks[k * joints + l];
            add_block(&mut blocks[p * joints + l], &below);
        }
    }
}

/// Adds every bone's column to its parent's, leaves first.
fn chain_columns(parents: &[Option<usize>], blocks: &mut [Block]) {
    let joints = parents.len();
    for k in (1..joints).rev() {
        let Some(p) = parents[k] else { continue };
        for l in 0..joints {
            let below = blocks[l * joints + k];
            add_block(&mut blocks[l * joints + p], &below);
        }
    }
}

/// Derivative of the nine features of joints 1..J by a turn about each world axis.
fn feature_slopes(kinematics: &Kinematics) -> Vec<Slope> {
    let slope = |j: usize| {
        let local_axes = kinematics.parent_rotations[j].transpose();
        std::array::from_fn(|a| {
            let turned = cross_matrix(local_axes.col(a)) * kinematics.locals[j];
            turned.transpose().to_cols_array().map(f64::from)
        })
    };
    (1..kinematics.locals.len()).map(slope).collect()
}

/// Gradient through the pose features, and the Gauss-Newton part of the correctives alone.
fn add_correctives(sums: &Sums, gram: &[f64], slopes: &[Slope], n: usize, normal: &mut Normal) {
    let p = sums.features.len();
    for (j, slope) in slopes.iter().enumerate() {
        for a in 0..3 {
            let features = &sums.features[9 * j..9 * j + 9];
            normal.gradient[3 * (j + 1) + a] +=
                slope[a].iter().zip(features).map(|(s, f)| s * f64::from(*f)).sum::<f64>();
        }
        for (i, other) in slopes.iter().enumerate().take(j + 1) {
            let mut half = [[0.0; 9]; 3];
            for a in 0..3 {
                for (entry, s) in slope[a].iter().enumerate() {
                    let row = &gram[(9 * j + entry) * p + 9 * i..(9 * j + entry) * p + 9 * i + 9];
                    for (x, g) in half[a].iter_mut().zip(row) {
                        *x += s * g;
                    }
                }
            }
            for a in 0..3 {
                for b in 0..3 {
                    let x: f64 = half[a].iter().zip(&other[b]).map(|(x, y)| x * y).sum();
                    normal.hessian[(3 * (j + 1) + a) * n + 3 * (i + 1) + b] += x;
                }
            }
        }
    }
}

/// Adds every bone's row to its parent's, leaves first.
fn chain_crossed(parents: &[Option<usize>], crossed: &mut [[Vec3A; 2]]) {
    let joints = parents.len();
    let p = crossed.len() / joints;
    for k in (1..joints).rev() {
        let Some(parent) = parents[k] else { continue };
        let (above, below) = crossed.split_at_mut(k * p);
        for (x, y) in above[parent * p..(parent + 1) * p].iter_mut().zip(&below[..p]) {
            x[0] += y[0];
            x[1] += y[1];
        }
    }
}

/// The part between bones and correctives, `crossed` chained; both orders of the product, as the matrix is symmetric.
fn add_cross(
    crossed: &[[Vec3A; 2]],
    slopes: &[Slope],
    joints: usize,
    n: usize,
    axis: &impl Fn(usize) -> (usize, Twist),
    normal: &mut Normal,
) {
    let p = 9 * slopes.len();
    let mut answers = vec![[0.0; 6]; joints * 3 * slopes.len()];
    for j in 0..joints {
        for (i, slope) in slopes.iter().enumerate() {
            for (b, entries) in slope.iter().enumerate() {
                let answer = &mut answers[(j * slopes.len() + i) * 3 + b];
                for (entry, x) in entries.iter().enumerate() {
                    let [turn, push] = crossed[j * p + 9 * i + entry];
                    for c in 0..3 {
                        answer[c] += x * f64::from(turn[c]);
                        answer[3 + c] += x * f64::from(push[c]);
                    }
                }
            }
        }
    }
    for a in 0..3 * joints + 3 {
        let (j, x) = axis(a);
        for b in 0..3 * slopes.len() {
            let value = dot(&answers[j * slopes.len() * 3 + b], &x);
            let (low, high) = (a.min(b + 3), a.max(b + 3));
            normal.hessian[high * n + low] += if low == high { 2.0 * value } else { value };
        }
    }
}

/// The part between shape and correctives, `crossed` bone by bone.
fn add_shape_correctives(
    crossed: &[[Vec3A; 2]],
    with_shape: &[Vec<f32>],
    translations: &ShapeTranslations,
    slopes: &[Slope],
    joints: usize,
    normal: &mut Normal,
) {
    let n = normal.gradient.len();
    let p = 9 * slopes.len();
    for (s, (own, translations)) in with_shape.iter().zip(translations).enumerate() {
        let mut features: Vec<f64> = own.iter().map(|x| f64::from(*x)).collect();
        for (row, t) in crossed.chunks_exact(p).zip(translations) {
            for (x, [_, push]) in features.iter_mut().zip(row) {
                *x += f64::from(push.dot(*t));
            }
        }
        for (j, slope) in slopes.iter().enumerate() {
            for a in 0..3 {
                let x: f64 = slope[a].iter().zip(&features[9 * j..]).map(|(x, y)| x * y).sum();
                normal.hessian[(3 * joints + 3 + s) * n + 3 * (j + 1) + a] += x;
            }
        }
    }
}

/// Rows of the shape coefficients.
fn add_shape(
    parents: &[Option<usize>],
    sums: &Sums,
    bones: &[Block],
    translations: &ShapeTranslations,
    axis: &impl Fn(usize) -> (usize, Twist),
    normal: &mut Normal,
) {
    let joints = parents.len();
    let shapes = translations.len();
    let first = 3 * joints + 3;
    let n = first + shapes;
    let linear = |t: Vec3A| -> Twist { [0.0, 0.0, 0.0, f64::from(t.x), f64::from(t.y), f64::from(t.z)] };
    for s in 0..shapes {
        let own: Vec<Twist> = translations[s].iter().map(|t| linear(*t)).collect();
        let bone_gradient: f64 = own.iter().zip(&sums.bones).map(|(x, g)| dot(x, g)).sum();
        normal.gradient[first + s] = sums.shape[s] + bone_gradient;
        // what the matrix answers to this coefficient, bone by bone, then down the chain
        let mut answer: Vec<Twist> = (0..joints).map(|k| sums.bone_shape[k * shapes + s]).collect();
        for k in 0..joints {
            for (l, x) in own.iter().enumerate() {
                let part = apply(&bones[k * joints + l], x);
                add(&mut answer[k], &part);
            }
        }
        for t in 0..=s {
            let through_bones: f64 = (0..joints).map(|k| dot(&answer[k], &linear(translations[t][k]))).sum();
            let crossed: f64 = (0..joints).map(|k| dot(&sums.bone_shape[k * shapes + t], &own[k])).sum();
            normal.hessian[(first + s) * n + first + t] = sums.shape_shape[s * shapes + t] + through_bones + crossed;
        }
        for k in (1..joints).rev() {
            if let Some(p) = parents[k] {
                let below = answer[k];
                add(&mut answer[p], &below);
            }
        }
        for a in 0..first {
            let (j, x) = axis(a);
            normal.hessian[(first + s) * n + a] += dot(&answer[j], &x);
        }
    }
}

fn cross_matrix(w: Vec3A) -> Mat3A {
    Mat3A::from_cols(Vec3A::new(0.0, w.z, -w.y), Vec3A::new(-w.z, 0.0, w.x), Vec3A::new(w.y, -w.x, 0.0))
}

fn dot(a: &Twist, b: &Twist) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

fn add(a: &mut Twist, b: &Twist) {
    a.iter_mut().zip(b).for_each(|(x, y)| *x += y);
}

fn add_block(a: &mut Block, b: &Block) {
    a.iter_mut().zip(b).for_each(|(x, y)| add(x, y));
}

fn apply(m: &Block, x: &Twist) -> Twist {
    std::array::from_fn(|i| dot(&m[i], x))
}
