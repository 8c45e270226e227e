//! Named regions and tissue of the neutral mesh.

use super::parameters::NEUTRAL_STATURE;
use super::relax::Net;
use super::skeleton::JOINTS;
use super::weights::diffuse;
use crate::{BodyError, BodyModel, Region, RegionMap, Result};
use glam::{Vec2, Vec3};
use softtissue_geometry::Topology;

/// Where things are on the neutral body, metres.
#[derive(Clone, Copy, Debug)]
pub struct Landmarks {
    /// Rest joints.
    pub joints: [Vec3; JOINTS],
    /// Size against the procedural body of neutral stature.
    pub scale: f32,
    /// Middle of the left breast and its radius.
    pub breast: (Vec3, f32),
}

impl Landmarks {
    /// Of a body with SMPL's 24 joints. The breast is looked for on the front of the chest.
    ///
    /// # Errors
    /// A body outside of human size or without a chest.
    pub fn of(model: &BodyModel) -> Result<Self> {
        let joints = model.joint_regressor.joints(&model.template);
        Self::measured(&model.template, &joints)
    }

    /// Of a rest mesh in metres, Y up, facing +Z, and its 24 joints.
    ///
    /// # Errors
    /// As [`Landmarks::of`].
    pub fn measured(positions: &[Vec3], joints: &[Vec3]) -> Result<Self> {
        let bad = |reason: String| Err(BodyError::Inconsistent(reason));
        let Ok(joints) = <[Vec3; JOINTS]>::try_from(joints) else {
            return bad(format!("it has {} joints, expected SMPL's {JOINTS}", joints.len()));
        };
        let (low, high) = positions.iter().fold((f32::MAX, f32::MIN), |(l, h), p| (l.min(p.y), h.max(p.y)));
        let scale = (high - low) / NEUTRAL_STATURE;
        if !(0.3..=2.0).contains(&scale) {
            return bad(format!("it is {:.2} m tall along Y: give it in metres with Y up", high - low));
        }
        // the neck and collars lie above the breast, the belly below
        let (bottom, top) = (joints[9].y - 0.06 * scale, joints[12].y - 0.12 * scale);
        let side =
            |p: &&Vec3| (0.035 * scale..0.14 * scale).contains(&(p.x - joints[9].x)) && (bottom..top).contains(&p.y);
        let Some(tip) = positions.iter().filter(side).max_by(|a, b| a.z.total_cmp(&b.z)) else {
            return bad("it has no chest above the third joint of its spine".into());
        };
        let radius = 0.050 * scale;
        let breast = (Vec3::new(tip.x, tip.y, tip.z - 0.6 * radius), radius);
        Ok(Self { joints, scale, breast })
    }
}

/// The region of each vertex, symmetric.
pub fn regions(marks: &Landmarks, net: &Net, positions: &[Vec3], dense: &[[f32; JOINTS]]) -> RegionMap {
    let mut map = vec![Region::Rest; positions.len()];
    for &v in net.left() {
        let r = region(marks, positions[v as usize], &dense[v as usize]);
        map[v as usize] = r;
        map[net.mirror[v as usize] as usize] = r;
    }
    RegionMap(map)
}

/// `p` lies on the left or in the middle.
fn region(marks: &Landmarks, p: Vec3, weights: &[f32; JOINTS]) -> Region {
    let j = &marks.joints;
    let s = marks.scale;
    let share = |joints: &[usize]| joints.iter().map(|j| weights[*j]).sum::<f32>();
    let along = |a: usize, b: usize| (p - j[a]).dot(j[b] - j[a]) / (j[b] - j[a]).length_squared();
    if share(&[12, 15]) > 0.6 && p.y > j[12].y + 0.01 * s {
        return Region::Head;
    }
    if share(&[20, 21, 22, 23]) > 0.5 {
        return Region::Hands;
    }
    if share(&[7, 8, 10, 11]) > 0.5 {
        return Region::Feet;
    }
    if share(&[16, 17]) > 0.5 && (0.12..0.85).contains(&along(16, 18)) {
        return Region::UpperArms;
    }
    if share(&[16, 17, 18, 19]) > 0.5 {
        return Region::Rest;
    }
    let buttock_low = j[1].y - 0.075 * s;
    if p.z < -0.03 * s && p.y > buttock_low && p.y < j[0].y + 0.055 * s {
        return Region::Buttocks;
    }
    let thigh = along(1, 4);
    if share(&[1, 2, 4, 5]) > 0.5 {
        let calf = along(4, 7);
        if calf > 0.10 && calf < 0.75 {
            return Region::Calves;
        }
        return if (0.0..0.85).contains(&thigh) { Region::Thighs } else { Region::Rest };
    }
    if p.y < j[1].y - 0.03 * s {
        return Region::Thighs;
    }
    if p.y < j[9].y - 0.085 * s {
        return if p.z > -0.035 * s { Region::Belly } else { Region::Rest };
    }
    if p.y < j[9].y + 0.10 * s && p.z > 0.015 * s { Region::Chest } else { Region::Rest }
}

