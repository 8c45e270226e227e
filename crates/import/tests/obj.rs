//! OBJ sequences keep their vertex order and answer bad files with one sentence.

use glam::Vec3;
use proptest::prelude::*;
use softtissue_clips::ClipId;
use softtissue_geometry::Topology;
use softtissue_import::{ImportLimits, SequenceConfig, Units, import_obj_sequences, read_mesh, read_obj_frame};
use softtissue_monitor::Silent;
use std::fmt::Write;
use std::path::Path;

fn tetrahedron() -> Topology {
    Topology { vertex_count: 4, faces: vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], quads: vec![] }
}

fn obj(points: &[Vec3], faces: &[[u32; 3]]) -> String {
    let mut text = String::from("# exported\r\nmtllib ../../../etc/passwd\r\no body\r\n");
    points.iter().for_each(|p| writeln!(text, "v {} {} {}\r", p.x, p.y, p.z).unwrap());
    faces.iter().for_each(|f| writeln!(text, "f {}//1 {}//1 {}//1\r", f[0] + 1, f[1] + 1, f[2] + 1).unwrap());
    text
}

fn points() -> Vec<Vec3> {
    vec![Vec3::ZERO, Vec3::X, Vec3::Y * 1.7, Vec3::Z]
}

const CONFIG: SequenceConfig = SequenceConfig {
    fps: 60.0,
    units: Units::Metres,
    limits: ImportLimits { file_bytes: 1 << 20, vertices: 1000, faces: 1000, face_corners: 8, frames: 100 },
};

/// Imports one clip of the given frames; returns the message or the number of frames.
fn import(frames: &[(&str, String)], config: &SequenceConfig) -> Result<usize, String> {
    let dir = tempfile::tempdir().unwrap();
    let clip = dir.path().join("in/anna/hips");
    std::fs::create_dir_all(&clip).unwrap();
    for (name, text) in frames {
        std::fs::write(clip.join(name), text).unwrap();
    }
    let out = dir.path().join("out");
    match import_obj_sequences(&dir.path().join("in"), &tetrahedron(), config, &out, &Silent) {
        Ok(set) => Ok(set.scan(&ClipId::new("anna", "hips", 0)).unwrap().vertices.len()),
        Err(e) => {
            assert!(!out.join("index.json").exists(), "nothing is left that looks finished");
            Err(e.to_string())
        }
    }
}

fn two(first: &str, second: &str) -> Vec<(&'static str, String)> {
    vec![("f9.obj", first.to_owned()), ("f10.obj", second.to_owned())]
}

#[test]
fn frames_come_in_natural_order_and_scaled() {
    let dir = tempfile::tempdir().unwrap();
    let clip = dir.path().join("in/anna/hips.1");
    std::fs::create_dir_all(&clip).unwrap();
    for n in [100, 9, 10] {
        let mut p = points();
        p[0].x = n as f32;
        let scaled: Vec<Vec3> = p.iter().map(|p| *p * 1000.0).collect();
        std::fs::write(clip.join(format!("f{n}.obj")), obj(&scaled, &tetrahedron().faces)).unwrap();
    }
    let config = SequenceConfig { units: Units::Millimetres, ..CONFIG };
    let set = import_obj_sequences(&dir.path().join("in"), &tetrahedron(), &config, &dir.path().join("out"), &Silent)
        .unwrap();
    let scan = set.scan(&ClipId::new("anna", "hips", 1)).unwrap();
    let first: Vec<f32> = scan.vertices.iter().map(|f| f[0].x.round()).collect();
    assert_eq!(first, [9.0, 10.0, 100.0]);
}

#[test]
fn bad_frames_are_refused_with_file_and_place() {
    let good = obj(&points(), &tetrahedron().faces);
    let cases = [
        ("NaN", good.replace("v 1 0 0", "v NaN 0 0"), "line 5"),
        ("overflow", good.replace("v 1 0 0", "v 1e400 0 0"), "not finite"),
        ("decimal comma", good.replace("v 1 0 0", "v 1,5 0 0"), "decimals"),
        ("index zero", good.replace("f 1//1", "f 0//1"), "outside the mesh"),
        ("negative out of range", good.replace("f 1//1", "f -9//1"), "outside the mesh"),
        ("index too large", good.replace("f 1//1", "f 7//1"), "names vertex 7"),
        ("empty", String::new(), "holds no vertex"),
        ("count", obj(&points()[..3], &[[0, 1, 2]]), "3 vertices, but the template has 4"),
        (
            "millimetres",
            obj(&points().iter().map(|p| *p * 1000.0).collect::<Vec<_>>(), &tetrahedron().faces),
            "--units millimetres",
        ),
    ];
    for (name, text, says) in cases {
        let message = import(&two(&good, &text), &CONFIG).unwrap_err();
        assert!(message.contains("f10.obj") && message.contains(says), "{name}: {message}");
        assert!(!message.contains('\n'), "{name}: one sentence");
    }
    assert_eq!(import(&two(&good, &good), &CONFIG), Ok(2));
}

