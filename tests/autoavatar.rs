//! AutoAvatar through the real command: learned from raw scans, judged, shown, animated, and its evidence script.

use crate::support::{Said, data_dir, folder, softtissue, tiny_run, tiny_train};
use serde_json::Value;
use std::path::Path;
use std::process::Command;

const SETTINGS: [&str; 23] = [
    "method=autoavatar",
    "synth.bmi=[29.0]",
    r#"synth.motions=["one_leg_jump","punching","shake_hips"]"#,
    "split.validation_motions=[]",
    r#"autoavatar.interpolation=["punching"]"#,
    "autoavatar.raw_points=2500",
    "autoavatar.kept_points=600",
    "autoavatar.grid=24",
    "autoavatar.network.observers=200",
    "autoavatar.network.channels=[4,6]",
    "autoavatar.network.latents=4",
    "autoavatar.network.decoder=8",
    "autoavatar.network.neighbours=4",
    "autoavatar.teacher.steps=6",
    "autoavatar.teacher.surface=60",
    "autoavatar.teacher.near=40",
    "autoavatar.teacher.within=20",
    "autoavatar.rollout.steps=2",
    "autoavatar.rollout.surface=60",
    "autoavatar.rollout.near=40",
    "autoavatar.rollout.within=20",
    "train.checkpoint_every=2",
    "eval.bounded_seconds=2",
];

fn train(out: &Path) -> Command {
    let mut train = tiny_train(&tiny_run().config, out);
    SETTINGS.iter().for_each(|s| {
        train.args(["--set", s]);
    });
    train
}

fn text(path: &Path) -> String {
    path.display().to_string()
}

