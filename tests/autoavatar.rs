//! AutoAvatar through the real command: learned from raw scans, judged, stopped and resumed, animated.

use crate::support::{Said, folder, softtissue, tiny_run, tiny_train};
use serde_json::Value;
use std::path::Path;
use std::process::Command;

const SETTINGS: [&str; 22] = [
    "method=autoavatar",
    "synth.bmi=[29.0]",
    r#"synth.motions=["one_leg_jump", "punching", "shake_hips"]"#,
    "split.validation_motions=[]",
    r#"autoavatar.interpolation=["punching"]"#,
    "autoavatar.raw_points=2500",
    "autoavatar.kept_points=600",
    "autoavatar.grid=24",
    "autoavatar.network.observers=200",
    "autoavatar.network.channels=[4, 6]",
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
    assert!(said.out.contains("extrapolation, s00") && said.out.contains("interpolation, s00"), "{}", said.out);
    let figures = std::fs::read(out.join("autoavatar.json")).expect("measures");
    let figures: Value = serde_json::from_slice(&figures).expect("JSON");
    for network in ["autoregressive", "pose"] {
        let own = &figures["extrapolation"][network];
        // a rollout from frame 20 and one from frame 40 of 48; after a few steps the surface is about the body's
        assert_eq!(own["rollouts"], 2, "{own}");
        for frames in ["1", "2", "4", "8", "16"] {
            let mm = own["distance_mm"][frames].as_f64().expect("a distance");
            assert!((0.5..40.0).contains(&mm), "{network}, {frames}: {mm}");
        }
        assert!(own["distance_mm"]["30"].is_null() && own["volume_change"]["1"].is_null(), "{own}");
        assert!(own["volume_change"]["4"].as_f64().is_some_and(|e| (0.0..1.0).contains(&e)), "{own}");
    }

    let avatar = out.join("avatar");
    let surfaces = home.join("surfaces");
    let play = ["animate", "--bundle", &text(&avatar), "--motion", "synth:punching", "--frames", "5", "--out"];
    softtissue(&[&play[..], &[&text(&surfaces)]].concat()).fine();
    let last = std::fs::read_to_string(surfaces.join("frame_00004.obj")).expect("a surface");
    assert!(last.contains("\nvn ") && last.matches("\nv ").count() > 100);
    softtissue(&[&play[..], &[&text(&home.join("a.glb"))]].concat()).fine();
    softtissue(&[&play[..], &[&text(&home.join("b.glb")), "--shape", "0,1"]].concat()).refused(2, &["--shape"]);
    softtissue(&["export", &text(&avatar), "--onnx", &text(&home.join("x.onnx"))])
        .refused(3, &["AutoAvatar", "real-time"]);
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
    refused(&["autoavatar.network.atlas=48"], &["autoavatar.network.atlas is 48", "power of two"]);
    refused(&[r#"autoavatar.networks=["pose", "pose"]"#], &["pose twice"]);
}
