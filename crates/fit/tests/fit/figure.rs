//! A small figure of tubes with SMPL's 24 joints: cheap, smooth, and with correctives and shapes that matter.

use glam::{Vec2, Vec3};
use softtissue_body::{BodyModel, JointRegressor, Mirror, Region, RegionMap, Skeleton, SkinWeights, UvAtlas};
use softtissue_geometry::Topology;
use softtissue_random::Draws;
use std::sync::Arc;

/// Rest joints, metres.
const JOINTS: [[f32; 3]; 24] = [
    [0.0, 0.95, 0.0],
    [0.09, 0.88, 0.0],
    [-0.09, 0.88, 0.0],
    [0.0, 1.06, 0.0],
    [0.10, 0.48, 0.0],
    [-0.10, 0.48, 0.0],
    [0.0, 1.18, 0.0],
    [0.10, 0.08, -0.02],
    [-0.10, 0.08, -0.02],
    [0.0, 1.26, 0.0],
    [0.11, 0.03, 0.10],
    [-0.11, 0.03, 0.10],
    [0.0, 1.46, 0.0],
    [0.08, 1.38, 0.0],
    [-0.08, 1.38, 0.0],
    [0.0, 1.55, 0.01],
    [0.19, 1.40, 0.0],
    [-0.19, 1.40, 0.0],
    [0.40, 1.25, 0.0],
    [-0.40, 1.25, 0.0],
    [0.58, 1.08, 0.0],
    [-0.58, 1.08, 0.0],
    [0.64, 1.02, 0.0],
    [-0.64, 1.02, 0.0],
];
/// End of each bone, and its radius.
fn bone(j: usize) -> (Vec3, f32) {
    let at = |k: usize| Vec3::from_array(JOINTS[k]);
    let past = |a: usize, b: usize, length: f32| at(b) + (at(b) - at(a)).normalize() * length;
    match j {
        0 => (at(3), 0.15),
        1 | 2 => (at(j + 3), 0.08),
        3 => (at(6), 0.14),
        4 | 5 => (at(j + 3), 0.055),
        6 => (at(9), 0.14),
        7 | 8 => (at(j + 3), 0.04),
        9 => (at(12), 0.15),
        10 | 11 => (past(j - 3, j, 0.07), 0.03),
        12 => (at(15), 0.06),
        13 | 14 => (at(j + 3), 0.06),
        15 => (Vec3::new(0.0, 1.72, 0.02), 0.09),
        16 | 17 => (at(j + 2), 0.05),
        18 | 19 => (at(j + 2), 0.04),
        20 | 21 => (at(j + 2), 0.03),
        _ => (past(j - 2, j, 0.09), 0.025),
    }
}

/// The figure with `rings x sectors` vertices a bone and three shapes (height, girth, belly).
pub fn figure(rings: usize, sectors: usize) -> BodyModel {
    let skeleton = Skeleton::smpl();
    let (mut template, mut skin, mut regions, mut faces) = (vec![], vec![], vec![], vec![]);
    let mut axes = vec![];
    for j in 0..24 {
        let (from, (to, radius)) = (Vec3::from_array(JOINTS[j]), bone(j));
        let along = (to - from).normalize();
        let side = along.any_orthonormal_vector();
        let other = along.cross(side);
        let first = template.len() as u32;
        for ring in 0..rings {
            let t = ring as f32 / (rings - 1) as f32;
            for sector in 0..sectors {
                let angle = std::f32::consts::TAU * (sector as f32 + 0.5 * (ring % 2) as f32) / sectors as f32;
                let out = side * angle.cos() + other * angle.sin();
                template.push(from.lerp(to, t) + out * radius * (1.0 - 0.15 * (2.0 * t - 1.0).powi(2)));
                axes.push(out);
                skin.push(weights(&skeleton, j, t));
                regions.push(region(j, out));
            }
        }
        let at = |ring: usize, sector: usize| first + (ring * sectors + sector % sectors) as u32;
        for ring in 0..rings - 1 {
            for s in 0..sectors {
                faces.push([at(ring, s), at(ring, s + 1), at(ring + 1, s)]);
                faces.push([at(ring + 1, s), at(ring, s + 1), at(ring + 1, s + 1)]);
            }
        }
    }
    let v = template.len();
    let height = template.iter().map(|p| *p * 0.04);
    let girth = axes.iter().map(|a| *a * 0.008);
    let belly = template.iter().zip(&axes).map(|(p, a)| *a * 0.02 * (-((p.y - 1.12) / 0.12).powi(2)).exp());
    let shape_directions = height.chain(girth).chain(belly).collect();
    BodyModel {
        topology: Arc::new(Topology { vertex_count: v, faces, quads: vec![] }),
        pose_directions: correctives(&template, &axes),
        joint_regressor: regressor(v, rings * sectors, sectors),
        shape_directions,
        template,
        skin,
        skeleton,
        uv: UvAtlas { coordinates: vec![Vec2::ZERO], faces: vec![] },
        mirror: Mirror { vertices: (0..v as u32).collect(), joints: (0..24).collect() },
        regions: RegionMap(regions),
    }
}

