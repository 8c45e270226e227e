//! Acclaim's skeletons (ASF).
//!
//! Source: J. Lander, "Working with Motion Capture File Formats", Game Developer, January 1998. A bone turns about its
//! start, in axes of its own: `parent_from_rest = C M C^-1` with the bone's `axis` C and the frame's angles M. Here it
//! becomes a joint at the end of its parent bone.

use super::MotionLimits;
use super::foreign::ForeignSkeleton;
use super::text::{Text, excerpt};
use crate::Result;
use glam::{DQuat, DVec3};
use softtissue_store::read_limited;
use std::collections::HashMap;
use std::path::Path;

/// Metres of a unit in a file that says `length 1`: an inch.
const INCH_M: f64 = 0.0254;
/// What `length` says in the files of CMU, whose unit is known.
const CMU_LENGTH: f64 = 0.45;

/// An Acclaim skeleton as motions in its terms need it.
#[derive(Debug)]
pub(super) struct Acclaim {
    pub skeleton: ForeignSkeleton,
    /// `[J]` axes in which the joint's angles are meant.
    pub axes: Vec<DQuat>,
    /// `[J]` what the numbers of a frame are, the root first.
    pub degrees_of_freedom: Vec<Vec<Freedom>>,
    /// Joint by the bone's name.
    pub by_name: HashMap<String, usize>,
    /// Metres of a unit, where the file tells.
    pub metres: Option<f64>,
}

/// One number of a bone in a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Freedom {
    /// Along an axis; the root alone.
    Along(usize),
    /// About an axis.
    About(usize),
}

#[derive(Default)]
struct Bone {
    name: String,
    direction: DVec3,
    length: f64,
    axis: Option<DQuat>,
    freedoms: Vec<Freedom>,
}

struct Reader<'a> {
    text: Text<'a>,
    degrees: bool,
    length: f64,
    root: Bone,
    bones: Vec<Bone>,
    parents: HashMap<String, String>,
}

/// Reads an ASF file, in its units and axes.
///
/// # Errors
/// Names the line and what is wrong with it.
pub(super) fn read_asf(path: &Path, limits: &MotionLimits) -> Result<Acclaim> {
    let bytes = read_limited(path, limits.file_bytes)?;
    let content = String::from_utf8_lossy(&bytes);
    let root = Bone { name: "root".into(), ..Bone::default() };
    let (bones, parents) = (Vec::new(), HashMap::new());
    let mut reader = Reader { text: Text::new(path, &content), degrees: true, length: 1.0, root, bones, parents };
    reader.sections(limits)?;
    reader.skeleton()
}

