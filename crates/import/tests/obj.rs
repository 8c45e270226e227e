//! OBJ files, read in their own order or as general meshes.

use glam::Vec3;
use proptest::prelude::*;
use softtissue_geometry::Topology;
use softtissue_import::{ImportLimits, read_mesh, read_obj_frame};
use std::fmt::Write;
use std::path::Path;

fn tetrahedron() -> Topology {
    Topology { vertex_count: 4, faces: vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], quads: vec![] }
}

pub fn obj(points: &[Vec3], faces: &[[u32; 3]]) -> String {
    let mut text = String::from("# exported\r\nmtllib ../../../etc/passwd\r\no body\r\n");
    points.iter().for_each(|p| writeln!(text, "v {} {} {}\r", p.x, p.y, p.z).unwrap());
    faces.iter().for_each(|f| writeln!(text, "f {}//1 {}//1 {}//1\r", f[0] + 1, f[1] + 1, f[2] + 1).unwrap());
    text
}

fn points() -> Vec<Vec3> {
    vec![Vec3::ZERO, Vec3::X, Vec3::Y * 1.7, Vec3::Z]
}

const LIMITS: ImportLimits = ImportLimits {
    file_bytes: 1 << 20,
    vertices: 1000,
    faces: 1000,
    face_corners: 8,
    frames: 100,
    clip_points: 100_000,
};

#[test]
fn long_numbers_are_read_to_their_end() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("long.obj");
    std::fs::write(&path, format!("v {}25e1 0 0", "0".repeat(50))).unwrap();
    assert_eq!(read_obj_frame(&path, &LIMITS).unwrap().positions, [Vec3::new(250.0, 0.0, 0.0)]);
}

#[test]
fn no_material_file_is_opened() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("m.obj");
    std::fs::write(&path, obj(&points(), &tetrahedron().faces).replace("../../../etc/passwd", "/dev/zero")).unwrap();
    let mesh = read_mesh(&path, &LIMITS).unwrap();
    assert_eq!(mesh.topology.faces.len(), 4);
    assert_eq!(read_obj_frame(&path, &LIMITS).unwrap().positions, points());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Correspondence survives: whatever the face order, vertex `i` of the file is vertex `i` of the frame.
    #[test]
    fn vertex_order_is_kept(seed in proptest::collection::vec((-2.0f32..2.0, -2.0f32..2.0, -2.0f32..2.0), 3..40), faces in proptest::collection::vec((0usize..40, 0usize..40, 0usize..40), 0..40)) {
        let p: Vec<Vec3> = seed.into_iter().map(Vec3::from).collect();
        let faces: Vec<[u32; 3]> = faces.into_iter().map(|(a, b, c)| [a % p.len(), b % p.len(), c % p.len()].map(|i| i as u32)).collect();
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("p.obj");
        std::fs::write(&path, obj(&p, &faces)).unwrap();
        let frame = read_obj_frame(Path::new(&path), &LIMITS).unwrap();
        prop_assert_eq!(&frame.positions, &p);
        prop_assert_eq!(frame.faces.iter().map(|f| [f[0], f[1], f[2]]).collect::<Vec<_>>(), faces);
    }
}

#[test]
fn colours_of_vertices_are_read_where_every_vertex_has_one() {
    let dir = tempfile::tempdir().unwrap();
    let read = |text: &str| {
        let path = dir.path().join("painted.obj");
        std::fs::write(&path, text).unwrap();
        read_obj_frame(&path, &LIMITS).unwrap().colors
    };
    assert_eq!(read("v 0 0 0 1 0.5 0\nv 1 0 0 0 0 0.25\n"), [Vec3::new(1.0, 0.5, 0.0), Vec3::new(0.0, 0.0, 0.25)]);
    assert!(read("v 0 0 0 1 0.5 0\nv 1 0 0\n").is_empty());
    assert!(read("v 0 0 0 1.0\n").is_empty(), "a weight is no colour");
}
