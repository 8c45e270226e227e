use glam::{Mat3, Vec3};
use softtissue_body::{ShapedBody, Skeleton};
use softtissue_clips::{ClipId, MotionClip};
use softtissue_geometry::rotation_from_axis_angle;
use softtissue_import::motion::{MotionConfig, ReadMotion, RetargetConfig, Retargeted, read_motion, retarget};
use std::path::{Path, PathBuf};

/// A cut of a real take.
pub fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/motion").join(name)
}

/// A file that Python made.
pub fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/fixtures/motion").join(name)
}

/// Reads a motion that is fine.
pub fn read(path: &Path) -> ReadMotion {
    read_motion(path, &MotionConfig::default()).unwrap()
}

/// An adult in A-pose: the left half; the right is its mirror image.
pub fn body() -> ShapedBody {
    const LEFT: [(usize, [f32; 3]); 15] = [
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
    let mut joints = vec![Vec3::ZERO; 24];
    for (j, p) in LEFT {
        joints[j] = Vec3::from_array(p);
        if p[0] > 0.0 {
            joints[j + 1] = Vec3::new(-p[0], p[1], p[2]);
        }
    }
    ShapedBody { vertices: vec![Vec3::ZERO, Vec3::Y * 1.68], joints }
}

/// Puts a motion onto [`body`].
pub fn on_body(read: &ReadMotion) -> Retargeted {
    let config = RetargetConfig::default();
    retarget(Path::new("clip"), read, ClipId::new("a", "b", 0), &Skeleton::smpl(), &body(), &config).unwrap()
}

/// `world_from_rest` rotations and positions of all joints in a frame.
pub fn posed(clip: &MotionClip, t: usize) -> ([Mat3; 24], [Vec3; 24]) {
    let (joints, parents) = (body().joints, Skeleton::smpl().parents);
    let mut world = [Mat3::IDENTITY; 24];
    let mut at = [joints[0] + clip.translations[t]; 24];
    for j in 0..24 {
        let local = rotation_from_axis_angle(clip.rotations.frame(t)[j]);
        world[j] = parents[j].map_or(local, |p| world[usize::from(p)] * local);
        if let Some(p) = parents[j].map(usize::from) {
            at[j] = at[p] + world[p] * (joints[j] - joints[p]);
        }
    }
    (world, at)
}

/// Angle between two rotations, degrees.
pub fn degrees(a: Mat3, b: Mat3) -> f32 {
    let d = a.transpose() * b;
    // by the sine where it is small: the cosine of a small angle has no digits left
    let sine = Vec3::new(d.y_axis.z - d.z_axis.y, d.z_axis.x - d.x_axis.z, d.x_axis.y - d.y_axis.x).length();
    sine.atan2(d.x_axis.x + d.y_axis.y + d.z_axis.z - 1.0).to_degrees()
}

/// Greatest difference of joint rotations (relative to the parents; degrees) and of joint positions (metres).
pub fn differences(a: &MotionClip, b: &MotionClip) -> (f32, f32) {
    assert_eq!(a.len(), b.len());
    let mut worst = (0.0f32, 0.0f32);
    for t in 0..a.len() {
        let ((_, at_a), (_, at_b)) = (posed(a, t), posed(b, t));
        for j in 0..24 {
            let [wa, wb] = [a, b].map(|c| rotation_from_axis_angle(c.rotations.frame(t)[j]));
            worst = (worst.0.max(degrees(wa, wb)), worst.1.max(at_a[j].distance(at_b[j])));
        }
    }
    worst
}
