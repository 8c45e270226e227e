use super::SmplConfig;
use super::fields::Fields;
use super::joints::JointTable;
use crate::body::{ImportedBody, mirror};
use crate::pickle::SparseRows;
use crate::{ImportLimits, Result};
use glam::Vec3;
use softtissue_body::procedural::derived_regions;
use softtissue_body::{BodyModel, JointRegressor, Mirror, Skeleton, SkinWeights, UvAtlas};
use softtissue_geometry::{Topology, signed_volume};
use std::sync::Arc;

/// Weights under this share of a joint row are rounding.
const LEAST_SHARE: f64 = 1e-7;

/// Makes a body of a model's parts.
pub fn convert(fields: &Fields<'_>, config: &SmplConfig) -> Result<ImportedBody> {
    let template = points(fields, "v_template")?;
    let v = template.len();
    let mut faces = faces(fields, v)?;
    let weights = fields.require("weights")?;
    weights.expect_shape(&[Some(v), None])?;
    let joint_count = weights.shape()[1];
    let table = JointTable::of(joint_count).ok_or_else(|| {
        weights.refuse(format!("{joint_count} joints; models of 24 (SMPL), 52 (SMPL-H) and 55 (SMPL-X) are read"))
    })?;
    let parents = parents(fields, joint_count)?;
    let rows = joint_rows(fields, joint_count, v)?;
    let (dense, mut notes) = (weights.f32s()?, Vec::new());
    if signed_volume(&template, &faces) < 0.0 {
        faces.iter_mut().for_each(|f| f.swap(1, 2));
        notes.push("its faces are wound inwards and are turned round".to_owned());
    }
    let shape_directions = shape_directions(fields, v, config.shapes, &mut notes)?;
    let pose_directions = pose_directions(fields, v, joint_count)?;

    let place = fields.file();
    let folded = fold(&dense, joint_count, &table.smpl_of);
    let smpl_skin = skin(&folded, 24).map_err(|at| weights.refuse(bad_weights(at)))?;
    let kept_joints: Vec<usize> =
        if config.keep_joints { (0..joint_count).collect() } else { table.stands_for.clone() };
    let skin = if config.keep_joints {
        skin(&dense, joint_count).map_err(|at| weights.refuse(bad_weights(at)))?
    } else {
        smpl_skin.clone()
    };
    let skeleton = if config.keep_joints {
        Skeleton { names: table.names.clone(), parents }
    } else {
        let smpl = Skeleton::smpl();
        check_tree(&parents, &table, &smpl).map_err(|reason| fields.place("kintree_table").refuse(reason))?;
        smpl
    };
    let joint_regressor = JointRegressor { rows: kept_joints.iter().map(|j| rows.rows[*j].clone()).collect() };
    let smpl_rows = JointRegressor { rows: table.stands_for.iter().map(|j| rows.rows[*j].clone()).collect() };
    let vertices = match fields.array("vert_sym_idxs")? {
        Some(array) => mirror::stated(&array, v)?,
        None => {
            let (pairs, worst) = mirror::by_geometry(&template).map_err(|reason| place.refuse(reason))?;
            notes.push(format!("symmetry derived from the template, partners at most {:.1} mm apart", 1e3 * worst));
            pairs
        }
    };
    let smpl_joints = smpl_rows.joints(&template);
    let regions = derived_regions(&template, &faces, &smpl_joints, &smpl_skin, &vertices)
        .map_err(|e| place.refuse(e.to_string()))?;
    notes.push("regions derived from skin weights and joints; no texture coordinates".into());
    if joint_count != 24 && !config.keep_joints {
        notes.push(format!("{joint_count} joints folded into 24: fingers, jaw and eyes do not move by themselves"));
    }
    let topology = Topology { vertex_count: v, faces, quads: vec![] };
    if let Err(reason) = topology.check_closed_manifold() {
        notes.push(format!("its surface is not closed ({reason}): volume and weight mean little"));
    }
    let model = BodyModel {
        shape_directions,
        pose_directions: kept_features(&pose_directions, &kept_joints, v),
        joint_regressor,
        skin,
        mirror: Mirror { vertices, joints: JointTable::mirror(&skeleton.names) },
        skeleton,
        uv: UvAtlas::default(),
        regions,
        topology: Arc::new(topology),
        template,
    };
    model.check().map_err(|e| place.refuse(e.to_string()))?;
    Ok(ImportedBody { model, source: table.model, notes })
}

fn points(fields: &Fields<'_>, key: &str) -> Result<Vec<Vec3>> {
    let array = fields.require(key)?;
    array.expect_shape(&[None, Some(3)])?;
    let limit = ImportLimits::default().vertices;
    if array.is_empty() || array.shape()[0] > limit {
        return Err(array.refuse(format!("{} vertices are not between 1 and {limit}", array.shape()[0])));
    }
    Ok(array.f32s()?.as_chunks::<3>().0.iter().map(|p| Vec3::from_array(*p)).collect())
}

fn faces(fields: &Fields<'_>, vertices: usize) -> Result<Vec<[u32; 3]>> {
    let array = fields.require("f")?;
    array.expect_shape(&[None, Some(3)])?;
    let index = |i: i64| u32::try_from(i).ok().filter(|i| (*i as usize) < vertices);
    let indices: Option<Vec<u32>> = array.integers()?.into_iter().map(index).collect();
    let indices = indices.ok_or_else(|| array.refuse("it names a vertex past the last; get the file again"))?;
    Ok(indices.as_chunks::<3>().0.to_vec())
}

