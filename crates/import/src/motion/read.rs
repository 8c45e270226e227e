use super::amass::read_amass;
use super::amc::read_amc;
use super::bvh::{parse_bvh, read_bvh};
use super::cmu_wrists;
use super::foreign::ForeignMotion;
use super::guess::{MotionUnits, UpAxis, guess_units, guess_up};
use super::person::Person;
use super::{MotionConfig, RATES, resample::axis_angle};
use crate::{ImportError, Result};
use serde::Serialize;
use std::path::Path;

/// Ends of names of motions that are read.
const EXTENSIONS: [&str; 3] = ["bvh", "amc", "npz"];
/// A jump after the first frame by more than this many radians, and so many times what follows, parts a reference pose
/// from the motion.
const REFERENCE_JUMP: (f64, f64) = (0.35, 8.0);
/// Rates nearer to a whole number than this share of it are that number: files round their frame time.
const ROUNDED: f64 = 1e-4;

/// A person's motion from a foreign file, in metres, Y up, on its own skeleton.
#[derive(Clone, Debug)]
pub struct ReadMotion {
    /// The motion.
    pub motion: ForeignMotion,
    /// Which joint is what.
    pub person: Person,
    /// What the file is, and what was guessed of it.
    pub facts: MotionFacts,
}

/// What a motion file is.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MotionFacts {
    /// `BVH`, `ASF/AMC` or `AMASS`.
    pub format: &'static str,
    /// Joints of its skeleton.
    pub joints: usize,
    /// Frames that are used.
    pub frames: usize,
    /// Frames a second.
    pub fps: f64,
    /// Unit of length in words.
    pub units: String,
    /// Metres of a unit.
    pub metres_per_unit: f64,
    /// Axis that points up in the file.
    pub up: UpAxis,
    /// Height of the skeleton, metres.
    pub height_m: f64,
    /// Which names its joints have.
    pub naming: &'static str,
    /// The skeleton's file, where it is another one.
    pub skeleton: Option<String>,
    /// Which of these the file does not say.
    pub guessed: Vec<&'static str>,
    /// What else was found and done.
    pub notes: Vec<String>,
}

impl MotionFacts {
    /// All in one line.
    pub fn sentence(&self) -> String {
        let guessed = |what: &str| if self.guessed.contains(&what) { " (guessed)" } else { "" };
        let mut line = format!(
            "{}, {} joints with {}, {} frames at {:.2} a second{}, {}{}, {:?} up{}, {:.2} m tall",
            self.format,
            self.joints,
            self.naming,
            self.frames,
            self.fps,
            guessed("rate"),
            self.units,
            guessed("units"),
            self.up,
            guessed("up"),
            self.height_m
        );
        for note in &self.notes {
            line.push_str("; ");
            line.push_str(note);
        }
        line
    }
}

/// Whether a file is a foreign motion by its name.
pub fn is_motion_file(path: &Path) -> bool {
    path.extension().is_some_and(|e| EXTENSIONS.iter().any(|known| e.eq_ignore_ascii_case(known)))
}

/// What a format's reader gives, in the file's units and axes.
struct Raw {
    format: &'static str,
    motion: ForeignMotion,
    metres: Option<f64>,
    up: Option<UpAxis>,
    skeleton: Option<String>,
    rate_guessed: bool,
}

/// Reads a motion by the end of its name: `.bvh`, `.amc` (with its `.asf`) or `.npz` (AMASS).
///
/// # Errors
/// Names the file, the place in it, and what is wrong.
pub fn read_motion(path: &Path, config: &MotionConfig) -> Result<ReadMotion> {
    check(path, config)?;
    understand(path, read_raw(path, config)?, config)
}

/// The same of a BVH file that lies in memory; `name` stands in messages.
///
/// # Errors
/// As [`read_motion`].
pub fn read_bvh_bytes(name: &Path, bytes: &[u8], config: &MotionConfig) -> Result<ReadMotion> {
    check(name, config)?;
    let limit = config.limits.file_bytes;
    if bytes.len() as u64 > limit {
        return Err(ImportError::file(name, format!("more than {limit} bytes")));
    }
    let motion = parse_bvh(name, bytes, config)?;
    let (metres, up, skeleton) = (None, None, None);
    understand(name, Raw { format: "BVH", motion, metres, up, skeleton, rate_guessed: false }, config)
}

