//! Which joint of a foreign skeleton is what of a person.
//!
//! Files of one person differ in names only, and the same name means different joints: in the 3dsMax-friendly files of
//! CMU `LeftShoulder` is the upper arm and `Neck` the second joint of the neck, in the MotionBuilder-friendly ones the
//! collar bone and the first. Limbs are told by names and by what else the side has; the trunk by how it branches.

use super::foreign::{ForeignPose, ForeignSkeleton};
use glam::DVec3;

/// Joints of a person in a foreign skeleton. Pairs are (left, right).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Person {
    /// Which names the file uses.
    pub naming: Naming,
    /// Where the legs meet.
    pub pelvis: usize,
    /// From above the pelvis to where the arms branch off, that one included.
    pub spine: Vec<usize>,
    /// Between the arms' branch and the head.
    pub neck: Vec<usize>,
    /// Head.
    pub head: Option<usize>,
    /// Legs.
    pub legs: [Leg; 2],
    /// Arms.
    pub arms: [Arm; 2],
}

/// Joints of a leg.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Leg {
    /// Turns the thigh.
    pub hip: usize,
    /// Turns the shank.
    pub knee: usize,
    /// Turns the foot.
    pub ankle: usize,
    /// Turns the toes.
    pub toe: Option<usize>,
}

/// Joints of an arm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Arm {
    /// Turns the collar bone.
    pub collar: Option<usize>,
    /// Turns the upper arm.
    pub shoulder: usize,
    /// Turns the forearm.
    pub elbow: usize,
    /// Turns the hand.
    pub wrist: Option<usize>,
}

/// Families of names, for what is said of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Naming {
    /// `LeftHip`, `LeftCollar`, `LeftShoulder`: Biovision's, and CMU's 3dsMax-friendly files.
    Biovision,
    /// `LeftUpLeg`, `LeftShoulder`, `LeftArm`: MotionBuilder's, Mixamo's, and CMU's MotionBuilder-friendly files.
    MotionBuilder,
    /// `lThigh`, `lCollar`, `lShldr`: Poser's and Daz's, and CMU's Daz-friendly files.
    Daz,
    /// `lfemur`, `lhumerus`: Acclaim's.
    Acclaim,
    /// Others that are understood.
    Other,
}

impl Naming {
    /// In words.
    pub fn words(self) -> &'static str {
        match self {
            Self::Biovision => "Biovision names (CMU's 3dsMax-friendly files)",
            Self::MotionBuilder => "MotionBuilder names",
            Self::Daz => "Daz names",
            Self::Acclaim => "Acclaim names",
            Self::Other => "names of its own",
        }
    }
}

const THIGH: &[&str] = &["femur", "upleg", "upperleg", "thigh", "thighbend", "hip"];
const SHANK: &[&str] = &["tibia", "leg", "lowleg", "lowerleg", "shin", "calf", "knee"];
const ANKLE: &[&str] = &["ankle", "foot"];
const TOE: &[&str] = &["toe", "toes", "ball", "foot"];
const COLLAR: &[&str] = &["clavicle", "collar", "collarbone", "shoulder"];
const UPPER_ARM: &[&str] = &["humerus", "arm", "uparm", "upperarm", "shldr", "shldrbend", "shoulder"];
const FOREARM: &[&str] = &["radius", "forearm", "forearmbend", "lowarm", "lowerarm", "elbow"];
const WRIST: &[&str] = &["wrist"];
const HAND: &[&str] = &["hand"];
const SIDES: [&str; 2] = ["left", "right"];

impl Person {
    /// Finds a person's joints by name and structure.
    ///
    /// # Errors
    /// Says which joint is not found.
    pub fn find(skeleton: &ForeignSkeleton) -> Result<Self, String> {
        let names: Vec<(Option<usize>, String)> = skeleton.names.iter().map(|n| sided(n)).collect();
        let sides = [0, 1].map(|side| Side { skeleton, names: &names, side });
        let [left, right] = sides;
        let legs = [left.leg()?, right.leg()?];
        let arms = [left.arm()?, right.arm()?];
        let pelvis = skeleton.common_ancestor(legs[0].hip, legs[1].hip);
        let chest = skeleton.common_ancestor(arms[0].shoulder, arms[1].shoulder);
        let spine = skeleton.path_down(skeleton.common_ancestor(pelvis, chest), chest);
        let head = names.iter().position(|(side, name)| side.is_none() && name == "head");
        let mut neck = head.map_or_else(Vec::new, |head| skeleton.path_down(chest, head));
        neck.pop();
        let has = |wanted: &str| names.iter().any(|(side, name)| side.is_some() && name == wanted);
        let naming = if has("femur") && has("humerus") {
            Naming::Acclaim
        } else if has("upleg") && has("arm") {
            Naming::MotionBuilder
        } else if has("shldr") || has("shldrbend") {
            Naming::Daz
        } else if has("hip") && has("collar") && has("shoulder") {
            Naming::Biovision
        } else {
            Naming::Other
        };
        Ok(Self { naming, pelvis, spine, neck, head, legs, arms })
    }

