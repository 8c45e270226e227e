//! Pose correctives: what linear blending loses against dual quaternions (Kavan et al. 2007), as a linear function
//! of the 207 pose features (Loper et al. 2015). A joint's nine features are fitted alone, so that a corrective
//! stays near its joint.

use super::joint_rows::solve_symmetric;
use super::relax::Net;
use super::skeleton::JOINTS;
use super::weights::mirrored_joint;
use crate::{Pose, ShapedBody, SkinWeights};
use glam::{Affine3A, Mat3, Quat, Vec3};
use rayon::prelude::*;
use softtissue_random::Draws;

/// Sampled rotations a joint.
const ROTATIONS: usize = 48;
/// Largest sampled angle, radians.
const LARGEST_ANGLE: f64 = 1.7;
/// Ridge on the nine weights, against feature variances of order one.
const RIDGE: f64 = 0.3;
/// No corrective of a sampled pose is larger, metres.
const LARGEST_OFFSET: f32 = 0.03;
/// Shorter ones are the rounding of coordinates, metres: the joint moves the whole vertex or nothing of it. As zeros they
/// let the pose fit leave a joint out where it has no correctives.
const ROUNDING: f32 = 2e-6;
/// Blended matrices nearer to singular are left out, as unposing them is meaningless.
const LEAST_DETERMINANT: f32 = 0.25;

/// What the fit reads of a model whose correctives are still zero.
pub struct PoseFit<'a> {
    /// Neutral rest mesh and joints.
    pub shaped: &'a ShapedBody,
    /// `[V]`.
    pub skin: &'a [SkinWeights],
    /// `[J]`.
    pub parents: &'a [Option<u8>],
    /// Symmetry.
    pub net: &'a Net,
    /// Seed of the sampled rotations.
    pub seed: u64,
}

impl PoseFit<'_> {
    /// `[9 (J - 1), V]`.
    pub fn directions(&self) -> Vec<Vec3> {
        let v = self.skin.len();
        let mut joints: Vec<Vec<Vec3>> = (1..JOINTS)
            .into_par_iter()
            .map(|j| if mirrored_joint(j) < j { vec![] } else { self.joint_directions(j) })
            .collect();
        for j in 1..JOINTS {
            let other = mirrored_joint(j);
            if other <= j {
                let source = joints[other - 1].clone();
                joints[j - 1] = if other == j { self.symmetric(&source) } else { self.mirrored(&source) };
            }
        }
        let all = joints.concat();
        assert_eq!(all.len(), 9 * (JOINTS - 1) * v, "directions of every feature");
        all
    }

    /// The nine directions `[9, V]` of one joint by ridge regression over rotations of it alone.
    fn joint_directions(&self, joint: usize) -> Vec<Vec3> {
        let v = self.skin.len();
        let mut draws = Draws::new(self.seed, "body/correctives", joint as u64, 0);
        let mut features = Vec::with_capacity(ROTATIONS);
        let mut offsets = Vec::with_capacity(ROTATIONS);
        for _ in 0..ROTATIONS {
            let axis = Vec3::new(draws.normal() as f32, draws.normal() as f32, draws.normal() as f32);
            let w = axis.normalize_or(Vec3::X) * draws.range(0.2, LARGEST_ANGLE) as f32;
            let mut rotations = vec![Vec3::ZERO; JOINTS];
            rotations[joint] = w;
            features.push((Mat3::from_quat(Quat::from_scaled_axis(w)) - Mat3::IDENTITY).transpose().to_cols_array());
            offsets.push(self.lost_by_blending(&rotations));
        }
        let mut a = vec![vec![0.0; 9]; 9];
        for f in &features {
            for i in 0..9 {
                for k in 0..9 {
                    a[i][k] += f64::from(f[i] * f[k]);
                }
            }
        }
        (0..9).for_each(|i| a[i][i] += RIDGE);
        // rows of (A^-1 F^T): how each sampled pose enters each weight
        let inverse: Vec<Vec<f64>> =
            features.iter().map(|f| solve_symmetric(a.clone(), f.iter().map(|x| f64::from(*x)).collect())).collect();
        let mut out = vec![Vec3::ZERO; 9 * v];
        for (row, offset) in inverse.iter().zip(&offsets) {
            for i in 0..9 {
                let w = row[i] as f32;
                for (o, d) in out[i * v..(i + 1) * v].iter_mut().zip(offset) {
                    *o += *d * w;
                }
            }
        }
        out
    }

    /// `unpose(dual quaternion skinning) - T`, clamped, `[V]`.
    fn lost_by_blending(&self, rotations: &[Vec3]) -> Vec<Vec3> {
        let transforms = self.joint_transforms(Pose { rotations, translation: Vec3::ZERO });
        self.skin
            .iter()
            .zip(&self.shaped.vertices)
            .map(|(skin, rest)| {
                let linear = skin.blend(&transforms);
                if skin.weights[1] == 0.0 || linear.matrix3.determinant() < LEAST_DETERMINANT {
                    return Vec3::ZERO;
                }
                let target = blend_dual_quaternions(skin, &transforms).transform_point3(*rest);
                let offset = linear.inverse().transform_point3(target) - *rest;
                if offset.length() < ROUNDING { Vec3::ZERO } else { offset.clamp_length_max(LARGEST_OFFSET) }
            })
            .collect()
    }

    fn joint_transforms(&self, pose: Pose) -> Vec<Affine3A> {
        let mut transforms: Vec<Affine3A> = Vec::with_capacity(JOINTS);
        for (j, (joint, w)) in self.shaped.joints.iter().zip(pose.rotations).enumerate() {
            let r = Mat3::from_quat(Quat::from_scaled_axis(*w));
            let about = Affine3A::from_mat3_translation(r, *joint - r * *joint);
            transforms.push(self.parents[j].map_or(about, |p| transforms[p as usize] * about));
        }
        transforms
    }

    /// Directions of the joint on the other side: features and displacements both change sign with each x index.
    fn mirrored(&self, source: &[Vec3]) -> Vec<Vec3> {
        let v = self.skin.len();
        let mut out = vec![Vec3::ZERO; 9 * v];
        for i in 0..9 {
            let sign = feature_sign(i);
            for vertex in 0..v {
                let d = source[i * v + self.net.mirror[vertex] as usize] * sign;
                out[i * v + vertex] = Vec3::new(-d.x, d.y, d.z);
            }
        }
        out
    }

    /// The symmetric part, for a joint on the middle plane.
    fn symmetric(&self, source: &[Vec3]) -> Vec<Vec3> {
        source.iter().zip(self.mirrored(source)).map(|(a, b)| (*a + b) * 0.5).collect()
    }
}

