use glam::Vec3;
use softtissue_body::BodyModel;

/// Vertices a block: the block's blendshapes fit the second-level cache, so that one trip through memory serves both
/// the offsets and the gradient.
pub(crate) const BLOCK: usize = 64;
/// Numbers of a block.
pub(crate) const LANES: usize = 3 * BLOCK;

/// At most four bones that move a vertex, ascending, with their weights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Influences {
    pub bones: [u8; 4],
    pub weights: [f32; 4],
    pub count: u8,
}

impl Influences {
    pub fn iter(&self) -> impl Iterator<Item = (usize, f32)> + Clone + '_ {
        (0..self.count as usize).map(|i| (self.bones[i] as usize, self.weights[i]))
    }
    /// The bone with the largest weight.
    pub fn dominant(&self) -> usize {
        let best = (0..self.count as usize).max_by(|&a, &b| self.weights[a].total_cmp(&self.weights[b]));
        self.bones[best.unwrap_or(0)] as usize
    }
}

/// A body laid out for the fit: vertices sorted by the bones that move them, pose blendshapes in blocks of
/// vertices, blocks that a joint does not reach marked.
#[derive(Debug)]
pub struct PackedBody {
    pub(crate) joint_count: usize,
    pub(crate) parents: Vec<Option<usize>>,
    /// Joints of the trunk, `[J]`.
    pub(crate) trunk: Vec<bool>,
    /// Vertex of the mesh at each place, `[V]`.
    pub(crate) order: Vec<u32>,
    pub(crate) influences: Vec<Influences>,
    /// `[blocks][P][LANES]`, zero behind the last vertex.
    directions: Vec<f32>,
    /// `[blocks][J - 1]`: the joint's nine fields are not all zero there.
    reached: Vec<bool>,
}

impl PackedBody {
    /// Lays a body out.
    pub fn new(body: &BodyModel) -> Self {
        let v = body.vertex_count();
        let influences: Vec<Influences> = body.skin.iter().map(sorted_influences).collect();
        let mut order: Vec<u32> = (0..v as u32).collect();
        order.sort_by_key(|&i| {
            let s = &influences[i as usize];
            (s.dominant(), s.count, s.bones, i)
        });
        let influences = order.iter().map(|&i| influences[i as usize]).collect();
        let feature_count = 9 * (body.joint_count() - 1);
        let blocks = v.div_ceil(BLOCK);
        let mut directions = vec![0.0; blocks * feature_count * LANES];
        for (place, &vertex) in order.iter().enumerate() {
            for p in 0..feature_count {
                let at = ((place / BLOCK) * feature_count + p) * LANES + 3 * (place % BLOCK);
                let d = body.pose_directions[p * v + vertex as usize];
                directions[at..at + 3].copy_from_slice(&d.to_array());
            }
        }
        let reached = directions.chunks_exact(9 * LANES).map(|joint| joint.iter().any(|x| *x != 0.0)).collect();
        Self {
            joint_count: body.joint_count(),
            parents: body.skeleton.parents.iter().map(|p| p.map(usize::from)).collect(),
            trunk: body.skeleton.trunk(),
            order,
            influences,
            directions,
            reached,
        }
    }

    pub(crate) fn vertex_count(&self) -> usize {
        self.order.len()
    }
    pub(crate) fn feature_count(&self) -> usize {
        9 * (self.joint_count - 1)
    }
    pub(crate) fn blocks(&self) -> usize {
        self.order.len().div_ceil(BLOCK)
    }
    /// A field in the mesh's order, sorted.
    pub(crate) fn sorted<T: Copy>(&self, field: &[T]) -> Vec<T> {
        assert_eq!(field.len(), self.order.len(), "vertices of a field");
        self.order.iter().map(|&v| field[v as usize]).collect()
    }
    /// A sorted field in the mesh's order.
    pub(crate) fn unsorted<T: Copy + Default>(&self, sorted: &[T]) -> Vec<T> {
        let mut field = vec![T::default(); sorted.len()];
        for (&v, x) in self.order.iter().zip(sorted) {
            field[v as usize] = *x;
        }
        field
    }

    /// `Bp` of a block from the pose features, `[LANES]`.
    #[inline(always)]
    pub(crate) fn block_offsets(&self, block: usize, features: &[f32], offsets: &mut [f32; LANES]) {
        offsets.fill(0.0);
        for (joint, f) in features.as_chunks::<9>().0.iter().enumerate() {
            if let Some(rows) = self.rows(block, joint) {
                let rows: [&[f32; LANES]; 9] = std::array::from_fn(|p| &rows[p]);
                for i in 0..LANES {
                    let low = f[0] * rows[0][i] + f[1] * rows[1][i] + f[2] * rows[2][i] + f[3] * rows[3][i];
                    let high = f[4] * rows[4][i] + f[5] * rows[5][i] + f[6] * rows[6][i] + f[7] * rows[7][i];
                    offsets[i] += low + high + f[8] * rows[8][i];
                }
            }
        }
    }

