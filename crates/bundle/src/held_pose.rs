use glam::{Quat, Vec3};
use softtissue_body::Pose;

/// A copy of a pose.
#[derive(Clone, Debug)]
pub(crate) struct HeldPose {
    pub(crate) rotations: Vec<Vec3>,
    /// As given, teleports included.
    pub(crate) translation: Vec3,
    /// Teleports up to here.
    pub(crate) teleported: Vec3,
}

impl HeldPose {
    pub(crate) fn rest(joints: usize) -> Self {
        Self { rotations: vec![Vec3::ZERO; joints], translation: Vec3::ZERO, teleported: Vec3::ZERO }
    }
    pub(crate) fn clear(&mut self) {
        self.rotations.fill(Vec3::ZERO);
        (self.translation, self.teleported) = (Vec3::ZERO, Vec3::ZERO);
    }
    /// Copies without allocating.
    pub(crate) fn set(&mut self, other: &Self) {
        self.rotations.copy_from_slice(&other.rotations);
        (self.translation, self.teleported) = (other.translation, other.teleported);
    }
    /// With the root where it would be without teleports.
    pub(crate) fn steady(&self) -> Pose<'_> {
        Pose { rotations: &self.rotations, translation: self.translation - self.teleported }
    }
    /// Becomes what lies between two poses; teleports are those of `from`.
    pub(crate) fn set_between(&mut self, from: &Self, to: &Self, part: f32) {
        for (w, (a, b)) in self.rotations.iter_mut().zip(from.rotations.iter().zip(&to.rotations)) {
            let from = Quat::from_scaled_axis(*a);
            *w = axis_angle(from * Quat::from_scaled_axis(part * turn(from, Quat::from_scaled_axis(*b))));
        }
        let moved = to.steady().translation - from.steady().translation;
        (self.translation, self.teleported) = (from.translation + part * moved, from.teleported);
    }
}

/// The rotation from one to another in the frame of the first, axis times angle of at most half a turn.
pub(crate) fn turn(from: Quat, to: Quat) -> Vec3 {
    axis_angle(from.inverse() * to)
}

/// Axis times angle of at most half a turn.
pub(crate) fn axis_angle(q: Quat) -> Vec3 {
    let q = if q.w < 0.0 { -q } else { q };
    let v = Vec3::new(q.x, q.y, q.z);
    let sine = v.length();
    // Twice the angle's half over its sine, which tends to 2.
    if sine < 1e-6 { 2.0 * v } else { v * (2.0 * sine.atan2(q.w) / sine) }
}
