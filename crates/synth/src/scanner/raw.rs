use crate::Result;
use crate::subject::Waves;
use glam::{Mat3, Vec3};
use softtissue_body::{BodyModel, Region};
use softtissue_clips::RawFrame;
use softtissue_geometry::{face_normals, vertex_normals};
use softtissue_random::Draws;
use std::collections::HashMap;
use std::path::Path;

/// Standard deviation of the noise along the normal, metres; three times that on hands and feet.
const NOISE: f32 = 0.0007;
/// Root mean square of the error that neighbours share, along the normal, metres.
const BIAS: f32 = 0.001;
/// Part of the points that lie anywhere within [`STRAY`] of where they should.
const OUTLIERS: f64 = 0.001;
/// Metres.
const STRAY: f64 = 0.3;
/// Surfaces that face each other nearer than this are bridged, metres.
const WEB: f32 = 0.02;
/// Cameras in a ring, and how far away they stand, metres.
const CAMERAS: usize = 8;
const CAMERA_DISTANCE: f32 = 2.5;
/// Cameras that must see a point.
const SEEN_BY: usize = 2;
/// Cell of a camera's depth picture, radians, and how far behind the nearest point is hidden, metres.
const CELL: f32 = 0.012;
const BEHIND: f32 = 0.04;
/// Cosine of the flattest angle at which a camera sees.
const FLATTEST: f32 = 0.2;

/// A scanner of surfaces: points with normals, noise along the normal, an error that neighbours share, holes where
/// fewer than two cameras see, webs between surfaces that nearly touch, and outliers.
pub struct RawScanner<'a> {
    body: &'a BodyModel,
    points: usize,
    stage: String,
    seed: u64,
    bias: Waves,
    rough: Vec<bool>,
}

#[derive(Clone, Copy)]
struct Sample {
    point: Vec3,
    normal: Vec3,
    rough: bool,
}

impl<'a> RawScanner<'a> {
    /// A scanner for one clip: the same clip and seed give the same scans.
    pub fn new(body: &'a BodyModel, points: usize, clip: &str, seed: u64) -> Self {
        let bias = Waves::draw(&mut Draws::new(seed, &format!("synth-raw-bias/{clip}"), 0, 0), 6, 0.15, 0.6);
        let rough = body.regions.0.iter().map(|r| matches!(r, Region::Hands | Region::Feet)).collect();
        Self { body, points, stage: format!("synth-raw/{clip}"), seed, bias, rough }
    }

    /// The scan of frame `t`, whose true vertices are `[V]`, metres.
    pub fn scan(&self, t: usize, vertices: &[Vec3]) -> RawFrame {
        let mut draws = Draws::new(self.seed, &self.stage, 0, t as u64);
        let mut samples = self.sample(vertices, &mut draws);
        let seen = visible(&samples);
        let webs = webs(&samples, &mut draws);
        webs.into_iter().for_each(|(i, sample)| samples[i] = sample);
        let mut frame = RawFrame::default();
        for (sample, seen) in samples.iter().zip(seen) {
            let noise = NOISE * if sample.rough { 3.0 } else { 1.0 } * draws.normal() as f32;
            let mut point = sample.point + sample.normal * (noise + BIAS * self.bias.at(sample.point));
            if draws.uniform() < OUTLIERS {
                point += Vec3::from_array(std::array::from_fn(|_| draws.range(-STRAY, STRAY) as f32));
            }
            if seen {
                frame.points.push(point);
                frame.normals.push(sample.normal);
            }
        }
        frame
    }

    /// Points spread over the surface by area.
    fn sample(&self, vertices: &[Vec3], draws: &mut Draws) -> Vec<Sample> {
        let faces = &self.body.topology.faces;
        let normals = vertex_normals(vertices, faces);
        let mut ends = Vec::with_capacity(faces.len());
        let mut total = 0.0f64;
        for normal in face_normals(vertices, faces) {
            total += f64::from(normal.length());
            ends.push(total);
        }
        let each = |_| {
            let at = draws.uniform() * total;
            let f = ends.partition_point(|end| *end < at).min(faces.len() - 1);
            let (mut u, mut v) = (draws.uniform() as f32, draws.uniform() as f32);
            if u + v > 1.0 {
                (u, v) = (1.0 - u, 1.0 - v);
            }
            let weights = [1.0 - u - v, u, v];
            let mix =
                |field: &[Vec3]| -> Vec3 { faces[f].iter().zip(weights).map(|(i, w)| field[*i as usize] * w).sum() };
            let rough = self.rough[faces[f][0] as usize];
            Sample { point: mix(vertices), normal: mix(&normals).normalize_or(Vec3::Y), rough }
        };
        (0..self.points).map(each).collect()
    }
}