    /// Adds a block's part of `pose_directions . field`, `[P]`.
    #[inline(always)]
    pub(crate) fn add_block_products(&self, block: usize, field: &[f32; LANES], products: &mut [f32]) {
        for (joint, out) in products.as_chunks_mut::<9>().0.iter_mut().enumerate() {
            if let Some(rows) = self.rows(block, joint) {
                for (row, x) in rows.iter().zip(out) {
                    *x += dot(row, field);
                }
            }
        }
    }

    /// Adds a block's part of six fields' products with the pose blendshapes, `[P]`.
    pub(crate) fn add_block_twists(&self, block: usize, fields: &[[f32; LANES]; 6], products: &mut [[f32; 6]]) {
        for (joint, out) in products.as_chunks_mut::<9>().0.iter_mut().enumerate() {
            if let Some(rows) = self.rows(block, joint) {
                for (row, x) in rows.iter().zip(out) {
                    for (sum, field) in x.iter_mut().zip(fields) {
                        *sum += dot(row, field);
                    }
                }
            }
        }
    }

    #[inline(always)]
    fn rows(&self, block: usize, joint: usize) -> Option<&[[f32; LANES]; 9]> {
        let joints = self.joint_count - 1;
        self.reached[block * joints + joint].then(|| {
            let start = (block * joints + joint) * 9 * LANES;
            self.directions[start..start + 9 * LANES].as_chunks::<LANES>().0.as_array().expect("nine rows")
        })
    }

    /// `Dt W field` of the pose blendshapes, `[P]`; weights and field sorted.
    pub(crate) fn products(&self, weights: &[f32], field: &[Vec3]) -> Vec<f32> {
        let mut products = vec![0.0; self.feature_count()];
        for block in 0..self.blocks() {
            let mut lanes = [0.0; LANES];
            let part = weights.iter().zip(field).skip(block * BLOCK).take(BLOCK);
            for (lane, (w, x)) in lanes.as_chunks_mut::<3>().0.iter_mut().zip(part) {
                *lane = (*x * *w).to_array();
            }
            self.add_block_products(block, &lanes, &mut products);
        }
        products
    }

    /// `Dt W D` of the pose blendshapes, `[P, P]`, for sorted vertex weights.
    pub(crate) fn gram(&self, weights: &[f32]) -> Vec<f64> {
        use rayon::prelude::*;
        let p = self.feature_count();
        let joints = self.joint_count - 1;
        let mut gram = vec![0.0f64; p * p];
        gram.par_chunks_mut(9 * p).enumerate().for_each(|(joint, out)| {
            for block in 0..self.blocks() {
                let Some(rows) = self.rows(block, joint) else { continue };
                let mut weighted = [[0.0f32; LANES]; 9];
                for (place, w) in weights[block * BLOCK..].iter().take(BLOCK).enumerate() {
                    for (x, row) in weighted.iter_mut().zip(rows) {
                        for c in 0..3 {
                            x[3 * place + c] = w * row[3 * place + c];
                        }
                    }
                }
                for other in joint..joints {
                    let Some(others) = self.rows(block, other) else { continue };
                    for (a, x) in weighted.iter().enumerate() {
                        for (b, row) in others.iter().enumerate() {
                            out[a * p + 9 * other + b] += f64::from(dot(row, x));
                        }
                    }
                }
            }
        });
        for i in 0..p {
            for j in 0..i / 9 * 9 {
                gram[i * p + j] = gram[j * p + i];
            }
        }
        gram
    }
}

#[inline(always)]
fn dot(a: &[f32; LANES], b: &[f32; LANES]) -> f32 {
    let mut sums = [0.0f32; 16];
    for (x, y) in a.as_chunks::<16>().0.iter().zip(b.as_chunks::<16>().0) {
        for i in 0..16 {
            sums[i] += x[i] * y[i];
        }
    }
    sums.iter().sum()
}

fn sorted_influences(skin: &softtissue_body::SkinWeights) -> Influences {
    let mut pairs: Vec<(u8, f32)> = skin.joints.iter().copied().zip(skin.weights).filter(|(_, w)| *w > 0.0).collect();
    pairs.sort_by_key(|(bone, _)| *bone);
    let mut influences = Influences { bones: [0; 4], weights: [0.0; 4], count: pairs.len() as u8 };
    for (i, (bone, w)) in pairs.into_iter().enumerate() {
        (influences.bones[i], influences.weights[i]) = (bone, w);
    }
    influences
}
