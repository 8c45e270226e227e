use crate::reference::random_body;
use glam::{DVec3, Vec3};
use softtissue_body::{BodyModel, JointRegressor, Pose, SkinWeights};
use softtissue_store::TensorFile;
use std::path::Path;

fn points(numbers: &[f32]) -> Vec<Vec3> {
    numbers.as_chunks::<3>().0.iter().map(|p| Vec3::from_array(*p)).collect()
}

/// The body of the golden file; what the formulas do not use is borrowed from a random body of the same size.
fn body(file: &TensorFile) -> BodyModel {
    let tensor = |name| file.f32(name).unwrap();
    let template = points(&tensor("template"));
    let v = template.len();
    let rows = tensor("joint_regressor");
    let sparse = |row: &[f32]| (0u32..).zip(row.iter().copied()).filter(|(_, w)| *w > 0.0).collect::<Vec<_>>();
    let weights = tensor("skin_weights");
    let skin = weights.chunks_exact(24).map(|row| {
        let mut skin = SkinWeights { joints: [0; 4], weights: [0.0; 4] };
        for (slot, (j, w)) in sparse(row).into_iter().enumerate() {
            (skin.joints[slot], skin.weights[slot]) = (j as u8, w);
        }
        skin
    });
    BodyModel {
        template,
        shape_directions: points(&tensor("shape_directions")),
        pose_directions: points(&tensor("pose_directions")),
        joint_regressor: JointRegressor { rows: rows.chunks_exact(v).map(sparse).collect() },
        skin: skin.collect(),
        ..random_body(41)
    }
}

#[test]
fn posed_vertices_and_joints_are_those_of_the_published_formulas() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/smpl_reference.safetensors");
    let file = TensorFile::open(&path).unwrap();
    let body = body(&file);
    let (v, j, s) = (body.vertex_count(), body.joint_count(), body.shape_count());
    assert_eq!((v, j, s), (40, 24, 4));
    let [theta, translation, delta] = ["theta", "translation", "delta"].map(|n| points(&file.f32(n).unwrap()));
    let beta = file.f32("beta").unwrap();
    let [posed, joints] = ["posed", "posed_joints"].map(|n| file.f64(n).unwrap());
    let close = |ours: &[Vec3], theirs: &[f64], what: &str| {
        for (a, b) in ours.iter().zip(theirs.as_chunks::<3>().0) {
            let b = DVec3::from_array(*b);
            assert!((a.as_dvec3() - b).length() < 2e-5, "{what}: {a} for {b}");
        }
    };
    for case in 0..translation.len() {
        let shaped = body.shaped(&beta[case * s..(case + 1) * s]);
        let pose = Pose { rotations: &theta[case * j..(case + 1) * j], translation: translation[case] };
        let ours = body.posed(&shaped, pose, Some(&delta[case * v..(case + 1) * v]));
        close(&ours, &posed[case * v * 3..(case + 1) * v * 3], &format!("vertex of case {case}"));
        let ours = body.posed_joints(&shaped.joints, pose);
        close(&ours, &joints[case * j * 3..(case + 1) * j * 3], &format!("joint of case {case}"));
    }
}
