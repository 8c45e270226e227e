//! Acclaim's motions (AMC), on an ASF skeleton.

use super::asf::{Acclaim, Freedom, read_asf};
use super::foreign::{ForeignMotion, check_size};
use super::text::{Text, excerpt, number};
use super::{MotionConfig, MotionLimits};
use crate::{ImportError, Result};
use glam::{DQuat, DVec3};
use softtissue_store::{StoreError, read_limited};
use std::path::{Path, PathBuf};

/// The format states no rate; CMU's files have this one.
const CMU_FPS: f64 = 120.0;

/// What an AMC file and its skeleton give.
pub(super) struct AcclaimMotion {
    pub motion: ForeignMotion,
    /// Metres of a unit, where the skeleton tells.
    pub metres: Option<f64>,
    /// The skeleton's file.
    pub skeleton: PathBuf,
    /// Whether the rate was stated by the user.
    pub rate_stated: bool,
}

/// Reads an AMC file on its skeleton, in their units and axes.
///
/// # Errors
/// Names the line and what is wrong with it.
pub(super) fn read_amc(path: &Path, config: &MotionConfig) -> Result<AcclaimMotion> {
    let skeleton = match &config.skeleton {
        Some(path) => path.clone(),
        None => skeleton_beside(path)?,
    };
    let acclaim = read_asf(&skeleton, &config.limits)?;
    let bytes = read_limited(path, config.limits.file_bytes)?;
    let content = String::from_utf8_lossy(&bytes);
    let mut reader = Reader::new(Text::new(path, &content), &acclaim);
    reader.frames(&config.limits)?;
    let Reader { text, rotations, positions, frames, .. } = reader;
    check_size(acclaim.skeleton.len(), frames, &config.limits).map_err(|e| text.file_error(e))?;
    let fps = config.fps.unwrap_or(CMU_FPS);
    let motion = ForeignMotion { skeleton: acclaim.skeleton, fps, rotations, moving: vec![0], positions };
    Ok(AcclaimMotion { motion, metres: acclaim.metres, skeleton, rate_stated: config.fps.is_some() })
}

/// `01.asf` beside `01_01.amc`, or the only skeleton in the folder.
fn skeleton_beside(path: &Path) -> Result<PathBuf> {
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let entries = std::fs::read_dir(folder).map_err(|e| StoreError::io("read", folder, e))?;
    let is_asf = |p: &PathBuf| p.extension().is_some_and(|e| e.eq_ignore_ascii_case("asf"));
    let mut found: Vec<PathBuf> = entries.flatten().map(|e| e.path()).filter(is_asf).collect();
    found.sort();
    let subject = path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
    let subject = subject.split('_').next().unwrap_or_default();
    let own = found.iter().position(|p| p.file_stem().is_some_and(|s| s.to_string_lossy() == subject));
    match (own, found.len()) {
        (Some(at), _) => Ok(found.swap_remove(at)),
        (None, 1) => Ok(found.swap_remove(0)),
        (None, n) => {
            let reason = format!("its skeleton is not known, {n} .asf files lie beside it; name it by --skeleton");
            Err(ImportError::file(path, reason))
        }
    }
}

struct Reader<'a> {
    text: Text<'a>,
    acclaim: &'a Acclaim,
    degrees: bool,
    rotations: Vec<DQuat>,
    positions: Vec<DVec3>,
    /// Frames that are complete or begun.
    frames: u64,
    /// Which joints the frame has.
    seen: Vec<bool>,
}

impl<'a> Reader<'a> {
    fn new(text: Text<'a>, acclaim: &'a Acclaim) -> Self {
        let seen = vec![false; acclaim.skeleton.len()];
        Self { text, acclaim, degrees: true, rotations: Vec::new(), positions: Vec::new(), frames: 0, seen }
    }

    fn frames(&mut self, limits: &MotionLimits) -> Result<()> {
        let mut number: Option<u64> = None;
        while let Some(line) = self.text.next_line() {
            match line.as_bytes()[0] {
                b'#' => {}
                b':' => self.degrees = !line.eq_ignore_ascii_case(":RADIANS") && self.degrees,
                b'0'..=b'9' => {
                    self.finish_frame()?;
                    let next = line
                        .parse()
                        .map_err(|_| self.text.error(format!("{:?} is no frame number and no bone", excerpt(line))))?;
                    if let Some(last) = number.filter(|last| last.checked_add(1) != Some(next)) {
                        let reason = format!("frame {next} follows frame {last}; export the motion again");
                        return Err(self.text.error(reason));
                    }
                    number = Some(next);
                    self.begin_frame(limits)?;
                }
                _ if number.is_none() => {
                    return Err(self.text.file_error("it does not begin with a frame number; is it an AMC file?"));
                }
                _ => self.bone(line)?,
            }
        }
        self.finish_frame()
    }

    fn begin_frame(&mut self, limits: &MotionLimits) -> Result<()> {
        self.frames += 1;
        let joints = self.acclaim.skeleton.len();
        if self.frames > limits.frames as u64 || self.frames * joints as u64 > limits.rotations as u64 {
            return Err(self
                .text
                .error(format!("more than the {} frames that are read; cut the clip", self.frames - 1)));
        }
        self.rotations.resize(self.rotations.len() + joints, DQuat::IDENTITY);
        self.positions.push(DVec3::ZERO);
        self.seen.fill(false);
        Ok(())
    }

    /// A bone without freedom has no line; every other must be there.
    fn finish_frame(&mut self) -> Result<()> {
        let missing = |j: &usize| !self.seen[*j] && !self.acclaim.degrees_of_freedom[*j].is_empty();
        match (0..self.seen.len()).find(missing) {
            Some(j) if self.frames > 0 => {
                let name = &self.acclaim.skeleton.names[j];
                Err(self.text.error(format!("the frame that ends here has no {name}; export the motion again")))
            }
            _ => Ok(()),
        }
    }

    fn bone(&mut self, line: &str) -> Result<()> {
        let mut words = line.split_ascii_whitespace();
        let name = words.next().unwrap_or_default();
        let Some(&joint) = self.acclaim.by_name.get(name) else {
            return Err(self.text.error(format!("the skeleton has no bone {:?}; is it of this file?", excerpt(name))));
        };
        if std::mem::replace(&mut self.seen[joint], true) {
            return Err(self.text.error(format!("{name} stands twice in one frame")));
        }
        let freedoms = &self.acclaim.degrees_of_freedom[joint];
        let (mut turn, mut along) = (DQuat::IDENTITY, DVec3::ZERO);
        for freedom in freedoms {
            let word =
                words.next().ok_or_else(|| self.text.error(format!("{name} needs {} numbers", freedoms.len())))?;
            let x = number(word).map_err(|e| self.text.error(e))?;
            match freedom {
                Freedom::Along(axis) => along[*axis] = x,
                Freedom::About(axis) => {
                    let angle = if self.degrees { x.to_radians() } else { x };
                    turn = DQuat::from_axis_angle(DVec3::AXES[*axis], angle) * turn;
                }
            }
        }
        if words.next().is_some() {
            return Err(self.text.error(format!("{name} has more than {} numbers", freedoms.len())));
        }
        let axes = self.acclaim.axes[joint];
        let frame = self.rotations.len() - self.seen.len();
        self.rotations[frame + joint] = axes * turn * axes.inverse();
        if joint == 0 {
            let last = self.positions.len() - 1;
            self.positions[last] = along;
        }
        Ok(())
    }
}
