//! `method = "softsmpl"` and its ablations through the command.

use crate::support::{Said, folder, measures, softtissue, tiny_run, tiny_train};
use serde_json::Value;
use std::path::{Path, PathBuf};

fn trained(home: &Path, name: &str, more: &[&str]) -> PathBuf {
    let out = home.join(name);
    let mut train = tiny_train(&tiny_run().config, &out);
    train.args(["--set", "method=softsmpl"]).args(more);
    Said::of(&train.output().expect("the command starts")).fine();
    out
}

fn manifest(run: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(run.join("bundle/manifest.json")).expect("a manifest")).expect("JSON")
}

#[test]
fn softsmpl_is_learned_whole_and_tells_what_its_descriptor_gives_away() {
    let home = folder("softsmpl");
    let quick = ["eval.bounded_seconds=0", "eval.decay_subjects=0", "eval.compare_objectives=false"];
    let run = trained(&home, "whole", &quick.map(|s| ["--set", s]).concat());
    let manifest = manifest(&run);
    assert_eq!(manifest["info"]["method"], "softsmpl");
    assert_eq!(manifest["descriptor"]["features"], "disentangled-pose");
    assert_eq!(
        (manifest["model"]["features"].as_u64(), manifest["model"]["pose_encoder_layers"].as_u64()),
        (Some(36), Some(3))
    );
    for stage in ["softsmpl.poses", "softsmpl-of-s00", "softsmpl-of-s01", "softsmpl"] {
        assert!(run.join("stages").join(format!("{stage}.safetensors")).exists(), "{stage}");
    }
    let found = measures(&run);
    assert!(found.methods["softsmpl"].soft_ratio.is_some_and(f64::is_finite));
    for name in ["pose", "pose/static", "disentangled-pose", "disentangled-pose/static"] {
        let leak = found.leak[name];
        let (subject, motion) = (leak.subject.expect("two people"), leak.motion.expect("four motions"));
        assert_eq!((subject.chance, motion.chance), (0.5, 0.25), "{name}");
        assert!((0.0..=1.0).contains(&subject.accuracy) && (0.0..=1.0).contains(&motion.accuracy), "{name}");
    }
    let told = |name: &str| found.leak[name].subject.expect("two people").accuracy;
    assert!(told("pose/static") > 0.9, "joint rotations give two people away: {}", told("pose/static"));
    let report = std::fs::read_to_string(run.join("report/index.html")).expect("a report");
    assert!(report.contains("disentangled-pose, without velocities"));
    // two people, two training motions each, mirrored: 8 own clips, and as many of the other's
    assert!(report.contains("8 with mirrored ones, 8 transferred"));
    // what is shipped plays
    let bundle = run.join("bundle").display().to_string();
    let glb = home.join("a.glb").display().to_string();
    softtissue(&["animate", "--bundle", &bundle, "--motion", "synth:punching", "--out", &glb]).fine();
}

#[test]
fn imported_motion_joins_the_poses_that_are_learned() {
    let home = folder("softsmpl-poses");
    let imported = home.join("walk.safetensors").display().to_string();
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/motion/cmu_01_01.bvh").display().to_string();
    softtissue(&["import", "motion", &source, "--out", &imported]).fine();
    let alone = ["--no-eval", "--set", "softsmpl.transfer=false"];
    let motions = format!("softsmpl.poses.motions=[{imported:?}]");
    let poses = |run: PathBuf| std::fs::read(run.join("stages/softsmpl.poses.safetensors")).expect("a stage");
    let with = poses(trained(&home, "with", &[&alone[..], &["--set", &motions]].concat()));
    assert!(with != poses(trained(&home, "alone", &alone)));
    let missing = "softsmpl.poses.motions=[\"nowhere.safetensors\"]";
    let mut train = tiny_train(&tiny_run().config, &home.join("missing"));
    train.args(["--set", "method=softsmpl", "--set", missing]);
    Said::of(&train.output().expect("the command starts")).refused(3, &["nowhere.safetensors"]);
}

#[test]
fn ablations_bear_their_names() {
    let home = folder("softsmpl-ablations");
    let run = trained(
        &home,
        "without",
        &["--no-eval", "--set", "softsmpl.static_disentangling=false", "--set", "softsmpl.transfer=false"],
    );
    let manifest = manifest(&run);
    assert_eq!(manifest["info"]["method"], "softsmpl/without-both");
    // rotations, velocities and accelerations of 23 joints and the root's motion
    assert_eq!(manifest["model"]["features"], 213);
    assert!(manifest["model"].get("pose_encoder_layers").is_none());
    assert!(!run.join("stages/softsmpl.poses.safetensors").exists());
    softtissue(&["train", "--set", "method=softsmpl", "--set", "softsmpl.training.batch=0"])
        .refused(2, &["softsmpl.training.batch", "1 or more"]);
    softtissue(&["train", "--set", "method=softsmple"]).refused(2, &["softsmple", "softsmpl"]);
}
