//! The whole job on little data: what it leaves behind, and that training never looks at the truth.

use crate::support::{
    Said, bytes_below, copy_below, copy_of_the_run, folder, measures, softtissue, tiny_run, tiny_scans, tiny_train,
};
use serde_json::Value;
use softtissue_clips::{ClipId, ScanClip, ScanSet, TruthSet};
use softtissue_eval::Metrics;
use std::path::{Path, PathBuf};

fn json(path: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(path).expect("a file")).expect("JSON")
}

#[test]
fn the_job_leaves_bundle_report_animation_and_measures() {
    let run = tiny_run();
    for file in ["bundle/manifest.json", "bundle/model.safetensors", "report/index.html", "animation.glb", "log.jsonl"]
    {
        assert!(run.path.join(file).metadata().expect(file).len() > 100, "{file}");
    }
    for word in ["report", "bundle", "animation", "soft ratio"] {
        assert!(run.said.out.contains(word), "{word} is missing in {}", run.said.out);
    }
    let metrics = json(&run.path.join("metrics.json"));
    assert_eq!(metrics["schema"], 1);
    let methods = metrics["methods"].as_object().expect("methods");
    for name in
        ["body", "mean", "ridge", "ar2-pooled", "ar2-subject", "resonators", "softtissue", "softtissue/without-gru"]
    {
        let error = methods[name]["regions"]["soft"]["mean_mm"].as_f64().expect(name);
        assert!(error.is_finite() && error > 0.0, "{name}: {error}");
    }
    assert!(metrics["subspace"]["16"]["pca_mm"].as_f64().expect("PCA") > 0.0);
    assert!(metrics["fit"]["joint_deg_median"].as_f64().expect("fit") < 3.0);
    assert!(metrics["fit_objectives"]["posed"]["delta_mm_mean"].is_f64());
    for gate in ["regressor.gru_share", "data.scan_components", "data.true_components", "run.peak_memory"] {
        let value = metrics["gates"][gate]["value"].as_f64();
        // the one figure that no system but Linux tells
        assert!(value.is_some() || (gate == "run.peak_memory" && !cfg!(target_os = "linux")), "{gate}");
        assert!(run.said.out.contains(gate), "{gate} is missing in {}", run.said.out);
    }
    assert_eq!(metrics["shape_response"]["softtissue"].as_array().expect("a curve").len(), 7);
    let decays = metrics["decays"].as_array().expect("decays");
    for region in ["belly", "chest", "buttocks"] {
        let decay = decays.iter().find(|d| d["region"] == region).expect(region);
        assert_eq!(decay["subject"], "s01", "only the heaviest is asked");
        let hz = decay["truth"]["hz"].as_f64().expect("a frequency");
        assert!((2.0..6.0).contains(&hz), "{region} of a heavy person rings at {hz} Hz");
    }
    // At least one event file of TensorBoard.
    assert!(std::fs::read_dir(run.path.join("tensorboard")).expect("events").count() > 0);
}

#[test]
fn training_never_opens_the_truth() {
    let run = tiny_run();
    assert!(measures(&run.path).truth);
    // The same scans at another place, without their truth.
    let home = folder("without-truth");
    copy_below(&tiny_scans(), &home.join("scans"));
    let out = home.join("run");
    let mut command = tiny_train(&run.config, &out);
    command.arg("--data").arg(home.join("scans")).arg("--no-eval");
    Said::of(&command.output().expect("the command starts")).fine();
    let model = |root: &Path| std::fs::read(root.join("bundle/model.safetensors")).expect("a model");
    assert_eq!(model(&out), model(&run.path), "the same scans teach the same bytes, truth or no truth");
    let manifest = json(&out.join("bundle/manifest.json"));
    assert_eq!(manifest["info"]["licence"], "unspecified", "nobody said whose scans these are");
    assert_eq!(json(&run.path.join("bundle/manifest.json"))["info"]["licence"], "CC0-1.0");
}

