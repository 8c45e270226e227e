//! Dyna through the command: trained, judged in its four cases, played on heavier and lighter bodies.

use crate::support::{Said, copy_below, copy_of_the_run, folder, softtissue, tiny_run, tiny_train};
use serde_json::Value;
use softtissue_eval::Metrics;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// A finished run of method `dyna` on the shared scans. Nobody changes it.
fn dyna_run() -> &'static Path {
    static RUN: OnceLock<PathBuf> = OnceLock::new();
    RUN.get_or_init(|| {
        let out = folder("dyna").join("run");
        let mut train = tiny_train(&tiny_run().config, &out);
        train.args(["--set", "method=dyna"]);
        Said::of(&train.output().expect("the command starts")).fine();
        out
    })
}

fn text(path: &Path) -> String {
    path.display().to_string()
}

#[test]
fn dyna_is_trained_judged_and_shipped() {
    let run = dyna_run();
    let metrics = Metrics::read(&run.join("metrics.json")).expect("measures");
    assert_eq!(metrics.method.as_deref(), Some("dyna"));
    for name in ["dyna", "dyna/zero-order", "dyna/fitted", "ar2-subject/dyna", "resonators"] {
        let ratio = metrics.methods[name].soft_ratio.expect(name);
        assert!(ratio.is_finite() && ratio < 1.5, "{name}: {ratio}");
    }
    // What size tiny learns is worse than no flesh at all; here only that memory does something, and fades.
    let dyna = &metrics.methods["dyna"];
    assert_ne!(dyna.soft_ratio, metrics.methods["dyna/zero-order"].soft_ratio);
    assert!(dyna.bounded_ratio.expect("a long rollout") < 3.0);
    let rest = dyna.rest_ratio.expect("a stop");
    assert!(0.0 < rest && rest < 1.0, "{rest}");
    assert_eq!(metrics.shape_response["dyna"].len(), 7);
    let sweep = &metrics.bmi_response["dyna"];
    assert!(sweep.first().expect("light").bmi == 18.0 && sweep.last().expect("heavy").bmi == 34.0, "{sweep:?}");
    assert!(sweep.iter().all(|p| p.amplitude_mm > 0.0 && p.speed_mm_s > 0.0), "{sweep:?}");
    let timing = &metrics.timing["dyna"];
    for part in ["skinning", "descriptor", "regressor", "decoder"] {
        let ms = timing.part(part).expect(part);
        assert!(ms > 0.0 && ms < timing.whole_p95_ms, "{part}: {timing:?}");
    }
    assert_eq!((timing.part("encoder"), timing.part("feedback")), (None, None));
    let manifest: Value =
        serde_json::from_slice(&std::fs::read(run.join("bundle/manifest.json")).expect("a file")).expect("JSON");
    assert_eq!(manifest["info"]["method"], "dyna");
    assert_eq!(manifest["model"]["kind"], "autoregressive");
    assert_eq!(manifest["model"]["people"].as_array().expect("people").len(), 2);
    let said = softtissue(&["inspect", &text(&run.join("bundle"))]);
    assert!(said.fine().out.contains("dyna"), "{}", said.out);
}

#[test]
fn judging_again_gives_the_same_and_changes_no_bundle() {
    let run = folder("dyna-again").join("run");
    copy_below(dyna_run(), &run);
    let before = Metrics::read(&run.join("metrics.json")).expect("measures").without_times();
    softtissue(&["eval", &text(&run)]).fine();
    assert_eq!(Metrics::read(&run.join("metrics.json")).expect("measures").without_times(), before);
    let model = |root: &Path| std::fs::read(root.join("bundle/model.safetensors")).expect("a model");
    assert_eq!(model(&run), model(dyna_run()));
}

#[test]
fn the_four_cases_are_judged() {
    let run = folder("dyna-cases").join("run");
    copy_below(dyna_run(), &run);
    let said = softtissue(&["eval", &text(&run), "--protocol", "dyna-cases"]);
    said.fine();
    let metrics = Metrics::read(&run.join("metrics-dyna-cases.json")).expect("measures");
    let folds: Vec<&str> = metrics.clips.iter().filter_map(|c| c.fold.as_deref()).collect();
    assert_eq!(folds, ["new-instance", "new-motion", "new-subject", "new-both"]);
    for clip in &metrics.clips {
        assert!(clip.methods["dyna"].soft_ratio.is_some_and(f64::is_finite), "{:?}", clip.fold);
    }
    assert!(said.out.contains("What was left out") && said.out.contains("new-both"), "{}", said.out);
    assert!(run.join("report-dyna-cases/index.html").exists());
    let kept: Vec<_> = metrics.over_time.iter().filter_map(|c| c.fold.as_deref()).collect();
    assert_eq!(kept, folds, "one person's one take each");
    assert_eq!(metrics.over_time[0].methods["dyna"]["belly-chest"].len(), 48);
}