#[test]
fn one_person_is_learned_from_raw_scans_judged_and_animated() {
    let home = folder("autoavatar");
    let out = home.join("run");
    let said = Said::of(&train(&out).output().expect("the command starts"));
    said.fine();
    assert!(said.out.contains("\nextrapolation set") && said.out.contains("\ninterpolation set"), "{}", said.out);
    let figures = std::fs::read(out.join("autoavatar.json")).expect("measures");
    let figures: Value = serde_json::from_slice(&figures).expect("JSON");
    for network in ["autoregressive", "pose"] {
        let own = &figures["extrapolation"][network]["rollout"];
        // a rollout from frame 20 and one from frame 40 of 48; after a few steps the surface is about the body's
        assert_eq!(own["rollouts"], 2, "{own}");
        for frames in ["1", "2", "4", "8", "16"] {
            let mm = own["distance_mm"][frames].as_f64().expect("a distance");
            assert!((0.5..40.0).contains(&mm), "{network}, {frames}: {mm}");
        }
        assert!(own["distance_mm"]["30"].is_null() && own["volume_change"]["1"].is_null(), "{own}");
        assert!(own["volume_change"]["4"].as_f64().is_some_and(|e| (0.0..1.0).contains(&e)), "{own}");
    }

    // what stands still has the last true heights: after a few steps nobody else is as near, and nobody as stiff
    let (still, own) = (&figures["extrapolation"]["standing-still"], &figures["extrapolation"]["autoregressive"]);
    assert!(still["rollout"]["distance_mm"]["1"].as_f64() < own["rollout"]["distance_mm"]["1"].as_f64(), "{figures}");
    assert_eq!(still["rollout"]["height_energy"].as_f64(), Some(0.0), "{figures}");
    assert!(own["spectral_db"].as_f64().is_some_and(|db| db > 1.0), "{figures}");
    let long = &figures["cycles"]["autoregressive"];
    // two seconds of a motion less the three frames that start it
    assert_eq!((&long["frames"], &long["clip"]), (&117.into(), &"s00/punching.0".into()));
    assert!(long["bounded_ratio"].as_f64().is_some_and(|r| r > 0.0 && r < 10.0), "{long}");
    let curves = &figures["over_time"]["distance_mm"]["pose"];
    assert_eq!((&figures["over_time"]["start"], curves.as_array().map(Vec::len)), (&3.into(), Some(45)));

    let told = softtissue(&["inspect", &text(&out.join("autoavatar.json"))]);
    assert!(told.fine().out.contains("extrapolation set") && said.out.contains(told.out.trim_end()), "{}", told.out);
    let report = std::fs::read_to_string(out.join("report/index.html")).expect("a report");
    for words in ["id=\"chart-rollouts\"", "standing still", "view-predicted", "view-pose", "view-surface"] {
        assert!(report.contains(words), "{words}");
    }
    assert!(std::fs::read(out.join("autoavatar.png")).expect("a picture").starts_with(b"\x89PNG"));
    let page = home.join("page.html");
    let view = ["view", &text(&out), "--no-browser", "--out", &text(&page)];
    softtissue(&[&view[..], &["--clip", "s00/shake_hips.0", "--range", "10..30"]].concat()).fine();
    let page = std::fs::read_to_string(page).expect("a page");
    assert!(page.contains("\"frames\":20") && page.contains("AutoAvatar") && page.contains("True surface"));
    softtissue(&[&view[..], &["--fit"]].concat()).refused(2, &["--fit"]);

    let avatar = out.join("avatar");
    let surfaces = home.join("surfaces");
    let play = ["animate", "--bundle", &text(&avatar), "--motion", "synth:punching", "--frames", "5", "--out"];
    softtissue(&[&play[..], &[&text(&surfaces)]].concat()).fine();
    let last = std::fs::read_to_string(surfaces.join("frame_00004.obj")).expect("a surface");
    assert!(last.contains("\nvn ") && last.matches("\nv ").count() > 100);
    softtissue(&[&play[..], &[&text(&home.join("a.glb"))]].concat()).fine();
    let glb = std::fs::read(home.join("a.glb")).expect("a file");
    assert!(glb.windows(8).any(|w| w == b"\"NORMAL\""), "normals of every frame");
    softtissue(&[&play[..], &[&text(&home.join("b.glb")), "--shape", "0,1"]].concat()).refused(2, &["--shape"]);
    softtissue(&["export", &text(&avatar), "--onnx", &text(&home.join("x.onnx"))])
        .refused(3, &["AutoAvatar", "real-time"]);

    // of the interpolation motion the first half was learned; what says otherwise is not judged by it
    assert_eq!(figures["interpolation"]["pose"]["rollout"]["rollouts"], 1);
    let manifest = avatar.join("manifest.json");
    let kept = std::fs::read_to_string(&manifest).expect("a manifest");
    let judged = |key: &str, value: Value| {
        let mut changed: Value = serde_json::from_str(&kept).expect("JSON");
        changed["info"]["provenance"][key] = value;
        std::fs::write(&manifest, changed.to_string()).expect("the disk");
        softtissue(&["eval", &text(&out), "--quiet"])
    };
    judged("first_half_of", serde_json::json!([])).refused(3, &["has seen the second half of s00/punching.0"]);
    judged("selected_on", serde_json::json!(["s00/one_leg_jump.0"])).refused(3, &["has seen s00/one_leg_jump.0"]);
    judged("scans", serde_json::json!({"fingerprint": "0"})).refused(3, &["was learned from other scans"]);
    std::fs::write(&manifest, kept).expect("the disk");

    std::fs::write(avatar.join("pose.safetensors"), b"damaged").expect("the disk");
    softtissue(&[&play[..], &[&text(&surfaces)]].concat()).refused(3, &["pose.safetensors", "hash"]);
}