#[test]
fn other_connectivity_of_the_same_count_is_refused() {
    // A template with a quad's worth of freedom: vertices 0-3 in a strip of two triangles, each seen from both sides.
    let template = Topology { vertex_count: 5, faces: vec![[0, 1, 2], [0, 2, 3], [0, 3, 4]], quads: vec![] };
    let p: Vec<Vec3> = (0..5).map(|i| Vec3::new(i as f32, (i % 2) as f32 * 1.7, 0.0)).collect();
    let run = |faces: &[[u32; 3]]| {
        let dir = tempfile::tempdir().unwrap();
        let clip = dir.path().join("in/a/b");
        std::fs::create_dir_all(&clip).unwrap();
        for n in 0..2 {
            std::fs::write(clip.join(format!("{n}.obj")), obj(&p, faces)).unwrap();
        }
        import_obj_sequences(&dir.path().join("in"), &template, &CONFIG, &dir.path().join("out"), &Silent)
            .map(|_| ())
            .map_err(|e| e.to_string())
    };
    assert_eq!(run(&template.faces), Ok(()));
    assert!(run(&[[1, 3, 4], [0, 2, 3], [1, 2, 4]]).unwrap_err().contains("other connectivity"));
}

#[test]
fn sequences_need_frames_and_a_rate() {
    let good = obj(&points(), &tetrahedron().faces);
    assert!(import(&[], &CONFIG).unwrap_err().contains("no frame"));
    assert!(import(&[("1.obj", good.clone())], &CONFIG).unwrap_err().contains("no velocity"));
    for fps in [0.0, -1.0, f32::NAN] {
        assert!(import(&two(&good, &good), &SequenceConfig { fps, ..CONFIG }).unwrap_err().contains("frames a second"));
    }
}

#[test]
fn folders_that_name_no_clip_or_one_twice_are_refused_by_path() {
    let good = obj(&points(), &tetrahedron().faces);
    let run = |folders: &[&str]| {
        let dir = tempfile::tempdir().unwrap();
        for folder in folders {
            let clip = dir.path().join("in").join(folder);
            std::fs::create_dir_all(&clip).unwrap();
            (0..2).for_each(|n| std::fs::write(clip.join(format!("{n}.obj")), &good).unwrap());
        }
        import_obj_sequences(&dir.path().join("in"), &tetrahedron(), &CONFIG, &dir.path().join("out"), &Silent)
            .map(|set| set.clips().len())
            .map_err(|e| e.to_string())
    };
    assert_eq!(run(&["anna/hips.0", "anna/hips.1"]), Ok(2));
    let message = run(&["anna/big hips"]).unwrap_err();
    assert!(message.contains("big hips") && message.contains("rename"), "{message}");
    let message = run(&["anna/hips", "anna/hips.0"]).unwrap_err();
    assert!(message.contains("anna/hips.0") && message.contains("another take"), "{message}");
}

#[test]
fn a_second_import_that_fails_leaves_nothing_that_looks_finished() {
    let dir = tempfile::tempdir().unwrap();
    let (clip, out) = (dir.path().join("in/anna/hips"), dir.path().join("out"));
    std::fs::create_dir_all(&clip).unwrap();
    let write = |text: &str| (0..2).for_each(|n| std::fs::write(clip.join(format!("{n}.obj")), text).unwrap());
    let run = || import_obj_sequences(&dir.path().join("in"), &tetrahedron(), &CONFIG, &out, &Silent);
    write(&obj(&points(), &tetrahedron().faces));
    run().unwrap();
    assert!(out.join("index.json").exists());
    write("v NaN 0 0");
    run().unwrap_err();
    assert!(!out.join("index.json").exists());
}

#[test]
fn long_numbers_are_read_to_their_end() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("long.obj");
    std::fs::write(&path, format!("v {}25e1 0 0", "0".repeat(50))).unwrap();
    assert_eq!(read_obj_frame(&path, &CONFIG.limits).unwrap().positions, [Vec3::new(250.0, 0.0, 0.0)]);
}

#[test]
fn no_material_file_is_opened() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("m.obj");
    std::fs::write(&path, obj(&points(), &tetrahedron().faces).replace("../../../etc/passwd", "/dev/zero")).unwrap();
    let mesh = read_mesh(&path, &CONFIG.limits).unwrap();
    assert_eq!(mesh.topology.faces.len(), 4);
    assert_eq!(read_obj_frame(&path, &CONFIG.limits).unwrap().positions, points());
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
        let frame = read_obj_frame(Path::new(&path), &CONFIG.limits).unwrap();
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
        read_obj_frame(&path, &CONFIG.limits).unwrap().colors
    };
    assert_eq!(read("v 0 0 0 1 0.5 0\nv 1 0 0 0 0 0.25\n"), [Vec3::new(1.0, 0.5, 0.0), Vec3::new(0.0, 0.0, 0.25)]);
    assert!(read("v 0 0 0 1 0.5 0\nv 1 0 0\n").is_empty());
    assert!(read("v 0 0 0 1.0\n").is_empty(), "a weight is no colour");
}
