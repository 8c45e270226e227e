//! What a file does not say: its unit and its up axis.

use super::foreign::ForeignMotion;
use super::person::Person;
use glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};

/// Unit of length of a foreign motion.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum MotionUnits {
    /// 1 m.
    Metres,
    /// 0.01 m.
    Centimetres,
    /// 0.001 m.
    Millimetres,
    /// 0.0254 m.
    Inches,
    /// CMU's files: an inch over 0.45, 0.056444 m.
    Cmu,
}

impl MotionUnits {
    /// Those that a guess chooses from.
    pub const ALL: [Self; 5] = [Self::Metres, Self::Centimetres, Self::Millimetres, Self::Inches, Self::Cmu];

    /// Metres in one unit.
    pub fn metres(self) -> f64 {
        match self {
            Self::Metres => 1.0,
            Self::Centimetres => 0.01,
            Self::Millimetres => 0.001,
            Self::Inches => 0.0254,
            Self::Cmu => 0.0254 / 0.45,
        }
    }

    /// In words.
    pub fn words(self) -> &'static str {
        match self {
            Self::Metres => "metres",
            Self::Centimetres => "centimetres",
            Self::Millimetres => "millimetres",
            Self::Inches => "inches",
            Self::Cmu => "CMU units (0.0564 m)",
        }
    }
}

/// The axis that points up.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum UpAxis {
    /// As here.
    Y,
    /// As in many modelling programs.
    Z,
}

impl UpAxis {
    /// Turns the axis into Y.
    pub fn y_up_from_this(self) -> DQuat {
        match self {
            Self::Y => DQuat::IDENTITY,
            Self::Z => DQuat::from_rotation_x(-std::f64::consts::FRAC_PI_2),
        }
    }
    /// The axis.
    pub fn axis(self) -> DVec3 {
        match self {
            Self::Y => DVec3::Y,
            Self::Z => DVec3::Z,
        }
    }
}

/// Stature of the people that a guess expects, metres, and how far off a guess may be.
const STATURE_M: f64 = 1.55;
const STATURES_M: std::ops::RangeInclusive<f64> = 0.9..=2.4;
/// Frames that are looked at for the up axis.
const LOOKED_AT: usize = 200;

/// The unit in which a skeleton is a person.
///
/// # Errors
/// Says that there is none.
pub(super) fn guess_units(height: f64) -> Result<MotionUnits, String> {
    let off = |u: &MotionUnits| (height * u.metres() / STATURE_M).ln().abs();
    let nearest = MotionUnits::ALL.into_iter().min_by(|a, b| off(a).total_cmp(&off(b))).unwrap_or(MotionUnits::Metres);
    if STATURES_M.contains(&(height * nearest.metres())) {
        return Ok(nearest);
    }
    Err(format!("its skeleton is {height:.4} units tall, which is a person in no unit that is known; state --units"))
}

/// The axis along which heads are over ankles, over the whole clip.
pub(super) fn guess_up(motion: &ForeignMotion, person: &Person) -> UpAxis {
    let step = motion.len().div_ceil(LOOKED_AT).max(1);
    let over: DVec3 = (0..motion.len()).step_by(step).map(|t| person.upright(&motion.pose(t))).sum();
    if over.z.abs() > over.y.abs() { UpAxis::Z } else { UpAxis::Y }
}
