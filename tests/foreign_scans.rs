//! Scans of foreign formats through the real command: what comes in, and how hostile files are answered. The files are
//! those of `tests/fixtures/scans/make.py`, and frames made of the tiny scans' own vertices.

use crate::support::{Said, command, data_dir, folder, softtissue, tiny_scans};
use softtissue_clips::ScanSet;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// A refusal takes no longer.
const ANSWER: Duration = Duration::from_secs(5);

fn import(source: &Path, out: &Path, more: &[&str]) -> Said {
    let mut import = command();
    import.args(["import", "scans"]).arg(source).arg("--out").arg(out).arg("--data-dir").arg(data_dir()).args(more);
    Said::of(&import.output().expect("the command starts"))
}

/// Refused with exit code 3 in time, and nothing looks finished.
#[track_caller]
fn refused(source: &Path, more: &[&str], words: &[&str]) {
    let out = source.with_file_name("refused-out");
    // the body is made once and then kept, which is no part of the answer
    tiny_scans();
    let started = Instant::now();
    import(source, &out, more).refused(3, words);
    assert!(started.elapsed() < ANSWER, "{words:?} took {:?}", started.elapsed());
    assert!(!out.join("index.json").exists(), "{words:?}: nothing looks finished");
}

/// Two frames of the tiny scans, in the body's vertex order.
fn true_frames() -> [Vec<[f32; 3]>; 2] {
    let set = ScanSet::open(&tiny_scans()).expect("the tiny scans");
    let clip = set.scan(&set.ids()[0]).expect("a clip");
    [0, 1].map(|t| clip.vertices.frame(t).iter().map(|p| p.to_array()).collect())
}

fn obj(points: &[[f32; 3]]) -> String {
    let mut text = String::new();
    points.iter().for_each(|p| writeln!(text, "v {} {} {}", p[0], p[1], p[2]).expect("a line"));
    text
}

fn ply(points: &[[f32; 3]]) -> Vec<u8> {
    let properties = "property float x\nproperty float y\nproperty float z\n";
    let head = format!("ply\nformat binary_big_endian 1.0\nelement vertex {}\n{properties}end_header\n", points.len());
    let mut bytes = head.into_bytes();
    points.iter().flatten().for_each(|x| bytes.extend(x.to_be_bytes()));
    bytes
}

/// A source with the clip `anna/hips` of these frames.
fn source(dir: &Path, name: &str, frames: &[(&str, &[u8])]) -> PathBuf {
    let clip = dir.join(name).join("anna/hips");
    std::fs::create_dir_all(&clip).expect("a folder");
    frames.iter().for_each(|(file, bytes)| std::fs::write(clip.join(file), bytes).expect("a frame"));
    dir.join(name)
}

#[test]
fn hostile_hdf5_and_arrays_are_answered_with_their_dataset() {
    let dir = folder("hostile-hdf5");
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/scans");
    let case = |name: &str, words: &[&str]| {
        let path = dir.join(name);
        std::fs::copy(fixtures.join(name), &path).expect("a fixture");
        refused(&path, &[], &[&[name], words].concat());
    };
    case("external_storage.hdf5", &["50004_hips"]);
    case("virtual.hdf5", &["virtual.hdf5"]);
    case("external_link.hdf5", &["external_link.hdf5"]);
    case("bomb.hdf5", &["50004_hips", "no scan does"]);
    case("vast.hdf5", &["50004_hips", "more than"]);
    case("cyclic.hdf5", &["cyclic.hdf5"]);
    case("nameless.hdf5", &["SUBJECT_SEQUENCE"]);
    case("no_frame.hdf5", &["50004_hips", "no frame"]);
    case("one_frame.hdf5", &["50004_hips", "no velocity"]);
    case("two_axes.hdf5", &["50004_hips", "(vertices, 3, frames)"]);
    case("nan.hdf5", &["50004_hips"]);
    case("dfaust.hdf5", &["50004_hips", "8 vertices, but the template has 1724"]);
    case("anna_fps.npz", &["array fps"]);
    case("anna_nothing.npz", &["vertices"]);
    for (name, bytes) in [("empty.hdf5", &b""[..]), ("junk.h5", &[0xab; 5000]), ("half.npz", b"PK\x03\x04")] {
        std::fs::write(dir.join(name), bytes).expect("a file");
        refused(&dir.join(name), &[], &[name]);
    }
    refused(&dir.join("nowhere.hdf5"), &[], &["nowhere.hdf5", "does not exist"]);
    // the same door, from `train`
    let mut train = command();
    train.arg("train").arg("--data").arg(dir.join("bomb.hdf5")).arg("--out").arg(dir.join("run"));
    train.arg("--data-dir").arg(data_dir());
    Said::of(&train.output().expect("the command starts")).refused(3, &["bomb.hdf5", "50004_hips"]);
    assert!(!dir.join("run/config.toml").exists());
}

