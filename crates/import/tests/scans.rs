//! 4D scans keep their vertex order and answer bad files with one sentence. Foreign files are those of
//! `tests/fixtures/scans/make.py`.

use crate::obj::obj;
use glam::Vec3;
use proptest::prelude::*;
use softtissue_clips::{ClipId, RawScans, ScanSet};
use softtissue_geometry::Topology;
use softtissue_import::ImportLimits;
use softtissue_import::scans::{RawScanSource, ScanImportConfig, ScanSource, Units, UpAxis, import_scans, read_ply};
use softtissue_monitor::Silent;
use std::fmt::Write;
use std::path::{Path, PathBuf};

fn fixture(name: &str) -> PathBuf {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/fixtures/scans")).join(name)
}

/// The box of `make.py`.
fn box_topology() -> Topology {
    let faces = vec![
        [0, 1, 3],
        [0, 3, 2],
        [4, 6, 7],
        [4, 7, 5],
        [0, 4, 5],
        [0, 5, 1],
        [2, 3, 7],
        [2, 7, 6],
        [0, 2, 6],
        [0, 6, 4],
        [1, 5, 7],
        [1, 7, 3],
    ];
    Topology { vertex_count: 8, faces, quads: vec![] }
}

/// Where vertex `v` of the box is in frame `t`.
fn truth(v: usize, t: usize) -> Vec3 {
    let side = |bit: usize, low: f32, high: f32| if v >> bit & 1 == 1 { high } else { low };
    Vec3::new(side(0, -0.25, 0.25) + 0.01 * t as f32, side(2, 0.0, 1.7), side(1, -0.1, 0.1))
}

const CONFIG: ScanImportConfig = ScanImportConfig {
    fps: None,
    assumed_fps: 60.0,
    units: None,
    up: None,
    fill_gaps: false,
    limits: ImportLimits {
        file_bytes: 1 << 20,
        vertices: 10_000,
        faces: 1000,
        face_corners: 8,
        frames: 1000,
        clip_points: 4_000_000,
    },
};

/// Imports a source; returns the set's folder and the set, or the message.
fn import(source: &Path, config: &ScanImportConfig) -> Result<(tempfile::TempDir, ScanSet), String> {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("out");
    let run = || import_scans(&ScanSource::open(source, config)?, &box_topology(), &out, &Silent);
    match run() {
        Ok(set) => Ok((dir, set)),
        Err(e) => {
            assert!(!out.join("index.json").exists(), "nothing is left that looks finished");
            let message = e.to_string();
            assert!(!message.contains('\n'), "one sentence: {message}");
            Err(message)
        }
    }
}

#[track_caller]
fn refused(source: &Path, config: &ScanImportConfig, words: &[&str]) {
    let message = import(source, config).map(|_| ()).unwrap_err();
    words.iter().for_each(|word| assert!(message.contains(word), "{word:?} is missing in: {message}"));
}

#[track_caller]
fn is_truth(set: &ScanSet, id: &str, frames: usize) {
    let scan = set.scan(&id.parse::<ClipId>().unwrap()).unwrap();
    assert_eq!((scan.vertices.len(), scan.vertices.points_per_frame()), (frames, 8), "{id}");
    for t in 0..frames {
        for (v, p) in scan.vertices.frame(t).iter().enumerate() {
            assert!(p.distance(truth(v, t)) < 1e-6, "{id}, frame {t}, vertex {v}: {p} is not {}", truth(v, t));
        }
    }
}

#[test]
fn dfaust_and_dyna_come_in_whatever_their_type_and_chunks() {
    let (_dir, set) = import(&fixture("dfaust.hdf5"), &CONFIG).unwrap();
    is_truth(&set, "50004/hips", 5);
    is_truth(&set, "50004/running_on_spot_bugfix", 3);
    assert_eq!(set.provenance()["fps"], 60.0);
    assert_eq!(set.provenance()["units"], "metres");
    assert_eq!(set.provenance()["notes"].as_array().unwrap().len(), 3, "units, up axis and rate were guessed");
    let (_dir, set) = import(&fixture("dyna.h5"), &CONFIG).unwrap();
    is_truth(&set, "50002/punching", 4);
}

