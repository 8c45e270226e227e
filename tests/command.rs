//! Arguments, settings and what is printed.

use crate::support::{command, data_dir, folder, softtissue, tiny_config, tiny_scans};
use std::process::Stdio;

#[test]
fn help_names_every_verb_and_usage_errors_exit_with_two() {
    let help = softtissue(&["--help"]);
    for verb in [
        "train",
        "eval",
        "animate",
        "export",
        "view",
        "synth",
        "fit",
        "import",
        "inspect",
        "config",
        "completions",
        "man",
    ] {
        assert!(help.fine().out.contains(verb), "{verb}");
    }
    assert_eq!(softtissue(&["trian"]).code, 2);
    assert_eq!(softtissue(&[]).code, 2);
    assert!(softtissue(&["--version"]).fine().out.contains(env!("CARGO_PKG_VERSION")));
}

#[cfg(not(feature = "web"))]
#[test]
fn pages_need_a_build_that_has_the_player() {
    let dir = folder("pages");
    let page = dir.join("page").display().to_string();
    // what a folder is is told before what it holds
    let bundle = dir.join("bundle");
    std::fs::create_dir_all(&bundle).expect("a folder");
    std::fs::write(bundle.join("manifest.json"), "{}").expect("a manifest");
    let bundle = bundle.display().to_string();
    softtissue(&["view", &bundle, "--no-browser"]).refused(2, &["--features web", "rustup target add"]);
    softtissue(&["export", "nowhere", "--web", &page]).refused(2, &["--features web"]);
    assert!(!dir.join("page").exists());
    softtissue(&["export", "nowhere", "--onnx", "n.onnx", "--motion", "synth:hips"]).refused(2, &["--web DIR"]);
}

#[test]
fn settings_print_check_and_explain() {
    let printed = softtissue(&["config", "print"]).fine().out.clone();
    assert!(printed.contains("[regressor.training.network]") && printed.contains("seed = 1"));
    let explained = softtissue(&["config", "explain"]).fine().out.clone();
    assert!(explained.lines().filter(|l| l.trim_start().starts_with('#')).count() > 50);
    softtissue(&["config", "check", "--config", "smoke", "--set", "seed=7"]).fine();
    // What is printed is a configuration, and means the same.
    let dir = folder("printed");
    let file = dir.join("printed.toml");
    std::fs::write(&file, &printed).expect("a file");
    assert_eq!(softtissue(&["config", "print", "--config", &file.display().to_string()]).fine().out, printed);
}

#[test]
fn a_dry_run_says_what_it_would_do_and_does_nothing() {
    let dir = folder("dry");
    let out = dir.join("run");
    let said = softtissue(&[
        "train",
        "--config",
        &tiny_config(&dir).display().to_string(),
        "--out",
        &out.display().to_string(),
        "--dry-run",
    ]);
    assert!(said.fine().out.contains("8 clips"), "{}", said.out);
    assert!(!out.exists());
}

#[test]
fn the_second_solver_of_the_fit_is_reached_by_a_setting() {
    let (scans, dir) = (tiny_scans(), folder("adam"));
    let [config, scans, data, out] =
        [tiny_config(&dir), scans, data_dir(), dir.join("fit")].map(|path| path.display().to_string());
    let settings = ["--set", "fit.solver=adam", "--set", "fit.adam.iterations=3"];
    let said = softtissue(
        &[&["fit", &scans, "--config", &config, "--data-dir", &data, "--out", &out], settings.as_slice()].concat(),
    );
    assert!(said.fine().out.contains("8 clips fitted"), "{}", said.out);
    let quality = std::fs::read(dir.join("fit/quality.json")).expect("a file");
    let quality: serde_json::Value = serde_json::from_slice(&quality).expect("JSON");
    // The start and three iterations, which no other solver spends on every frame; then the frames together.
    let clips = quality.as_array().expect("clips");
    assert!(clips.iter().all(|clip| clip["evaluations"] == 4.0), "{quality}");
    assert!(clips.iter().all(|clip| clip["smoothing_evaluations"].as_f64() >= Some(1.0)), "{quality}");
}

#[test]
fn completions_and_manual_page_are_printed() {
    assert!(softtissue(&["completions", "bash"]).fine().out.contains("_softtissue"));
    assert!(softtissue(&["man"]).fine().out.contains(".TH softtissue"));
}

#[test]
fn a_closed_pipe_is_no_panic() {
    let mut child = command()
        .args(["config", "explain"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the command starts");
    drop(child.stdout.take());
    let output = child.wait_with_output().expect("a child");
    assert!(!String::from_utf8_lossy(&output.stderr).contains("panicked"));
}
