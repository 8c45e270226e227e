use super::FeatureBlock;
use super::filter::{LowPass, VelocityTrack};
use glam::{Affine3A, Mat3, Vec3};
use softtissue_body::Pose;
use softtissue_geometry::rotation_from_axis_angle;

/// Gravity, m/s^2, Y up.
const GRAVITY: Vec3 = Vec3::new(0.0, -9.81, 0.0);
/// A blended matrix with a smaller determinant is not inverted; its transpose (its inverse, were it a rotation) is used.
const SMALLEST_DETERMINANT: f32 = 0.1;

/// `f_v = B_v^-1 (g - a_v) - g`: the force a unit mass of flesh at `v` feels in the rest frame, with `a_v` the
/// acceleration of the skinned vertex and `B_v` its blended skinning matrix; then `u = V f` on the delta modes.
#[derive(Clone, Debug)]
pub(super) struct ForceFeatures {
    /// Vertices whose forces count, ascending.
    vertices: Vec<u32>,
    /// `[M, 3 * vertices]`, row-major.
    modes: Vec<f32>,
    mode_count: usize,
    /// Entries of `R_j - I` of the joints below the root follow the forces.
    pose_joints: usize,
    low_pass: LowPass,
    fps: f32,
}

/// Memory and scratch of [`ForceFeatures`].
#[derive(Clone, Debug)]
pub(super) struct ForceState {
    previous: Vec<Vec3>,
    tracks: Vec<VelocityTrack<Vec3>>,
    force: Vec<f32>,
    started: bool,
}

impl ForceFeatures {
    /// `modes` is `[M, V, 3]`; only the listed vertices' columns are kept.
    pub(super) fn new(modes: &[f32], mode_count: usize, vertices: Vec<u32>, low_pass: LowPass, fps: f32) -> Self {
        let width = modes.len() / mode_count;
        let kept = modes
            .chunks_exact(width)
            .flat_map(|mode| vertices.iter().flat_map(|v| mode[3 * *v as usize..][..3].iter().copied()))
            .collect();
        Self { vertices, modes: kept, mode_count, pose_joints: 0, low_pass, fps }
    }
    pub(super) fn with_pose_entries(mut self, joints: usize) -> Self {
        self.pose_joints = joints - 1;
        self
    }
    pub(super) fn blocks(&self) -> Vec<FeatureBlock> {
        let mut sizes = vec![("modal-forces", self.mode_count)];
        if self.pose_joints > 0 {
            sizes.push(("pose-entries", 9 * self.pose_joints));
        }
        FeatureBlock::in_a_row(&sizes)
    }
    pub(super) fn weight_bytes(&self) -> usize {
        size_of_val(&self.modes[..])
    }
    pub(super) fn state(&self) -> ForceState {
        let n = self.vertices.len();
        ForceState {
            previous: vec![Vec3::ZERO; n],
            tracks: vec![VelocityTrack::default(); n],
            force: vec![0.0; 3 * n],
            started: false,
        }
    }
    pub(super) fn step(
        &self,
        state: &mut ForceState,
        pose: Pose,
        transforms: &[Affine3A],
        skinned: &[Vec3],
        out: &mut [f32],
    ) {
        for (i, &v) in self.vertices.iter().enumerate() {
            let position = skinned[v as usize];
            let acceleration = if state.started {
                let velocity = (position - state.previous[i]) * self.fps;
                self.low_pass.step(&mut state.tracks[i], velocity, self.fps).1
            } else {
                Vec3::ZERO
            };
            state.previous[i] = position;
            let posed_from_rest = Mat3::from(transforms[v as usize].matrix3);
            let rest_from_posed = if posed_from_rest.determinant() < SMALLEST_DETERMINANT {
                posed_from_rest.transpose()
            } else {
                posed_from_rest.inverse()
            };
            (rest_from_posed * (GRAVITY - acceleration) - GRAVITY).write_to_slice(&mut state.force[3 * i..]);
        }
        state.started = true;
        let (forces, entries) = out.split_at_mut(self.mode_count);
        for (u, mode) in forces.iter_mut().zip(self.modes.chunks_exact(state.force.len().max(1))) {
            *u = dot(mode, &state.force);
        }
        for (entry, w) in entries.chunks_exact_mut(9).zip(&pose.rotations[1..]) {
            let d = rotation_from_axis_angle(*w) - Mat3::IDENTITY;
            entry.copy_from_slice(&d.transpose().to_cols_array());
        }
    }
}

/// Sixteen partial sums, so that the compiler may use wide registers; the order of additions is fixed.
fn dot(a: &[f32], b: &[f32]) -> f32 {
    let ((a, a_rest), (b, b_rest)) = (a.as_chunks::<16>(), b.as_chunks::<16>());
    let mut sums = [0.0f32; 16];
    for (a, b) in a.iter().zip(b) {
        for k in 0..16 {
            sums[k] += a[k] * b[k];
        }
    }
    sums.iter().sum::<f32>() + a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum::<f32>()
}