#[test]
fn units_and_up_axis_are_guessed_or_stated() {
    let (_dir, set) = import(&fixture("z_up_millimetres.hdf5"), &CONFIG).unwrap();
    is_truth(&set, "50007/knees", 3);
    assert_eq!((&set.provenance()["units"], &set.provenance()["up"]), (&"millimetres".into(), &"z".into()));
    let notes = set.provenance()["notes"].to_string();
    assert!(notes.contains("Z is up") && notes.contains("millimetres") && notes.contains("--units"), "{notes}");
    let stated = ScanImportConfig { fps: Some(30.0), units: Some(Units::Millimetres), up: Some(UpAxis::Z), ..CONFIG };
    let (_dir, set) = import(&fixture("z_up_millimetres.hdf5"), &stated).unwrap();
    is_truth(&set, "50007/knees", 3);
    let left: Vec<&str> = set.provenance()["notes"].as_array().unwrap().iter().map(|n| n.as_str().unwrap()).collect();
    assert!(left.len() == 1 && left[0].contains("without faces"), "{left:?}");
    let wrong = ScanImportConfig { units: Some(Units::Metres), ..stated };
    refused(&fixture("z_up_millimetres.hdf5"), &wrong, &["50007_knees", "frame 0", "--units millimetres"]);
}

#[test]
fn hdf5_that_should_not_come_in_is_named_with_its_dataset() {
    let case = |name: &str, words: &[&str]| refused(&fixture(name), &CONFIG, &[&[name], words].concat());
    case("nan.hdf5", &["50004_hips", "frame 1, vertex 2", "not finite"]);
    case("integers.hdf5", &["50004_hips", "floats"]);
    case("two_axes.hdf5", &["50004_hips", "[8, 3]", "(vertices, 3, frames)"]);
    case("one_frame.hdf5", &["50004_hips", "no velocity"]);
    case("no_frame.hdf5", &["50004_hips", "no frame"]);
    case("nameless.hdf5", &["dataset hips", "SUBJECT_SEQUENCE"]);
    case("nothing.hdf5", &["SUBJECT_SEQUENCE"]);
    case("group.hdf5", &["SUBJECT_SEQUENCE"]);
    case("other_faces.hdf5", &["50004_hips", "other connectivity"]);
    case("negative_face.hdf5", &["dataset faces", "negative"]);
    case("text_faces.hdf5", &["dataset faces", "integers"]);
    case("bomb.hdf5", &["50004_hips", "no scan does"]);
    case("vast.hdf5", &["50004_hips", "more than"]);
    case("external_storage.hdf5", &["50004_hips", "inside this file"]);
    case("external_link.hdf5", &["external_link.hdf5"]);
    case("virtual.hdf5", &["virtual.hdf5"]);
    case("cyclic.hdf5", &["cyclic.hdf5"]);
}

#[test]
fn damaged_hdf5_is_refused_or_read_but_never_a_panic() {
    let bytes = std::fs::read(fixture("dfaust.hdf5")).unwrap();
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("damaged.hdf5");
    for end in [0, 1, 7, 8, 96, bytes.len() / 2, bytes.len() - 1] {
        std::fs::write(&path, &bytes[..end]).unwrap();
        refused(&path, &CONFIG, &["damaged.hdf5"]);
    }
    for at in (0..bytes.len()).step_by(29) {
        let mut flipped = bytes.clone();
        flipped[at] ^= 0x55;
        std::fs::write(&path, &flipped).unwrap();
        let _ = import(&path, &CONFIG);
    }
    refused(&dir.path().join("nowhere.hdf5"), &CONFIG, &["nowhere.hdf5", "does not exist"]);
}