/// Which samples enough cameras see: those that face a camera and are not behind what is nearer in its direction.
fn visible(samples: &[Sample]) -> Vec<bool> {
    let middle = samples.iter().map(|s| s.point).sum::<Vec3>() / samples.len().max(1) as f32;
    let mut seen_by = vec![0usize; samples.len()];
    for camera in 0..CAMERAS {
        let turn = Mat3::from_rotation_y(camera as f32 * std::f32::consts::TAU / CAMERAS as f32);
        let height = if camera % 2 == 0 { 0.6 } else { -0.4 };
        let eye = middle + turn * Vec3::new(0.0, height, CAMERA_DISTANCE);
        let cell = |s: &Sample| {
            let p = turn.transpose() * (s.point - eye);
            ((p.x / -p.z / CELL).floor() as i32, (p.y / -p.z / CELL).floor() as i32)
        };
        let mut nearest: HashMap<(i32, i32), f32> = HashMap::new();
        for s in samples {
            let depth = nearest.entry(cell(s)).or_insert(f32::MAX);
            *depth = depth.min(s.point.distance(eye));
        }
        for (s, seen_by) in samples.iter().zip(&mut seen_by) {
            let facing = s.normal.dot((eye - s.point).normalize()) > FLATTEST;
            *seen_by += usize::from(facing && s.point.distance(eye) < nearest[&cell(s)] + BEHIND);
        }
    }
    seen_by.into_iter().map(|n| n >= SEEN_BY).collect()
}

/// Samples that lie on a bridge between surfaces that face each other.
fn webs(samples: &[Sample], draws: &mut Draws) -> Vec<(usize, Sample)> {
    let cell = |p: Vec3| (p / WEB).floor().as_ivec3().to_array();
    let mut cells: HashMap<[i32; 3], Vec<usize>> = HashMap::new();
    for (i, s) in samples.iter().enumerate() {
        cells.entry(cell(s.point)).or_default().push(i);
    }
    let mut webs = Vec::new();
    for (i, s) in samples.iter().enumerate() {
        // half of the points are bridged, from whatever other side their own cell holds
        let opposite = |j: &&usize| {
            let o = &samples[**j];
            s.normal.dot(o.normal) < -0.5 && s.normal.dot(o.point - s.point) > 0.0 && s.point.distance(o.point) < WEB
        };
        let Some(j) = cells[&cell(s.point)].iter().find(opposite) else { continue };
        if draws.uniform() < 0.5 {
            let across = samples[*j].point - s.point;
            let along = across.cross(s.normal).normalize_or(s.normal);
            let bridge = Sample { point: s.point + across * draws.uniform() as f32, normal: along, rough: s.rough };
            webs.push((i, bridge));
        }
    }
    webs
}

/// Writes points and normals as little-endian PLY.
///
/// # Errors
/// The disk.
pub fn write_ply(path: &Path, frame: &RawFrame) -> Result<()> {
    softtissue_store::write_atomic(path, |w| {
        write!(w, "ply\nformat binary_little_endian 1.0\nelement vertex {}\n", frame.points.len())?;
        for name in ["x", "y", "z", "nx", "ny", "nz"] {
            writeln!(w, "property float {name}")?;
        }
        writeln!(w, "end_header")?;
        for (p, n) in frame.points.iter().zip(&frame.normals) {
            for x in p.to_array().into_iter().chain(n.to_array()) {
                w.write_all(&x.to_le_bytes())?;
            }
        }
        Ok(())
    })?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sheet(z: f32, normal: Vec3) -> Vec<Sample> {
        let at = |i: usize| Vec3::new((i % 30) as f32 * 0.01 - 0.15, (i / 30) as f32 * 0.01 - 0.15, z);
        (0..900).map(|i| Sample { point: at(i), normal, rough: false }).collect()
    }

    #[test]
    fn what_lies_behind_is_a_hole() {
        let front = sheet(0.2, Vec3::Z);
        let behind = sheet(0.0, Vec3::Z);
        let seen = visible(&[front, behind].concat());
        let share = |s: &[bool]| s.iter().filter(|x| **x).count() as f32 / s.len() as f32;
        assert!(share(&seen[..900]) > 0.95, "{}", share(&seen[..900]));
        assert!(share(&seen[900..]) < 0.5, "{}", share(&seen[900..]));
    }

    #[test]
    fn webs_join_only_what_faces_each_other_nearby() {
        let count = |gap: f32, other: Vec3| {
            let mut draws = Draws::new(1, "webs", 0, 0);
            webs(&[sheet(0.001, Vec3::Z), sheet(0.001 + gap, other)].concat(), &mut draws).len()
        };
        assert!(count(0.01, Vec3::NEG_Z) > 100);
        assert_eq!(count(0.03, Vec3::NEG_Z), 0);
        assert_eq!(count(0.01, Vec3::Z), 0);
    }
}