#[test]
fn hostile_frames_are_answered_with_file_and_place() {
    let dir = folder("hostile-frames");
    let [first, second] = true_frames();
    let good = obj(&first);
    let next = obj(&second);
    let line = |text: &str| format!("{text}\n{}", good.split_once('\n').expect("lines").1);
    let face = |text: &str| format!("{good}{text}\n");
    let long = face(&format!("f{}", " 1".repeat(6_000_000)));
    let scaled: Vec<[f32; 3]> = first.iter().map(|p| p.map(|x| x * 1000.0)).collect();
    let cases: [(&str, String, &[&str]); 15] = [
        ("nan", line("v NaN 0 0"), &["f2.obj, line 1", "finite"]),
        ("infinite", line("v inf 0 0"), &["f2.obj, line 1", "finite"]),
        ("huge", line("v 1e400 0 0"), &["f2.obj, line 1", "finite"]),
        ("comma", line("v 0,5 0 0"), &["f2.obj, line 1", "decimals"]),
        ("zero", face("f 0 1 2"), &["f2.obj, line 1725", "outside"]),
        ("negative", face("f -9999 1 2"), &["f2.obj, line 1725", "outside"]),
        ("above-u32", face("f 4294967297 1 2"), &["f2.obj, line 1725", "outside"]),
        ("past-the-end", face("f 1725 1 2"), &["f2.obj", "names vertex 1725"]),
        ("degenerate", face("f 5 5 5"), &["f2.obj", "connectivity"]),
        ("connectivity", face("f 1 900 1700"), &["f2.obj", "connectivity"]),
        ("long", long, &["f2.obj, line 1725", "64 corners"]),
        ("empty", String::new(), &["f2.obj", "no vertex"]),
        ("count", good.lines().skip(1).fold(String::new(), |s, l| s + l + "\n"), &["f2.obj", "1723 vertices"]),
        ("millimetres-among-metres", obj(&scaled), &["f2.obj", "--units millimetres"]),
        ("two-points", "v 0 0 0\nv 0 1 0\n".into(), &["f2.obj", "2 vertices"]),
    ];
    for (name, text, words) in cases {
        let frames: [(&str, &[u8]); 3] =
            [("f1.obj", good.as_bytes()), ("f2.obj", text.as_bytes()), ("f3.obj", next.as_bytes())];
        refused(&source(&dir, name, &frames), &[], words);
    }
    let frame = ply(&first);
    let header = |from: &str, to: &str| {
        let text: String = frame.iter().map(|b| char::from(*b)).collect();
        text.replacen(from, to, 1).chars().map(|c| c as u8).collect::<Vec<u8>>()
    };
    let cases: [(&str, Vec<u8>, &[&str]); 5] = [
        ("ply-vast", header("vertex 1724", "vertex 4000000000"), &["f2.ply", "more than"]),
        ("ply-bare", header("end_header", "element nothing 3000000\nend_header"), &["f2.ply", "no property"]),
        ("ply-half", frame[..frame.len() - 5].to_vec(), &["f2.ply", "truncated"]),
        ("ply-junk", vec![0x9d; 4000], &["f2.ply", "PLY"]),
        ("ply-void", vec![], &["f2.ply", "PLY"]),
    ];
    for (name, bytes, words) in cases {
        refused(&source(&dir, name, &[("f1.ply", &frame), ("f2.ply", &bytes), ("f3.ply", &frame)]), &[], words);
    }
}

