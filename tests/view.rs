//! `view`: a page in one file of whatever moves, and sentences for what does not.

use crate::support::{Said, data_dir, folder, softtissue, tiny_run, tiny_scans};
use serde_json::Value;
use softtissue_body::BodyModel;
use softtissue_clips::{ClipId, FitSet, ScanSet, TruthSet};
use std::fmt::Write;
use std::path::{Path, PathBuf};

fn text(path: &Path) -> String {
    path.display().to_string()
}

fn view(path: &Path, more: &[&str]) -> Said {
    softtissue(&[&["view", &text(path), "--no-browser"], more].concat())
}

/// Makes a page; what its script reads, and the page.
fn page(path: &Path, home: &Path, more: &[&str]) -> (Value, String) {
    let out = home.join("page.html");
    let _ = std::fs::remove_file(&out);
    let said = view(path, &[&["--out", &text(&out)], more].concat());
    assert_eq!(said.fine().out.lines().last(), Some(text(&out).as_str()), "{}", said.out);
    let html = std::fs::read_to_string(&out).expect("a page");
    let (_, rest) = html.split_once("id=\"data\">").expect("data");
    let data = serde_json::from_str(rest.split_once("</script>").expect("an end").0).expect("JSON");
    (data, html)
}

fn keys(data: &Value) -> Vec<&str> {
    data["layers"].as_array().expect("layers").iter().filter_map(|l| l["key"].as_str()).collect()
}

fn clips(data: &Value) -> Vec<&str> {
    data["clips"].as_array().expect("clips").iter().filter_map(|c| c["clip"].as_str()).collect()
}

/// The fit of the shared run: the one in the cache that has its clips and the latest list.
fn tiny_fit() -> PathBuf {
    let set = ScanSet::open(&tiny_scans()).expect("the tiny scans");
    let entries = std::fs::read_dir(data_dir().join("cache")).expect("the cache").flatten().map(|e| e.path());
    let fits = entries.filter(|p| p.file_name().is_some_and(|n| n.to_string_lossy().starts_with("fit-")));
    fits.filter_map(|p| FitSet::open(&p).ok())
        .find(|f| f.topology() == set.topology() && f.clips() == set.clips())
        .expect("its fit")
        .root()
        .to_owned()
}

#[test]
fn a_run_shows_truth_body_and_prediction_and_its_fit_when_asked() {
    let home = folder("view-run");
    let run = &tiny_run().path;
    let (data, html) = page(run, &home, &[]);
    assert_eq!(keys(&data), ["reference", "alone", "predicted"]);
    assert_eq!((&data["reference"], &data["layers"][0]["label"]), (&0.into(), &"Truth".into()));
    assert!(!clips(&data).is_empty() && clips(&data).iter().all(|c| c.contains("/one_leg_jump.0 · test")), "{data}");
    assert!(html.contains("Run of method softtissue"));
    let (data, _) = page(run, &home, &["--clip", "s01/punching.0", "--fit", "--range", "10..30"]);
    assert_eq!(keys(&data), ["scan", "fit", "reference", "predicted", "surface", "alone", "deltas"]);
    assert_eq!(clips(&data), ["s01/punching.0 · seen in training"]);
    assert_eq!(data["clips"][0]["frames"], 20);
    assert!((data["clips"][0]["start"].as_f64().expect("a time") - 10.0 / 60.0).abs() < 1e-6);
    // nothing of the run was touched, and nothing is left beside it
    assert!(!run.join("page.html").exists());
}

#[test]
fn a_run_without_a_bundle_shows_what_there_is_and_one_without_scans_says_so() {
    let home = folder("view-unfinished");
    let run = home.join("run");
    std::fs::create_dir_all(&run).expect("a folder");
    for name in ["config.toml", "provenance.json"] {
        std::fs::copy(tiny_run().path.join(name), run.join(name)).expect("a copy");
    }
    let (data, html) = page(&run, &home, &[]);
    assert_eq!(keys(&data), ["reference", "alone"]);
    assert!(html.contains("No bundle yet"));
    let elsewhere = home.join("elsewhere");
    view(&run, &["--data-dir", &text(&elsewhere)]).refused(3, &["elsewhere", "--data-dir", "train --resume"]);
    assert!(!elsewhere.exists(), "looking makes nothing");
}

#[test]
fn scans_fits_and_clips_of_ours_have_their_layers() {
    let home = folder("view-ours");
    let scans = tiny_scans();
    let made = scans.parent().expect("a parent");
    for path in [scans.as_path(), made, &made.join("truth")] {
        let (data, html) = page(path, &home, &[]);
        assert_eq!(keys(&data), ["scan", "reference", "alone"], "{}", path.display());
        assert!(clips(&data).len() > 1 && html.contains("Scans and their truth: 8 clips"));
    }
    let set = ScanSet::open(&scans).expect("the tiny scans");
    let id: ClipId = set.ids()[5].clone();
    let clip = ScanSet::scan_path(&scans, &id);
    let (data, _) = page(&clip, &home, &[]);
    assert_eq!((clips(&data), keys(&data).len()), (vec![id.to_string().as_str()], 3), "a clip knows its set");
    // away from its set, a clip and its body
    let alone = home.join("alone");
    std::fs::create_dir_all(&alone).expect("a folder");
    std::fs::copy(&clip, alone.join("clip.safetensors")).expect("a copy");
    let (data, _) = page(&alone.join("clip.safetensors"), &home, &["--body", &text(&tiny_body())]);
    assert_eq!(keys(&data), ["scan"]);
    let fit = tiny_fit();
    let (data, _) = page(&fit, &home, &["--clip", &id.to_string()]);
    assert_eq!((keys(&data), clips(&data)), (vec!["fit", "deltas"], vec![id.to_string().as_str()]));
    assert_eq!(keys(&page(&FitSet::delta_path(&fit, &id), &home, &[]).0), ["deltas", "alone"]);
    let motion = TruthSet::motion_path(&made.join("truth"), &id);
    assert_eq!(keys(&page(&motion, &home, &["--range", "..7"]).0), ["alone"]);
}

