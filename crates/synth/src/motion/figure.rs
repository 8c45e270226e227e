use super::limb::ROLL;
use crate::{Result, SynthError};
use glam::{DQuat, DVec3};
use softtissue_body::{ShapedBody, Skeleton};

/// Joints `J` of SMPL's skeleton.
pub const JOINTS: usize = 24;

/// SMPL's joint indices; pairs are (left, right).
pub(crate) mod joint {
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

/// `+1` for the left side (`+X`), `-1` for the right.
pub(crate) const SIDE: [f64; 2] = [1.0, -1.0];

/// A subject as the motions see it: rest joints and where the soles are.
#[derive(Clone, Debug)]
pub struct Figure {
    /// Rest joints, metres, SMPL's order.
    pub joints: [DVec3; JOINTS],
    /// Height of the soles in the rest pose, metres.
    pub sole: f64,
    parents: [Option<usize>; JOINTS],
}

impl Figure {
    /// Of a shaped body: its rest joints, soles at its lowest vertex.
    pub fn new(shaped: &ShapedBody) -> Result<Self> {
        let sole = shaped.vertices.iter().map(|v| v.y).fold(f32::INFINITY, f32::min);
        Self::from_joints(&shaped.joints.iter().map(|j| j.as_dvec3()).collect::<Vec<_>>(), f64::from(sole))
    }

    /// Of 24 rest joints (SMPL's order) and the height of the soles.
    pub fn from_joints(joints: &[DVec3], sole: f64) -> Result<Self> {
        let bad = |reason: String| SynthError::Skeleton { reason };
        let joints: [DVec3; JOINTS] =
            joints.try_into().map_err(|_| bad(format!("this body has {} joints", joints.len())))?;
        for side in 0..2 {
            let thigh = joints[HIP[side]] - joints[KNEE[side]];
            let shank = joints[KNEE[side]] - joints[ANKLE[side]];
            if !(thigh.y > 0.1 && shank.y > 0.1 && joints[BALL[side]].y > sole) {
                return Err(bad("its legs do not hang down from the hips to the soles at rest".into()));
            }
        }
        let mut parents = [None; JOINTS];
        for (slot, parent) in parents.iter_mut().zip(&Skeleton::smpl().parents) {
            *slot = parent.map(usize::from);
        }
        Ok(Self { joints, sole, parents })
    }

    /// Thigh plus shank, metres.
    pub fn leg_length(&self, side: usize) -> f64 {
        self.thigh(side) + self.shank(side)
    }
    pub(crate) fn thigh(&self, side: usize) -> f64 {
        self.joints[HIP[side]].distance(self.joints[KNEE[side]])
    }
    pub(crate) fn shank(&self, side: usize) -> f64 {
        self.joints[KNEE[side]].distance(self.joints[ANKLE[side]])
    }
    /// Height of the ball joint over the ground in a flat foot.
    pub fn ball_height(&self, side: usize) -> f64 {
        self.joints[BALL[side]].y - self.sole
    }
    /// Half the distance between the hip joints.
    pub(crate) fn hip_half_width(&self) -> f64 {
        0.5 * (self.joints[HIP[0]].x - self.joints[HIP[1]].x)
    }

    /// Half the distance of comfortably standing ankles: the geometric mean of hips and resting ankles.
    pub(crate) fn stance_half_width(&self) -> f64 {
        let ankles = 0.5 * (self.joints[ANKLE[0]].x - self.joints[ANKLE[1]].x);
        (self.hip_half_width() * ankles.max(0.5 * self.hip_half_width())).sqrt()
    }
    /// Angle of the resting upper arm from hanging down, radians.
    pub(crate) fn rest_elevation(&self, side: usize) -> f64 {
        (self.joints[ELBOW[side]] - self.joints[SHOULDER[side]]).angle_between(DVec3::NEG_Y)
    }

    /// World positions and orientations of all joints.
    pub fn forward(&self, local: &[DQuat; JOINTS], translation: DVec3) -> ([DVec3; JOINTS], [DQuat; JOINTS]) {
        let mut positions = [DVec3::ZERO; JOINTS];
        let mut world = [DQuat::IDENTITY; JOINTS];
        for j in 0..JOINTS {
            match self.parents[j] {
                Some(p) => {
                    positions[j] = positions[p] + world[p] * (self.joints[j] - self.joints[p]);
                    world[j] = (world[p] * local[j]).normalize();
                }
                None => {
                    positions[j] = self.joints[j] + translation;
                    world[j] = local[j];
                }
            }
        }
        (positions, world)
    }

    /// The pad of the toes, about which a bearing foot rolls: it stays where it is while its foot bears.
    pub fn toe_pad(&self, side: usize, positions: &[DVec3; JOINTS], world: &[DQuat; JOINTS]) -> DVec3 {
        positions[BALL[side]] + world[ANKLE[side]] * DVec3::Z * ROLL
    }

    /// Centre of mass of a posed figure: segment masses and centres of Winter, Biomechanics and Motor Control
    /// of Human Movement (4th ed., table 4.1).
    pub fn centre_of_mass(&self, p: &[DVec3; JOINTS]) -> DVec3 {
        let along = |a: usize, b: usize, s: f64| p[a].lerp(p[b], s);
        let mut sum = 0.142 * along(PELVIS, SPINE[0], 0.3)
            + 0.139 * along(SPINE[0], SPINE[1], 0.6)
            + 0.216 * along(SPINE[2], NECK, 0.2)
            + 0.081 * along(NECK, HEAD, 1.6);
        for s in 0..2 {
            sum += 0.100 * along(HIP[s], KNEE[s], 0.433)
                + 0.0465 * along(KNEE[s], ANKLE[s], 0.433)
                + 0.0145 * along(ANKLE[s], BALL[s], 0.5)
                + 0.028 * along(SHOULDER[s], ELBOW[s], 0.436)
                + 0.016 * along(ELBOW[s], WRIST[s], 0.43)
                + 0.006 * p[HAND[s]];
        }
        sum
    }
}