#[test]
fn settings_that_cannot_work_are_refused() {
    let refused = |settings: &[&str], words: &[&str]| {
        let sets: Vec<&str> = settings.iter().flat_map(|s| ["--set", s]).collect();
        softtissue(&[&["train", "--dry-run"], &sets[..]].concat()).refused(2, words);
    };
    refused(&["autoavatar.rollout.frames=9"], &["autoavatar.rollout.frames is 9", "1 to 8"]);
    refused(&["autoavatar.network.observers=1"], &["autoavatar.network.observers is 1", "from 2"]);
    refused(&["autoavatar.network.atlas=2", "autoavatar.network.channels=[4, 4]"], &["autoavatar.network.atlas is 2"]);
    refused(&["autoavatar.network.atlas=48"], &["autoavatar.network.atlas is 48", "power of two"]);
    refused(&[r#"autoavatar.networks=["pose", "pose"]"#], &["pose twice"]);
}

/// A split that leaves out other people says nothing of the one who is learned.
#[test]
fn a_person_of_whom_no_clip_is_left_out_is_not_judged() {
    let home = folder("autoavatar-seen");
    let mut train = train(&home.join("run"));
    for set in ["synth.bmi=[29.0,20.0]", "split.test_motions=[]", "autoavatar.interpolation=[]"] {
        train.args(["--set", set]);
    }
    train.args(["--set", r#"split.test_subjects=["s01"]"#]);
    let said = Said::of(&train.output().expect("the command starts"));
    said.refused(2, &["no clip of s00 is left out to judge by", "--no-eval"]);
    assert!(!home.join("run/avatar").exists());
}

/// Everything of the script on the smallest job: four runs, one judgement, one page.
#[test]
fn the_evidence_script_writes_the_papers_tables_and_says_what_is_missing() {
    let home = folder("evidence-autoavatar");
    // its configuration is the script's, and its body is in the cache
    tiny_run();
    let settings: Vec<&str> =
        SETTINGS.into_iter().filter(|s| !s.starts_with("method") && !s.contains("interpolation")).collect();
    let settings = settings.join(" ").replace("validation_motions=[]", r#"validation_motions=["shake_hips"]"#);
    let run = |arguments: &[&str]| {
        let mut command = Command::new("scripts/evidence-autoavatar.sh");
        command.current_dir(env!("CARGO_MANIFEST_DIR")).args(arguments);
        command.env("SIZE", "tiny").env("CONFIG", "tests/evidence.toml").env("NETWORKS", "autoregressive pose");
        command.env("SET", &settings).env("SOFTTISSUE", env!("CARGO_BIN_EXE_softtissue"));
        command.env("OUT", home.join("out")).env("RUNS", home.join("runs")).env("DATA", data_dir());
        Said::of(&command.output().expect("a shell"))
    };
    run(&[]).fine();
    let page = std::fs::read_to_string(home.join("out/autoavatar.md")).expect("a page");
    let section = |title: &str| -> &str {
        let (_, rest) = page.split_once(&format!("\n## {title}")).unwrap_or_else(|| panic!("no {title} in {page}"));
        rest.split("\n## ").next().unwrap_or_default()
    };
    let rows = |text: &str, name: &str| text.lines().filter(|l| l.starts_with(&format!("{name}  "))).count();
    // both sets, both errors, the motion and the clip of fig. 7
    let first = section("The paper's table 1");
    assert_eq!(["standing-still", "pose", "autoregressive"].map(|r| rows(first, r)), [6; 3], "{first}");
    assert_eq!(["softsmpl", "rough/pose"].map(|r| rows(first, r)), [0; 2], "{first}");
    let rough = section("Fitted and rough poses");
    assert_eq!(["autoregressive", "rough/autoregressive", "closest-point/pose"].map(|r| rows(rough, r)), [4, 4, 0]);
    assert_eq!(rows(section("Nearest neighbours"), "closest-point/autoregressive"), 4);
    // what learns registered scans has seen the interpolation motion whole
    let registered = section("SoftSMPL on the same scans");
    assert_eq!(["softsmpl", "body"].map(|r| rows(registered, r)), [4; 2], "{registered}");
    assert!(section("Time").contains("| rough | 2 | ") && section("Settings").contains("neighbours = 4"));
    assert!(section("What differs from the paper").contains("| size |"));
    let figures = std::fs::read_to_string(home.join("out/autoavatar.json")).expect("measures");
    let figures: Value = serde_json::from_str(&figures).expect("JSON");
    let mm = |row: &str| figures["extrapolation"][row]["rollout"]["distance_mm"]["1"].as_f64().expect("a distance");
    // registered, with the person's template: nearer than a field after a few steps
    assert!(mm("softsmpl") < mm("pose") && mm("body") < mm("pose"), "{figures}");
    // nothing shakes on the body alone: what loses or finds a surface there is no motion
    let energy = |row: &str| figures["extrapolation"][row]["rollout"]["height_energy"].as_f64().expect("an energy");
    assert!(energy("body") < 0.05 && energy("autoregressive") > 0.2, "{figures}");
    assert!(mm("rough/pose") != mm("pose") && mm("closest-point/pose") != mm("pose"), "{figures}");

    run(&["--check"]).fine();
    std::fs::write(home.join("out/autoavatar.txt"), first).expect("a file");
    let said = run(&["--check"]);
    assert!(said.code == 1 && said.err.contains("no row of body"), "{}", said.err);
    assert_eq!(run(&["everything"]).code, 2);
}