#[test]
fn eval_judges_again_agrees_and_leaves_the_bundle_alone() {
    let run = tiny_run();
    let copy = copy_of_the_run("judged-again");
    std::fs::remove_file(copy.join("metrics.json")).expect("measures");
    softtissue(&["eval", &copy.display().to_string()]).fine();
    assert_eq!(measures(&copy), measures(&run.path));
    assert_eq!(bytes_below(&copy.join("bundle")), bytes_below(&run.path.join("bundle")));
    assert_eq!(bytes_below(&copy.join("stages")), bytes_below(&run.path.join("stages")));
    // What is not there is not made by the way.
    std::fs::remove_file(copy.join("stages/regressor.safetensors")).expect("a stage");
    softtissue(&["eval", &copy.display().to_string()]).refused(3, &["regressor.safetensors", "--resume"]);
    std::fs::remove_file(copy.join("bundle/manifest.json")).expect("a manifest");
    softtissue(&["eval", &copy.display().to_string()]).refused(3, &["no finished bundle", "--resume"]);
}

/// The bytes of a tensor file's arrays, without the header that names what they were made from.
fn arrays(path: &Path) -> Vec<u8> {
    let bytes = std::fs::read(path).expect("a tensor file");
    let header = u64::from_le_bytes(bytes[..8].try_into().expect("a length")) as usize;
    bytes[8 + header..].to_vec()
}

#[test]
fn a_fold_learns_nothing_from_what_it_judges() {
    let home = folder("folds");
    let clean = blind_fold(&home, &[], &["basis", "ladder", "subspace-16", "regressor"]).display().to_string();
    softtissue(&["eval", &clean, "--protocol", "leave-one-sequence-out", "--folds", "dancing"])
        .refused(3, &["dancing"]);
}

#[test]
fn a_fold_of_softsmpl_learns_nothing_from_what_it_judges() {
    let stages = ["subspace-16", "softsmpl.poses", "softsmpl-of-s00", "softsmpl-of-s01", "softsmpl"];
    blind_fold(&folder("softsmpl-folds"), &["--set", "method=softsmpl"], &stages);
}

/// Runs a fold with the clip that it leaves out as it is and a million times too large: every stage and the bundle stay.
/// Returns the run of the clip as it is.
fn blind_fold(home: &Path, settings: &[&str], stages: &[&str]) -> PathBuf {
    let run = tiny_run();
    let fold = |name: &str, poison: bool| {
        let scans = home.join(name).join("scans");
        copy_below(&tiny_scans(), &scans);
        let out = home.join(name).join("run");
        let mut train = tiny_train(&run.config, &out);
        train.args(settings).arg("--data").arg(&scans).arg("--no-eval");
        Said::of(&train.output().expect("the command starts")).fine();
        if poison {
            let path = ScanSet::scan_path(&scans, &ClipId::new("s01", "punching", 0));
            let mut clip = ScanClip::read(&path).expect("a scan");
            for t in 0..clip.vertices.len() {
                clip.vertices.frame_mut(t).iter_mut().for_each(|p| *p *= 1e6);
            }
            clip.write(&path).expect("a scan");
        }
        let text = out.display().to_string();
        let said = softtissue(&["eval", &text, "--protocol", "leave-one-sequence-out", "--folds", "s01/punching"]);
        (out, said)
    };
    let (clean, said) = fold("clean", false);
    said.fine();
    let metrics = json(&clean.join("metrics-leave-one-sequence-out.json"));
    assert_eq!(metrics["clips"].as_array().expect("clips").len(), 1);
    assert_eq!(metrics["clips"][0]["motion"], "punching");
    // What judging says of scans a million times too large is of no interest here.
    let (poisoned, said) = fold("poisoned", true);
    let name = "leave-one-sequence-out/s01.punching";
    for stage in stages {
        let path = |out: &Path| out.join("stages").join(name).join(format!("{stage}.safetensors"));
        assert!(path(&poisoned).exists(), "{stage}: {}", said.err);
        assert!(arrays(&path(&poisoned)) == arrays(&path(&clean)), "{stage} saw the clip that was left out");
    }
    let model = |out: &Path| std::fs::read(out.join("folds").join(name).join("model.safetensors"));
    assert!(model(&poisoned).expect("a model") == model(&clean).expect("a model"), "the bundle saw it");
    clean
}