fn check(path: &Path, config: &MotionConfig) -> Result<()> {
    if let Some(fps) = config.fps.filter(|fps| !RATES.contains(fps)) {
        let reason = format!("a rate of {fps} frames a second; state {} to {}", RATES.start(), RATES.end());
        return Err(ImportError::file(path, reason));
    }
    if let Some(units) = config.units_m.filter(|u| !(*u >= 1e-6 && *u <= 1e3)) {
        return Err(ImportError::file(path, format!("a unit of {units} m is none; state --units")));
    }
    Ok(())
}

fn understand(path: &Path, mut raw: Raw, config: &MotionConfig) -> Result<ReadMotion> {
    let mut notes = Vec::new();
    if cmu_wrists::mend(&mut raw.motion) {
        notes.push("wrists put right, whose axes these files exchange".to_owned());
    }
    if raw.motion.len() > 3 && begins_with_reference(&raw.motion) {
        raw.motion.drop_first();
        notes.push("the first frame, a reference pose, left out".to_owned());
    }
    resolve(path, raw, notes, config)
}

fn read_raw(path: &Path, config: &MotionConfig) -> Result<Raw> {
    let extension = path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    let (metres, up, skeleton, rate_guessed) = (None, None, None, false);
    match extension.as_str() {
        "bvh" => {
            let motion = read_bvh(path, config)?;
            Ok(Raw { format: "BVH", motion, metres, up, skeleton, rate_guessed })
        }
        "amc" => {
            let read = read_amc(path, config)?;
            let name = read.skeleton.file_name().map(|n| n.to_string_lossy().into_owned());
            let rate_guessed = !read.rate_stated;
            Ok(Raw { format: "ASF/AMC", motion: read.motion, metres: read.metres, up, skeleton: name, rate_guessed })
        }
        "npz" => {
            let motion = read_amass(path, config)?;
            Ok(Raw { format: "AMASS", motion, metres: Some(1.0), up: Some(UpAxis::Z), skeleton, rate_guessed })
        }
        _ => Err(ImportError::file(path, "it is no motion that is read (.bvh, .amc, or .npz of AMASS)")),
    }
}

fn resolve(path: &Path, raw: Raw, notes: Vec<String>, config: &MotionConfig) -> Result<ReadMotion> {
    let Raw { format, mut motion, metres, up, skeleton, rate_guessed } = raw;
    let refuse = |reason| ImportError::file(path, reason);
    let person = Person::find(&motion.skeleton).map_err(refuse)?;
    let mut guessed = Vec::new();
    let rest = motion.skeleton.rest();
    let height = person.height(&motion.skeleton, &rest);
    let metres_per_unit = match config.units_m.or(metres) {
        Some(metres) => metres,
        None => {
            guessed.push("units");
            guess_units(height).map_err(refuse)?.metres()
        }
    };
    if !(height * metres_per_unit > 0.3 && height * metres_per_unit < 5.0) {
        let height = height * metres_per_unit;
        return Err(refuse(format!("its skeleton would be {height:.3} m tall, which is no person; state --units")));
    }
    let up = config.up.or(up).unwrap_or_else(|| {
        guessed.push("up");
        guess_up(&motion, &person)
    });
    if rate_guessed {
        guessed.push("rate");
    }
    motion.scale(metres_per_unit);
    motion.turn(up.y_up_from_this());
    let units = MotionUnits::ALL.into_iter().find(|u| (u.metres() / metres_per_unit - 1.0).abs() < 1e-6);
    let facts = MotionFacts {
        format,
        joints: motion.skeleton.len(),
        frames: motion.len(),
        fps: motion.fps,
        units: units.map_or_else(|| format!("units of {metres_per_unit} m"), |u| u.words().to_owned()),
        metres_per_unit,
        up,
        height_m: height * metres_per_unit,
        naming: person.naming.words(),
        skeleton,
        guessed,
        notes,
    };
    Ok(ReadMotion { motion, person, facts })
}

/// Whether the first frame is another pose than the motion begins with.
fn begins_with_reference(motion: &ForeignMotion) -> bool {
    let joints = motion.skeleton.len();
    let jump = |t: usize| {
        let (a, b) = (&motion.rotations[t * joints..], &motion.rotations[(t + 1) * joints..]);
        (0..joints).map(|j| axis_angle(a[j].inverse() * b[j]).length()).fold(0.0, f64::max)
    };
    let usual = jump(1).max(jump(2));
    let (least, times) = REFERENCE_JUMP;
    jump(0) > least && jump(0) > times * usual
}

/// A rate that a file states, without the rounding of its last digits; `None` where it is no rate.
pub(super) fn snapped_rate(fps: f64) -> Option<f64> {
    if !RATES.contains(&fps) {
        return None;
    }
    let whole = fps.round();
    Some(if (fps - whole).abs() <= ROUNDED * fps { whole } else { fps })
}
