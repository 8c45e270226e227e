//! SMPL and its kin, as the layouts of the released files have them (`tests/fixtures/bodies/make.py`).

use glam::Vec3;
use softtissue_body::procedural::{ProceduralConfig, generate};
use softtissue_body::{BodyModel, Region, Skeleton};
use softtissue_clips::inspection::{ExamConfig, ProblemKind};
use softtissue_import::arrays::{ArrayLimits, Npz};
use softtissue_import::pickle::{Pickle, PickleLimits, PickledArrays};
use softtissue_import::{ImportedBody, Place, SmplConfig, examine_body, import_smpl};
use std::path::{Path, PathBuf};

fn fixture(name: &str) -> PathBuf {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/fixtures")).join(name)
}

fn import(name: &str, config: &SmplConfig) -> ImportedBody {
    import_smpl(&fixture(name), config).unwrap()
}

/// Every entry of `[V, 3, K]` is that of `[K, V]`.
fn assert_directions(found: &[Vec3], name: &str, count: usize) {
    let npz = Npz::open(&fixture("bodies/expected.npz"), &ArrayLimits::default()).unwrap();
    let array = npz.require(name).unwrap();
    let (v, held, values) = (array.shape()[0], array.shape()[2], array.f32s().unwrap());
    assert_eq!(found.len(), count * v);
    for k in 0..count {
        for i in 0..v {
            let expected: [f32; 3] = std::array::from_fn(|axis| values[(3 * i + axis) * held + k]);
            assert_eq!(found[k * v + i].to_array(), expected, "{name} {k} of vertex {i}");
        }
    }
}

#[test]
fn the_pickle_of_python_2_gives_the_arrays_it_was_made_of() {
    let ImportedBody { model, source, notes } = import("bodies/smpl.pkl", &SmplConfig::default());
    assert_eq!((source, model.joint_count(), model.shape_count()), ("SMPL", 24, 10));
    assert_eq!(model.skeleton, Skeleton::smpl());
    assert_directions(&model.shape_directions, "shapedirs", 10);
    assert_directions(&model.pose_directions, "posedirs", 207);
    let expected = Npz::open(&fixture("bodies/expected.npz"), &ArrayLimits::default()).unwrap();
    let joints = expected.require("J").unwrap().f32s().unwrap();
    for (found, expected) in model.joint_regressor.joints(&model.template).iter().zip(joints.as_chunks::<3>().0) {
        assert!(found.distance(Vec3::from_array(*expected)) < 1e-6, "{found} {expected:?}");
    }
    let symmetry = expected.require("vert_sym_idxs").unwrap().integers().unwrap();
    assert!(model.mirror.vertices.iter().zip(symmetry).all(|(a, b)| i64::from(*a) == b));
    assert!(notes.iter().any(|n| n.contains("first 10 of its 12")), "{notes:?}");
    model.check().unwrap();
}

#[test]
fn npz_with_a_sparse_matrix_in_a_box_gives_the_same_body() {
    let pickled = import("bodies/smpl.pkl", &SmplConfig::default()).model;
    let zipped = import("bodies/smpl.npz", &SmplConfig::default());
    assert!(zipped.notes.iter().any(|n| n.contains("symmetry derived")), "{:?}", zipped.notes);
    assert_eq!(format!("{:?}", zipped.model), format!("{pickled:?}"));
    let regions = &pickled.regions.0;
    assert!(
        [Region::Head, Region::Belly, Region::Hands, Region::Feet].iter().all(|r| regions.contains(r)),
        "{regions:?}"
    );
}

#[test]
fn hands_and_face_fold_into_24_joints_or_stay() {
    for (file, count, middle) in [("bodies/smplh.npz", 52, 25), ("bodies/smplx.npz", 55, 28)] {
        let all = import(file, &SmplConfig { keep_joints: true, shapes: 300, ..SmplConfig::default() }).model;
        let folded = import(file, &SmplConfig::default()).model;
        assert_eq!((all.joint_count(), folded.joint_count()), (count, 24));
        assert_eq!(folded.skeleton, Skeleton::smpl());
        assert_eq!(all.regions, folded.regions);
        assert_eq!(all.joint_regressor.rows[middle], folded.joint_regressor.rows[22]);
        let v = all.vertex_count();
        let features = |body: &BodyModel, j: usize| body.pose_directions[9 * (j - 1) * v..9 * j * v].to_vec();
        assert_eq!(features(&all, middle), features(&folded, 22));
        assert_eq!(features(&all, 21), features(&folded, 21));
        all.check().unwrap();
        folded.check().unwrap();
    }
}