/// `[J]` parents. The second row of the table says which joint a column is of.
fn parents(fields: &Fields<'_>, joints: usize) -> Result<Vec<Option<u8>>> {
    let array = fields.require("kintree_table")?;
    array.expect_shape(&[Some(2), Some(joints)])?;
    let table = array.integers()?;
    let (above, own) = table.split_at(joints);
    let column = |id: i64| own.iter().position(|o| *o == id);
    (0..joints)
        .map(|j| match column(above[j]) {
            // The root's parent is -1, or 2^32 - 1 where the numbers have no sign.
            _ if j == 0 => Ok(None),
            Some(parent) if parent < j => Ok(Some(parent as u8)),
            _ => Err(array.refuse(format!("joint {j} does not come after its parent; get the file again"))),
        })
        .collect()
}

/// Whether the tree is SMPL's, once hands and face are folded.
fn check_tree(parents: &[Option<u8>], table: &JointTable, smpl: &Skeleton) -> std::result::Result<(), String> {
    for (joint, from) in table.stands_for.iter().enumerate() {
        let parent = parents[*from].map(|p| table.smpl_of[usize::from(p)]);
        if parent != smpl.parents[joint] {
            return Err(format!("{} hangs from another joint than SMPL's; pass --keep-joints", smpl.names[joint]));
        }
    }
    Ok(())
}

struct Rows {
    rows: Vec<Vec<(u32, f32)>>,
}

fn joint_rows(fields: &Fields<'_>, joints: usize, vertices: usize) -> Result<Rows> {
    let SparseRows { rows, columns } = fields.rows("J_regressor")?;
    let place = fields.place("J_regressor");
    if rows.len() != joints || columns != vertices {
        return Err(place.refuse(format!("it is {} x {columns}, expected {joints} x {vertices}", rows.len())));
    }
    let mut out = Vec::with_capacity(joints);
    for (j, row) in rows.into_iter().enumerate() {
        let sum: f64 = row.iter().map(|(_, w)| w).sum();
        // Rows that do not sum to one would move joints when the body moves as a whole.
        if sum.is_nan() || (sum - 1.0).abs() > 0.01 {
            return Err(place.refuse(format!("its row {j} sums to {sum:.3}, expected 1; get the file again")));
        }
        out.push(row.into_iter().filter(|(_, w)| w.abs() > LEAST_SHARE).map(|(v, w)| (v, (w / sum) as f32)).collect());
    }
    Ok(Rows { rows: out })
}

/// `[S, V]` from `[V, 3, S]`.
fn shape_directions(fields: &Fields<'_>, v: usize, wanted: usize, notes: &mut Vec<String>) -> Result<Vec<Vec3>> {
    let array = fields.require("shapedirs")?;
    array.expect_shape(&[Some(v), Some(3), None])?;
    let held = array.shape()[2];
    let count = held.min(wanted);
    if held > count {
        notes.push(format!("the first {count} of its {held} shape directions"));
    }
    Ok(transposed(&array.f32s()?, v, held, count))
}

/// `[P, V]` from `[V, 3, P]`.
fn pose_directions(fields: &Fields<'_>, v: usize, joints: usize) -> Result<Vec<Vec3>> {
    let array = fields.require("posedirs")?;
    let features = 9 * (joints - 1);
    array.expect_shape(&[Some(v), Some(3), Some(features)])?;
    Ok(transposed(&array.f32s()?, v, features, features))
}

fn transposed(values: &[f32], v: usize, held: usize, count: usize) -> Vec<Vec3> {
    let at = |i: usize, axis: usize, k: usize| values[(3 * i + axis) * held + k];
    let point = |k: usize, i: usize| Vec3::new(at(i, 0, k), at(i, 1, k), at(i, 2, k));
    (0..count).flat_map(|k| (0..v).map(move |i| (k, i))).map(|(k, i)| point(k, i)).collect()
}

/// Pose directions of the joints that stay, nine features each.
fn kept_features(all: &[Vec3], joints: &[usize], v: usize) -> Vec<Vec3> {
    joints[1..].iter().flat_map(|j| all[9 * (j - 1) * v..9 * j * v].iter().copied()).collect()
}

/// Sums the weights `[V, J]` of joints that fold into one, `[V, 24]`.
fn fold(dense: &[f32], joints: usize, smpl_of: &[u8]) -> Vec<f32> {
    let mut folded = vec![0.0; dense.len() / joints * 24];
    for (row, out) in dense.chunks_exact(joints).zip(folded.chunks_exact_mut(24)) {
        row.iter().zip(smpl_of).for_each(|(w, j)| out[usize::from(*j)] += w);
    }
    folded
}

/// The four largest weights of each row; the number of a vertex whose weights are negative or nowhere near one.
fn skin(dense: &[f32], joints: usize) -> std::result::Result<Vec<SkinWeights>, usize> {
    let row = |(v, row): (usize, &[f32])| {
        let sum: f32 = row.iter().sum();
        if row.iter().any(|w| *w < -1e-4) || (sum - 1.0).abs() > 0.02 {
            return Err(v);
        }
        let mut order: Vec<usize> = (0..joints).filter(|j| row[*j] > 0.0).collect();
        order.sort_by(|a, b| row[*b].total_cmp(&row[*a]).then(a.cmp(b)));
        order.truncate(4);
        let sum: f32 = order.iter().map(|j| row[*j]).sum();
        let mut skin = SkinWeights { joints: [0; 4], weights: [0.0; 4] };
        for (slot, j) in order.iter().enumerate() {
            (skin.joints[slot], skin.weights[slot]) = (*j as u8, row[*j] / sum);
        }
        Ok(skin)
    };
    dense.chunks_exact(joints).enumerate().map(row).collect()
}

fn bad_weights(vertex: usize) -> String {
    format!("the weights of vertex {vertex} are negative or do not sum to one; get the file again")
}
