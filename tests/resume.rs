//! Stopping and going on: the same bytes as not stopping.

use crate::support::{Said, bytes_below, folder, tiny_run, tiny_train};
use std::path::Path;
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

/// Starts a run and waits until `seen` holds of its folder (or it ends).
fn start_until(config: &Path, out: &Path, seen: impl Fn(&Path) -> bool) -> Child {
    let mut child =
        tiny_train(config, out).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().expect("the command starts");
    let begun = Instant::now();
    while !seen(out) && begun.elapsed() < Duration::from_secs(300) {
        if child.try_wait().expect("a child").is_some() {
            break;
        }
        std::thread::sleep(Duration::from_millis(2));
    }
    child
}

fn signal(child: &Child, name: &str) {
    let status = std::process::Command::new("kill").arg(name).arg(child.id().to_string()).status().expect("kill");
    assert!(status.success() || name == "-KILL");
}

fn resume(config: &Path, out: &Path) -> Said {
    let mut command = tiny_train(config, out);
    if out.join("config.toml").exists() {
        command.arg("--resume");
    }
    Said::of(&command.output().expect("the command starts"))
}

/// Weights, optimiser-made results, bundle, and measures without times.
fn learned(run: &Path) -> Vec<(std::path::PathBuf, Vec<u8>)> {
    let mut files = bytes_below(&run.join("stages"));
    files.extend(bytes_below(&run.join("bundle")));
    files
}

fn metrics(run: &Path) -> serde_json::Value {
    let mut v: serde_json::Value =
        serde_json::from_slice(&std::fs::read(run.join("metrics.json")).expect("measures")).expect("JSON");
    for method in v["methods"].as_object_mut().expect("methods").values_mut() {
        method.as_object_mut().expect("a method").remove("frames_per_second");
    }
    v
}

fn logged(out: &Path, stage: &str, step: u64) -> bool {
    let text = std::fs::read_to_string(out.join("log.jsonl")).unwrap_or_default();
    text.lines().any(|l| l.contains(&format!("\"stage\":\"{stage}\"")) && l.contains(&format!("\"step\":{step},")))
        || text.contains(&format!("\"step\":{step},\"stage\":\"{stage}\""))
        || text.lines().any(|l| {
            serde_json::from_str::<serde_json::Value>(l)
                .is_ok_and(|v| v["stage"] == stage && v["step"].as_u64().is_some_and(|s| s >= step))
        })
}

#[test]
fn stopped_runs_end_in_the_same_bytes() {
    let whole = tiny_run();
    let home = folder("resumed");
    let stops = [("subspace-8", 3, "-INT", 130), ("subspace-16", 7, "-TERM", 143), ("regressor", 5, "-KILL", -1)];
    for (stage, step, name, code) in stops {
        let out = home.join(stage);
        let child = start_until(&whole.config, &out, |out| logged(out, stage, step));
        signal(&child, name);
        let said = Said::of(&child.wait_with_output().expect("a child"));
        // A run that was quicker than the signal proves nothing about stopping, but must still agree.
        assert!(said.code == code || said.code == 0, "{name} in {stage}: {} {}", said.code, said.err);
        if name != "-KILL" && said.code != 0 {
            assert!(said.err.contains("--resume"), "{}", said.err);
        }
        resume(&whole.config, &out).fine();
        assert_eq!(learned(&out), learned(&whole.path), "stopped in {stage} by {name}");
        assert_eq!(metrics(&out), metrics(&whole.path), "stopped in {stage} by {name}");
    }
}

#[test]
fn a_second_signal_leaves_at_once() {
    let whole = tiny_run();
    let out = folder("twice").join("run");
    let child = start_until(&whole.config, &out, |out| out.join("log.jsonl").exists());
    signal(&child, "-INT");
    signal(&child, "-INT");
    let begun = Instant::now();
    let said = Said::of(&child.wait_with_output().expect("a child"));
    assert!(begun.elapsed() < Duration::from_secs(20));
    assert!([130, 0].contains(&said.code), "{} {}", said.code, said.err);
}

#[test]
fn another_configuration_is_not_resumed() {
    let whole = tiny_run();
    let out = folder("foreign").join("run");
    let child = start_until(&whole.config, &out, |out| logged(out, "subspace-8", 2));
    signal(&child, "-INT");
    child.wait_with_output().expect("a child");
    let mut other = tiny_train(&whole.config, &out);
    other.args(["--resume", "--set", "subspace.training.dropout=0.3"]);
    Said::of(&other.output().expect("the command starts")).refused(6, &["another --out"]);
    let again = Said::of(&tiny_train(&whole.config, &out).output().expect("the command starts"));
    again.refused(2, &["--resume"]);
}
