use super::{Place, Problem, ProblemKind};
use glam::Vec3;

/// Joints of a person that tell left from right, as (left, right).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sides {
    /// Hips.
    pub hips: [usize; 2],
    /// Ankles.
    pub ankles: [usize; 2],
    /// Balls of the feet, if the skeleton has them.
    pub toes: Option<[usize; 2]>,
    /// Shoulders.
    pub shoulders: [usize; 2],
}

impl Sides {
    /// Of a skeleton whose joints are named as SMPL's are; `None` where one is not there.
    pub fn of_names(names: &[String]) -> Option<Self> {
        let joint = |name: String| names.iter().position(|n| *n == name);
        let pair = |part: &str| Some([joint(format!("left_{part}"))?, joint(format!("right_{part}"))?]);
        Some(Self { hips: pair("hip")?, ankles: pair("ankle")?, toes: pair("foot"), shoulders: pair("shoulder")? })
    }
}

/// Watches whether left is left: feet point ahead, and arms and legs of a side are on one side.
#[derive(Clone, Copy, Debug)]
pub struct SideWatch {
    sides: Sides,
    /// Agreement of legs and arms with the feet, and with each other.
    legs: f32,
    arms: f32,
    together: f32,
}

impl SideWatch {
    /// Nothing seen yet.
    pub fn new(sides: Sides) -> Self {
        Self { sides, legs: 0.0, arms: 0.0, together: 0.0 }
    }

    /// Joints of a frame, metres, Y up.
    pub fn frame(&mut self, at: &[Vec3]) {
        let across = |pair: [usize; 2]| {
            let way = at[pair[0]] - at[pair[1]];
            Vec3::new(way.x, 0.0, way.z).normalize_or_zero()
        };
        let (hips, shoulders) = (across(self.sides.hips), across(self.sides.shoulders));
        self.together += hips.dot(shoulders);
        if let Some(toes) = self.sides.toes {
            let ahead: Vec3 = (0..2).map(|s| at[toes[s]] - at[self.sides.ankles[s]]).sum();
            // who looks ahead with the head up has the left hand there
            let left = Vec3::Y.cross(ahead).normalize_or_zero();
            self.legs += hips.dot(left);
            self.arms += shoulders.dot(left);
        }
    }

    /// What is wrong.
    pub fn finish(self) -> Vec<Problem> {
        let says = |what: &str| Problem::new(ProblemKind::LeftRightSwap, what);
        match (self.legs < 0.0, self.arms < 0.0) {
            (true, true) => vec![says("left and right look exchanged, by where the feet point")],
            (true, false) if self.sides.toes.is_some() => {
                vec![says("left and right legs look exchanged, by where the feet point")]
            }
            (false, true) => vec![says("left and right arms look exchanged, by where the feet point")],
            _ if self.together < 0.0 => vec![says("arms and legs do not agree on which side is left")],
            _ => vec![],
        }
    }
}

/// Joints at rest, facing +Z, that are on the other side than their name says, `left_` or `right_`.
pub fn misplaced_joints(names: &[String], at: &[Vec3]) -> Option<Problem> {
    let wrong = |(name, p): (&String, &Vec3)| {
        let side = if name.starts_with("left_") {
            p.x
        } else if name.starts_with("right_") {
            -p.x
        } else {
            return None;
        };
        (side < 0.0).then(|| Place::joint(name))
    };
    let places: Vec<Place> = names.iter().zip(at).filter_map(wrong).collect();
    let says = "joints lie on the other side than their names say";
    (!places.is_empty()).then(|| Problem::at(ProblemKind::LeftRightSwap, says, places))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Left hip, right hip, left ankle, right ankle, left toe, right toe, left shoulder, right shoulder; facing +Z.
    fn standing() -> Vec<Vec3> {
        [(0.1, 0.9, 0.0), (0.1, 0.1, 0.0), (0.1, 0.0, 0.15), (0.2, 1.4, 0.0)]
            .iter()
            .flat_map(|(x, y, z)| [Vec3::new(*x, *y, *z), Vec3::new(-x, *y, *z)])
            .collect()
    }

    fn told(change: impl Fn(&mut Vec<Vec3>), toes: bool) -> Vec<String> {
        let sides = Sides { hips: [0, 1], ankles: [2, 3], toes: toes.then_some([4, 5]), shoulders: [6, 7] };
        let mut watch = SideWatch::new(sides);
        for turn in [0.0, 1.0, 2.5] {
            let mut at = standing();
            change(&mut at);
            let turned: Vec<Vec3> = at.iter().map(|p| glam::Quat::from_rotation_y(turn) * *p).collect();
            watch.frame(&turned);
        }
        watch.finish().into_iter().map(|p| p.says).collect()
    }

    #[test]
    fn exchanged_limbs_are_told_and_straight_ones_are_not() {
        assert!(told(|_| (), true).is_empty() && told(|_| (), false).is_empty());
        let arms = |at: &mut Vec<Vec3>| at.swap(6, 7);
        assert!(told(arms, true)[0].contains("arms look exchanged"));
        assert!(told(arms, false)[0].contains("do not agree"));
        let legs = |at: &mut Vec<Vec3>| [(0, 1), (2, 3), (4, 5)].iter().for_each(|(a, b)| at.swap(*a, *b));
        assert!(told(legs, true)[0].contains("legs look exchanged"));
        let all = |at: &mut Vec<Vec3>| at.iter_mut().for_each(|p| p.x = -p.x);
        assert!(told(all, true)[0].contains("left and right look"));
    }

    #[test]
    fn joints_on_the_wrong_side() {
        let names: Vec<String> = ["pelvis", "left_hip", "right_hip"].map(String::from).to_vec();
        let at = [Vec3::X * -0.01, Vec3::X * 0.1, Vec3::X * -0.1];
        assert_eq!(misplaced_joints(&names, &at), None);
        let found = misplaced_joints(&names, &[at[0], at[2], at[1]]).unwrap();
        assert_eq!((found.count, found.first[0].joint.as_deref()), (2, Some("left_hip")));
    }
}
