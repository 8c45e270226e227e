use super::assembly::Assembly;
use super::targets::Target;
use glam::Vec3;
use softtissue_body::{BodyModel, ShapedBody, Skeleton};

/// A limb as a capsule that other flesh may not enter.
#[derive(Clone, Debug)]
struct Limb {
    joints: [usize; 2],
    radius: f32,
    /// Whether the flesh over a node belongs to this limb or lies next to its joint, `[V]`.
    own: Vec<bool>,
}

/// The limbs of a body that touch other flesh: upper arms, forearms, thighs.
#[derive(Clone, Debug)]
pub struct Limbs(Vec<Limb>);

/// A node near a limb during one interval.
#[derive(Clone, Copy, Debug)]
pub struct Candidate {
    /// Free node.
    pub node: u32,
    /// Ends of the limb's axis at the interval's start and its end.
    axis: [[Vec3; 2]; 2],
    radius: f32,
}

/// Pull out of a limb per metre of penetration, as the square of a frequency of 20 Hz, 1/s^2.
const STIFFNESS: f32 = 15_800.0;
/// Nodes whose skinned place is farther than this from a limb's surface are not looked at, m.
const REACH: f32 = 0.06;

impl Limbs {
    /// Radii from the skin round each bone.
    pub fn new(skeleton: &Skeleton, body: &BodyModel, shaped: &ShapedBody) -> Self {
        let mut limbs = Vec::new();
        for side in ["left", "right"] {
            for (from, to) in [("shoulder", "elbow"), ("elbow", "wrist"), ("hip", "knee")] {
                let index = |name: &str| skeleton.index(&format!("{side}_{name}"));
                if let (Some(a), Some(b)) = (index(from), index(to)) {
                    limbs.push(Limb::new(skeleton, body, shaped, a, b));
                }
            }
        }
        Self(limbs)
    }

    /// Free skin nodes that could touch a limb between two frames.
    pub fn candidates(&self, assembly: &Assembly, from: &Target, to: &Target) -> Vec<Candidate> {
        let mut found = Vec::new();
        for limb in &self.0 {
            let axis = [from, to].map(|t| limb.joints.map(|j| t.joints[j]));
            for (v, node) in assembly.skin_node.iter().enumerate() {
                let Some(node) = *node else { continue };
                if limb.own[v] {
                    continue;
                }
                let near = [from, to].iter().zip(axis).any(|(t, a)| {
                    let p = t.skin[v];
                    (p - closest_on_segment(p, a)).length() < limb.radius + REACH
                });
                if near {
                    found.push(Candidate { node, axis, radius: limb.radius });
                }
            }
        }
        found
    }
}

impl Limb {
    fn new(skeleton: &Skeleton, body: &BodyModel, shaped: &ShapedBody, a: usize, b: usize) -> Self {
        let axis = [shaped.joints[a], shaped.joints[b]];
        let weight = |v: usize, j: usize| -> f32 {
            let s = &body.skin[v];
            s.joints.iter().zip(s.weights).filter(|(k, _)| **k as usize == j).map(|(_, w)| w).sum()
        };
        let mut distances: Vec<f32> = (0..body.vertex_count())
            .filter(|&v| weight(v, a) > 0.9)
            .map(|v| (shaped.vertices[v] - closest_on_segment(shaped.vertices[v], axis)).length())
            .collect();
        distances.sort_by(f32::total_cmp);
        let radius = distances.get(distances.len() / 2).copied().unwrap_or(0.03) * 0.95;
        // the limb itself, what hangs on it, and the flesh about its upper joint
        let parent = skeleton.parents[a].map_or(a, usize::from);
        let own = (0..body.vertex_count())
            .map(|v| {
                let mine = weight(v, a) + weight(v, b) > 0.05;
                let at_joint = weight(v, parent) > 0.3 && (shaped.vertices[v] - axis[0]).length() < 1.6 * radius;
                mine || at_joint
            })
            .collect();
        Self { joints: [a, b], radius, own }
    }
}

impl Candidate {
    /// Acceleration out of the limb for a node at `x + u`: only penetration beyond that of the skinned place `x`
    /// counts, so that flesh without displacement is at rest. `s` in `[0, 1]` is the place in the interval.
    pub fn acceleration(&self, x: Vec3, u: Vec3, s: f32) -> Vec3 {
        let [a, b] = self.axis;
        let axis = [a[0].lerp(b[0], s), a[1].lerp(b[1], s)];
        let p = x + u;
        let away = p - closest_on_segment(p, axis);
        let distance = away.length();
        if distance >= self.radius || distance < 1e-4 {
            return Vec3::ZERO;
        }
        let skinned = (x - closest_on_segment(x, axis)).length();
        let deeper = self.radius.min(skinned) - distance;
        away * (STIFFNESS * deeper.max(0.0) / distance)
    }
}

fn closest_on_segment(p: Vec3, [a, b]: [Vec3; 2]) -> Vec3 {
    let axis = b - a;
    a + axis * ((p - a).dot(axis) / axis.length_squared().max(1e-9)).clamp(0.0, 1.0)
}