#[test]
fn arrays_of_vertices_come_in_with_their_rate() {
    let (_dir, set) = import(&fixture("anna_hips.npz"), &CONFIG).unwrap();
    is_truth(&set, "anna/hips", 3);
    assert_eq!(set.clips()[0].fps, 30.0);
    refused(&fixture("anna_fps.npz"), &CONFIG, &["anna_fps.npz", "array fps", "between 0 and 1000"]);
    refused(&fixture("anna_flat.npz"), &CONFIG, &["array vertices", "shape"]);
    refused(&fixture("anna_nothing.npz"), &CONFIG, &["no array `vertices`", "points"]);
    refused(Path::new("unnamed.npz"), &CONFIG, &["SUBJECT_MOTION.npz"]);
}

#[test]
fn a_folder_of_files_is_one_set() {
    let dir = tempfile::tempdir().unwrap();
    for name in ["dfaust.hdf5", "dyna.h5", "anna_hips.npz"] {
        std::fs::copy(fixture(name), dir.path().join(name)).unwrap();
    }
    let ids: Vec<String> = import(dir.path(), &CONFIG).unwrap().1.ids().iter().map(ToString::to_string).collect();
    assert_eq!(ids, ["50002/punching.0", "50004/hips.0", "50004/running_on_spot_bugfix.0", "anna/hips.0"]);
    std::fs::copy(fixture("dyna.h5"), dir.path().join("again.h5")).unwrap();
    refused(dir.path(), &CONFIG, &["50002_punching", "another take"]);
}

#[test]
fn ply_of_every_encoding_keeps_its_vertices() {
    for name in ["ascii.ply", "little.ply", "big.ply"] {
        let mesh = read_ply(&fixture(name), &CONFIG.limits).unwrap();
        assert_eq!(mesh.faces.len(), 12, "{name}");
        assert_eq!(mesh.faces[3], [4, 7, 5], "{name}");
        for (v, p) in mesh.positions.iter().enumerate() {
            assert!(p.distance(truth(v, 0)) < 1e-6, "{name}, vertex {v}: {p}");
        }
    }
}

fn ply_error(bytes: &[u8]) -> String {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("bad.ply");
    std::fs::write(&path, bytes).unwrap();
    let message = read_ply(&path, &CONFIG.limits).unwrap_err().to_string();
    assert!(message.contains("bad.ply") && !message.contains('\n'), "{message}");
    message
}

#[test]
fn hostile_ply_is_refused_before_memory_is_taken() {
    let good = std::fs::read_to_string(fixture("ascii.ply")).unwrap();
    let case = |from: &str, to: &str, words: &str| {
        assert!(good.contains(from), "{from}");
        let message = ply_error(good.replacen(from, to, 1).as_bytes());
        assert!(message.contains(words), "{words:?} is missing in: {message}");
    };
    case("element vertex 8", "element vertex 4000000000", "more than 10000");
    case("element vertex 8", "element vertex 99999999999999999999", "count");
    case("element vertex 8", "element vertex 9000", "truncated");
    case("element vertex 8", "element vertex -8", "count");
    case("element vertex 8", "element vertex 8.0", "count");
    case("element edge 2\nproperty int vertex1\nproperty int vertex2\n", "element edge 900\n", "no property");
    case("property float z\n", "", "no x, y and z");
    case("property float z", "property quaternion z", "quaternion");
    case("format ascii", "format klingon", "klingon");
    case("format ascii 1.0\n", "", "format");
    case("end_header", "end_heater", "end_heater");
    case("ply\n", "plx\n", "begin");
    case("3 0 1 3", "3 0 1 8", "face 0: it names vertex 8, the last one is 7");
    case("3 0 1 3", "3 0 1 -1", "points outside the mesh");
    case("3 0 1 3", "3 0 1 4294967296", "points outside the mesh");
    case("3 0 1 3", "2 0 1", "three corners");
    case("3 0 1 3", "900000 0 1 3", "900000");
    case("0 -0.25 0 -0.1", "0 NaN 0 -0.1", "vertex 0: its position");
    case("0 -0.25 0 -0.1", "0 1e400 0 -0.1", "not finite");
    case("0 -0.25 0 -0.1", "0 0,25 0 -0.1", "decimals");
    assert!(ply_error(b"").contains("PLY"));
    assert!(ply_error(&[0xff; 200_000]).contains("PLY"));
    assert!(ply_error(b"ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nproperty float y\nproperty float z\nend_header\n").contains("no vertex"));
    for name in ["little.ply", "big.ply"] {
        let bytes = std::fs::read(fixture(name)).unwrap();
        assert!(ply_error(&bytes[..bytes.len() - 1]).contains("truncated"), "{name}");
    }
    // what other programs write besides: CRLF, a comment that is no UTF-8
    let crlf = good.replace('\n', "\r\n").replace("end_header", "comment \u{fc}ber\r\nend_header");
    let latin: Vec<u8> = crlf.chars().map(|c| c as u8).collect();
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("a.ply"), latin).unwrap();
    assert_eq!(read_ply(&dir.path().join("a.ply"), &CONFIG.limits).unwrap().positions.len(), 8);
}