#[test]
fn sequences_that_are_none_are_answered_with_their_folder() {
    let dir = folder("hostile-sequences");
    let [first, second] = true_frames();
    let (a, b) = (obj(&first), obj(&second));
    let (a, b) = (a.as_bytes(), b.as_bytes());
    refused(&source(&dir, "none", &[]), &[], &["anna/hips", "no frame"]);
    refused(&source(&dir, "one", &[("1.obj", a)]), &[], &["anna/hips", "no velocity"]);
    let gap = source(&dir, "gap", &[("8.obj", a), ("9.obj", b), ("12.obj", a)]);
    refused(&gap, &[], &["9.obj and 12.obj", "--fill-gaps"]);
    refused(
        &source(&dir, "twice", &[("1.obj", a), ("01.obj", b), ("2.obj", a)]),
        &[],
        &["01.obj", "same frame number"],
    );
    let people = [("anna1.obj", a), ("anna2.obj", b), ("ben3.obj", a)];
    refused(&source(&dir, "people", &people), &[], &["two sequences"]);
    refused(&source(&dir, "unnamed", &[("left.obj", a), ("right.obj", b)]), &[], &["frame number"]);
    let fine = source(&dir, "fine", &[("9.obj", a), ("10.obj", b)]);
    for fps in ["0", "-5", "NaN"] {
        refused(&fine, &[&format!("--fps={fps}")], &["frames a second"]);
    }
    refused(&dir.join("fine/anna/hips/9.obj"), &[], &["single frame"]);
    import(&fine, &fine.join("inside"), &[]).refused(2, &["inside", "choose another"]);
}

#[test]
fn what_other_programs_write_comes_in_and_guesses_are_said() {
    let dir = folder("other-programs");
    let [first, second] = true_frames();
    let set_of = |name: &str, frames: &[(&str, &[u8])], more: &[&str]| {
        let out = dir.join(format!("{name}-out"));
        let said = import(&source(&dir, name, frames), &out, more);
        said.fine();
        (ScanSet::open(&out).expect("a set"), said.err)
    };
    // a byte order mark, CRLF, two objects of one name, Latin-1 in a comment, materials that are a device
    let strange = |points: &[[f32; 3]]| {
        let text = format!("\u{feff}{}", obj(points)).replace('\n', "\r\n");
        let mut bytes = text.into_bytes();
        bytes.extend(b"# b\xfcste\r\no body\r\no body\r\nmtllib /dev/zero\r\nmtllib ../../secret.mtl\r\nusemtl x\r\n");
        bytes
    };
    let (set, _) = set_of("strange", &[("f9.obj", &strange(&first)), ("f10.obj", &strange(&second))], &[]);
    let clip = set.scan(&set.ids()[0]).expect("a clip");
    assert_eq!(clip.vertices.frame(0)[7].to_array(), first[7]);
    assert_eq!(clip.vertices.frame(1)[1723].to_array(), second[1723], "frame 10 comes after frame 9");
    // millimetres with Z up
    let turned =
        |points: &[[f32; 3]]| ply(&points.iter().map(|p| [p[0] * 1e3, -p[2] * 1e3, p[1] * 1e3]).collect::<Vec<_>>());
    let frames = [("00009.ply", turned(&first)), ("00011.ply", turned(&second))];
    let frames: Vec<(&str, &[u8])> = frames.iter().map(|(n, b)| (*n, b.as_slice())).collect();
    let (set, said) = set_of("turned", &frames, &[]);
    assert!(said.contains("Z is up") && said.contains("millimetres") && said.contains("60 frames a second"), "{said}");
    let found = set.scan(&set.ids()[0]).expect("a clip").vertices.frame(1)[500];
    assert!(found.distance(second[500].into()) < 1e-5, "{found}");
    let stated = ["--up", "z", "--units", "millimetres", "--fps", "30"];
    let (set, _) = set_of("stated", &frames, &stated);
    assert_eq!(set.clips()[0].fps, 30.0);
    assert_eq!(set.provenance()["notes"].as_array().map(Vec::len), Some(1), "{}", set.provenance());
    softtissue(&["inspect", &dir.join("stated-out").display().to_string()]).fine();
}
