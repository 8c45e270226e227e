//! One trip over the vertices: value, and gradient and Gauss-Newton matrix in the space of bone twists.
//!
//! A change of pose gives every bone `k` a twist `(w, v)`, which moves the rest point `p` of a vertex by
//! `sum_k b_k (w_k x y_k + v_k)` with `y_k = A_k p` and skin weights `b_k`. A vertex meets at most four bones, so its
//! part of the normal matrix is at most ten blocks of 6 x 6, whatever the depth of the skeleton; the chain of joints
//! is applied once, to the sums.

use crate::ObjectiveKind;
use crate::packed::{BLOCK, Influences, LANES, PackedBody};
use crate::pose_state::Kinematics;
use glam::{Affine3A, Mat3A, Vec3, Vec3A};
use softtissue_body::SMALLEST_DETERMINANT;

/// A 6 x 6 block, rows padded to eight numbers.
pub(crate) type TwistBlock = [[f32; 8]; 6];

/// What the trip needs beside the body.
pub(crate) struct Surface<'a> {
    pub packed: &'a PackedBody,
    pub kind: ObjectiveKind,
    /// Sorted rest vertices with subject template, without pose correctives, `[V]`.
    pub rest: &'a [Vec3],
    /// Sorted weights, summing to one, `[V]`.
    pub weights: &'a [f32],
    /// Sorted shape blendshapes `[S, V]`; empty when the shape is held.
    pub shape_directions: &'a [Vec3],
}

/// Sums over vertices.
#[derive(Clone)]
pub(crate) struct Sums {
    /// Weighted mean squared residual, m^2.
    pub value: f64,
    /// Half the gradient by each bone's twist (angular, linear), `[J]`.
    pub bones: Vec<[f64; 6]>,
    /// Gauss-Newton blocks of bones `k <= l`, at [`pair`].
    pub pairs: Vec<TwistBlock>,
    /// Half the gradient by each pose feature with the bones held, `[P]`.
    pub features: Vec<f32>,
    /// Half the gradient by each shape coefficient with the bones held, `[S]`.
    pub shape: Vec<f64>,
    /// Gauss-Newton blocks of bone and shape, `[J][S]`.
    pub bone_shape: Vec<[f64; 6]>,
    /// Gauss-Newton block of the shape with the bones held, `[S, S]`.
    pub shape_shape: Vec<f64>,
}

/// Place of bones `k <= l` in a list of pairs.
pub(crate) fn pair(joints: usize, k: usize, l: usize) -> usize {
    debug_assert!(k <= l && l < joints);
    k * joints - k * (k + 1) / 2 + l
}

impl Sums {
    pub fn new(packed: &PackedBody, shapes: usize) -> Self {
        let j = packed.joint_count;
        Self {
            value: 0.0,
            bones: vec![[0.0; 6]; j],
            pairs: vec![[[0.0; 8]; 6]; j * (j + 1) / 2],
            features: vec![0.0; packed.feature_count()],
            shape: vec![0.0; shapes],
            bone_shape: vec![[0.0; 6]; j * shapes],
            shape_shape: vec![0.0; shapes * shapes],
        }
    }

    fn clear(&mut self) {
        self.value = 0.0;
        self.bones.fill([0.0; 6]);
        self.pairs.fill([[0.0; 8]; 6]);
        self.features.fill(0.0);
        self.shape.fill(0.0);
        self.bone_shape.fill([0.0; 6]);
        self.shape_shape.fill(0.0);
    }
}

/// The residual of a vertex and how it moves: `dr = motion (dB p) + correction d(rest)`.
pub(crate) struct Residual {
    pub value: Vec3A,
    /// The rest point that the bones carry.
    pub carried: Vec3A,
    pub motion: Mat3A,
    pub correction: Mat3A,
}