#[test]
fn subjects_and_dynas_cases_are_left_out_as_named() {
    let run = copy_of_the_run("protocols");
    let path = run.display().to_string();
    let eval = |protocol: &str, fold: &str| softtissue(&["eval", &path, "--protocol", protocol, "--folds", fold]);
    for (protocol, fold, judged) in [("leave-one-subject-out", "s01", 3), ("dyna-cases", "new-both", 1)] {
        eval(protocol, fold).fine();
        let metrics = Metrics::read(&run.join(format!("metrics-{protocol}.json"))).expect("measures");
        assert_eq!(metrics.clips.len(), judged, "{protocol}");
        assert!(metrics.clips.iter().all(|c| c.subject == "s01" && c.fold.as_deref() == Some(fold)), "{protocol}");
        assert!(metrics.methods["softtissue"].soft_ratio.is_some_and(f64::is_finite), "{protocol}");
        // Of a new person one motion fits the flesh and judges nobody.
        let by_subject = protocol == "leave-one-subject-out";
        assert_eq!(metrics.methods.contains_key("softtissue/tuned"), by_subject, "{protocol}");
        assert!(metrics.clips.iter().all(|c| c.motion != "jumping_jacks"), "{protocol}");
        let info = &json(&run.join("folds").join(protocol).join(fold).join("manifest.json"))["info"]["provenance"];
        let seen =
            [&info["trained_on"], &info["selected_on"]].map(|ids| ids.as_array().expect("clips").clone()).concat();
        let unseen = |id: &Value| {
            let id = id.as_str().expect("a clip");
            !id.starts_with("s01") && (protocol != "dyna-cases" || !id.contains("one_leg_jump"))
        };
        assert!(!seen.is_empty() && seen.iter().all(unseen), "{protocol}: {seen:?}");
    }
    eval("dyna-cases", "new-shoes").refused(3, &["new-shoes"]);
}

#[test]
fn a_bundle_animates_and_gain_zero_is_the_body_alone() {
    let run = tiny_run();
    let home = folder("animated");
    let bundle = run.path.join("bundle").display().to_string();
    let animate = |motion: &str, name: &str, more: &[&str]| {
        let out = home.join(name).display().to_string();
        let always = ["animate", "--bundle", &bundle, "--motion", motion, "--shape", "0,-2", "--out", &out];
        softtissue(&[&always[..], more].concat()).fine();
    };
    let made = "synth:one_leg_jump";
    animate(made, "a.glb", &["--frames", "20"]);
    assert!(std::fs::read(home.join("a.glb")).expect("a glTF").starts_with(b"glTF"));
    animate(made, "a.png", &["--frames", "20"]);
    assert!(std::fs::read(home.join("a.png")).expect("a picture").starts_with(b"\x89PNG"));
    let truth = tiny_scans().with_file_name("truth");
    let clip = TruthSet::motion_path(&truth, &ClipId::new("s00", "shake_hips", 0));
    animate(&clip.display().to_string(), "clip", &[]);
    assert_eq!(std::fs::read_dir(home.join("clip")).expect("frames").count(), 48, "all of the clip's frames");
    animate(made, "still", &["--frames", "40", "--gain", "0"]);
    animate(made, "soft", &["--frames", "40", "--gain", "1"]);
    let last = |name: &str| std::fs::read(home.join(name).join("frame_00039.obj")).expect("a frame");
    assert_ne!(last("still"), last("soft"));
}
