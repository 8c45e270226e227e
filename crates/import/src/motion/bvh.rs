//! Biovision's BVH, of any channel order.
//!
//! Source: M. Meredith, S. Maddock, "Motion Capture File Formats Explained", University of Sheffield 2001. A position
//! channel stands in place of the joint's offset, as most programs write and read it.

use super::foreign::{ForeignMotion, ForeignSkeleton, check_size};
use super::text::{Text, excerpt, number};
use super::{MotionConfig, MotionLimits, snapped_rate};
use crate::Result;
use glam::{DQuat, DVec3};
use softtissue_store::read_limited;
use std::path::Path;

/// One number of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Channel {
    Position(usize),
    Rotation(usize),
}

/// What the text between HIERARCHY and MOTION says.
#[derive(Default)]
struct Hierarchy {
    skeleton: ForeignSkeleton,
    /// `[J]` channels in the order of the file.
    channels: Vec<Vec<Channel>>,
}

/// A brace that is open.
#[derive(Clone, Copy)]
enum Block {
    Joint(usize),
    End(usize),
}

/// Reads a BVH file, in the file's units and axes.
///
/// # Errors
/// Names the line and what is wrong with it.
pub fn read_bvh(path: &Path, config: &MotionConfig) -> Result<ForeignMotion> {
    parse_bvh(path, &read_limited(path, config.limits.file_bytes)?, config)
}

/// The same of a file's bytes; `name` stands in messages.
pub(super) fn parse_bvh(name: &Path, bytes: &[u8], config: &MotionConfig) -> Result<ForeignMotion> {
    let content = String::from_utf8_lossy(bytes);
    let mut text = Text::new(name, &content);
    let hierarchy = Hierarchy::read(&mut text, &config.limits)?;
    frames(&mut text, hierarchy, config)
}

impl Hierarchy {
    fn read(text: &mut Text, limits: &MotionLimits) -> Result<Self> {
        if !text.next_line().is_some_and(|l| l.eq_ignore_ascii_case("HIERARCHY")) {
            return Err(text.file_error("it does not begin with HIERARCHY; is it a BVH file?"));
        }
        let mut hierarchy = Self::default();
        let mut open: Vec<Block> = Vec::new();
        let mut waiting: Option<Block> = None;
        loop {
            let Some(line) = text.next_line() else {
                return Err(text.file_error("it has no MOTION part; export it again"));
            };
            // A brace may stand behind a name.
            let (line, brace) = match line.strip_suffix('{') {
                Some(rest) => (rest.trim_end(), true),
                None => (line, false),
            };
            if let Some(block) = waiting.take() {
                if !(brace && line.is_empty()) {
                    return Err(text.error("a { is missing before this line"));
                }
                open.push(block);
                continue;
            }
            let (keyword, rest) = line.split_once(|c: char| c.is_ascii_whitespace()).unwrap_or((line, ""));
            let opens = match keyword.to_ascii_uppercase().as_str() {
                "" => None,
                "ROOT" | "JOINT" => Some(hierarchy.joint(text, keyword, rest.trim(), &open, limits)?),
                "END" => match open.last() {
                    Some(Block::Joint(j)) => Some(Block::End(*j)),
                    _ => return Err(text.error("an End Site outside of a joint")),
                },
                "OFFSET" => {
                    let [x, y, z] = text.numbers(rest)?;
                    hierarchy.offset(open.last(), DVec3::new(x, y, z)).map_err(|e| text.error(e))?;
                    None
                }
                "CHANNELS" => {
                    hierarchy.channels(open.last(), rest).map_err(|e| text.error(e))?;
                    None
                }
                "}" => {
                    open.pop().ok_or_else(|| text.error("a } without its {"))?;
                    None
                }
                "MOTION" if open.is_empty() => break,
                "MOTION" => return Err(text.error(format!("MOTION comes before {} braces are closed", open.len()))),
                _ => return Err(text.error(format!("{:?} is no part of a skeleton", excerpt(keyword)))),
            };
            match (opens, brace) {
                (Some(block), true) => open.push(block),
                (Some(block), false) => waiting = Some(block),
                (None, true) => return Err(text.error("a { without a joint")),
                (None, false) => {}
            }
        }
        if hierarchy.skeleton.is_empty() {
            return Err(text.error("the skeleton has no joint"));
        }
        Ok(hierarchy)
    }

    fn joint(
        &mut self,
        text: &Text,
        keyword: &str,
        name: &str,
        open: &[Block],
        limits: &MotionLimits,
    ) -> Result<Block> {
        let parent = match (open.last(), keyword.eq_ignore_ascii_case("ROOT")) {
            (None, true) if self.skeleton.is_empty() => None,
            (None, true) => return Err(text.error("a second ROOT: two people in one file; split it")),
            (Some(Block::Joint(parent)), false) => Some(*parent),
            _ => return Err(text.error(format!("{keyword} at a place where none may stand"))),
        };
        if name.is_empty() {
            return Err(text.error("a joint without a name"));
        }
        if self.skeleton.names.iter().any(|n| n == name) {
            return Err(text.error(format!("the joint {:?} stands twice; rename one", excerpt(name))));
        }
        if self.skeleton.len() == limits.joints {
            return Err(text.error(format!("more than {} joints", limits.joints)));
        }
        self.channels.push(Vec::new());
        Ok(Block::Joint(self.skeleton.push(excerpt(name), parent, DVec3::ZERO)))
    }