#[test]
fn arrays_are_the_same_in_every_protocol() {
    let limits = ArrayLimits::default();
    let npz = Npz::open(&fixture("arrays/stored.npz"), &limits).unwrap();
    for protocol in 0..6 {
        let bytes = std::fs::read(fixture(&format!("arrays/protocol{protocol}.pkl"))).unwrap();
        let pickle = Pickle::read(&bytes, &PickleLimits::default()).unwrap();
        let arrays = PickledArrays { pickle: &pickle, limits: &limits };
        let place = Place::file(Path::new("protocol.pkl"));
        let read = |key: &str| arrays.array(pickle.value(pickle.root(), key).unwrap(), &place);
        for key in ["f8", "f4_big_endian", "f8_fortran", "i4", "bool", "rate"] {
            let (found, expected) = (read(key).unwrap(), npz.require(key).unwrap());
            assert_eq!(found.shape(), expected.shape(), "{key} in protocol {protocol}");
            assert_eq!(found.f64s().unwrap(), expected.f64s().unwrap(), "{key} in protocol {protocol}");
        }
        assert_eq!(read("scalar").unwrap().number().unwrap(), 1.5);
        assert_eq!(read("list").unwrap().f64s().unwrap(), [1.0, 2.5]);
        assert_eq!(read("boxed").unwrap().f64s().unwrap(), [1.0, 2.0]);
        assert!(read("class").is_err());
    }
}

#[test]
fn damaged_pickles_never_panic() {
    let bytes = std::fs::read(fixture("arrays/protocol2.pkl")).unwrap();
    let (limits, place) = (ArrayLimits::default(), Place::file(Path::new("a.pkl")));
    for at in 0..bytes.len() {
        for value in [0, b'.', b'(', b'R', b'\\', 0x7f, 0xff, bytes[at].wrapping_add(1)] {
            let mut bytes = bytes.clone();
            bytes[at] = value;
            let Ok(pickle) = Pickle::read(&bytes, &PickleLimits { nodes: 10_000, ..PickleLimits::default() }) else {
                continue;
            };
            let arrays = PickledArrays { pickle: &pickle, limits: &limits };
            for key in ["f8", "f8_fortran", "boxed", "scalar"] {
                let array = pickle.value(pickle.root(), key).map(|id| arrays.array(id, &place));
                let _ = array.map(|a| a.map(|a| a.f64s()));
            }
        }
    }
}

#[test]
fn a_sound_body_gives_no_finding_and_planted_faults_are_told() {
    let config = ProceduralConfig { level: 0, people: 40, ..ProceduralConfig::default() };
    let mut body = generate(&config).expect("a body").model;
    let exam = ExamConfig::default();
    let (facts, problems) = examine_body(&body, &exam);
    assert_eq!(problems, []);
    assert_eq!((facts.pieces, facts.genus), (1, Some(0)));
    body.skeleton.names.swap(1, 2);
    body.mirror.vertices.swap(10, 500);
    let mut topology = (*body.topology).clone();
    topology.faces[20].swap(0, 1);
    body.topology = topology.into();
    let kinds: Vec<(ProblemKind, usize)> = examine_body(&body, &exam).1.iter().map(|p| (p.kind, p.count)).collect();
    let swap = ProblemKind::LeftRightSwap;
    assert_eq!(kinds, [(ProblemKind::FlippedFaces, 1), (swap, 2), (swap, 2)]);
    let mut topology = (*body.topology).clone();
    topology.faces.iter_mut().for_each(|f| f.swap(0, 1));
    topology.faces[20].swap(0, 1);
    body.topology = topology.into();
    assert_eq!(examine_body(&body, &exam).1[0].kind, ProblemKind::InsideOut);
}