/// Writes frames into `home/anna/hips`.
fn frames(home: &Path, named: &[(&str, String)]) {
    let clip = home.join("anna/hips");
    std::fs::create_dir_all(&clip).unwrap();
    named.iter().for_each(|(name, text)| std::fs::write(clip.join(name), text).unwrap());
}

fn box_obj(t: usize) -> String {
    let points: Vec<Vec3> = (0..8).map(|v| truth(v, t)).collect();
    obj(&points, &box_topology().faces)
}

#[test]
fn frames_go_by_their_numbers_and_gaps_are_said() {
    let dir = tempfile::tempdir().unwrap();
    frames(dir.path(), &[("f10.obj", box_obj(1)), ("f9.obj", box_obj(0)), ("f011.obj", box_obj(2))]);
    is_truth(&import(dir.path(), &CONFIG).unwrap().1, "anna/hips", 3);
    frames(dir.path(), &[("f14.obj", box_obj(5))]);
    refused(dir.path(), &CONFIG, &["anna/hips", "f011.obj and f14.obj", "--fill-gaps"]);
    let (_dir, set) = import(dir.path(), &ScanImportConfig { fill_gaps: true, ..CONFIG }).unwrap();
    is_truth(&set, "anna/hips", 6);
    assert_eq!(set.provenance()["interpolated_frames"]["anna/hips.0"], serde_json::json!([3, 4]));
    frames(dir.path(), &[("f09.obj", box_obj(0))]);
    refused(dir.path(), &CONFIG, &["f09.obj", "f9.obj", "same frame number"]);
}

#[test]
fn every_second_frame_is_no_gap_and_two_sequences_are_no_clip() {
    let dir = tempfile::tempdir().unwrap();
    frames(dir.path(), &[("f2.obj", box_obj(0)), ("f4.obj", box_obj(1)), ("f6.obj", box_obj(2))]);
    is_truth(&import(dir.path(), &CONFIG).unwrap().1, "anna/hips", 3);
    frames(dir.path(), &[("g8.obj", box_obj(3))]);
    refused(dir.path(), &CONFIG, &["f2.obj and g8.obj", "two sequences"]);
    std::fs::remove_file(dir.path().join("anna/hips/g8.obj")).unwrap();
    frames(dir.path(), &[("nameless.obj", box_obj(3))]);
    refused(dir.path(), &CONFIG, &["nameless.obj", "frame number"]);
}

#[test]
fn bad_obj_frames_are_refused_with_file_and_place() {
    let good = box_obj(0);
    let scaled: Vec<Vec3> = (0..8).map(|v| truth(v, 0) * 1000.0).collect();
    let cases = [
        ("NaN", good.replacen("v 0.25 0 -0.1", "v NaN 0 0", 1), "line 5"),
        ("overflow", good.replacen("v 0.25 0 -0.1", "v 1e400 0 0", 1), "not finite"),
        ("decimal comma", good.replacen("v 0.25 0 -0.1", "v 0,25 0 0", 1), "decimals"),
        ("index zero", good.replacen("f 1//1", "f 0//1", 1), "outside the mesh"),
        ("negative out of range", good.replacen("f 1//1", "f -9//1", 1), "outside the mesh"),
        ("index too large", good.replacen("f 1//1", "f 11//1", 1), "names vertex 11"),
        ("index above u32", good.replacen("f 1//1", "f 4294967299//1", 1), "outside the mesh"),
        ("empty", String::new(), "holds no vertex"),
        ("count", obj(&[Vec3::ZERO, Vec3::X, Vec3::Y], &[[0, 1, 2]]), "3 vertices, but the template has 8"),
        (
            "connectivity",
            obj(&(0..8).map(|v| truth(v, 0)).collect::<Vec<_>>(), &[[0, 7, 6], [1, 6, 3]]),
            "connectivity",
        ),
        ("millimetres among metres", obj(&scaled, &box_topology().faces), "--units millimetres"),
    ];
    for (name, text, says) in cases {
        assert_ne!(text, good, "{name}");
        let dir = tempfile::tempdir().unwrap();
        frames(dir.path(), &[("f9.obj", good.clone()), ("f10.obj", text)]);
        refused(dir.path(), &CONFIG, &["f10.obj", says]);
    }
}

