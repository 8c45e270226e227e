//! The part of the Gauss-Newton matrix between bone twists and pose correctives.
//!
//! It is the dearest part (every vertex meets all features), but seen from the bones it changes slowly: it is kept in
//! the bones' own frames, where it is nearly constant, and made anew when the pose has moved far from where it was
//! made. It steers steps only; the gradient is whole without it, so no minimum depends on its age.

use crate::accumulate::Surface;
use crate::packed::{BLOCK, LANES};
use crate::pose_state::{Kinematics, PoseState};
use glam::{Vec3, Vec3A};

/// Rows (angular, linear) of one bone in a block of vertices.
type Rows = [[f32; LANES]; 6];

/// `[J][P]` twists in the bones' own frames.
#[derive(Clone)]
pub(crate) struct Cross {
    joints: usize,
    local: Vec<[Vec3A; 2]>,
    made_at: PoseState,
}

impl Cross {
    /// Whether any joint has turned by more than `angle` radians since this was made.
    pub fn is_older_than(&self, state: &PoseState, angle: f32) -> bool {
        let turned = state.rotations.iter().zip(&self.made_at.rotations).skip(1);
        turned.map(|(a, b)| a.angle_between(*b)).any(|x| x > angle)
    }

    /// `[J][P]` twists about the kinematics' origin, world axes.
    pub fn world(&self, kinematics: &Kinematics) -> Vec<[Vec3A; 2]> {
        let p = self.local.len() / self.joints;
        let carried = self.local.chunks_exact(p).zip(&kinematics.transforms).flat_map(|(row, bone)| {
            let arm = bone.translation - kinematics.origin;
            row.iter().map(move |[turn, push]| {
                let push = bone.matrix3 * *push;
                [bone.matrix3 * *turn + arm.cross(push), push]
            })
        });
        carried.collect()
    }
}

impl Surface<'_> {
    /// The part between bones and correctives at a pose; `scan` sorted, `[V]`.
    pub fn cross(&self, kinematics: &Kinematics, state: &PoseState, scan: &[Vec3]) -> Cross {
        let joints = self.packed.joint_count;
        let p = self.packed.feature_count();
        let mut sums = vec![[0.0f32; 6]; joints * p];
        let mut rows: Vec<(usize, Box<Rows>)> = Vec::new();
        for block in 0..self.packed.blocks() {
            let mut offsets = [0.0; LANES];
            self.packed.block_offsets(block, &kinematics.features, &mut offsets);
            rows.clear();
            for place in 0..BLOCK.min(self.rest.len() - block * BLOCK) {
                self.fill_rows(block * BLOCK + place, place, kinematics, &offsets, scan, &mut rows);
            }
            for (bone, rows) in &rows {
                self.packed.add_block_twists(block, rows, &mut sums[bone * p..(bone + 1) * p]);
            }
        }
        let local = sums.chunks_exact(p).zip(&kinematics.transforms).flat_map(|(row, bone)| {
            let local_from_world = bone.matrix3.transpose();
            let arm = bone.translation - kinematics.origin;
            row.iter().map(move |x| {
                let (turn, push) = (Vec3A::new(x[0], x[1], x[2]), Vec3A::new(x[3], x[4], x[5]));
                [local_from_world * (turn - arm.cross(push)), local_from_world * push]
            })
        });
        Cross { joints, local: local.collect(), made_at: state.clone() }
    }

    fn fill_rows(
        &self,
        v: usize,
        place: usize,
        kinematics: &Kinematics,
        offsets: &[f32; LANES],
        scan: &[Vec3],
        rows: &mut Vec<(usize, Box<Rows>)>,
    ) {
        let r = self.residual(kinematics, v, offsets, place, scan[v]);
        // takes a change of the rest position to a force on the carried point
        let pull = r.motion.transpose() * r.correction * self.weights[v];
        for (bone, b) in self.packed.influences[v].iter() {
            let y = kinematics.transforms[bone].transform_point3a(r.carried) - kinematics.origin;
            let at = rows.iter().position(|(k, _)| *k == bone).unwrap_or_else(|| {
                rows.push((bone, Box::new([[0.0; LANES]; 6])));
                rows.len() - 1
            });
            for c in 0..3 {
                let push = pull.col(c) * b;
                let turn = y.cross(push);
                for i in 0..3 {
                    rows[at].1[i][3 * place + c] = turn[i];
                    rows[at].1[3 + i][3 * place + c] = push[i];
                }
            }
        }
    }
}
