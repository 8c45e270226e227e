//! AMASS: SMPL, SMPL-H and SMPL-X poses in npz archives.
//!
//! Source: N. Mahmood et al., "AMASS: Archive of Motion Capture as Surface Shapes", ICCV 2019. The first generation has
//! `poses (T, 156)`, `trans (T, 3)` and `mocap_framerate`, the second `root_orient`, `pose_body`, `trans` and
//! `mocap_frame_rate`. Axis-angle, metres, Z up. The body itself is not in the file: its rest joints are those of an
//! average adult here, so that the root's path is right to some centimetres.

use super::foreign::{ForeignMotion, ForeignSkeleton, check_size};
use super::text::LARGEST;
use super::{MotionConfig, snapped_rate};
use crate::Result;
use crate::arrays::{Array, ArrayLimits, Npz};
use glam::{DQuat, DVec3};
use std::path::Path;

/// Body joints that are read; fingers, jaw and eyes are left.
const JOINTS: usize = 22;

/// SMPL's names, parents and, relative to these, an average adult's joints in the T-pose, metres.
const SKELETON: [(&str, Option<usize>, [f64; 3]); JOINTS] = [
    ("pelvis", None, [0.0, -0.22, 0.03]),
    ("left_hip", Some(0), [0.06, -0.09, -0.005]),
    ("right_hip", Some(0), [-0.06, -0.09, -0.005]),
    ("spine1", Some(0), [0.0, 0.11, -0.03]),
    ("left_knee", Some(1), [0.045, -0.38, 0.005]),
    ("right_knee", Some(2), [-0.045, -0.38, 0.005]),
    ("spine2", Some(3), [0.0, 0.135, 0.0]),
    ("left_ankle", Some(4), [-0.015, -0.41, -0.04]),
    ("right_ankle", Some(5), [0.015, -0.41, -0.04]),
    ("spine3", Some(6), [0.0, 0.055, 0.025]),
    ("left_foot", Some(7), [0.035, -0.06, 0.12]),
    ("right_foot", Some(8), [-0.035, -0.06, 0.12]),
    ("neck", Some(9), [0.0, 0.21, -0.035]),
    ("left_collar", Some(9), [0.075, 0.115, -0.02]),
    ("right_collar", Some(9), [-0.075, 0.115, -0.02]),
    ("head", Some(12), [0.0, 0.09, 0.05]),
    ("left_shoulder", Some(13), [0.105, 0.035, -0.01]),
    ("right_shoulder", Some(14), [-0.105, 0.035, -0.01]),
    ("left_elbow", Some(16), [0.26, -0.015, -0.02]),
    ("right_elbow", Some(17), [-0.26, -0.015, -0.02]),
    ("left_wrist", Some(18), [0.25, 0.01, 0.0]),
    ("right_wrist", Some(19), [-0.25, 0.01, 0.0]),
];

/// Reads an AMASS archive, Z up.
///
/// # Errors
/// Names the array and what is wrong with it.
pub(super) fn read_amass(path: &Path, config: &MotionConfig) -> Result<ForeignMotion> {
    let limits = ArrayLimits {
        file_bytes: config.limits.archive_bytes,
        array_bytes: config.limits.array_bytes,
        ..ArrayLimits::default()
    };
    let file = Npz::open(path, &limits)?;
    let trans = file.require("trans")?;
    trans.expect_shape(&[None, Some(3)])?;
    let frames = trans.shape()[0];
    check_size(JOINTS, frames as u64, &config.limits).map_err(|e| trans.refuse(e))?;
    let places: Vec<DVec3> = vectors(&numbers(&trans)?).collect();
    let turns = match file.get("poses")? {
        Some(poses) => {
            poses.expect_shape(&[Some(frames), None])?;
            let width = poses.shape()[1];
            if width < 3 * JOINTS {
                return Err(poses.refuse(format!("{width} numbers a frame, expected at least {}", 3 * JOINTS)));
            }
            let numbers = numbers(&poses)?;
            numbers.chunks_exact(width).flat_map(|frame| vectors(&frame[..3 * JOINTS])).collect::<Vec<_>>()
        }
        None => {
            let (root, body) = (file.require("root_orient")?, file.require("pose_body")?);
            root.expect_shape(&[Some(frames), Some(3)])?;
            body.expect_shape(&[Some(frames), Some(3 * (JOINTS - 1))])?;
            let (root, body) = (numbers(&root)?, numbers(&body)?);
            let frames = root.chunks_exact(3).zip(body.chunks_exact(3 * (JOINTS - 1)));
            frames.flat_map(|(root, body)| vectors(root).chain(vectors(body))).collect()
        }
    };
    let skeleton = average_adult();
    let pelvis = skeleton.offsets[0];
    Ok(ForeignMotion {
        skeleton,
        fps: rate(&file, config)?,
        rotations: turns.into_iter().map(DQuat::from_scaled_axis).collect(),
        moving: vec![0],
        // SMPL turns about the pelvis joint and adds `trans` to everything
        positions: places.into_iter().map(|p| p + pelvis).collect(),
    })
}

fn rate(file: &Npz, config: &MotionConfig) -> Result<f64> {
    if let Some(fps) = config.fps {
        return Ok(fps);
    }
    let stated = match file.get("mocap_framerate")? {
        Some(rate) => rate,
        None => file.require("mocap_frame_rate")?,
    };
    let fps = stated.number()?;
    snapped_rate(fps)
        .ok_or_else(|| stated.refuse(format!("a rate of {fps} frames a second; correct it, or state --source-fps")))
}

/// Numbers that can be coordinates or angles.
fn numbers(array: &Array) -> Result<Vec<f64>> {
    let numbers = array.f64s()?;
    match numbers.iter().position(|x| x.abs() > LARGEST) {
        Some(at) => Err(array.refuse(format!("number {at} is beyond any body or angle; mend or cut the clip"))),
        None => Ok(numbers),
    }
}

fn vectors(numbers: &[f64]) -> impl Iterator<Item = DVec3> {
    numbers.as_chunks::<3>().0.iter().map(|v| DVec3::from_array(*v))
}

fn average_adult() -> ForeignSkeleton {
    let mut skeleton = ForeignSkeleton::default();
    for (name, parent, offset) in SKELETON {
        skeleton.push(name.into(), parent, DVec3::from_array(offset));
    }
    skeleton
}