/// Sign of entry `i` (row-major) of `M R M` against `R` for the mirror `M = diag(-1, 1, 1)`.
fn feature_sign(i: usize) -> f32 {
    if (i / 3 == 0) != i.is_multiple_of(3) { -1.0 } else { 1.0 }
}

/// Dual quaternion linear blending of rigid transforms.
fn blend_dual_quaternions(skin: &SkinWeights, transforms: &[Affine3A]) -> Affine3A {
    let mut real = Quat::from_xyzw(0.0, 0.0, 0.0, 0.0);
    let mut dual = Quat::from_xyzw(0.0, 0.0, 0.0, 0.0);
    let mut pivot: Option<Quat> = None;
    for (j, w) in skin.joints.iter().zip(skin.weights) {
        if w == 0.0 {
            continue;
        }
        let t = &transforms[*j as usize];
        let q = Quat::from_mat3a(&t.matrix3).normalize();
        let q = match pivot {
            Some(p) if p.dot(q) < 0.0 => -q,
            _ => q,
        };
        pivot.get_or_insert(q);
        let x = t.translation;
        let d = Quat::from_xyzw(x.x, x.y, x.z, 0.0) * q * 0.5;
        real += q * w;
        dual += d * w;
    }
    let length = real.length().max(1e-6);
    let (real, dual) = (real * (1.0 / length), dual * (1.0 / length));
    let t = dual * real.conjugate() * 2.0;
    Affine3A::from_rotation_translation(real, Vec3::new(t.x, t.y, t.z))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dual_quaternions_of_one_joint_are_its_transform() {
        let r = Quat::from_scaled_axis(Vec3::new(0.4, -1.0, 0.3));
        let t = [Affine3A::from_rotation_translation(r, Vec3::new(0.3, 0.2, -0.7))];
        let skin = SkinWeights { joints: [0; 4], weights: [1.0, 0.0, 0.0, 0.0] };
        let blended = blend_dual_quaternions(&skin, &t);
        assert!(blended.abs_diff_eq(t[0], 1e-6), "{blended} {}", t[0]);
    }

    #[test]
    fn a_half_way_blend_of_a_quarter_turn_keeps_volume() {
        let t = [Affine3A::IDENTITY, Affine3A::from_rotation_x(std::f32::consts::FRAC_PI_2)];
        let skin = SkinWeights { joints: [0, 1, 0, 0], weights: [0.5, 0.5, 0.0, 0.0] };
        assert!((blend_dual_quaternions(&skin, &t).matrix3.determinant() - 1.0).abs() < 1e-5);
        assert!(skin.blend(&t).matrix3.determinant() < 0.6);
    }
}
