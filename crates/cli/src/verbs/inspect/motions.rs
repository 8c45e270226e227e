//! Motions, foreign and ours.

use super::facts::{Facts, range};
use crate::args::MotionSourceArgs;
use crate::verbs::contact_sheet::Tile;
use crate::verbs::near::BodyFinder;
use anyhow::Result;
use glam::Vec3;
use serde_json::json;
use softtissue_body::{BodyModel, Pose};
use softtissue_clips::MotionClip;
use softtissue_clips::inspection::{ClipFindings, SequenceWatch, SideWatch, Sides, WatchConfig};
use softtissue_import::motion::{ForeignPose, ReadMotion, examine};
use softtissue_store::TensorFile;
use std::path::Path;

/// Frames shown.
const SHOWN: usize = 6;
/// Thickness of a bone as a share of its length, and at least, metres.
const THICKNESS: (f32, f32) = (0.08, 0.008);
/// Joints of clips on our skeleton lower than this are below the floor, metres: on a body that is not the one of the
/// clip it lies a little elsewhere.
const BELOW: f32 = 0.25;

/// Facts of a foreign motion.
pub fn foreign(path: &Path) -> Result<Facts> {
    let read = MotionSourceArgs::default().read(path)?;
    let found = examine(&read);
    let facts = &read.facts;
    let guessed = (!facts.guessed.is_empty()).then_some(&facts.guessed);
    let mut told = Facts::new(format!("foreign motion ({})", facts.format))
        .with("frames", facts.frames)
        .with("frames_per_second", facts.fps)
        .with("seconds", facts.frames as f64 / facts.fps)
        .with("joints", facts.joints)
        .with("names", facts.naming)
        .with("skeleton", &facts.skeleton)
        .with("units", &facts.units)
        .with("metres_per_unit", facts.metres_per_unit)
        .with("up", format!("{:?}", facts.up))
        .with("height_m", facts.height_m)
        .with("guessed", guessed)
        .with("notes", (!facts.notes.is_empty()).then_some(&facts.notes))
        .with("range_m", found.range.map(range));
    told.problems = found.problems;
    let shown = shown(read.motion.len());
    told.rows.push(shown.map(|t| bones(&read, &read.motion.pose(t))).collect());
    Ok(told)
}

/// Some frames of a clip, from the first on.
fn shown(frames: usize) -> impl Iterator<Item = usize> {
    let shown = SHOWN.min(frames);
    (0..shown).map(move |i| i * frames / shown)
}

/// Every bone as a slender octahedron.
fn bones(read: &ReadMotion, pose: &ForeignPose) -> Tile {
    let skeleton = &read.motion.skeleton;
    let mut tile = Tile::default();
    for j in 0..skeleton.len() {
        let at = pose.positions[j].as_vec3();
        if let Some(parent) = skeleton.parents[j] {
            add_bone(&mut tile, pose.positions[parent].as_vec3(), at);
        }
        if let Some(end) = skeleton.ends[j] {
            add_bone(&mut tile, at, at + (pose.rotations[j] * end).as_vec3());
        }
    }
    tile
}

fn add_bone(tile: &mut Tile, from: Vec3, to: Vec3) {
    let length = from.distance(to);
    if length < 1e-4 {
        return;
    }
    let along = (to - from) / length;
    let (side, other) = along.any_orthonormal_pair();
    let thick = (THICKNESS.0 * length).max(THICKNESS.1);
    let middle = from + (to - from) * 0.2;
    let first = tile.points.len() as u32;
    let round = [side, other, -side, -other].map(|way| middle + way * thick);
    tile.points.push(from);
    tile.points.extend(round);
    tile.points.push(to);
    for k in 0..4 {
        let (a, b) = (first + 1 + k, first + 1 + (k + 1) % 4);
        tile.faces.extend([[first, b, a], [first + 5, a, b]]);
    }
}

/// Facts of a motion clip of ours.
pub fn ours(path: &Path, file: &TensorFile, finder: &BodyFinder) -> Result<Facts> {
    let clip = MotionClip::read(path)?;
    let joints = clip.rotations.points_per_frame();
    let mut facts = Facts::new("motion clip")
        .with("clip", clip.id.to_string())
        .with("frames", clip.len())
        .with("frames_per_second", clip.fps)
        .with("seconds", clip.len() as f32 / clip.fps)
        .with("joints", joints)
        .with("units", "metres and radians")
        .with("up", "Y");
    if let Some(body) = finder.of_joints(joints) {
        let found = examine_clip(&clip, &body);
        facts.set("range_m", found.range.map(range));
        facts.set("range_is_of", "joints of a body of middle shape");
        facts.problems = found.problems;
        let rest = body.shaped(&[]);
        let pose = |t: usize| Pose { rotations: clip.rotations.frame(t), translation: clip.translations[t] };
        let tile = |t| Tile::new(&body.posed(&rest, pose(t), None), &body.topology.faces);
        facts.rows.push(shown(clip.len()).map(tile).collect());
    }
    if let Some(provenance) = file.meta("provenance") {
        facts.set("provenance", serde_json::from_str(provenance).unwrap_or_else(|_| json!(provenance)));
    }
    Ok(facts)
}

/// Range of the joints, and what is wrong with a motion, on a body of middle shape.
pub fn examine_clip(clip: &MotionClip, body: &BodyModel) -> ClipFindings {
    let config = WatchConfig { floor_m: Some(BELOW), ..WatchConfig::joints() };
    let mut watch = SequenceWatch::new(clip.fps, config).named(body.skeleton.names.clone());
    let mut sides = Sides::of_names(&body.skeleton.names).map(SideWatch::new);
    let joints = body.shaped(&[]).joints;
    for t in 0..clip.len() {
        let pose = Pose { rotations: clip.rotations.frame(t), translation: clip.translations[t] };
        let at = body.posed_joints(&joints, pose);
        watch.frame(t, &at);
        if let Some(sides) = &mut sides {
            sides.frame(&at);
        }
    }
    let range = watch.range();
    let mut problems = sides.map_or_else(Vec::new, SideWatch::finish);
    problems.extend(watch.finish());
    ClipFindings { range, problems, ..ClipFindings::default() }
}
