use softtissue_body::Skeleton;

/// The joints of a model: what they are called and where each goes in SMPL's 24.
pub struct JointTable {
    /// Which model has this many joints.
    pub model: &'static str,
    /// `[J]`.
    pub names: Vec<String>,
    /// `[J]` the joint of SMPL's 24 that each turns with.
    pub smpl_of: Vec<u8>,
    /// `[24]` the joint that stands for each of SMPL's.
    pub stands_for: Vec<usize>,
}

/// Fingers in the order of SMPL-H and SMPL-X, three joints each.
const FINGERS: [&str; 5] = ["index", "middle", "pinky", "ring", "thumb"];
/// The joint at the root of the middle finger, within a hand's fifteen: where SMPL has its hand.
const MIDDLE: usize = 3;

impl JointTable {
    /// Of 24 (SMPL), 52 (SMPL-H) or 55 (SMPL-X) joints.
    pub fn of(count: usize) -> Option<Self> {
        let smpl = Skeleton::smpl().names;
        let (model, face): (_, &[&str]) = match count {
            24 => {
                let all: Vec<usize> = (0..24).collect();
                let smpl_of = (0..24).collect();
                return Some(Self { model: "SMPL", names: smpl, smpl_of, stands_for: all });
            }
            52 => ("SMPL-H", &[]),
            55 => ("SMPL-X", &["jaw", "left_eye", "right_eye"]),
            _ => return None,
        };
        let mut names: Vec<String> = smpl[..22].to_vec();
        let mut smpl_of: Vec<u8> = (0..22).collect();
        names.extend(face.iter().map(|n| (*n).to_owned()));
        smpl_of.extend(face.iter().map(|_| 15));
        let mut stands_for: Vec<usize> = (0..22).collect();
        for (side, hand) in [("left", 22), ("right", 23)] {
            stands_for.push(names.len() + MIDDLE);
            for finger in FINGERS {
                names.extend((1..=3).map(|k| format!("{side}_{finger}{k}")));
                smpl_of.extend([hand; 3]);
            }
        }
        Some(Self { model, names, smpl_of, stands_for })
    }

    /// `[J]` the joint on the other side, by name.
    pub fn mirror(names: &[String]) -> Vec<u8> {
        let other = |name: &str| match name.split_once('_') {
            Some(("left", rest)) => format!("right_{rest}"),
            Some(("right", rest)) => format!("left_{rest}"),
            _ => name.to_owned(),
        };
        let index = |name: String, own: usize| names.iter().position(|n| *n == name).unwrap_or(own) as u8;
        names.iter().enumerate().map(|(j, name)| index(other(name), j)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hands_and_faces_fold_into_smpl() {
        for (count, left, right) in [(24, 22, 23), (52, 25, 40), (55, 28, 43)] {
            let table = JointTable::of(count).unwrap();
            assert_eq!((table.names.len(), table.smpl_of.len(), table.stands_for.len()), (count, count, 24));
            assert_eq!(table.stands_for[22..], [left, right]);
            let mirror = JointTable::mirror(&table.names);
            assert!((0..count).all(|j| usize::from(mirror[usize::from(mirror[j])]) == j));
            assert_eq!(usize::from(mirror[left]), right);
        }
        let x = JointTable::of(55).unwrap();
        assert_eq!((x.names[28].as_str(), x.smpl_of[23]), ("left_middle1", 15));
        assert!(JointTable::of(23).is_none());
    }
}