    /// Thigh and shank, mean over the sides, in the file's unit.
    pub fn leg_length(&self, pose: &ForeignPose) -> f64 {
        let at = &pose.positions;
        let length = |l: &Leg| at[l.hip].distance(at[l.knee]) + at[l.knee].distance(at[l.ankle]);
        0.5 * self.legs.iter().map(length).sum::<f64>()
    }

    /// From the soles of stretched legs to the top of a stretched trunk, in the file's unit.
    pub fn height(&self, skeleton: &ForeignSkeleton, pose: &ForeignPose) -> f64 {
        let at = &pose.positions;
        let mut joints = vec![];
        joints.extend(&self.spine);
        joints.extend(&self.neck);
        joints.extend(&self.head);
        let mut from = self.hips(pose);
        let mut trunk = 0.0;
        for j in &joints {
            trunk += from.distance(at[*j]);
            from = at[*j];
        }
        let top = joints.last().and_then(|j| self.tip(skeleton, *j)).map_or(0.0, DVec3::length);
        // what lies below the ankle is not told by every file
        self.leg_length(pose) * 1.09 + trunk + top
    }

    /// Where a bone ends: the first thing below the joint that is not at the joint itself.
    pub fn tip(&self, skeleton: &ForeignSkeleton, joint: usize) -> Option<DVec3> {
        let mut at = joint;
        loop {
            match skeleton.parents.iter().position(|p| *p == Some(at)) {
                Some(child) if skeleton.offsets[child].length() > 1e-9 => return Some(skeleton.offsets[child]),
                Some(child) => at = child,
                None => return skeleton.ends[at].filter(|e| e.length() > 1e-9),
            }
        }
    }

    /// Midway between the hip joints.
    pub fn hips(&self, pose: &ForeignPose) -> DVec3 {
        0.5 * (pose.positions[self.legs[0].hip] + pose.positions[self.legs[1].hip])
    }

    /// From midway between the ankles to the head (or what is highest of the trunk).
    pub fn upright(&self, pose: &ForeignPose) -> DVec3 {
        let top = self.head.or(self.neck.last().copied()).or(self.spine.last().copied()).unwrap_or(self.pelvis);
        let ankles = 0.5 * (pose.positions[self.legs[0].ankle] + pose.positions[self.legs[1].ankle]);
        pose.positions[top] - ankles
    }
}

/// One side of a skeleton.
#[derive(Clone, Copy)]
struct Side<'a> {
    skeleton: &'a ForeignSkeleton,
    names: &'a [(Option<usize>, String)],
    side: usize,
}

