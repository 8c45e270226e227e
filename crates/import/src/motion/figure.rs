use glam::{DQuat, DVec3};
use softtissue_body::{ShapedBody, Skeleton};

/// Joints of our skeleton.
pub(super) const JOINTS: usize = 24;

/// Our joints (SMPL's order); pairs are (left, right).
pub(super) mod joint {
    pub const PELVIS: usize = 0;
    pub const HIP: [usize; 2] = [1, 2];
    pub const SPINE: [usize; 3] = [3, 6, 9];
    pub const KNEE: [usize; 2] = [4, 5];
    pub const ANKLE: [usize; 2] = [7, 8];
    pub const BALL: [usize; 2] = [10, 11];
    pub const NECK: usize = 12;
    pub const COLLAR: [usize; 2] = [13, 14];
    pub const HEAD: usize = 15;
    pub const SHOULDER: [usize; 2] = [16, 17];
    pub const ELBOW: [usize; 2] = [18, 19];
    pub const WRIST: [usize; 2] = [20, 21];
    pub const HAND: [usize; 2] = [22, 23];
}
use joint::*;

/// A body of ours as a motion sees it: rest joints, and where the soles are.
#[derive(Clone, Debug)]
pub(super) struct Figure {
    /// Rest joints, metres.
    pub rest: [DVec3; JOINTS],
    /// Height of the soles at rest, metres.
    pub sole: f64,
    parents: [Option<usize>; JOINTS],
}

impl Figure {
    /// `None` for a body with another skeleton.
    pub fn new(skeleton: &Skeleton, shaped: &ShapedBody) -> Option<Self> {
        if *skeleton != Skeleton::smpl() || shaped.joints.len() != JOINTS || shaped.vertices.is_empty() {
            return None;
        }
        let sole = shaped.vertices.iter().map(|v| v.y).fold(f32::INFINITY, f32::min);
        Some(Self {
            rest: std::array::from_fn(|j| shaped.joints[j].as_dvec3()),
            sole: f64::from(sole),
            parents: std::array::from_fn(|j| skeleton.parents[j].map(usize::from)),
        })
    }

    pub fn parent(&self, joint: usize) -> Option<usize> {
        self.parents[joint]
    }
    /// Rest vector from one joint to another.
    pub fn bone(&self, from: usize, to: usize) -> DVec3 {
        self.rest[to] - self.rest[from]
    }
    pub fn thigh(&self, side: usize) -> f64 {
        self.bone(HIP[side], KNEE[side]).length()
    }
    pub fn shank(&self, side: usize) -> f64 {
        self.bone(KNEE[side], ANKLE[side]).length()
    }
    /// Thigh and shank, mean over the sides.
    pub fn leg_length(&self) -> f64 {
        0.5 * (0..2).map(|s| self.thigh(s) + self.shank(s)).sum::<f64>()
    }
    /// Height of the ball joints over the ground when standing.
    pub fn ball_height(&self) -> f64 {
        0.5 * (self.rest[BALL[0]].y + self.rest[BALL[1]].y) - self.sole
    }
    /// Height of the ankles over the ground when standing.
    pub fn ankle_height(&self) -> f64 {
        0.5 * (self.rest[ANKLE[0]].y + self.rest[ANKLE[1]].y) - self.sole
    }
    /// Midway between the hip joints at rest, from the pelvis joint.
    pub fn hips(&self) -> DVec3 {
        0.5 * (self.rest[HIP[0]] + self.rest[HIP[1]]) - self.rest[PELVIS]
    }

    /// Where the joints are, from `world_from_rest` rotations and the pelvis.
    pub fn positions(&self, world: &[DQuat; JOINTS], pelvis: DVec3) -> [DVec3; JOINTS] {
        let mut at = [pelvis; JOINTS];
        for j in 1..JOINTS {
            if let Some(p) = self.parents[j] {
                at[j] = at[p] + world[p] * self.bone(p, j);
            }
        }
        at
    }
}