/// A bone's own joint, its parent near the start, and a child near the end.
fn weights(skeleton: &Skeleton, j: usize, t: f32) -> SkinWeights {
    let parent = skeleton.parents[j].map_or(0, usize::from);
    let child = (0..24).find(|&c| skeleton.parents[c] == Some(j as u8)).unwrap_or(j);
    let up = if j == parent { 0.0 } else { 0.5 * (1.0 - t / 0.35).max(0.0) };
    let down = if j == child { 0.0 } else { 0.5 * ((t - 0.65) / 0.35).max(0.0) };
    SkinWeights { joints: [j as u8, parent as u8, child as u8, 0], weights: [1.0 - up - down, up, down, 0.0] }
}

fn region(j: usize, out: Vec3) -> Region {
    match j {
        0 if out.z < -0.3 => Region::Buttocks,
        3 | 6 if out.z > 0.3 => Region::Belly,
        9 if out.z > 0.0 => Region::Chest,
        1 | 2 => Region::Thighs,
        4 | 5 => Region::Calves,
        16 | 17 => Region::UpperArms,
        12 | 15 => Region::Head,
        20..=23 => Region::Hands,
        7 | 8 | 10 | 11 => Region::Feet,
        _ => Region::Rest,
    }
}

/// The first ring of each bone lies round its joint.
fn regressor(v: usize, a_bone: usize, sectors: usize) -> JointRegressor {
    let row = |j: usize| (0..sectors).map(|s| ((j * a_bone + s) as u32, 1.0 / sectors as f32)).collect();
    assert_eq!(v, 24 * a_bone);
    JointRegressor { rows: (0..24).map(row).collect() }
}

/// Up to 12 mm a radian of bulge within 12 cm of each joint, in a fixed random mixture of features.
fn correctives(template: &[Vec3], axes: &[Vec3]) -> Vec<Vec3> {
    let mut draws = Draws::new(5, "figure correctives", 0, 0);
    let mut directions = Vec::with_capacity(207 * template.len());
    for joint in JOINTS.iter().skip(1) {
        let joint = Vec3::from_array(*joint);
        for _ in 0..9 {
            let mut number = || (0.006 * draws.normal()) as f32;
            let (radial, fixed) = (number(), Vec3::new(number(), number(), number()));
            directions.extend(template.iter().zip(axes).map(|(p, a)| {
                let near = (1.0 - p.distance(joint) / 0.12).max(0.0);
                (*a * radial + fixed) * near
            }));
        }
    }
    directions
}

/// A smooth random pose: joint angles of about `size` radians, the root turned anywhere.
pub fn smooth_pose(seed: u64, t: f32, size: f32) -> (Vec<Vec3>, Vec3) {
    let mut draws = Draws::new(seed, "smooth pose", 0, 0);
    let mut wave = |amplitude: f32| {
        let (rate, phase, middle) =
            (draws.range(2.0, 6.0), draws.range(0.0, std::f64::consts::TAU), draws.range(-0.5, 0.5));
        amplitude * ((rate * f64::from(t) + phase).sin() + middle) as f32
    };
    let mut rotations: Vec<Vec3> = (0..24).map(|_| Vec3::new(wave(size), wave(size), wave(size))).collect();
    rotations[0] = Vec3::new(wave(0.4), wave(1.5), wave(0.4));
    let translation = Vec3::new(wave(0.5), wave(0.2), wave(0.5));
    (rotations, translation)
}

/// Flesh for tests: a wave of the given amplitude, metres, on soft vertices, none elsewhere.
pub fn jiggle(body: &BodyModel, t: f32, amplitude: f32) -> Vec<Vec3> {
    let wave = |(p, region): (&Vec3, &Region)| {
        let soft = if region.is_soft() { amplitude } else { 0.0 };
        soft * Vec3::new((25.0 * t + 27.0 * p.y).sin(), (28.0 * t + 25.0 * p.x).cos(), (22.0 * t + 24.0 * p.y).sin())
    };
    body.template.iter().zip(&body.regions.0).map(wave).collect()
}
