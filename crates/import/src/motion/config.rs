use super::UpAxis;
use std::ops::RangeInclusive;
use std::path::PathBuf;

/// Frames a second that a motion can have. At less than one a second nothing of a movement is left, and what lies between
/// two frames would be made up.
pub const RATES: RangeInclusive<f64> = 1.0..=1000.0;

/// How a foreign motion is read. What is `None` is taken from the file or guessed.
#[derive(Clone, Debug, Default)]
pub struct MotionConfig {
    /// The skeleton (ASF) of an AMC file; otherwise the one beside it.
    pub skeleton: Option<PathBuf>,
    /// Metres of one unit of length.
    pub units_m: Option<f64>,
    /// The axis that points up.
    pub up: Option<UpAxis>,
    /// Frames a second of the file.
    pub fps: Option<f64>,
    /// What is accepted.
    pub limits: MotionLimits,
}

/// What a reader of motions is willing to accept.
#[derive(Clone, Copy, Debug)]
pub struct MotionLimits {
    /// Bytes of a text file. Default 64 MiB; CMU's longest take has 20.
    pub file_bytes: u64,
    /// Bytes of an npz archive. Default 128 MiB.
    pub archive_bytes: u64,
    /// Bytes of one array of it. Default 160 MiB.
    pub array_bytes: u64,
    /// Joints. Default 512.
    pub joints: usize,
    /// Frames. Default 100,000.
    pub frames: usize,
    /// Joints times frames. Default 8 million.
    pub rotations: usize,
}

impl Default for MotionLimits {
    fn default() -> Self {
        Self {
            file_bytes: 64 << 20,
            archive_bytes: 128 << 20,
            array_bytes: 160 << 20,
            joints: 512,
            frames: 100_000,
            rotations: 8_000_000,
        }
    }
}

/// How a foreign motion is put onto our skeleton.
#[derive(Clone, Copy, Debug)]
pub struct RetargetConfig {
    /// Share of the hand's turn about the forearm that the forearm takes: our skeleton has no joint of its own for it,
    /// and a wrist that is wrung collapses. Default 0.5; AMASS's bodies have shared it out already.
    pub forearm_twist: f64,
    /// Speed below which the ball of a foot bears, m/s at the size of our body. Default 0.35.
    pub contact_speed: f64,
    /// Height above the ball's usual height on the ground up to which it can bear, metres. Default 0.05.
    pub contact_height: f64,
    /// Shortest contact, and longest gap in one that is closed, seconds. Default 0.06.
    pub contact_seconds: f64,
    /// Time over which a correction fades after (and grows before) a contact, seconds. Default 0.12.
    pub fade_seconds: f64,
}

impl Default for RetargetConfig {
    fn default() -> Self {
        Self {
            forearm_twist: 0.5,
            contact_speed: 0.35,
            contact_height: 0.05,
            contact_seconds: 0.06,
            fade_seconds: 0.12,
        }
    }
}