impl Side<'_> {
    /// The joint with the first of these names that the side has, below `above`.
    fn find(&self, wanted: &[&str], above: Option<usize>) -> Option<usize> {
        wanted.iter().find_map(|wanted| {
            let is = |(j, (side, name)): (usize, &(Option<usize>, String))| {
                let below = above.is_none_or(|a| a != j && self.skeleton.ancestry(j).contains(&a));
                (*side == Some(self.side) && name == wanted && below).then_some(j)
            };
            self.names.iter().enumerate().find_map(is)
        })
    }

    fn require(&self, what: &str, wanted: &[&str], above: Option<usize>) -> Result<usize, String> {
        self.find(wanted, above).ok_or_else(|| {
            let named: Vec<&str> = self.skeleton.names.iter().map(String::as_str).take(12).collect();
            format!(
                "no joint is named as the {} {what} (it has {}, ...); rename its joints as Mixamo's or CMU's are",
                SIDES[self.side],
                named.join(", ")
            )
        })
    }

    fn leg(&self) -> Result<Leg, String> {
        let hip = self.require("thigh", THIGH, None)?;
        let knee = self.require("shank", SHANK, Some(hip))?;
        let ankle = self.require("foot", ANKLE, Some(knee))?;
        Ok(Leg { hip, knee, ankle, toe: self.find(TOE, Some(ankle)) })
    }

    fn arm(&self) -> Result<Arm, String> {
        let shoulder = self.require("upper arm", UPPER_ARM, None)?;
        let elbow = self.require("forearm", FOREARM, Some(shoulder))?;
        let collar = self.find(COLLAR, None).filter(|c| *c != shoulder);
        let collar = collar.filter(|c| self.skeleton.ancestry(shoulder).contains(c));
        // Acclaim's wrist turns the forearm about itself and its hand bends; SMPL's wrist turns the hand, and its hand
        // joint has nothing below it.
        let (wrist, hand) = (self.find(WRIST, Some(elbow)), self.find(HAND, Some(elbow)));
        let has_fingers = |hand: &usize| self.skeleton.parents.contains(&Some(*hand));
        let wrist = match (wrist, hand) {
            (Some(_), Some(hand)) if has_fingers(&hand) => Some(hand),
            (wrist, hand) => wrist.or(hand),
        };
        Ok(Arm { collar, shoulder, elbow, wrist })
    }
}

/// Splits a name into a side and what is left: small letters, without separators, digits and name spaces.
fn sided(name: &str) -> (Option<usize>, String) {
    let name = name.rsplit([':', '|']).next().unwrap_or(name);
    let mut words: Vec<String> = words(name);
    words.retain(|w| !matches!(w.as_str(), "bip" | "def" | "jnt" | "bind" | "mixamorig" | "character" | "cc" | "base"));
    let of = |w: &str| match w {
        "l" | "left" => Some(0),
        "r" | "right" => Some(1),
        _ => None,
    };
    if let Some(at) = words.iter().position(|w| of(w).is_some()) {
        let side = of(&words.remove(at));
        return (side, words.concat());
    }
    let whole = words.concat();
    for (side, (long, short)) in [("left", "l"), ("right", "r")].into_iter().enumerate() {
        let rest = whole.strip_prefix(long).or_else(|| whole.strip_prefix(short));
        let known = [THIGH, SHANK, ANKLE, TOE, COLLAR, UPPER_ARM, FOREARM, WRIST, HAND];
        if let Some(rest) = rest.filter(|rest| known.iter().any(|names| names.contains(rest))) {
            return (Some(side), rest.to_owned());
        }
    }
    (None, whole)
}

/// Words by separators and by capitals: `LHipJoint` is l, hip, joint.
fn words(name: &str) -> Vec<String> {
    let letters: Vec<char> = name.chars().collect();
    let mut words = vec![String::new()];
    for (i, c) in letters.iter().enumerate() {
        let before = i.checked_sub(1).map(|i| letters[i]);
        let after = letters.get(i + 1);
        let capital =
            c.is_uppercase() && (before.is_some_and(char::is_lowercase) || after.is_some_and(|a| a.is_lowercase()));
        if capital || !c.is_alphabetic() {
            words.push(String::new());
        }
        if c.is_alphabetic() {
            let last = words.len() - 1;
            words[last].extend(c.to_lowercase());
        }
    }
    words.retain(|w| !w.is_empty());
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sides_are_told_from_names() {
        for (name, side, rest) in [
            ("LeftUpLeg", Some(0), "upleg"),
            ("LHipJoint", Some(0), "hipjoint"),
            ("rhumerus", Some(1), "humerus"),
            ("lowerback", None, "lowerback"),
            ("mixamorig:RightToeBase", Some(1), "toe"),
            ("Bip01 L UpperArm", Some(0), "upperarm"),
            ("upperarm_r", Some(1), "upperarm"),
            ("lShldr", Some(0), "shldr"),
            ("RFingers", Some(1), "fingers"),
            ("left_foot", Some(0), "foot"),
            ("Spine1", None, "spine"),
            ("CC_Base_L_Thigh", Some(0), "thigh"),
            ("radius", None, "radius"),
        ] {
            assert_eq!(sided(name), (side, rest.to_owned()), "{name}");
        }
    }
}
