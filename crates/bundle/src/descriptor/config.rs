use serde::{Deserialize, Serialize};

/// Which family of features describes a motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FeatureKind {
    /// SoftSMPL eq. 11 with the joint rotations in the place of the learned pose descriptor: rotations, angular
    /// velocities and accelerations of the joints below the root, root velocity and acceleration in the root's frame.
    Pose,
    /// SoftSMPL eq. 11 as published: the learned pose descriptor, its velocity and acceleration, root velocity and
    /// acceleration in the root's frame; 36 numbers with a descriptor of 10. The descriptor's encoder is learned from
    /// poses beforehand and belongs to the model.
    DisentangledPose,
    /// What the flesh feels in its rest frame, projected on the first modes of the deltas.
    ModalForces,
    /// Casas and Otaduy 2018: axis angles of all joints and the root's velocity, 75 numbers for 24 joints.
    Angles,
}

/// How a motion is described. The same value goes into the bundle.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct DescriptorConfig {
    /// Family of features. Default `modal-forces`.
    pub features: FeatureKind,
    /// Delta modes that forces are projected on. Default 40; more see finer patterns and cost time in proportion.
    pub modes: usize,
    /// Whether `modal-forces` also holds the entries of `R_j - I` of the joints below the root, for what
    /// depends on the pose itself. Default true.
    pub pose_entries: bool,
    /// Whether `pose` and `disentangled-pose` also hold the root's angular velocity in the root's frame. Default true.
    pub root_angular_velocity: bool,
    /// Whether `angles` holds the root's position (as published, if taken by the letter) in the place of its velocity:
    /// whoever stands elsewhere then moves otherwise. Default false.
    pub root_position: bool,
    /// Where the low-pass on velocities, which stands before second differences, falls to half power, Hz.
    /// Default 12; lower suppresses jitter of the poses and adds lag. Zero turns it off.
    pub cutoff_hz: f32,
    /// Frames a second of every motion. Default 60.
    pub fps: f32,
    /// Future frames that a feature may use. Default 0: causal. A player must delay its output by as many.
    pub look_ahead: usize,
}

impl Default for DescriptorConfig {
    fn default() -> Self {
        Self {
            features: FeatureKind::ModalForces,
            modes: 40,
            pose_entries: true,
            root_angular_velocity: true,
            root_position: false,
            cutoff_hz: 12.0,
            fps: 60.0,
            look_ahead: 0,
        }
    }
}
