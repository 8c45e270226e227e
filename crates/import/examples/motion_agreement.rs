//! How far two files of one take are apart on our skeleton: `cargo run -p softtissue-import --example motion_agreement A B`.

use glam::{DQuat, DVec3, Vec3};
use softtissue_body::{ShapedBody, Skeleton};
use softtissue_clips::{ClipId, MotionClip};
use softtissue_import::motion::{MotionConfig, RetargetConfig, read_motion, retarget};
use std::path::Path;

/// Left joints of an adult in A-pose, metres; the right ones are their mirror images.
const JOINTS: [(usize, [f32; 3]); 15] = [
    (0, [0.0, 0.915, -0.005]),
    (1, [0.088, 0.865, 0.0]),
    (3, [0.0, 1.005, -0.02]),
    (4, [0.138, 0.465, 0.008]),
    (6, [0.0, 1.125, -0.03]),
    (7, [0.182, 0.08, -0.025]),
    (9, [0.0, 1.195, -0.03]),
    (10, [0.192, 0.028, 0.095]),
    (12, [0.0, 1.395, -0.03]),
    (13, [0.072, 1.33, -0.025]),
    (15, [0.0, 1.48, 0.002]),
    (16, [0.168, 1.345, -0.028]),
    (18, [0.343, 1.15, -0.032]),
    (20, [0.502, 0.968, -0.01]),
    (22, [0.557, 0.905, -0.002]),
];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut joints = vec![Vec3::ZERO; 24];
    for (j, p) in JOINTS {
        joints[j] = Vec3::from_array(p);
        if p[0] > 0.0 {
            joints[j + 1] = Vec3::new(-p[0], p[1], p[2]);
        }
    }
    let body = ShapedBody { vertices: vec![Vec3::ZERO, Vec3::Y * 1.68], joints };
    let mut clips = Vec::new();
    for path in std::env::args_os().skip(1) {
        let path = Path::new(&path);
        let read = read_motion(path, &MotionConfig::default())?;
        let id = ClipId::new("a", "b", 0);
        let done = retarget(path, &read, id, &Skeleton::smpl(), &body, &RetargetConfig::default())?;
        println!("{}: {}", path.display(), read.facts.sentence());
        println!(
            "  root scaled by {:.4}, {:?} frames of contact, a bearing foot at most {:.1} mm off",
            done.scale,
            done.contact_frames,
            1e3 * done.worst_contact_m
        );
        clips.push(done.clip);
    }
    let [a, b] = &clips[..] else { return Err("name two files of one take".into()) };
    let (mut angle, mut distance) = ([0.0f64; 24], [0.0f64; 24]);
    for t in 0..a.len().min(b.len()) {
        let (pa, pb) = (posed(a, t, &body.joints), posed(b, t, &body.joints));
        for j in 0..24 {
            let turn = |c: &MotionClip| DQuat::from_scaled_axis(c.rotations.frame(t)[j].as_dvec3());
            angle[j] = angle[j].max(turn(a).angle_between(turn(b)).to_degrees());
            distance[j] = distance[j].max(pa[j].distance(pb[j]));
        }
    }
    println!("{} and {} frames; greatest difference of each joint:", a.len(), b.len());
    for (j, name) in Skeleton::smpl().names.iter().enumerate() {
        println!("  {name:15} {:8.4} degrees {:8.4} mm", angle[j], 1e3 * distance[j]);
    }
    Ok(())
}

fn posed(clip: &MotionClip, t: usize, joints: &[Vec3]) -> [DVec3; 24] {
    let parents = Skeleton::smpl().parents;
    let mut world = [DQuat::IDENTITY; 24];
    let mut at = [(joints[0] + clip.translations[t]).as_dvec3(); 24];
    for j in 0..24 {
        let local = DQuat::from_scaled_axis(clip.rotations.frame(t)[j].as_dvec3());
        world[j] = local;
        if let Some(p) = parents[j].map(usize::from) {
            world[j] = world[p] * local;
            at[j] = at[p] + world[p] * (joints[j] - joints[p]).as_dvec3();
        }
    }
    at
}