#[test]
fn weight_is_asked_for_by_its_index() {
    let home = folder("dyna-animated");
    let bundle = text(&dyna_run().join("bundle"));
    let animate = |name: &str, more: &[&str]| {
        let out = text(&home.join(name));
        let always =
            ["animate", "--bundle", &bundle, "--motion", "synth:one_leg_jump", "--frames", "10", "--out", &out];
        softtissue(&[&always[..], more].concat())
    };
    let vertices = |name: &str| {
        let text = std::fs::read_to_string(home.join(name).join("frame_00000.obj")).expect("a frame");
        let numbers = |l: &str| l.split_whitespace().map(|x| x.parse().expect("a number")).collect::<Vec<f32>>();
        text.lines().filter_map(|l| l.strip_prefix("v ")).map(numbers).collect::<Vec<_>>()
    };
    let extent = |name: &str, axis: usize| {
        let along = vertices(name).into_iter().map(|v| v[axis]);
        along.clone().fold(f32::MIN, f32::max) - along.fold(f32::MAX, f32::min)
    };
    animate("light", &["--bmi", "21", "--gain", "0"]).fine();
    animate("heavy", &["--bmi", "28", "--gain", "0"]).fine();
    assert!((extent("light", 1) - extent("heavy", 1)).abs() < 0.03, "as tall, but for how it stands");
    assert!(extent("heavy", 2) > extent("light", 2) + 0.02, "deeper from front to back");
    let said = animate("beyond", &["--bmi", "38"]);
    said.fine();
    assert!(said.err.contains("outside") && said.err.contains("nearer end"), "{}", said.err);
    animate("nobody", &["--bmi", "3"]).refused(2, &["--bmi", "body mass index"]);
    animate("nobody", &["--bmi", "99"]).refused(2, &["--bmi"]);
}

#[test]
fn a_run_is_not_judged_by_the_bundle_of_another_method() {
    let run = copy_of_the_run("another-bundle");
    let own = std::fs::read(run.join("metrics.json")).expect("measures");
    std::fs::remove_dir_all(run.join("bundle")).expect("a bundle");
    copy_below(&dyna_run().join("bundle"), &run.join("bundle"));
    softtissue(&["eval", &text(&run)]).refused(3, &["bundle", "dyna", "softtissue", "--against"]);
    assert_eq!(std::fs::read(run.join("metrics.json")).expect("measures"), own, "nothing was judged");
    let mut resumed = tiny_train(&tiny_run().config, &run);
    resumed.args(["--resume", "--set", "method=dyna"]);
    Said::of(&resumed.output().expect("the command starts")).refused(6, &["settings", "--out"]);
}

#[test]
fn a_dry_run_says_what_of_dyna_would_be_learned() {
    let mut train = tiny_train(&tiny_run().config, &folder("dyna-dry").join("run"));
    train.args(["--set", "method=dyna", "--set", "dyna.tau=3.5", "--dry-run"]);
    let said = Said::of(&train.output().expect("the command starts"));
    assert!(said.fine().out.contains("tau 3.5") && !said.out.contains("latent"), "{}", said.out);
}

#[test]
fn settings_that_dyna_cannot_be_learned_with_are_refused() {
    let run = folder("dyna-refused").join("run");
    for (setting, says) in [
        ("dyna.order=1", "dyna.order"),
        ("dyna.tau=0", "dyna.tau"),
        ("dyna.variance=0", "dyna.variance"),
        ("dyna.ar2.strengths=[]", "dyna.ar2.strengths"),
        ("fit.triangle_smoothness=0", "triangle_smoothness"),
        ("fit.delta_form=cubes", "delta_form"),
        ("method=dnya", "method"),
    ] {
        let mut train = tiny_train(&tiny_run().config, &run);
        train.args(["--set", "method=dyna", "--set", setting]);
        Said::of(&train.output().expect("the command starts")).refused(2, &[says]);
    }
}
