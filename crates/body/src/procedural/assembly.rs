//! From sampled people of one topology to a parametric body.

use super::joint_rows::joint_rows;
use super::parts::{self, Landmarks, Tissue};
use super::pose_fit::PoseFit;
use super::relax::Net;
use super::shape_space::{Scores, directions, mean};
use super::skeleton::JOINTS;
use super::weights::{mirrored_joint, skin_weights};
use crate::{BodyError, BodyModel, Mirror, Result, ShapedBody, Skeleton, UvAtlas};
use glam::Vec3;
use softtissue_geometry::{Topology, signed_volume};
use std::sync::Arc;

/// What a body is made of.
pub struct Stage<'a> {
    /// Connectivity.
    pub topology: Topology,
    /// Neighbours and symmetry.
    pub net: &'a Net,
    /// The neutral mesh, `[V]`: regions follow it.
    pub neutral: &'a [Vec3],
    /// Skin weights `[V]` of 24.
    pub dense: &'a [[f32; JOINTS]],
    /// Sampled people, `[N]` of `[V]`.
    pub samples: &'a [Vec<Vec3>],
    /// Their joints, `[N]` of 24.
    pub joints: &'a [[Vec3; JOINTS]],
    /// Where things are on the neutral mesh.
    pub marks: Landmarks,
    /// Texture coordinates.
    pub uv: UvAtlas,
    /// Seed of the rotations that pose correctives are fitted on.
    pub seed: u64,
}

/// The body, and the tissue under its neutral mesh.
pub fn assemble(stage: Stage, scores: &Scores) -> Result<(BodyModel, Tissue)> {
    let mut template = mean(stage.samples);
    let v = template.len();
    let genus = stage.topology.check_closed_manifold().map_err(|e| BodyError::Generator(e.to_string()))?;
    if genus != 0 {
        return Err(BodyError::Generator(format!("the mesh has genus {genus}")));
    }
    let regions = parts::regions(&stage.marks, stage.net, stage.neutral, stage.dense);
    let tissue = parts::tissue(&stage.marks, stage.net, stage.neutral, &regions);
    let shapes = scores.values[0].len();
    let mut shape_directions = directions(stage.samples, scores);
    for k in 0..shapes {
        mirror_field(stage.net, &mut shape_directions[k * v..(k + 1) * v]);
    }
    mirror_field(stage.net, &mut template);
    let joint_regressor = joint_rows(stage.net, &template, stage.samples, stage.joints);
    let skin = skin_weights(stage.net, stage.dense);
    let skeleton = Skeleton::smpl();
    let shaped = ShapedBody { joints: joint_regressor.joints(&template), vertices: template };
    let fit = PoseFit { shaped: &shaped, skin: &skin, parents: &skeleton.parents, net: stage.net, seed: stage.seed };
    let pose_directions = fit.directions();
    let model = BodyModel {
        template: shaped.vertices,
        shape_directions,
        pose_directions,
        joint_regressor,
        skin,
        skeleton,
        uv: stage.uv,
        mirror: Mirror {
            vertices: stage.net.mirror.clone(),
            joints: (0..JOINTS).map(|j| mirrored_joint(j) as u8).collect(),
        },
        regions,
        topology: Arc::new(stage.topology),
    };
    Ok((model, tissue))
}

/// Turns the components so that the first points along stature and the second along log BMI at fixed stature, as far
/// as these are linear in the scores; the others stay in order. The scores are white, so any rotation of them is as
/// good a basis of the same bodies.
pub fn align_axes(scores: &mut Scores, samples: &[Vec<Vec3>], topology: &Topology) {
    let statures: Vec<f64> = samples
        .iter()
        .map(|x| {
            let (low, high) = x.iter().fold((f32::MAX, f32::MIN), |(l, h), p| (l.min(p.y), h.max(p.y)));
            f64::from(high - low)
        })
        .collect();
    let bmi = |(x, stature): (&Vec<Vec3>, &f64)| (signed_volume(x, &topology.faces) / stature.powi(2)).ln();
    let log_bmi: Vec<f64> = samples.iter().zip(&statures).map(bmi).collect();
    let count = scores.values[0].len();
    // the scores' means are zero, so the products need no centring
    let towards = |target: &[f64]| -> Vec<f64> {
        (0..count).map(|k| scores.values.iter().zip(target).map(|(r, t)| r[k] * t).sum()).collect()
    };
    let mut candidates = vec![towards(&statures), towards(&log_bmi)];
    candidates.extend((2..count).map(|k| (0..count).map(|i| if i == k { 1.0 } else { 0.0 }).collect()));
    let mut basis: Vec<Vec<f64>> = Vec::with_capacity(count);
    for mut axis in candidates {
        for done in &basis {
            let dot: f64 = axis.iter().zip(done).map(|(a, d)| a * d).sum();
            axis.iter_mut().zip(done).for_each(|(a, d)| *a -= dot * d);
        }
        let length = axis.iter().map(|a| a * a).sum::<f64>().sqrt();
        axis.iter_mut().for_each(|a| *a /= length);
        basis.push(axis);
    }
    for row in &mut scores.values {
        *row = basis.iter().map(|axis| axis.iter().zip(row.iter()).map(|(a, r)| a * r).sum()).collect();
    }
}

/// Makes skin weights `[V]` mirror images of each other, by the left half.
pub fn mirror_rows(net: &Net, mut rows: Vec<[f32; JOINTS]>) -> Vec<[f32; JOINTS]> {
    for &v in net.left() {
        let (v, m) = (v as usize, net.mirror[v as usize] as usize);
        let row = rows[v];
        let flipped = std::array::from_fn(|j| row[mirrored_joint(j)]);
        if v == m {
            rows[v] = std::array::from_fn(|j| 0.5 * (row[j] + flipped[j]));
        } else {
            rows[m] = flipped;
        }
    }
    rows
}

fn mirror_field(net: &Net, field: &mut [Vec3]) {
    for &v in net.left() {
        let (v, m) = (v as usize, net.mirror[v as usize] as usize);
        let p = field[v];
        if v == m {
            field[v].x = 0.0;
        } else {
            field[m] = Vec3::new(-p.x, p.y, p.z);
        }
    }
}
