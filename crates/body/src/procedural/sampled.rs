use super::assembly::{Stage, align_axes, assemble, mirror_rows};
use super::parts::{self, Landmarks};
use super::relax::Net;
use super::shape_space::{Scores, principal_scores};
use super::skeleton::JOINTS;
use crate::{BodyError, BodyModel, RegionMap, Result, SkinWeights, UvAtlas};
use glam::Vec3;
use softtissue_geometry::{Topology, signed_volume};

/// People of one topology, whatever they come from, of whom a parametric body is made: principal components with our
/// signs, joint rows, regions, correctives.
#[derive(Clone, Debug)]
pub struct SampledPeople {
    /// Connectivity: closed, outward, genus 0.
    pub topology: Topology,
    /// The vertex on the other side, `[V]`, an involution.
    pub mirror: Vec<u32>,
    /// Texture coordinates.
    pub uv: UvAtlas,
    /// Skin weights `[V]` of SMPL's 24 joints; rows sum to one.
    pub weights: Vec<[f32; JOINTS]>,
    /// Somebody in the middle, who says which vertex belongs to which region.
    pub neutral: SampledPerson,
    /// Everybody who is sampled.
    pub people: Vec<SampledPerson>,
}

/// One person in the rest pose, metres, Y up, facing +Z.
#[derive(Clone, Debug)]
pub struct SampledPerson {
    /// `[V]`.
    pub vertices: Vec<Vec3>,
    /// SMPL's 24 joints.
    pub joints: [Vec3; JOINTS],
}

impl SampledPeople {
    /// The body with `shapes` coefficients: the first is stature (positive = taller), the second body mass (negative =
    /// heavier), the others in order of variance, positive = more volume. Pose correctives give back what linear
    /// blending loses against dual quaternions; `seed` draws the rotations that they are fitted on.
    ///
    /// # Errors
    /// Too few people, arrays of other lengths, or a mesh that is no sphere.
    pub fn body(&self, shapes: usize, seed: u64) -> Result<BodyModel> {
        let bad = |reason: String| Err(BodyError::Inconsistent(reason));
        let v = self.topology.vertex_count;
        if shapes < 2 || self.people.len() < 2 * shapes {
            return bad(format!("{} people are too few for {shapes} shape coefficients", self.people.len()));
        }
        let lengths = self.people.iter().chain([&self.neutral]).map(|p| p.vertices.len());
        if lengths.chain([self.mirror.len(), self.weights.len()]).any(|n| n != v) {
            return bad(format!("its people, symmetry or weights are not those of {v} vertices"));
        }
        let samples: Vec<Vec<Vec3>> = self.people.iter().map(|p| p.vertices.clone()).collect();
        let joints: Vec<[Vec3; JOINTS]> = self.people.iter().map(|p| p.joints).collect();
        let mut scores = principal_scores(&samples, shapes);
        align_axes(&mut scores, &samples, &self.topology);
        fix_signs(&mut scores, &samples, &self.topology);
        let net = Net::of_polygons(&self.topology.faces, &self.mirror, &self.neutral.vertices);
        let stage = Stage {
            topology: self.topology.clone(),
            net: &net,
            neutral: &self.neutral.vertices,
            dense: &mirror_rows(&net, self.weights.clone()),
            samples: &samples,
            joints: &joints,
            marks: Landmarks::measured(&self.neutral.vertices, &self.neutral.joints)?,
            uv: self.uv.clone(),
            seed,
        };
        let (model, _) = assemble(stage, &scores)?;
        model.check()?;
        Ok(model)
    }
}

/// Stature first and positive, index of body mass second and negative, volume positive in the others.
fn fix_signs(scores: &mut Scores, samples: &[Vec<Vec3>], topology: &Topology) {
    let measures: Vec<[f64; 2]> = samples
        .iter()
        .map(|x| {
            let (low, high) = x.iter().fold((f32::MAX, f32::MIN), |(l, h), p| (l.min(p.y), h.max(p.y)));
            [f64::from(high - low), signed_volume(x, &topology.faces)]
        })
        .collect();
    for k in 0..scores.values[0].len() {
        let measure = |[stature, volume]: &[f64; 2]| match k {
            0 => *stature,
            1 => -(volume / stature.powi(2)).ln(),
            _ => *volume,
        };
        // the scores' means are zero, so the products need no centring
        let sum: f64 = scores.values.iter().zip(&measures).map(|(row, m)| row[k] * measure(m)).sum();
        if sum < 0.0 {
            scores.values.iter_mut().for_each(|row| row[k] = -row[k]);
        }
    }
}

/// Regions of a body that names none, from its rest mesh (metres, Y up, facing +Z), SMPL's 24 joints and its skin
/// weights.
///
/// # Errors
/// Another number of joints, or a body outside of human size.
pub fn derived_regions(
    template: &[Vec3],
    faces: &[[u32; 3]],
    joints: &[Vec3],
    skin: &[SkinWeights],
    mirror: &[u32],
) -> Result<RegionMap> {
    let marks = Landmarks::measured(template, joints)?;
    let dense: Vec<[f32; JOINTS]> = skin
        .iter()
        .map(|s| {
            let mut row = [0.0; JOINTS];
            s.joints.iter().zip(s.weights).for_each(|(j, w)| row[usize::from(*j)] += w);
            row
        })
        .collect();
    let net = Net::of_polygons(faces, mirror, template);
    Ok(parts::regions(&marks, &net, template, &dense))
}
