//! The whole job on little data: what it leaves behind, and that training never looks at the truth.

use crate::support::{Said, bytes_below, data_dir, folder, softtissue, tiny_run, tiny_train};
use serde_json::Value;

fn json(path: &std::path::Path) -> Value {
    serde_json::from_slice(&std::fs::read(path).expect("a file")).expect("JSON")
}

#[test]
fn the_job_leaves_bundle_report_animation_and_measures() {
    let run = tiny_run();
    for file in ["bundle/manifest.json", "bundle/model.safetensors", "report/index.html", "animation.glb", "log.jsonl"] {
        assert!(run.path.join(file).metadata().expect(file).len() > 100, "{file}");
    }
    for word in ["report", "bundle", "animation", "soft ratio"] {
        assert!(run.said.out.contains(word), "{word} is missing in {}", run.said.out);
    }
    let metrics = json(&run.path.join("metrics.json"));
    assert_eq!(metrics["schema"], 1);
    let methods = metrics["methods"].as_object().expect("methods");
    for name in ["body", "mean", "ridge", "ar2-pooled", "ar2-subject", "resonators", "softtissue", "softtissue/without-gru"] {
        let error = methods[name]["regions"]["soft"]["mean_mm"].as_f64().expect(name);
        assert!(error.is_finite() && error > 0.0, "{name}: {error}");
    }
    assert!(metrics["subspace"]["16"]["pca_mm"].as_f64().expect("PCA") > 0.0);
    assert!(metrics["fit"]["joint_deg_median"].as_f64().expect("fit") < 3.0);
    assert!(metrics["fit_objectives"]["posed"]["delta_mm_mean"].is_f64());
    // At least one event file of TensorBoard.
    assert!(std::fs::read_dir(run.path.join("tensorboard")).expect("events").count() > 0);
}

#[test]
fn training_never_opens_the_truth() {
    let run = tiny_run();
    // The same scans at another place, without their truth.
    let home = folder("without-truth");
    let metrics = json(&run.path.join("metrics.json"));
    assert_eq!(metrics["truth"], true);
    let cache = std::fs::read_dir(data_dir().join("cache")).expect("cache").flatten().map(|e| e.path());
    let scans = cache
        .filter(|p| p.join("truth").exists() && p.join("synth.json").exists())
        .find(|p| {
            let recipe = json(&p.join("synth.json"));
            recipe["config"]["motions"].as_array().is_some_and(|m| m.len() == 4) && recipe["config"]["frames"] == 48
        })
        .expect("the tiny scans");
    let copy = home.join("data");
    std::fs::create_dir_all(copy.join("cache")).expect("a folder");
    for entry in std::fs::read_dir(data_dir().join("cache")).expect("cache").flatten() {
        let name = entry.file_name();
        if name.to_string_lossy().starts_with("body-") {
            std::fs::copy(entry.path(), copy.join("cache").join(name)).expect("the body");
        }
    }
    for (path, bytes) in bytes_below(&scans.join("scans")) {
        let to = home.join("scans").join(path);
        std::fs::create_dir_all(to.parent().expect("a parent")).expect("a folder");
        std::fs::write(to, bytes).expect("a scan");
    }
    let out = home.join("run");
    let mut command = tiny_train(&run.config, &out);
    command.arg("--data").arg(home.join("scans")).arg("--no-eval").arg("--data-dir").arg(&copy);
    Said::of(&command.output().expect("the command starts")).fine();
    let model = |root: &std::path::Path| std::fs::read(root.join("bundle/model.safetensors")).expect("a model");
    assert_eq!(model(&out), model(&run.path), "the same scans teach the same bytes, truth or no truth");
}

#[test]
fn eval_judges_again_and_agrees() {
    let run = tiny_run();
    let home = folder("judged-again");
    let copy = home.join("run");
    for (path, bytes) in bytes_below(&run.path) {
        let to = copy.join(path);
        std::fs::create_dir_all(to.parent().expect("a parent")).expect("a folder");
        std::fs::write(to, bytes).expect("a file");
    }
    std::fs::remove_file(copy.join("metrics.json")).expect("measures");
    softtissue(&["eval", &copy.display().to_string()]).fine();
    let strip = |mut v: Value| {
        for method in v["methods"].as_object_mut().expect("methods").values_mut() {
            method.as_object_mut().expect("a method").remove("frames_per_second");
        }
        v
    };
    assert_eq!(strip(json(&copy.join("metrics.json"))), strip(json(&run.path.join("metrics.json"))));
}

#[test]
fn a_fold_is_trained_without_what_it_judges() {
    let run = tiny_run();
    let home = folder("folds");
    let copy = home.join("run");
    for (path, bytes) in bytes_below(&run.path) {
        let to = copy.join(path);
        std::fs::create_dir_all(to.parent().expect("a parent")).expect("a folder");
        std::fs::write(to, bytes).expect("a file");
    }
    let copy = copy.display().to_string();
    let said = softtissue(&["eval", &copy, "--protocol", "leave-one-sequence-out", "--folds", "s01/punching"]);
    said.fine();
    let metrics = json(&std::path::Path::new(&copy).join("metrics-leave-one-sequence-out.json"));
    assert_eq!(metrics["clips"].as_array().expect("clips").len(), 1);
    assert_eq!(metrics["clips"][0]["motion"], "punching");
    softtissue(&["eval", &copy, "--protocol", "leave-one-sequence-out", "--folds", "dancing"]).refused(3, &["dancing"]);
}

#[test]
fn a_bundle_animates_and_gain_zero_is_the_body_alone() {
    let run = tiny_run();
    let home = folder("animated");
    let bundle = run.path.join("bundle").display().to_string();
    let to = |name: &str| home.join(name).display().to_string();
    softtissue(&["animate", "--bundle", &bundle, "--motion", "synth:one_leg_jump", "--shape", "0,-2", "--frames", "20", "--out", &to("a.glb")]).fine();
    assert!(std::fs::read(home.join("a.glb")).expect("a glTF").starts_with(b"glTF"));
    for (gain, name) in [("0", "still"), ("1", "soft")] {
        softtissue(&["animate", "--bundle", &bundle, "--motion", "synth:one_leg_jump", "--shape", "0,-2", "--frames", "40", "--gain", gain, "--out", &to(name)]).fine();
    }
    let last = |name: &str| std::fs::read(home.join(name).join("frame_00039.obj")).expect("a frame");
    assert_ne!(last("still"), last("soft"));
}