impl Reader<'_> {
    fn sections(&mut self, limits: &MotionLimits) -> Result<()> {
        let mut section = String::new();
        while let Some(line) = self.text.next_line() {
            if line.starts_with('#') {
                continue;
            }
            let (word, rest) = line.split_once(|c: char| c.is_ascii_whitespace()).unwrap_or((line, ""));
            if let Some(name) = word.strip_prefix(':') {
                section = name.to_ascii_lowercase();
                continue;
            }
            match section.as_str() {
                "units" => self.unit(word, rest)?,
                "root" => self.root(word, rest)?,
                "bonedata" => self.bone(word, rest, limits)?,
                "hierarchy" => self.children(word, rest)?,
                "" => return Err(self.text.file_error("it does not begin with a :section; is it an ASF file?")),
                _ => {}
            }
        }
        Ok(())
    }

    fn unit(&mut self, word: &str, rest: &str) -> Result<()> {
        match word {
            "angle" => self.degrees = !rest.trim().to_ascii_lowercase().starts_with("rad"),
            "length" => {
                [self.length] = self.text.numbers(rest)?;
                if self.length <= 0.0 {
                    return Err(self.text.error("a unit of length must be above 0"));
                }
            }
            _ => {}
        }
        Ok(())
    }

    fn root(&mut self, word: &str, rest: &str) -> Result<()> {
        match word {
            "order" => self.root.freedoms = self.freedoms(rest)?,
            "orientation" => {
                let angles = self.text.numbers(rest)?;
                self.root.axis = Some(self.turn(angles, "XYZ")?);
            }
            _ => {}
        }
        Ok(())
    }

    fn bone(&mut self, word: &str, rest: &str, limits: &MotionLimits) -> Result<()> {
        if word == "begin" {
            if self.bones.len() + 1 == limits.joints {
                return Err(self.text.error(format!("more than {} bones", limits.joints)));
            }
            self.bones.push(Bone::default());
            return Ok(());
        }
        if self.bones.is_empty() {
            return Err(self.text.error("a bone's data before its `begin`"));
        }
        let mut bone = self.bones.pop().unwrap_or_default();
        match word {
            "name" => bone.name = excerpt(rest.trim()),
            "direction" => bone.direction = DVec3::from_array(self.text.numbers(rest)?),
            "length" => [bone.length] = self.text.numbers(rest)?,
            "axis" => {
                let words: Vec<&str> = rest.split_ascii_whitespace().collect();
                let (order, angles) = words.split_last().ok_or_else(|| self.text.error("an axis without angles"))?;
                bone.axis = Some(self.turn(self.text.numbers(&angles.join(" "))?, order)?);
            }
            "dof" => bone.freedoms = self.freedoms(rest)?,
            _ => {}
        }
        if bone.freedoms.iter().any(|f| matches!(f, Freedom::Along(_))) {
            return Err(self.text.error("a bone that moves along an axis, which is not read; bake it to rotations"));
        }
        self.bones.push(bone);
        Ok(())
    }

    fn children(&mut self, word: &str, rest: &str) -> Result<()> {
        if matches!(word, "begin" | "end") {
            return Ok(());
        }
        for child in rest.split_ascii_whitespace() {
            if self.parents.insert(excerpt(child), excerpt(word)).is_some() {
                return Err(self.text.error(format!("{:?} has a second parent", excerpt(child))));
            }
        }
        Ok(())
    }

    fn freedoms(&self, words: &str) -> Result<Vec<Freedom>> {
        let mut found = Vec::new();
        for word in words.split_ascii_whitespace() {
            let freedom = match word.to_ascii_lowercase().as_str() {
                "rx" => Freedom::About(0),
                "ry" => Freedom::About(1),
                "rz" => Freedom::About(2),
                "tx" => Freedom::Along(0),
                "ty" => Freedom::Along(1),
                "tz" => Freedom::Along(2),
                _ => return Err(self.text.error(format!("{:?} is no degree of freedom that is read", excerpt(word)))),
            };
            if found.contains(&freedom) {
                return Err(self.text.error(format!("the degree of freedom {word} stands twice")));
            }
            found.push(freedom);
        }
        Ok(found)
    }

    /// Rotations about fixed axes, in the order that is named.
    fn turn(&self, angles: [f64; 3], order: &str) -> Result<DQuat> {
        let mut turn = DQuat::IDENTITY;
        for (axis, angle) in order.bytes().zip(angles) {
            let axis = match axis.to_ascii_uppercase() {
                axis @ b'X'..=b'Z' => usize::from(axis - b'X'),
                _ => return Err(self.text.error(format!("{:?} is no order of axes", excerpt(order)))),
            };
            turn = DQuat::from_axis_angle(DVec3::AXES[axis], self.radians(angle)) * turn;
        }
        Ok(turn)
    }

    fn radians(&self, angle: f64) -> f64 {
        if self.degrees { angle.to_radians() } else { angle }
    }

    /// Joints from bones, parents first.
    fn skeleton(self) -> Result<Acclaim> {
        let Self { text, root, bones, parents, length, .. } = self;
        if bones.is_empty() {
            return Err(text.file_error("it has no bone (:bonedata); is it an ASF file?"));
        }
        let mut found = Acclaim {
            skeleton: ForeignSkeleton::default(),
            axes: vec![root.axis.unwrap_or_default()],
            degrees_of_freedom: vec![root.freedoms],
            by_name: HashMap::from([(root.name.clone(), 0)]),
            metres: (length == CMU_LENGTH).then_some(INCH_M / length),
        };
        found.skeleton.push(root.name, None, DVec3::ZERO);
        // The bone of each joint, from the joint; nothing for the root.
        let mut spans = vec![DVec3::ZERO];
        let mut left = bones;
        loop {
            let before = left.len();
            let mut waiting = Vec::new();
            for bone in left {
                let Some(parent) = parents.get(&bone.name) else {
                    return Err(text.file_error(format!("the bone {:?} is missing in :hierarchy", bone.name)));
                };
                let Some(&parent) = found.by_name.get(parent) else {
                    waiting.push(bone);
                    continue;
                };
                let span = bone.direction.normalize_or_zero() * bone.length;
                let joint = found.skeleton.push(bone.name.clone(), Some(parent), spans[parent]);
                spans.push(span);
                found.axes.push(bone.axis.unwrap_or_default());
                found.degrees_of_freedom.push(bone.freedoms);
                if found.by_name.insert(bone.name.clone(), joint).is_some() {
                    return Err(text.file_error(format!("the bone {:?} stands twice; rename one", bone.name)));
                }
            }
            left = waiting;
            if left.is_empty() {
                break;
            }
            if left.len() == before {
                return Err(
                    text.file_error(format!("the bone {:?} hangs on none that leads to the root", left[0].name))
                );
            }
        }
        for joint in 1..found.skeleton.len() {
            if !found.skeleton.parents.contains(&Some(joint)) {
                found.skeleton.ends[joint] = Some(spans[joint]);
            }
        }
        Ok(found)
    }
}
