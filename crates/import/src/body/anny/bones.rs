use super::mesh::BaseMesh;
use super::source::Source;
use crate::Result;
use glam::Vec3;
use serde::Deserialize;
use std::collections::BTreeMap;

/// Joints of SMPL's skeleton.
pub const JOINTS: usize = 24;
/// Skin weights of the package's own 163 bones.
const WEIGHTS: &str = "rigs/standard/weights.default.json";

/// Skin weights folded onto SMPL's joints, `[all vertices]` rows that sum to one (or are zero on helpers).
pub type Rows = Vec<[f32; JOINTS]>;

#[derive(Deserialize)]
struct File {
    weights: BTreeMap<String, Vec<(u32, f32)>>,
}

/// Reads the package's skin weights. Breasts are folded into the chest: they are flesh, not skeleton.
pub fn read(source: &Source, vertices: usize) -> Result<Rows> {
    let refuse = |reason: String| source.place(WEIGHTS).refuse(format!("{reason}; get the package again"));
    let file: File = serde_json::from_slice(&source.read(WEIGHTS)?).map_err(|e| refuse(e.to_string()))?;
    let mut rows = vec![[0.0f32; JOINTS]; vertices];
    for (bone, weights) in &file.weights {
        let joint = joint_of(bone).ok_or_else(|| refuse(format!("the bone {bone:?} is not known")))?;
        for (vertex, weight) in weights {
            let row = rows.get_mut(*vertex as usize).ok_or_else(|| refuse(format!("{bone} holds vertex {vertex}")))?;
            if !weight.is_finite() || *weight < 0.0 {
                return Err(refuse(format!("{bone} holds vertex {vertex} with a weight of {weight}")));
            }
            row[joint] += weight;
        }
    }
    for row in &mut rows {
        let sum: f32 = row.iter().sum();
        if sum > 0.0 {
            row.iter_mut().for_each(|w| *w /= sum);
        }
    }
    Ok(rows)
}

/// The joint that a bone of the default rig turns with. Bones of the face and tongue hang from the head.
fn joint_of(bone: &str) -> Option<usize> {
    let (name, right) = match bone.rsplit_once('.') {
        Some((name, "L")) => (name, 0),
        Some((name, "R")) => (name, 1),
        _ => (bone, 0),
    };
    let stem = name.trim_end_matches(|c: char| c.is_ascii_digit() || c == '-');
    let paired = |left: usize| Some(left + right);
    match (stem, name) {
        ("root" | "pelvis", _) => Some(0),
        (_, "spine05") => Some(3),
        (_, "spine04" | "spine03") => Some(6),
        (_, "spine02" | "spine01" | "breast") => Some(9),
        ("neck", _) => Some(12),
        ("clavicle", _) | (_, "shoulder01") => paired(13),
        ("upperarm", _) => paired(16),
        ("lowerarm", _) => paired(18),
        ("wrist", _) => paired(20),
        ("metacarpal" | "finger", _) => paired(22),
        ("upperleg", _) => paired(1),
        ("lowerleg", _) => paired(4),
        ("foot", _) => paired(7),
        ("toe", _) => paired(10),
        (
            "head" | "jaw" | "eye" | "levator" | "oculi" | "orbicularis" | "oris" | "risorius" | "special"
            | "temporalis" | "tongue",
            _,
        ) => Some(15),
        _ => None,
    }
}

/// SMPL's rest joints of somebody, from the helper cubes. Joints that the package has no cube for lie between two, as
/// far along as SMPL's do.
pub fn joints(base: &BaseMesh, vertices: &[Vec3]) -> std::result::Result<[Vec3; JOINTS], String> {
    let cube = |name: &str| base.cube(vertices, name).ok_or_else(|| format!("the base mesh has no cube joint-{name}"));
    let between = |a: &str, b: &str, s: f32| Ok::<Vec3, String>(cube(a)?.lerp(cube(b)?, s));
    let mut joints = [Vec3::ZERO; JOINTS];
    joints[0] = cube("pelvis")?;
    joints[3] = between("spine-4", "spine-3", 0.35)?;
    joints[6] = cube("spine-2")?;
    joints[9] = between("spine-2", "spine-1", 0.5)?;
    joints[12] = between("spine-1", "neck", 0.75)?;
    joints[15] = between("neck", "head", 0.5)?;
    for (side, offset) in [("l", 0), ("r", 1)] {
        let cube = |name: &str| cube(&format!("{side}-{name}"));
        joints[1 + offset] = cube("upper-leg")?;
        joints[4 + offset] = cube("knee")?;
        joints[7 + offset] = cube("ankle")?;
        joints[10 + offset] = cube("toe-3-1")?;
        joints[13 + offset] = cube("clavicle")?.lerp(cube("shoulder")?, 0.35);
        joints[16 + offset] = cube("shoulder")?;
        joints[18 + offset] = cube("elbow")?;
        joints[20 + offset] = cube("hand")?;
        joints[22 + offset] = cube("hand-3")?.lerp(cube("finger-3-1")?, 0.65);
    }
    Ok(joints)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bones_go_to_the_joints_that_turn_them() {
        for (bone, joint) in [
            ("root", 0),
            ("pelvis.R", 0),
            ("breast.L", 9),
            ("spine05", 3),
            ("shoulder01.R", 14),
            ("upperarm02.L", 16),
            ("finger2-1.R", 23),
            ("metacarpal1.L", 22),
            ("toe1-2.R", 11),
            ("tongue05.L", 15),
            ("neck03", 12),
        ] {
            assert_eq!(joint_of(bone), Some(joint), "{bone}");
        }
        assert_eq!(joint_of("tail"), None);
    }
}
