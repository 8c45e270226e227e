//! Motions of people from foreign files onto our skeleton: BVH, ASF/AMC and AMASS.
//!
//! [`read_motion`] gives a motion on the file's own skeleton in metres, Y up ([`ReadMotion`]), and says what it guessed;
//! [`retarget`] puts it onto a body of ours; [`resample`] brings any clip to any rate.

mod align;
mod amass;
mod amc;
mod asf;
mod bvh;
mod cmu_wrists;
mod config;
mod contact;
mod figure;
mod foreign;
mod guess;
mod legs;
mod person;
mod problems;
mod read;
mod resample;
mod retarget;
mod text;

pub use config::{MotionConfig, MotionLimits, RATES, RetargetConfig};
pub use foreign::{ForeignMotion, ForeignPose, ForeignSkeleton};
pub use guess::{MotionUnits, UpAxis};
pub use person::{Arm, Leg, Naming, Person};
pub use problems::examine;
pub use read::{MotionFacts, ReadMotion, is_motion_file, read_bvh_bytes, read_motion};
pub use resample::resample;
pub use retarget::{Retargeted, retarget};

use read::snapped_rate;
