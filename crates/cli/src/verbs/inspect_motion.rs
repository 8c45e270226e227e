//! `inspect` of a foreign motion: what it is, what was guessed, what is wrong with it, and its bones in a picture.

use crate::args::MotionSourceArgs;
use anyhow::Result;
use glam::Vec3;
use serde_json::{Value, json};
use softtissue_import::motion::{ForeignPose, ReadMotion, problems};
use softtissue_render::{Camera, PLAIN, Picture, Scene};
use softtissue_store::write_atomic;
use std::path::Path;

/// Frames shown and pixels of one of them.
const SHOWN: usize = 6;
const SIZE: (usize, usize) = (160, 240);
/// Thickness of a bone as a share of its length, and at least, metres.
const THICKNESS: (f32, f32) = (0.08, 0.008);
/// Where the camera stands, radians.
const AZIMUTH: f32 = 0.5;
const ELEVATION: f32 = 0.1;

/// Facts of a motion; a picture where one is asked for.
pub fn inspect(path: &Path, picture: Option<&Path>) -> Result<Value> {
    let read = MotionSourceArgs::default().read(path)?;
    let (mut low, mut high) = (Vec3::MAX, Vec3::MIN);
    for t in 0..read.motion.len() {
        for at in read.motion.pose(t).positions {
            (low, high) = (low.min(at.as_vec3()), high.max(at.as_vec3()));
        }
    }
    if let Some(picture) = picture {
        draw(&read, picture)?;
    }
    let facts = &read.facts;
    Ok(json!({
        "what": format!("foreign motion ({})", facts.format),
        "frames": facts.frames, "frames_per_second": facts.fps, "seconds": facts.frames as f64 / facts.fps,
        "joints": facts.joints, "names": facts.naming, "skeleton": facts.skeleton,
        "units": facts.units, "metres_per_unit": facts.metres_per_unit, "up": format!("{:?}", facts.up),
        "height_m": facts.height_m, "guessed": facts.guessed, "notes": facts.notes,
        "range_m": {"low": low.to_array(), "high": high.to_array()}, "problems": problems(&read),
    }))
}

/// Some frames side by side, each seen from the front and a little to the side.
fn draw(read: &ReadMotion, path: &Path) -> Result<()> {
    let frames = read.motion.len();
    let (width, height) = SIZE;
    let pictures: Vec<Picture> = (0..SHOWN.min(frames))
        .map(|i| {
            let (points, faces) = bones(read, &read.motion.pose(i * frames / SHOWN.min(frames)));
            let mut scene = Scene::new();
            scene.add(&points, &faces, PLAIN);
            scene.draw(&Camera::framing(&points, AZIMUTH, ELEVATION), width, height)
        })
        .collect();
    let png = Picture::row(&pictures).to_png()?;
    Ok(write_atomic(path, |w| w.write_all(&png))?)
}

/// Every bone as a slender octahedron.
fn bones(read: &ReadMotion, pose: &ForeignPose) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let skeleton = &read.motion.skeleton;
    let (mut points, mut faces) = (Vec::new(), Vec::new());
    let mut add = |from: Vec3, to: Vec3| {
        let length = from.distance(to);
        if length < 1e-4 {
            return;
        }
        let along = (to - from) / length;
        let (side, other) = along.any_orthonormal_pair();
        let thick = (THICKNESS.0 * length).max(THICKNESS.1);
        let middle = from + (to - from) * 0.2;
        let first = points.len() as u32;
        points.extend([
            from,
            middle + side * thick,
            middle + other * thick,
            middle - side * thick,
            middle - other * thick,
            to,
        ]);
        for k in 0..4 {
            let (a, b) = (first + 1 + k, first + 1 + (k + 1) % 4);
            faces.extend([[first, b, a], [first + 5, a, b]]);
        }
    };
    for j in 0..skeleton.len() {
        let at = pose.positions[j].as_vec3();
        if let Some(parent) = skeleton.parents[j] {
            add(pose.positions[parent].as_vec3(), at);
        }
        if let Some(end) = skeleton.ends[j] {
            add(at, at + (pose.rotations[j] * end).as_vec3());
        }
    }
    (points, faces)
}