fn tiny_body() -> PathBuf {
    let set = ScanSet::open(&tiny_scans()).expect("the tiny scans");
    let entries = std::fs::read_dir(data_dir().join("cache")).expect("the cache").flatten().map(|e| e.path());
    entries
        .filter(|p| p.file_name().is_some_and(|n| n.to_string_lossy().starts_with("body-")))
        .find(|p| BodyModel::read(p).expect("a body").topology.hash() == set.topology())
        .expect("its body")
}

#[test]
fn foreign_scans_meshes_and_motions_are_shown_as_they_are() {
    let home = folder("view-foreign");
    let frames = home.join("scans/anna/hips");
    std::fs::create_dir_all(&frames).expect("a folder");
    for t in 0..5 {
        let x = 0.01 * t as f32;
        let mut obj = format!("v {x} 0 0\nv {} 0 0\nv {x} 0 0.5\nv {x} 1.7 0\n", x + 0.5);
        ["1 2 3", "1 4 2", "2 4 3", "3 4 1"].iter().for_each(|f| writeln!(obj, "f {f}").expect("a line"));
        std::fs::write(frames.join(format!("{t:03}.obj")), obj).expect("a frame");
    }
    let (data, html) = page(&home.join("scans"), &home, &[]);
    assert_eq!((keys(&data), clips(&data)), (vec!["scan"], vec!["anna/hips.0"]));
    assert_eq!((&data["mesh"]["vertices"], &data["clips"][0]["frames"]), (&4.into(), &5.into()));
    assert!(data["mesh"]["regions"].is_null() && html.contains("Assumed 60 frames a second"));
    let (data, html) = page(&frames.join("000.obj"), &home, &[]);
    assert_eq!(data["clips"][0]["frames"], 1);
    assert!(!html.contains("id=\"time\""), "one frame has no time");
    let bvh = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/motion/cmu_01_01.bvh");
    let (data, html) = page(&bvh, &home, &["--range", "0..40"]);
    assert_eq!((keys(&data), &data["clips"][0]["frames"]), (vec!["alone"], &40.into()));
    assert!(html.contains("cmu_01_01.bvh: "), "what was guessed of it is said");
}

#[test]
fn what_cannot_be_shown_is_refused_with_a_sentence() {
    let home = folder("view-refused");
    let run = &tiny_run().path;
    let scans = tiny_scans();
    view(run, &["--clip", "s01/one_leg_hop.0"])
        .refused(3, &["no clip s01/one_leg_hop.0", "write one of s01/one_leg_jump.0"]);
    view(&scans, &["--clip", "dancing"]).refused(2, &["dancing", "subject/motion"]);
    view(&scans, &["--range", "40..60"]).refused(2, &["--range 40..60", "48 frames"]);
    view(&scans, &["--clip", "s00/punching", "--clip", "s00/punching.0"]).refused(2, &["twice"]);
    assert_eq!(view(&scans, &["--range", "x"]).code, 2);
    view(&scans, &["--motion", "synth:hips"]).refused(2, &["--motion", "bundle"]);
    view(&scans, &["--fit"]).refused(2, &["--fit", "runs"]);
    view(&run.join("bundle"), &["--clip", "s01/punching"]).refused(2, &["--clip"]);
    view(&home.join("nowhere"), &[]).refused(3, &["nowhere", "does not exist"]);
    std::fs::write(home.join("letter.txt"), "dear").expect("a file");
    view(&home.join("letter.txt"), &[]).refused(3, &["letter.txt"]);
    view(&home, &[]).refused(3, &["view-refused", "run", "bundle"]);
    view(&data_dir().join("cache"), &[]).refused(3, &["a cache"]);
    view(&tiny_body(), &[]).refused(3, &["a body file"]);
    // another body: other vertices, then the same vertices in other triangles
    let set = ScanSet::open(&scans).expect("the tiny scans");
    let mut body = BodyModel::read(&tiny_body()).expect("a body");
    std::sync::Arc::make_mut(&mut body.topology).faces.rotate_left(1);
    let other = home.join("other.safetensors");
    body.write(&other).expect("a body");
    let count = set.vertex_count().to_string();
    view(&scans, &["--body", &text(&other)]).refused(3, &[&count, "--body"]);
    assert!(!home.join("page.html").exists());
}

#[test]
fn a_log_for_rerun_needs_a_build_that_writes_one() {
    let dir = folder("view-log");
    let log = dir.join("run.rrd");
    let said = view(&tiny_run().path, &["--viz", &text(&log)]);
    if cfg!(feature = "rerun") {
        assert_eq!(said.fine().out.lines().last(), Some(text(&log).as_str()), "{}", said.out);
        assert!(std::fs::read(&log).expect("a log").starts_with(b"RRF"));
    } else {
        said.refused(2, &["--viz", "--features rerun"]);
        assert!(!log.exists());
    }
}
