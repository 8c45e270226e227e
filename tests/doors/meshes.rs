//! Cases 1 to 27: vertices, faces, and what text and PLY can do to them.

use super::files::{
    Lay, P, ascii_ply, body, came_in, clip, faces, fixture, frame, junk, npy, obj, ply, replaced, take, vertices, zip,
};
use super::{Case, Door, Then};
use softtissue_clips::ScanSet;
use std::fmt::Write;
use std::path::Path;

/// A sequence whose second frame is the odd one.
fn second(source: &str, odd: impl Into<Vec<u8>>) -> Vec<Lay> {
    let [first, third] = [0, 2].map(|t| obj(&frame(t), &[]).into_bytes());
    clip(source, vec![("f1.obj", first), ("f2.obj", odd.into()), ("f3.obj", third)])
}

fn second_ply(source: &str, odd: impl Into<Vec<u8>>) -> Vec<Lay> {
    clip(source, vec![("f1.ply", ply(&frame(0))), ("f2.ply", odd.into()), ("f3.ply", ply(&frame(2)))])
}

fn refused(number: u8, source: &str, lay: Vec<Lay>, words: &[&'static str]) -> Case {
    Case::new(number, Door::Scans, source, lay, Then::Refused(words.to_vec()))
}

fn fine(number: u8, source: &str, lay: Vec<Lay>, words: &[&'static str]) -> Case {
    Case::new(number, Door::Scans, source, lay, Then::Fine(words.to_vec(), came_in))
}

/// The template's second frame with its first vertex, or a last face, as stated.
fn vertex(text: &str) -> String {
    format!("{text}\n{}", obj(&frame(1), &[]).split_once('\n').expect("lines").1)
}
fn face(text: &str) -> String {
    format!("{}{text}\n", obj(&frame(1), &[]))
}
fn ply_vertex(text: &str) -> Vec<u8> {
    let [x, y, z] = frame(1)[0];
    replaced(ascii_ply(&frame(1), &[]).as_bytes(), format!("{x} {y} {z}").as_bytes(), text.as_bytes())
}
fn ply_face(text: &str) -> String {
    ascii_ply(&frame(1), &[text])
}

/// Three frames, all made alike.
fn all(source: &str, make: impl Fn(Vec<P>) -> Vec<u8>) -> Vec<Lay> {
    let frames = ["f1.obj", "f2.obj", "f3.obj"].into_iter().enumerate();
    clip(source, frames.map(|(t, name)| (name, make(frame(t)))).collect())
}

fn nothing(_: &Path) {}

/// Where everything is stated nothing is guessed.
fn as_stated(out: &Path) {
    came_in(out);
    let set = ScanSet::open(out).expect("a set");
    assert_eq!((set.clips()[0].fps, &set.provenance()["notes"]), (30.0, &serde_json::json!([])));
}

pub fn cases() -> Vec<Case> {
    let mut cases = numbers();
    cases.extend(indices());
    cases.extend(orders());
    cases.extend(texts());
    cases.extend(surfaces());
    cases.extend(conventions());
    cases.extend(headers());
    cases
}

/// 1 to 3.
fn numbers() -> Vec<Case> {
    let nan = [&frame(1)[..5], &[[0.0, f32::NAN, 0.0]], &frame(1)[6..]].concat();
    let archive = zip(&[("vertices.npy", &vertices(&[frame(0), nan.clone()]))]);
    vec![
        refused(1, "nan", second("nan", vertex("v NaN 0 0")), &["f2.obj, line 1", "finite"]),
        refused(1, "infinite", second("infinite", vertex("v inf 0 0")), &["f2.obj, line 1", "finite"]),
        refused(1, "nan-ply", second_ply("nan-ply", ply(&nan)), &["f2.ply", "vertex 5", "finite"]),
        Case::refused(1, Door::Scans, "anna_nan.npz", archive, &["array vertices", "[1, 5, 1]", "finite"]),
        Case::fixture(1, Door::Body, "bodies/nan.npz", "nan.npz", &["v_template", "[5, 0]", "not finite"]),
        refused(2, "huge", second("huge", vertex("v 1e400 0 0")), &["f2.obj, line 1", "finite"]),
        refused(2, "huge-ply", second_ply("huge-ply", ply_vertex("1e400 0 0")), &["f2.ply", "vertex 0", "finite"]),
        refused(3, "comma", second("comma", vertex("v 0,5 0 0")), &["f2.obj, line 1", "decimals"]),
        refused(3, "comma-ply", second_ply("comma-ply", ply_vertex("0,5 0 0")), &["f2.ply", "vertex 0", "decimals"]),
    ]
}

/// 4 to 8.
fn indices() -> Vec<Case> {
    let outside = &["f2.obj, line 1725", "outside"];
    let quads = |points: Vec<P>| {
        let mut text = obj(&points, &faces()[200..]);
        for q in &body().topology.quads[..100] {
            writeln!(text, "f {}//1 {}//1 {}//1 {}//1", q[0] + 1, q[1] + 1, q[2] + 1, q[3] + 1).expect("a line");
        }
        text.into_bytes()
    };
    vec![
        refused(4, "zero", second("zero", face("f 0 1 2")), outside),
        refused(5, "negative", second("negative", face("f -9999 1 2")), outside),
        refused(5, "negative-ply", second_ply("negative-ply", ply_face("3 0 1 -1")), &["f2.ply", "face 0", "outside"]),
        refused(6, "above-u32", second("above-u32", face("f 4294967297 1 2")), outside),
        refused(6, "past", second("past", face("f 1725 1 2")), &["f2.obj", "face 1 names vertex 1725"]),
        refused(6, "past-ply", second_ply("past-ply", ply_face("3 0 1 1724")), &["f2.ply", "face 0", "vertex 1724"]),
        refused(7, "degenerate", second("degenerate", face("f 5 5 5")), &["f2.obj", "face 1", "connectivity"]),
        refused(7, "two-corners", second("two-corners", face("f 5 6")), &["f2.obj, line 1725", "three corners"]),
        fine(8, "mixed", all("mixed", quads), &[]),
    ]
}

/// 9 to 11: the order of vertices is the correspondence.
fn orders() -> Vec<Case> {
    // Every vertex goes to where another was; faces go along.
    let count = frame(0).len();
    let moved = |v: usize| (v * 601 + 7) % count;
    let permuted = |with_faces: bool| {
        move |points: Vec<P>| {
            let mut other = points.clone();
            points.iter().enumerate().for_each(|(v, p)| other[moved(v)] = *p);
            let faces: Vec<[u32; 3]> = faces().iter().map(|f| f.map(|v| moved(v as usize) as u32)).collect();
            obj(&other, if with_faces { &faces } else { &[] }).into_bytes()
        }
    };
    let two = |points: Vec<P>| {
        let text = obj(&points, &faces());
        let at = text.find("f ").expect("faces");
        format!("o body\n{}o body\ng body\n{}", &text[..at], &text[at..]).into_bytes()
    };
    vec![
        fine(9, "unreferenced", all("unreferenced", |p| obj(&p, &faces()[900..901]).into_bytes()), &[]),
        refused(10, "permuted", all("permuted", permuted(true)), &["f1.obj", "connectivity"]),
        refused(10, "permuted-cloud", all("permuted-cloud", permuted(false)), &["f1.obj", "another order"]),
        fine(11, "two-objects", all("two-objects", two), &[]),
    ]
}

/// 12 to 18.
fn texts() -> Vec<Case> {
    let crlf = |points: Vec<P>| format!("\u{feff}{}", obj(&points, &faces())).replace('\n', "\r\n").into_bytes();
    let latin = |points: Vec<P>| [b"# B\xfcste\no K\xf6rper\n", obj(&points, &faces()).as_bytes()].concat();
    let long = face(&format!("f{}", " 1".repeat(6_000_000)));
    let long_ply = ply_face(&format!("6000000{}", " 1".repeat(6_000_000)));
    let outside = |points: Vec<P>| format!("mtllib ../../../secret.mtl\n{}", obj(&points, &[])).into_bytes();
    let devices = |points: Vec<P>| {
        format!("mtllib /dev/zero\nmtllib pipe.mtl\nusemtl skin\n{}", obj(&points, &faces())).into_bytes()
    };
    let mut piped = all("devices", devices);
    piped.push(Lay::Pipe("devices/anna/hips/pipe.mtl".into()));
    let pipe = |door, name: &str| {
        Case::new(18, door, name, vec![Lay::Pipe(name.into())], Then::Refused(vec!["pipe or device"]))
    };
    let mut cases = vec![
        fine(12, "crlf", all("crlf", crlf), &[]),
        fine(13, "latin", all("latin", latin), &[]),
        refused(14, "empty", second("empty", ""), &["f2.obj", "no vertex"]),
        refused(14, "empty-ply", second_ply("empty-ply", ""), &["f2.ply", "PLY"]),
        refused(15, "junk", second("junk", junk()), &["f2.obj", "no vertex"]),
        refused(15, "junk-ply", second_ply("junk-ply", junk()), &["f2.ply", "PLY"]),
        refused(16, "long", second("long", long), &["f2.obj, line 1725", "64 corners"]),
        refused(16, "long-ply", second_ply("long-ply", long_ply), &["f2.ply", "face 0", "6000000"]),
        fine(17, "outside", all("outside", outside), &[]),
        fine(18, "devices", piped, &[]),
        pipe(Door::Motion, "pipe.bvh"),
        pipe(Door::Motion, "pipe.npz"),
        pipe(Door::Body, "pipe.pkl"),
    ];
    let two = take("cmu_01_01.bvh").lines().take(187).map(|l| format!("{l}\n")).collect::<String>();
    let long = format!("{two}{}", "1 ".repeat(6_000_000));
    cases.push(Case::refused(16, Door::Motion, "long.bvh", long, &["long.bvh, line 188", "more than 96"]));
    for (name, words) in [("empty.bvh", "HIERARCHY"), ("empty.npz", "zip")] {
        cases.push(Case::refused(14, Door::Motion, name, "", &[words]));
    }
    for (name, words) in [("junk.bvh", "HIERARCHY"), ("junk.npz", "zip")] {
        cases.push(Case::refused(15, Door::Motion, name, junk(), &[words]));
    }
    for (name, words) in [("anna_void.hdf5", "empty"), ("anna_void.npz", "zip")] {
        cases.push(Case::refused(14, Door::Scans, name, "", &[words]));
    }
    for (name, words) in [("anna_junk.h5", "HDF5"), ("anna_junk.npz", "zip")] {
        cases.push(Case::refused(15, Door::Scans, name, junk(), &[words]));
    }
    cases.push(Case::refused(14, Door::Body, "empty.pkl", "", &["neither a pickle"]));
    cases.push(Case::refused(15, Door::Body, "junk.pkl", junk(), &["neither a pickle"]));
    cases
}

/// 19 to 22.
fn surfaces() -> Vec<Case> {
    let doubled = |points: Vec<P>| obj(&points, &[&faces()[..], &faces()[..40]].concat()).into_bytes();
    let turned: Vec<[u32; 3]> = faces().iter().map(|[a, b, c]| [*a, *c, *b]).collect();
    let flipped = |points: Vec<P>| obj(&points, &turned).into_bytes();
    let mirrored =
        |points: Vec<P>| obj(&points.iter().map(|p| [-p[0], p[1], p[2]]).collect::<Vec<_>>(), &faces()).into_bytes();
    let body = |number, file: &str, words: &[&'static str]| {
        let bytes = std::fs::read(fixture("bodies").join(file)).expect("a fixture");
        Case::new(number, Door::Body, file, vec![Lay::Bytes(file.into(), bytes)], Then::Fine(words.to_vec(), nothing))
    };
    let fewer = obj(&frame(1)[1..], &[]);
    let mut strange = faces();
    strange[7] = [0, 899, 1699];
    let archive = zip(&[
        ("vertices.npy", &vertices(&[frame(0), frame(1)])),
        ("faces.npy", &npy("<u4", false, &format!("({}, 3)", strange.len()), &words(&strange))),
    ]);
    vec![
        fine(19, "doubled", all("doubled", doubled), &["more than two faces share an edge", "anna/hips.0"]),
        body(19, "shared_edge.npz", &["surface is not closed"]),
        fine(20, "flipped", all("flipped", flipped), &["wound inwards", "anna/hips.0"]),
        refused(20, "mirrored", all("mirrored", mirrored), &["f1.obj", "mirrored"]),
        body(20, "inwards.npz", &["wound inwards"]),
        refused(21, "count", second("count", fewer), &["f2.obj", "1723 vertices, but the template has 1724"]),
        Case::fixture(21, Door::Scans, "scans/dfaust.hdf5", "dfaust.hdf5", &["50004_hips", "8 vertices"]),
        refused(22, "connectivity", second("connectivity", face("f 1 900 1700")), &["f2.obj", "connectivity"]),
        Case::refused(22, Door::Scans, "anna_other.npz", archive, &["face 8", "connectivity"]),
    ]
}

fn words(faces: &[[u32; 3]]) -> Vec<u8> {
    faces.iter().flatten().flat_map(|i| i.to_le_bytes()).collect()
}

/// 23 and 24.
fn conventions() -> Vec<Case> {
    let scaled = |by: f32| move |points: Vec<P>| points.iter().map(|p| p.map(|x| x * by)).collect::<Vec<P>>();
    let in_units = |by: f32| move |points: Vec<P>| obj(&scaled(by)(points), &faces()).into_bytes();
    let z_up = |points: Vec<P>| obj(&points.iter().map(|p| [p[0], -p[2], p[1]]).collect::<Vec<_>>(), &[]).into_bytes();
    let among = second("among-metres", obj(&scaled(1e3)(frame(1)), &[]));
    let motion = |number, file: &str, words: &[&'static str]| {
        let bytes = std::fs::read(fixture("motion").join(file)).expect("a fixture");
        Case::new(number, Door::Motion, file, vec![Lay::Bytes(file.into(), bytes)], Then::Fine(words.to_vec(), nothing))
    };
    let stated = all("stated", in_units(1e3));
    vec![
        fine(23, "centimetres", all("centimetres", in_units(100.0)), &["lengths are centimetres", "--units"]),
        fine(23, "millimetres", all("millimetres", in_units(1e3)), &["lengths are millimetres", "--units"]),
        Case::new(23, Door::Scans, "stated", stated, Then::Fine(vec!["1 clips"], as_stated)).with(&[
            "--units",
            "millimetres",
            "--up",
            "y",
            "--fps",
            "30",
        ]),
        refused(23, "among-metres", among, &["f2.obj", "--units millimetres"]),
        Case::fixture(23, Door::Body, "bodies/millimetres.npz", "millimetres.npz", &["1700.00 m tall", "metres"]),
        motion(23, "daz.bvh", &["centimetres (guessed)"]),
        Case::refused(23, Door::Motion, "cmu.bvh", take("cmu_01_01.bvh"), &["--units", "tall"])
            .with(&["--units", "metres"]),
        fine(24, "z-up", all("z-up", z_up), &["Z is up", "--up"]),
        motion(24, "motion_builder.bvh", &["Z up (guessed)", "inches (guessed)"]),
    ]
}

/// 25 to 27.
fn headers() -> Vec<Case> {
    let whole = ply(&frame(1));
    let header = |from: &str, to: &str| replaced(&whole, from.as_bytes(), to.as_bytes());
    let big = ["f1.ply", "f2.ply", "f3.ply"].into_iter().enumerate().map(|(t, name)| (name, ply(&frame(t)))).collect();
    let bare = header("end_header", "element nothing 3000000\nend_header");
    let half = whole[..whole.len() - 5].to_vec();
    let twice = header("end_header", "element vertex 1\nproperty char x\nend_header");
    let vast = header("vertex 1724", "vertex 4000000000");
    vec![
        refused(25, "vast", second_ply("vast", vast), &["f2.ply", "4000000000", "more than"]),
        refused(25, "more", second_ply("more", header("1724", "900000")), &["f2.ply", "truncated"]),
        refused(25, "half", second_ply("half", half), &["f2.ply", "truncated"]),
        refused(26, "bare", second_ply("bare", bare), &["f2.ply", "no property"]),
        refused(26, "twice", second_ply("twice", twice), &["f2.ply", "twice"]),
        fine(27, "big-endian", clip("big-endian", big), &[]),
    ]
}