    fn offset(&mut self, block: Option<&Block>, offset: DVec3) -> std::result::Result<(), String> {
        match block {
            Some(Block::Joint(j)) => self.skeleton.offsets[*j] = offset,
            Some(Block::End(j)) => self.skeleton.ends[*j] = Some(offset),
            None => return Err("an OFFSET outside of a joint".into()),
        }
        Ok(())
    }

    fn channels(&mut self, block: Option<&Block>, rest: &str) -> std::result::Result<(), String> {
        let Some(Block::Joint(joint)) = block else { return Err("CHANNELS outside of a joint".into()) };
        let mut words = rest.split_ascii_whitespace();
        let count: usize =
            words.next().and_then(|w| w.parse().ok()).ok_or("CHANNELS is followed by their number and their names")?;
        let mut channels = Vec::new();
        for word in words {
            let axis = match word.as_bytes()[0].to_ascii_uppercase() {
                axis @ b'X'..=b'Z' => usize::from(axis - b'X'),
                _ => return Err(format!("{:?} is no channel", excerpt(word))),
            };
            let channel = match word[1..].to_ascii_lowercase().as_str() {
                "position" => Channel::Position(axis),
                "rotation" => Channel::Rotation(axis),
                _ => return Err(format!("{:?} is no channel", excerpt(word))),
            };
            if channels.contains(&channel) {
                return Err(format!("the channel {word} stands twice"));
            }
            channels.push(channel);
        }
        if channels.len() != count {
            return Err(format!("{count} channels are announced and {} named", channels.len()));
        }
        self.channels[*joint] = channels;
        Ok(())
    }
}

/// What follows a keyword with its colon, whatever the spaces.
fn value<'a>(line: &'a str, keyword: &str) -> Option<&'a str> {
    let head = line.get(..keyword.len())?;
    head.eq_ignore_ascii_case(keyword).then(|| line[keyword.len()..].trim())
}

fn frames(text: &mut Text, hierarchy: Hierarchy, config: &MotionConfig) -> Result<ForeignMotion> {
    let Hierarchy { skeleton, channels } = hierarchy;
    let stated = text.next_line().and_then(|l| value(l, "Frames:"));
    let stated = stated.ok_or_else(|| text.error("`Frames:` with their number is expected here"))?;
    let stated: u64 =
        stated.parse().map_err(|_| text.error(format!("{:?} is no number of frames", excerpt(stated))))?;
    check_size(skeleton.len(), stated, &config.limits).map_err(|e| text.error(e))?;
    let seconds = text.next_line().and_then(|l| value(l, "Frame Time:"));
    let seconds = seconds.ok_or_else(|| text.error("`Frame Time:` in seconds is expected here"))?;
    let fps = config.fps.or_else(|| snapped_rate(1.0 / number(seconds).ok()?)).ok_or_else(|| {
        text.error(format!("a frame time of {:?} s; correct it, or state --source-fps", excerpt(seconds)))
    })?;
    let moves = |j: &usize| channels[*j].iter().any(|c| matches!(c, Channel::Position(_)));
    let mut motion = ForeignMotion { fps, moving: (0..skeleton.len()).filter(moves).collect(), ..Default::default() };
    let width: usize = channels.iter().map(Vec::len).sum();
    let mut row = Vec::with_capacity(width);
    for frame in 0..stated {
        let Some(line) = text.next_line() else {
            return Err(text.error(format!("{stated} frames are stated, but the file ends after {frame}")));
        };
        fill(&mut row, line, width).map_err(|e| text.error(e))?;
        push_frame(&mut motion, &skeleton, &channels, &row);
    }
    if text.next_line().is_some() {
        return Err(text.error(format!("this line follows the {stated} frames that are stated; correct `Frames:`")));
    }
    motion.skeleton = skeleton;
    Ok(motion)
}

fn fill(row: &mut Vec<f64>, line: &str, width: usize) -> std::result::Result<(), String> {
    row.clear();
    for word in line.split_ascii_whitespace() {
        if row.len() == width {
            return Err(format!("more than {width} numbers, but the skeleton has {width} channels"));
        }
        row.push(number(word)?);
    }
    if row.len() < width {
        return Err(format!("{} numbers, but the skeleton has {width} channels", row.len()));
    }
    Ok(())
}

fn push_frame(motion: &mut ForeignMotion, skeleton: &ForeignSkeleton, channels: &[Vec<Channel>], row: &[f64]) {
    let mut values = row.iter();
    for (j, channels) in channels.iter().enumerate() {
        let (mut turn, mut at, mut moves) = (DQuat::IDENTITY, skeleton.offsets[j], false);
        for (channel, value) in channels.iter().zip(values.by_ref()) {
            match channel {
                Channel::Position(axis) => (at[*axis], moves) = (*value, true),
                Channel::Rotation(axis) => {
                    turn *= DQuat::from_axis_angle(DVec3::AXES[*axis], value.to_radians());
                }
            }
        }
        motion.rotations.push(turn);
        if moves {
            motion.positions.push(at);
        }
    }
}