#[test]
fn sequences_need_frames_names_and_a_rate() {
    let dir = tempfile::tempdir().unwrap();
    refused(dir.path(), &CONFIG, &["no scan"]);
    frames(dir.path(), &[]);
    refused(dir.path(), &CONFIG, &["anna/hips", "no frame"]);
    frames(dir.path(), &[("1.obj", box_obj(0))]);
    refused(dir.path(), &CONFIG, &["no velocity"]);
    frames(dir.path(), &[("2.obj", box_obj(1))]);
    for fps in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        refused(dir.path(), &ScanImportConfig { fps: Some(fps), ..CONFIG }, &["frames a second"]);
    }
    std::fs::rename(dir.path().join("anna/hips"), dir.path().join("anna/big hips")).unwrap();
    refused(dir.path(), &CONFIG, &["big hips", "rename"]);
    std::fs::rename(dir.path().join("anna/big hips"), dir.path().join("anna/hips.0")).unwrap();
    frames(dir.path(), &[("1.obj", box_obj(0)), ("2.obj", box_obj(1))]);
    refused(dir.path(), &CONFIG, &["anna/hips", "another take"]);
}

#[test]
fn a_second_import_that_fails_leaves_nothing_that_looks_finished() {
    let (dir, out) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let run = || import_scans(&ScanSource::open(dir.path(), &CONFIG)?, &box_topology(), out.path(), &Silent);
    frames(dir.path(), &[("1.obj", box_obj(0)), ("2.obj", box_obj(1))]);
    run().unwrap();
    assert!(out.path().join("index.json").exists());
    frames(dir.path(), &[("2.obj", "v NaN 0 0".into())]);
    run().unwrap_err();
    assert!(!out.path().join("index.json").exists());
}

#[test]
fn scans_whose_count_varies_are_raw_and_handed_out_by_frame() {
    let dir = tempfile::tempdir().unwrap();
    let cloud = |n: usize, t: usize| {
        let points: Vec<Vec3> = (0..n).map(|v| 1000.0 * truth(v, t)).map(|p| Vec3::new(p.x, -p.z, p.y)).collect();
        obj(&points, &[])
    };
    frames(dir.path(), &[("1.obj", cloud(7, 0)), ("2.obj", cloud(5, 1)), ("4.obj", cloud(6, 3))]);
    let source = ScanSource::open(dir.path(), &ScanImportConfig { fill_gaps: true, ..CONFIG }).unwrap();
    assert!(source.is_raw(8).unwrap());
    let raw = RawScanSource::new(&source).unwrap();
    let clip = &raw.clips()[0];
    assert_eq!(clip.frames, 4);
    assert!(raw.frame(&clip.id, 2).unwrap().is_none(), "this one is missing");
    let frame = raw.frame(&clip.id, 3).unwrap().unwrap();
    assert_eq!(frame.points.len(), 6);
    assert!(frame.points[5].distance(truth(5, 3)) < 1e-6, "metres, Y up: {}", frame.points[5]);
    // registered frames are none, nor is a set in which a single frame is wrong
    let registered = tempfile::tempdir().unwrap();
    frames(registered.path(), &[("1.obj", box_obj(0)), ("2.obj", cloud(5, 1)), ("3.obj", box_obj(2))]);
    assert!(!ScanSource::open(registered.path(), &CONFIG).unwrap().is_raw(8).unwrap());
}

