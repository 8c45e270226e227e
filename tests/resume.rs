//! Stopping and going on: the same bytes as not stopping.

use crate::support::{Said, bytes_below, command, folder, measures, tiny_run, tiny_train};
use softtissue_random::Draws;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

/// Starts a run, or goes on with one, that holds after `done` steps of `stage` until a signal comes, and waits until it
/// is there.
fn start_and_hold(config: &Path, out: &Path, stage: &str, done: u64, deaf: bool) -> Child {
    let place = format!("{stage}:{done}{}", if deaf { ":deaf" } else { "" });
    let resume = out.join("config.toml").exists().then_some("--resume");
    let mut child = tiny_train(config, out)
        .args(resume)
        .env("SOFTTISSUE_PAUSE_AT", place)
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the command starts");
    let begun = Instant::now();
    while !logged(out, stage, done - 1) {
        assert!(begun.elapsed() < Duration::from_secs(600), "{stage} never came to step {done}");
        if let Some(status) = child.try_wait().expect("a child") {
            panic!("it ended by itself: {status} {}", Said::of(&child.wait_with_output().expect("a child")).err);
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    child
}

fn logged(out: &Path, stage: &str, step: u64) -> bool {
    let text = std::fs::read_to_string(out.join("log.jsonl")).unwrap_or_default();
    text.lines()
        .filter_map(|l| serde_json::from_str::<serde_json::Value>(l).ok())
        .any(|line| line["stage"] == stage && line["step"] == step && line.get("loss").is_some())
}

fn signal(child: &Child, name: &str) {
    let status = std::process::Command::new("kill").arg(name).arg(child.id().to_string()).status().expect("kill");
    assert!(status.success(), "{name} reaches a process that is still there");
}

fn end(child: Child) -> Said {
    Said::of(&child.wait_with_output().expect("a child"))
}

fn resume(config: &Path, out: &Path) -> Said {
    Said::of(&tiny_train(config, out).arg("--resume").output().expect("the command starts"))
}

/// Results of all stages and the bundle.
fn learned(run: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut files = bytes_below(&run.join("stages"));
    files.extend(bytes_below(&run.join("bundle")));
    files
}

/// Steps and validations in the log, without their times.
fn steps(run: &Path) -> Vec<String> {
    let text = std::fs::read_to_string(run.join("log.jsonl")).expect("a log");
    let lines = text.lines().map(|l| serde_json::from_str::<serde_json::Value>(l).expect("a whole line"));
    let mut steps: Vec<String> = lines
        .filter(|line| line.get("step").is_some())
        .map(|mut line| {
            line.as_object_mut().expect("an object").remove("elapsed_s");
            line.to_string()
        })
        .collect();
    steps.sort();
    steps
}

#[test]
fn stopped_runs_end_in_the_same_bytes() {
    let whole = tiny_run();
    let home = folder("resumed");
    let signals = [("-INT", 130), ("-TERM", 143), ("-KILL", -1)];
    for (index, stage) in ["subspace-8", "subspace-16", "regressor"].into_iter().enumerate() {
        let out = home.join(stage);
        for (stop, done) in drawn_steps(index as u64).into_iter().enumerate() {
            let (name, code) = signals[(index + stop) % signals.len()];
            let child = start_and_hold(&whole.config, &out, stage, done, false);
            signal(&child, name);
            let said = end(child);
            assert_eq!(said.code, code, "{name} in {stage}: {}", said.err);
            if name != "-KILL" {
                let steps = format!("after {done} steps");
                assert!(said.err.contains("--resume") && said.err.contains(&steps), "{}", said.err);
            }
            assert!(!out.join("bundle/manifest.json").exists(), "it was stopped before its end");
        }
        resume(&whole.config, &out).fine();
        assert_eq!(steps(&out), steps(&whole.path), "each step is logged once: {stage}");
        assert!(learned(&out) == learned(&whole.path), "stopped in {stage}");
        assert_eq!(measures(&out), measures(&whole.path), "stopped in {stage}");
    }
}

/// Three different steps of a stage's twelve, ascending, drawn.
fn drawn_steps(stage: u64) -> Vec<u64> {
    let mut draws = Draws::new(7, "stops", stage, 0);
    let mut steps = BTreeSet::new();
    while steps.len() < 3 {
        steps.insert(1 + draws.bits() % 11);
    }
    steps.into_iter().collect()
}

#[test]
fn a_second_signal_leaves_at_once() {
    let whole = tiny_run();
    let out = folder("twice").join("run");
    let mut child = start_and_hold(&whole.config, &out, "subspace-8", 2, true);
    signal(&child, "-INT");
    std::thread::sleep(Duration::from_millis(300));
    assert!(child.try_wait().expect("a child").is_none(), "the first signal only asks");
    let begun = Instant::now();
    signal(&child, "-TERM");
    let said = end(child);
    assert_eq!(said.code, 143, "{}", said.err);
    assert!(begun.elapsed() < Duration::from_secs(20), "it does not wait for the work, which holds for a minute");
    assert!(!said.err.contains("--resume"), "nothing was saved, and nothing is claimed: {}", said.err);
}

#[test]
#[cfg(target_os = "linux")]
fn animate_stops_and_leaves_nothing() {
    let out = folder("animate-stopped").join("a.glb");
    let bundle = tiny_run().path.join("bundle");
    let mut command = command();
    command.arg("animate").arg("--bundle").arg(bundle).arg("--out").arg(&out);
    command.args(["--motion", "synth:shake_hips", "--frames", "36000"]).env("SOFTTISSUE_PAUSE_AT", "animate:3");
    let child = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().expect("the command starts");
    let catches_signals = || {
        let status = std::fs::read_to_string(format!("/proc/{}/status", child.id())).unwrap_or_default();
        let caught = status.lines().find_map(|l| l.strip_prefix("SigCgt:")).map(str::trim);
        caught.and_then(|mask| u64::from_str_radix(mask, 16).ok()).is_some_and(|mask| mask & 2 != 0)
    };
    let begun = Instant::now();
    while !catches_signals() {
        assert!(begun.elapsed() < Duration::from_secs(60), "it never listened for Ctrl-C");
        std::thread::sleep(Duration::from_millis(10));
    }
    signal(&child, "-INT");
    end(child).refused(130, &["stopped", "nothing was written"]);
    assert!(!out.exists());
}

#[test]
fn another_configuration_is_not_resumed() {
    let whole = tiny_run();
    let out = folder("foreign").join("run");
    let child = start_and_hold(&whole.config, &out, "subspace-8", 3, false);
    signal(&child, "-INT");
    assert_eq!(end(child).code, 130);
    let mut other = tiny_train(&whole.config, &out);
    other.args(["--resume", "--set", "subspace.training.dropout=0.3"]);
    Said::of(&other.output().expect("the command starts")).refused(6, &["another --out"]);
    let again = Said::of(&tiny_train(&whole.config, &out).output().expect("the command starts"));
    again.refused(2, &["--resume"]);
}