impl Surface<'_> {
    /// The objective alone.
    pub fn value(&self, kinematics: &Kinematics, scan: &[Vec3]) -> f64 {
        let mut value = 0.0;
        for block in 0..self.packed.blocks() {
            let mut offsets = [0.0; LANES];
            self.packed.block_offsets(block, &kinematics.features, &mut offsets);
            let mut sum = 0.0f32;
            for (place, v) in self.vertices(block).enumerate() {
                let r = self.residual(kinematics, v, &offsets, place, scan[v]);
                sum += self.weights[v] * r.value.length_squared();
            }
            value += f64::from(sum);
        }
        value
    }

    /// Residuals in sorted order, `[V]`: unposed deltas when the objective is the unposed one.
    pub fn residuals(&self, kinematics: &Kinematics, scan: &[Vec3]) -> Vec<Vec3> {
        let mut residuals = Vec::with_capacity(scan.len());
        for block in 0..self.packed.blocks() {
            let mut offsets = [0.0; LANES];
            self.packed.block_offsets(block, &kinematics.features, &mut offsets);
            for (place, v) in self.vertices(block).enumerate() {
                residuals.push(self.residual(kinematics, v, &offsets, place, scan[v]).value.into());
            }
        }
        residuals
    }

    /// Vertices, in the mesh's order of numbers, whose blended matrix is near singular.
    pub fn folded(&self, kinematics: &Kinematics) -> Vec<u32> {
        let folded = |v: &usize| {
            let blended: Mat3A =
                self.packed.influences[*v].iter().map(|(k, b)| kinematics.transforms[k].matrix3 * b).sum();
            blended.determinant() < SMALLEST_DETERMINANT
        };
        (0..self.rest.len()).filter(folded).map(|v| self.packed.order[v]).collect()
    }

    /// All sums; `scan` in sorted order, `[V]`.
    pub fn accumulate(&self, kinematics: &Kinematics, scan: &[Vec3], sums: &mut Sums) {
        sums.clear();
        for block in 0..self.packed.blocks() {
            self.accumulate_block(block, kinematics, scan, sums);
        }
    }

    fn accumulate_block(&self, block: usize, kinematics: &Kinematics, scan: &[Vec3], sums: &mut Sums) {
        let mut offsets = [0.0; LANES];
        self.packed.block_offsets(block, &kinematics.features, &mut offsets);
        let mut pulled = [0.0; LANES];
        let mut value = 0.0f32;
        for (place, v) in self.vertices(block).enumerate() {
            let r = self.residual(kinematics, v, &offsets, place, scan[v]);
            let weight = self.weights[v];
            value += weight * r.value.length_squared();
            let back = r.correction.transpose() * (r.value * weight);
            pulled[3 * place..3 * place + 3].copy_from_slice(&back.to_array());
            self.accumulate_bones(&self.packed.influences[v], kinematics, &r, weight, sums);
            if !sums.shape.is_empty() {
                self.accumulate_shape(v, kinematics, &r, back, sums);
            }
        }
        sums.value += f64::from(value);
        self.packed.add_block_products(block, &pulled, &mut sums.features);
    }

    #[inline(always)]
    fn accumulate_bones(
        &self,
        bones: &Influences,
        kinematics: &Kinematics,
        r: &Residual,
        weight: f32,
        sums: &mut Sums,
    ) {
        let root = weight.sqrt();
        // rows of the weighted 3 x 3 that takes a motion of the carried point to the residual
        let rows = (r.motion * root).transpose();
        let residual = r.value * root;
        let mut columns = [[[0.0f32; 8]; 3]; 4];
        for (slot, (k, b)) in bones.iter().enumerate() {
            let y = kinematics.transforms[k].transform_point3a(r.carried) - kinematics.origin;
            let mut gradient = [0.0f32; 6];
            for c in 0..3 {
                let row = rows.col(c) * b;
                let angular = y.cross(row);
                let x = [angular.x, angular.y, angular.z, row.x, row.y, row.z, 0.0, 0.0];
                for i in 0..6 {
                    gradient[i] += x[i] * residual[c];
                }
                columns[slot][c] = x;
            }
            for (sum, x) in sums.bones[k].iter_mut().zip(gradient) {
                *sum += f64::from(x);
            }
        }
        let joints = self.packed.joint_count;
        for (first, (k, _)) in bones.iter().enumerate() {
            for (second, (l, _)) in bones.iter().enumerate().skip(first) {
                add_product(&mut sums.pairs[pair(joints, k, l)], &columns[first], &columns[second]);
            }
        }
    }

    fn accumulate_shape(&self, v: usize, kinematics: &Kinematics, r: &Residual, back: Vec3A, sums: &mut Sums) {
        let (shapes, count, weight) = (sums.shape.len(), self.rest.len(), self.weights[v]);
        let fields: Vec<Vec3A> = (0..shapes).map(|s| Vec3A::from(self.shape_directions[s * count + v])).collect();
        for (s, field) in fields.iter().enumerate() {
            sums.shape[s] += f64::from(back.dot(*field));
            let moved = r.correction * *field * weight;
            for (t, other) in fields.iter().enumerate() {
                sums.shape_shape[s * shapes + t] += f64::from(moved.dot(r.correction * *other));
            }
            let force = r.motion.transpose() * moved;
            for (k, b) in self.packed.influences[v].iter() {
                let y = kinematics.transforms[k].transform_point3a(r.carried) - kinematics.origin;
                let turn = y.cross(force);
                for (sum, x) in
                    sums.bone_shape[k * shapes + s].iter_mut().zip(turn.to_array().into_iter().chain(force.to_array()))
                {
                    *sum += f64::from(b * x);
                }
            }
        }
    }

    fn vertices(&self, block: usize) -> std::ops::Range<usize> {
        block * BLOCK..((block + 1) * BLOCK).min(self.rest.len())
    }

    #[inline(always)]
    pub(crate) fn residual(
        &self,
        kinematics: &Kinematics,
        v: usize,
        offsets: &[f32; LANES],
        place: usize,
        scan: Vec3,
    ) -> Residual {
        let bones = &self.packed.influences[v];
        let offset = Vec3::new(offsets[3 * place], offsets[3 * place + 1], offsets[3 * place + 2]);
        let rest = Vec3A::from(self.rest[v] + offset);
        let scan = Vec3A::from(scan);
        let mut blended = Affine3A::ZERO;
        for (k, b) in bones.iter() {
            blended.matrix3 += kinematics.transforms[k].matrix3 * b;
            blended.translation += kinematics.transforms[k].translation * b;
        }
        match self.kind {
            ObjectiveKind::Posed => Residual {
                value: blended.transform_point3a(rest) - scan,
                carried: rest,
                motion: Mat3A::IDENTITY,
                correction: blended.matrix3,
            },
            ObjectiveKind::Unposed => {
                let folded = blended.matrix3.determinant() < SMALLEST_DETERMINANT;
                if folded {
                    // on its way a step may fold a vertex; its strongest bone alone can always be undone
                    blended = kinematics.transforms[bones.dominant()];
                }
                let rest_from_posed = blended.matrix3.inverse();
                let unposed = rest_from_posed * (scan - blended.translation);
                Residual {
                    value: unposed - rest,
                    carried: unposed,
                    motion: -rest_from_posed,
                    correction: -Mat3A::IDENTITY,
                }
            }
        }
    }
}

/// `block += a^T b` for two `[3, 6]` matrices.
#[inline(always)]
fn add_product(block: &mut TwistBlock, a: &[[f32; 8]; 3], b: &[[f32; 8]; 3]) {
    for i in 0..6 {
        for j in 0..8 {
            block[i][j] += a[0][i] * b[0][j] + a[1][i] * b[1][j] + a[2][i] * b[2][j];
        }
    }
}