#[test]
fn hdf5_in_another_topology_can_be_taken_as_raw() {
    let raw = RawScanSource::new(&ScanSource::open(&fixture("dfaust.hdf5"), &CONFIG).unwrap()).unwrap();
    let frame = raw.frame(&"50004/hips".parse().unwrap(), 4).unwrap().unwrap();
    assert!(frame.points[6].distance(truth(6, 4)) < 1e-6);
    // corners of a box look outwards
    assert!(frame.normals.iter().zip(&frame.points).all(|(n, p)| n.dot(*p - Vec3::new(0.04, 0.85, 0.0)) > 0.0));
    let arrays = RawScanSource::new(&ScanSource::open(&fixture("anna_hips.npz"), &CONFIG).unwrap());
    assert!(arrays.err().unwrap().to_string().contains("npz"));
}

/// A PLY file of these points and triangles.
fn ply(points: &[Vec3], faces: &[[u32; 3]], big: Option<bool>) -> Vec<u8> {
    let format = match big {
        None => "ascii",
        Some(false) => "binary_little_endian",
        Some(true) => "binary_big_endian",
    };
    let mut text = format!(
        "ply\nformat {format} 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\nelement face {}\n\
         property list uchar uint vertex_indices\nend_header\n",
        points.len(),
        faces.len()
    );
    let Some(big) = big else {
        points.iter().for_each(|p| writeln!(text, "{} {} {}", p.x, p.y, p.z).unwrap());
        faces.iter().for_each(|f| writeln!(text, "3 {} {} {}", f[0], f[1], f[2]).unwrap());
        return text.into_bytes();
    };
    let word = |x: u32| if big { x.to_be_bytes() } else { x.to_le_bytes() };
    let mut bytes = text.into_bytes();
    points.iter().flat_map(|p| p.to_array()).for_each(|x| bytes.extend(word(x.to_bits())));
    for face in faces {
        bytes.push(3);
        face.iter().for_each(|i| bytes.extend(word(*i)));
    }
    bytes
}

type Corners = Vec<(usize, usize, usize)>;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Correspondence survives: whatever the face order and encoding, vertex `i` of the file is vertex `i` of the frame.
    #[test]
    fn vertex_order_is_kept(
        seed in proptest::collection::vec((-2.0f32..2.0, -2.0f32..2.0, -2.0f32..2.0), 3..40),
        faces in proptest::collection::vec((0usize..40, 0usize..40, 0usize..40), 0..40),
    ) {
        let (seed, faces): (Vec<(f32, f32, f32)>, Corners) = (seed, faces);
        let p: Vec<Vec3> = seed.into_iter().map(Vec3::from).collect();
        let faces: Vec<[u32; 3]> =
            faces.into_iter().map(|(a, b, c)| [a % p.len(), b % p.len(), c % p.len()].map(|i| i as u32)).collect();
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("p.ply");
        for big in [None, Some(false), Some(true)] {
            std::fs::write(&path, ply(&p, &faces, big)).unwrap();
            let frame = read_ply(&path, &CONFIG.limits).unwrap();
            prop_assert_eq!(&frame.positions, &p);
            prop_assert_eq!(frame.faces.iter().map(|f| [f[0], f[1], f[2]]).collect::<Vec<_>>(), faces.clone());
        }
    }

    /// Whatever the bytes, reading ends in a mesh or in a sentence.
    #[test]
    fn any_bytes_are_survived(at in 0usize..600, with in any::<u8>(), end in 0usize..650, which in 0usize..3) {
        let mut bytes = std::fs::read(fixture(["ascii.ply", "little.ply", "big.ply"][which])).unwrap();
        let at = at % bytes.len();
        bytes[at] = with;
        bytes.truncate(end.max(1));
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("any.ply");
        std::fs::write(&path, bytes).unwrap();
        let _ = read_ply(&path, &CONFIG.limits);
    }
}
