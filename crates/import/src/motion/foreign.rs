use super::MotionLimits;
use glam::{DQuat, DVec3};

/// Joints of a foreign skeleton; parents come before their children. Every joint's rotation is the identity at rest, so
/// all joint frames are then parallel to the file's axes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ForeignSkeleton {
    /// `[J]` names as the file has them.
    pub names: Vec<String>,
    /// `[J]` parents, `None` for the root.
    pub parents: Vec<Option<usize>>,
    /// `[J]` rest position relative to the parent (the root's: to the origin).
    pub offsets: Vec<DVec3>,
    /// `[J]` where a joint without children has the end of its bone, relative to the joint.
    pub ends: Vec<Option<DVec3>>,
}

/// A motion as a file has it, on its own skeleton: local rotations, and positions of the joints that move by themselves
/// (the root; others in some files).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ForeignMotion {
    /// The skeleton.
    pub skeleton: ForeignSkeleton,
    /// Frames a second.
    pub fps: f64,
    /// `[T, J]` rotations relative to the parent.
    pub rotations: Vec<DQuat>,
    /// Joints that have a position of their own in every frame, ascending.
    pub moving: Vec<usize>,
    /// `[T, moving]` these positions relative to the parent, in place of the offset.
    pub positions: Vec<DVec3>,
}

/// Where all joints are in one frame.
#[derive(Clone, Debug, PartialEq)]
pub struct ForeignPose {
    /// `[J]` positions.
    pub positions: Vec<DVec3>,
    /// `[J]` `world_from_rest` rotations.
    pub rotations: Vec<DQuat>,
}

impl ForeignSkeleton {
    /// Joints `J`.
    pub fn len(&self) -> usize {
        self.names.len()
    }
    /// Whether there is no joint.
    pub fn is_empty(&self) -> bool {
        self.names.is_empty()
    }

    pub(super) fn push(&mut self, name: String, parent: Option<usize>, offset: DVec3) -> usize {
        self.names.push(name);
        self.parents.push(parent);
        self.offsets.push(offset);
        self.ends.push(None);
        self.len() - 1
    }

    /// The way from a joint to the root, both included.
    pub fn ancestry(&self, joint: usize) -> Vec<usize> {
        let mut way = vec![joint];
        while let Some(parent) = self.parents[way[way.len() - 1]] {
            way.push(parent);
        }
        way
    }

    /// The nearest joint that both hang below (or are).
    pub fn common_ancestor(&self, a: usize, b: usize) -> usize {
        let way = self.ancestry(a);
        self.ancestry(b).into_iter().find(|j| way.contains(j)).unwrap_or(0)
    }

    /// Joints from `top` (left out) down to `bottom` (included); empty where `bottom` is not below `top`.
    pub fn path_down(&self, top: usize, bottom: usize) -> Vec<usize> {
        let way = self.ancestry(bottom);
        match way.iter().position(|j| *j == top) {
            Some(at) => way[..at].iter().rev().copied().collect(),
            None => Vec::new(),
        }
    }

    /// Positions and rotations that given local rotations and root positions lead to.
    fn posed(&self, local: impl Fn(usize) -> DQuat, position: impl Fn(usize) -> DVec3) -> ForeignPose {
        let mut pose = ForeignPose { positions: Vec::with_capacity(self.len()), rotations: Vec::new() };
        for j in 0..self.len() {
            let (at, turn) = match self.parents[j] {
                Some(p) => (pose.positions[p] + pose.rotations[p] * position(j), pose.rotations[p] * local(j)),
                None => (position(j), local(j)),
            };
            pose.positions.push(at);
            pose.rotations.push(turn);
        }
        pose
    }

    /// The pose in which no joint is turned.
    pub fn rest(&self) -> ForeignPose {
        self.posed(|_| DQuat::IDENTITY, |j| self.offsets[j])
    }
}

impl ForeignMotion {
    /// Frames `T`.
    pub fn len(&self) -> usize {
        self.rotations.len() / self.skeleton.len().max(1)
    }
    /// Whether there is no frame.
    pub fn is_empty(&self) -> bool {
        self.rotations.is_empty()
    }

    /// All joints in frame `t`.
    pub fn pose(&self, t: usize) -> ForeignPose {
        let (joints, moving) = (self.skeleton.len(), self.moving.len());
        let rotations = &self.rotations[t * joints..(t + 1) * joints];
        let positions = &self.positions[t * moving..(t + 1) * moving];
        let at = |j: usize| {
            let own = self.moving.binary_search(&j);
            own.map_or(self.skeleton.offsets[j], |k| positions[k])
        };
        self.skeleton.posed(|j| rotations[j], at)
    }

    /// Lengths in metres, of a file whose unit has `metres`.
    pub(super) fn scale(&mut self, metres: f64) {
        self.skeleton.offsets.iter_mut().for_each(|o| *o *= metres);
        self.skeleton.ends.iter_mut().flatten().for_each(|o| *o *= metres);
        self.positions.iter_mut().for_each(|p| *p *= metres);
    }

    /// Turns the world under the motion: joints keep their own frames, the root goes along.
    pub(super) fn turn(&mut self, new_from_old: DQuat) {
        let joints = self.skeleton.len();
        for frame in self.rotations.chunks_exact_mut(joints.max(1)) {
            frame[0] = new_from_old * frame[0];
        }
        match self.moving.iter().position(|m| *m == 0) {
            Some(k) => {
                let moving = self.moving.len();
                self.positions.chunks_exact_mut(moving).for_each(|frame| frame[k] = new_from_old * frame[k]);
            }
            None => self.skeleton.offsets[0] = new_from_old * self.skeleton.offsets[0],
        }
    }

    /// Leaves out the first frame.
    pub(super) fn drop_first(&mut self) {
        self.rotations.drain(..self.skeleton.len());
        self.positions.drain(..self.moving.len());
    }
}

/// Refuses what would take more memory than the limits allow, before it is taken.
pub(super) fn check_size(joints: usize, frames: u64, limits: &MotionLimits) -> Result<(), String> {
    if frames > limits.frames as u64 {
        return Err(format!("it states {frames} frames, at most {} are read; cut the clip", limits.frames));
    }
    if frames * joints as u64 > limits.rotations as u64 {
        return Err(format!("{frames} frames of {joints} joints are more than is read; cut the clip"));
    }
    match frames {
        0 => Err("it holds no frame; export the motion again".into()),
        1 => Err("it holds one frame, which has no velocity; a clip needs at least two".into()),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turning_the_world_turns_every_joint_alike() {
        let mut skeleton = ForeignSkeleton::default();
        let root = skeleton.push("root".into(), None, DVec3::new(1.0, 2.0, 3.0));
        skeleton.push("child".into(), Some(root), DVec3::new(0.0, 0.5, 0.1));
        let rotations = vec![DQuat::from_rotation_x(0.3), DQuat::from_rotation_y(1.0)];
        let fixed = ForeignMotion { skeleton, fps: 1.0, rotations, moving: vec![], positions: vec![] };
        let moving = ForeignMotion { moving: vec![0], positions: vec![DVec3::X], ..fixed.clone() };
        let turn = DQuat::from_rotation_x(-1.2);
        for motion in [fixed, moving] {
            let before = motion.pose(0);
            let mut turned = motion.clone();
            turned.turn(turn);
            let after = turned.pose(0);
            for j in 0..2 {
                assert!(after.positions[j].abs_diff_eq(turn * before.positions[j], 1e-12));
                assert!((turn * before.rotations[j]).dot(after.rotations[j]).abs() > 1.0 - 1e-12);
            }
        }
    }
}
