use glam::Vec3;
use rayon::prelude::*;

/// Vertices a block: its offsets for all poses of a batch stay in the first-level cache.
const BLOCK: usize = 128;
/// Pose features taken together, so that each sum is loaded and stored once for four of them.
const GROUP: usize = 4;

/// `offsets[n] += features[n] x directions` for poses `n`; `directions` is `[P, V]`.
///
/// The sum runs over features in order whatever the number of poses and threads, so the result does not depend on either.
pub(crate) fn pose_offsets_into(
    directions: &[Vec3],
    vertex_count: usize,
    features: &[Vec<f32>],
    offsets: &mut [Vec<Vec3>],
) {
    assert_eq!(features.len(), offsets.len(), "poses");
    if vertex_count == 0 {
        return;
    }
    let feature_count = directions.len() / vertex_count;
    for f in features {
        assert_eq!(f.len(), feature_count, "pose features");
    }
    let mut blocks: Vec<Vec<&mut [f32]>> = (0..vertex_count.div_ceil(BLOCK)).map(|_| Vec::new()).collect();
    for field in offsets.iter_mut() {
        for (block, part) in field.chunks_mut(BLOCK).enumerate() {
            blocks[block].push(bytemuck::cast_slice_mut(part));
        }
    }
    blocks.into_par_iter().with_min_len(4).enumerate().for_each(|(block, mut fields)| {
        let start = block * BLOCK;
        let end = (start + BLOCK).min(vertex_count);
        let mut p = 0;
        while p < feature_count {
            let group = GROUP.min(feature_count - p);
            let rows: [&[f32]; GROUP] = std::array::from_fn(|i| {
                let at = (p + i.min(group - 1)) * vertex_count;
                bytemuck::cast_slice(&directions[at + start..at + end])
            });
            for (field, f) in fields.iter_mut().zip(features) {
                let f: [f32; GROUP] = std::array::from_fn(|i| if i < group { f[p + i] } else { 0.0 });
                if f != [0.0; GROUP] {
                    add_rows(field, rows, f);
                }
            }
            p += GROUP;
        }
    });
}

/// `sum += f0 r0 + f1 r1 + f2 r2 + f3 r3`, element by element.
fn add_rows(sum: &mut [f32], rows: [&[f32]; GROUP], f: [f32; GROUP]) {
    let n = sum.len();
    let [a, b, c, d] = rows.map(|r| &r[..n]);
    for i in 0..n {
        sum[i] += f[0] * a[i] + f[1] * b[i] + f[2] * c[i] + f[3] * d[i];
    }
}
