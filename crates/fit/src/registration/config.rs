use crate::{FitError, Result};
use serde::{Deserialize, Serialize};

/// Settings of the registration. Weights are relative to data of weight one a vertex. The defaults were chosen on
/// generated raw scans, none of a test motion.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RegistrationConfig {
    /// Frames of a subject, from the starts of its clips, that shape and static detail come from; more average out
    /// more noise and cost linearly. Default 12.
    pub subject_frames: usize,
    /// Scan points that steer the pose; the surface uses all. Default 3000.
    pub pose_points: usize,
    /// Gauss-Newton steps of a frame's pose at most, each with new closest points. Default 8.
    pub pose_iterations: usize,
    /// Times that closest points are sought anew for a frame's surface. Default 3.
    pub rounds: usize,
    /// Farthest that a scan point is sought a place for, metres; flesh that swings further is lost. Default 0.08.
    pub reach: f32,
    /// Distance at which a scan point counts a quarter (Geman and McClure), metres; small forgets outliers sooner and
    /// fast flesh too. Default 0.015.
    pub outlier: f32,
    /// Weight of the squared difference of displacements along an edge. Large smooths noise away, and then flesh.
    /// Default 0.1.
    pub smoothing: f32,
    /// Weight of the squared distance of a vertex from the model; decides in holes. Default 0.003.
    pub coupling: f32,
    /// How many times stronger the coupling is on hands, feet and head, where scans are worst. Default 30.
    pub extremity_coupling: f32,
    /// Share of the frame before's flesh that the model starts from; holes keep moving, and drift lasts longer.
    /// Default 0.5.
    pub memory: f32,
    /// Weight of each joint's squared turn from rest beside the mean squared distance, m^2/rad^2. Default 1e-6.
    pub pose_prior: f64,
    /// Weight of each joint's squared turn from the pose that the two frames before lead to, m^2/rad^2. Default 1e-5.
    pub smoothness: f64,
    /// Median distance of scan points, metres, beyond which a frame counts as lost. Default 0.02.
    pub refuse_beyond: f32,
}

impl Default for RegistrationConfig {
    fn default() -> Self {
        Self {
            subject_frames: 12,
            pose_points: 3000,
            pose_iterations: 8,
            rounds: 3,
            reach: 0.08,
            outlier: 0.015,
            smoothing: 0.1,
            coupling: 0.003,
            extremity_coupling: 30.0,
            memory: 0.5,
            pose_prior: 1e-6,
            smoothness: 1e-5,
            refuse_beyond: 0.02,
        }
    }
}

impl RegistrationConfig {
    /// Refuses values that no registration can be made with.
    pub fn check(&self) -> Result<()> {
        let refuse = |field, value: String, remedy| Err(FitError::Registration { field, value, remedy });
        for (field, value) in [
            ("subject_frames", self.subject_frames),
            ("pose_points", self.pose_points),
            ("pose_iterations", self.pose_iterations),
            ("rounds", self.rounds),
        ] {
            if value == 0 {
                return refuse(field, "0".into(), "write at least 1");
            }
        }
        for (field, value) in [
            ("reach", self.reach),
            ("outlier", self.outlier),
            ("smoothing", self.smoothing),
            ("coupling", self.coupling),
            ("extremity_coupling", self.extremity_coupling),
            ("refuse_beyond", self.refuse_beyond),
        ] {
            if !(value.is_finite() && value > 0.0) {
                return refuse(field, value.to_string(), "write more than 0");
            }
        }
        for (field, value) in [("pose_prior", self.pose_prior), ("smoothness", self.smoothness)] {
            if !(value.is_finite() && value >= 0.0) {
                return refuse(field, value.to_string(), "write 0 or more");
            }
        }
        if !(0.0..=1.0).contains(&self.memory) {
            return refuse("memory", self.memory.to_string(), "write 0 to 1");
        }
        Ok(())
    }
}