/// The texture chart of each quad: body part, times two for front and back (for hands and feet: above and below).
pub fn chart_labels(marks: &Landmarks, topology: &Topology, positions: &[Vec3], dense: &[[f32; JOINTS]]) -> Vec<u32> {
    const PART: [u32; JOINTS] = [0, 1, 2, 0, 3, 4, 0, 5, 6, 0, 5, 6, 7, 0, 0, 7, 8, 9, 10, 11, 12, 13, 12, 13];
    let j = &marks.joints;
    topology
        .quads
        .iter()
        .map(|quad| {
            let mut shares = [0.0f32; 14];
            for v in quad {
                dense[*v as usize].iter().zip(PART).for_each(|(w, p)| shares[p as usize] += w);
            }
            let part = (0..14).fold(0, |best, p| if shares[p] > shares[best] { p } else { best });
            let centre = quad.iter().map(|v| positions[*v as usize]).sum::<Vec3>() * 0.25;
            let front = match part {
                0 => centre.z > j[6].z + 0.01 * marks.scale,
                7 => centre.z > j[15].z,
                5 | 6 => centre.y > 0.02 * marks.scale,
                12 | 13 => {
                    let (wrist, hand) = (j[20 + part - 12], j[22 + part - 12]);
                    (centre - wrist).dot((hand - wrist).cross(Vec3::Z)) > 0.0
                }
                _ => {
                    let (a, b) = [
                        (1, 4),
                        (2, 5),
                        (4, 7),
                        (5, 8),
                        (0, 0),
                        (0, 0),
                        (0, 0),
                        (16, 18),
                        (17, 19),
                        (18, 20),
                        (19, 21),
                    ][part - 1];
                    let t = (centre - j[a]).dot(j[b] - j[a]) / (j[b] - j[a]).length_squared();
                    centre.z > j[a].z + (j[b].z - j[a].z) * t
                }
            };
            2 * part as u32 + u32::from(front)
        })
        .collect()
}

/// Smooth tissue maps of the neutral mesh, `[V]` each.
#[derive(Clone, Debug)]
pub struct Tissue {
    /// Fat thickness at neutral mass, metres.
    pub fat: Vec<f32>,
    /// 1 on the breast, 0 elsewhere.
    pub breast: Vec<f32>,
    /// 1 over the viscera (belly and flanks), 0 elsewhere.
    pub viscera: Vec<f32>,
}

/// Thickness by region, blended by diffusion over about 3 cm.
pub fn tissue(marks: &Landmarks, net: &Net, positions: &[Vec3], regions: &RegionMap) -> Tissue {
    const BLEND: f32 = 0.025 * 0.025;
    let (centre, radius) = marks.breast;
    // the footprint on the chest, seen from the front: about 11 cm across
    let is_breast = |p: Vec3| {
        let across = Vec2::new(p.x.abs() - centre.x, p.y - centre.y);
        across.length() < 1.1 * radius && p.z > centre.z - 0.2 * radius
    };
    let flank = |p: Vec3| p.x.abs() > 0.085 * marks.scale;
    let fat: Vec<f32> = positions
        .iter()
        .zip(&regions.0)
        .map(|(p, r)| {
            1e-3 * match r {
                Region::Belly if flank(*p) => 18.0,
                Region::Belly => 22.0,
                Region::Buttocks => 30.0,
                Region::Thighs => 16.0,
                Region::UpperArms => 12.0,
                Region::Chest => 10.0,
                Region::Calves => 7.0,
                Region::Head | Region::Hands | Region::Feet => 3.0,
                Region::Rest => 7.0,
            }
        })
        .collect();
    let indicator = |f: &dyn Fn(usize) -> bool| -> Vec<f32> {
        let hard: Vec<f32> = (0..positions.len()).map(|v| if f(v) { 1.0 } else { 0.0 }).collect();
        mirrored(net, diffuse(net, positions, &hard, 0.3 * BLEND)).into_iter().map(|x| x.clamp(0.0, 1.0)).collect()
    };
    Tissue {
        fat: mirrored(net, diffuse(net, positions, &fat, BLEND)),
        breast: indicator(&|v| is_breast(positions[v])),
        viscera: indicator(&|v| regions.0[v] == Region::Belly),
    }
}

/// Copies the left half onto the right.
fn mirrored(net: &Net, mut field: Vec<f32>) -> Vec<f32> {
    for &v in net.left() {
        field[net.mirror[v as usize] as usize] = field[v as usize];
    }
    field
}
