//! The loop with a toy trainee: resuming, rolling back, refusing foreign and damaged checkpoints.

use softtissue_monitor::{Monitor, Silent};
use softtissue_random::Draws;
use softtissue_train::{
    Checkpoint, CheckpointFolder, LoopConfig, NamedArray, RunLog, State, StepStats, TrainError, Trainee, train_to_end,
};
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};

/// A noisy descent with momentum towards 1; `poison` makes the loss of that step NaN.
struct Toy {
    x: f32,
    momentum: f32,
    poison: Option<u64>,
}

impl Trainee for Toy {
    fn step(&mut self, step: u64) -> Result<StepStats, TrainError> {
        let noise = Draws::new(3, "toy", 0, step).normal() as f32;
        self.momentum = 0.9 * self.momentum + (self.x - 1.0) + 0.01 * noise;
        self.x -= 0.01 * self.momentum;
        let loss = if self.poison == Some(step) { f64::NAN } else { f64::from((self.x - 1.0).powi(2)) };
        Ok(StepStats { loss, terms: vec![("x", f64::from(self.x))], learning_rate: 0.01 })
    }
    fn validate(&mut self) -> Result<f64, TrainError> {
        Ok(f64::from((self.x - 1.0).abs()))
    }
    fn state(&self) -> Vec<NamedArray> {
        vec![NamedArray { name: "toy".into(), shape: vec![2], data: vec![self.x, self.momentum] }]
    }
    fn load_state(&mut self, state: &State) -> Result<(), TrainError> {
        [self.x, self.momentum] = state["toy"].data[..].try_into().expect("two numbers");
        Ok(())
    }
}

fn toy() -> Toy {
    Toy { x: 0.0, momentum: 0.0, poison: None }
}

fn folders(dir: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(dir.join("checkpoints")).unwrap().flatten();
    let mut names: Vec<String> = entries.map(|e| e.file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

/// Asks to stop at the n-th question.
struct StopAfter(AtomicU64);

impl Monitor for StopAfter {
    fn begin(&self, _: &str, _: u64, _: &'static str) {}
    fn advance(&self, _: u64, _: &str) {}
    fn end(&self) {}
    fn say(&self, _: &str) {}
    fn should_stop(&self) -> bool {
        self.0.fetch_sub(1, Ordering::Relaxed) == 0
    }
}

const CONFIG: LoopConfig = LoopConfig { validate_every: 7, checkpoint_every: 10, keep_last: 2 };

fn run(dir: &Path, toy: &mut Toy, fingerprint: &str, monitor: &dyn Monitor) -> Result<(), TrainError> {
    let folder = CheckpointFolder::new(dir.join("checkpoints"), fingerprint.into(), CONFIG.keep_last);
    let log = RunLog::open(dir)?;
    train_to_end("toy", toy, 60, &CONFIG, &folder, &log, monitor).map(|_| ())
}

#[test]
fn a_stopped_and_resumed_run_ends_in_the_same_bytes() {
    let whole = tempfile::tempdir().unwrap();
    let mut unbroken = toy();
    run(whole.path(), &mut unbroken, "a", &Silent).unwrap();
    let mut draws = Draws::new(11, "stops", 0, 0);
    for _ in 0..3 {
        let at = 1 + draws.below(58) as u64;
        let dir = tempfile::tempdir().unwrap();
        let stopped = run(dir.path(), &mut toy(), "a", &StopAfter(AtomicU64::new(at)));
        assert!(matches!(stopped, Err(TrainError::Stopped { step, .. }) if step == at), "{stopped:?}");
        let mut resumed = toy();
        run(dir.path(), &mut resumed, "a", &Silent).unwrap();
        assert_eq!(resumed.state(), unbroken.state(), "stopped after {at} steps");
        let steps = std::fs::read_to_string(dir.path().join("log.jsonl")).unwrap().matches("\"loss\"").count();
        assert_eq!(steps, 60, "each step is logged once");
    }
}

#[test]
fn a_checkpoint_without_manifest_is_passed_over() {
    let dir = tempfile::tempdir().unwrap();
    run(dir.path(), &mut toy(), "a", &StopAfter(AtomicU64::new(35))).unwrap_err();
    std::fs::remove_file(dir.path().join("checkpoints/step-000035/manifest.json")).unwrap();
    let mut resumed = toy();
    run(dir.path(), &mut resumed, "a", &Silent).unwrap();
    let mut unbroken = toy();
    run(tempfile::tempdir().unwrap().path(), &mut unbroken, "a", &Silent).unwrap();
    assert_eq!(resumed.state(), unbroken.state());
}

#[test]
fn damaged_and_foreign_checkpoints_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    run(dir.path(), &mut toy(), "a", &StopAfter(AtomicU64::new(15))).unwrap_err();
    let foreign = run(dir.path(), &mut toy(), "b", &Silent).unwrap_err();
    assert!(foreign.to_string().contains("other settings"), "{foreign}");
    let state = dir.path().join("checkpoints/step-000015/state.safetensors");
    let bytes = std::fs::read(&state).unwrap();
    let mut flipped = bytes.clone();
    *flipped.last_mut().unwrap() ^= 1;
    for broken in [flipped, bytes[..bytes.len() - 1].to_vec(), [&bytes[..], b"x"].concat()] {
        std::fs::write(&state, broken).unwrap();
        let refused = run(dir.path(), &mut toy(), "a", &Silent).unwrap_err();
        assert!(
            matches!(refused, TrainError::Checkpoint { .. }) && refused.to_string().contains("damaged"),
            "{refused}"
        );
    }
}

#[test]
fn a_nan_rolls_back_to_the_last_checkpoint() {
    let dir = tempfile::tempdir().unwrap();
    let mut diverging = Toy { poison: Some(33), ..toy() };
    let error = run(dir.path(), &mut diverging, "a", &Silent).unwrap_err();
    assert!(matches!(error, TrainError::Diverged { step: 33, rolled_back_to: 30, .. }), "{error}");
    assert!(diverging.x.is_finite());
    let mut resumed = toy();
    run(dir.path(), &mut resumed, "a", &Silent).unwrap();
    let mut unbroken = toy();
    run(tempfile::tempdir().unwrap().path(), &mut unbroken, "a", &Silent).unwrap();
    assert_eq!(resumed.state(), unbroken.state());
}

#[test]
fn torn_checkpoints_go_and_steps_are_counted_as_numbers() {
    let dir = tempfile::tempdir().unwrap();
    let folder = CheckpointFolder::new(dir.path().join("checkpoints"), "a".into(), 2);
    let state: State = toy().state().into_iter().map(|a| (a.name.clone(), a)).collect();
    let save = |steps_done| folder.save(&Checkpoint { steps_done, state: state.clone(), best: None }).unwrap();
    save(999_999);
    let torn = save(500);
    std::fs::remove_file(torn.join("manifest.json")).unwrap();
    save(1_000_000);
    assert_eq!(folder.newest().unwrap().unwrap().steps_done, 1_000_000, "a million comes after 999999");
    assert_eq!(folders(dir.path()), ["step-1000000", "step-999999"], "the torn one is gone, whole ones are not");
    save(1_000_001);
    assert_eq!(folders(dir.path()), ["step-1000000", "step-1000001"]);
}

#[test]
fn a_manifest_that_does_not_list_the_state_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    run(dir.path(), &mut toy(), "a", &StopAfter(AtomicU64::new(15))).unwrap_err();
    let path = dir.path().join("checkpoints/step-000015/manifest.json");
    let text = std::fs::read_to_string(&path).unwrap();
    std::fs::write(&path, text.replace("state.safetensors", "other.safetensors")).unwrap();
    let refused = run(dir.path(), &mut toy(), "a", &Silent).unwrap_err();
    assert!(matches!(refused, TrainError::Checkpoint { .. }), "{refused}");
}

#[test]
fn a_start_that_is_not_finite_has_diverged() {
    let dir = tempfile::tempdir().unwrap();
    let error = run(dir.path(), &mut Toy { x: f32::NAN, ..toy() }, "a", &Silent).unwrap_err();
    assert!(matches!(error, TrainError::Diverged { step: 0, .. }), "{error}");
}

#[test]
fn the_log_holds_each_line_once_after_a_crash() {
    /// Step and kind of each line, sorted.
    fn lines(dir: &Path) -> Vec<(Option<u64>, bool)> {
        let text = std::fs::read_to_string(dir.join("log.jsonl")).unwrap();
        let values = text.lines().map(|l| serde_json::from_str::<serde_json::Value>(l).expect("a whole line"));
        let mut keys: Vec<_> = values.map(|v| (v["step"].as_u64(), v.get("validation_mm").is_some())).collect();
        keys.sort_unstable();
        keys
    }
    let whole = tempfile::tempdir().unwrap();
    run(whole.path(), &mut toy(), "a", &Silent).unwrap();
    // Stops at a step that was just validated, and before any checkpoint.
    for at in [14, 35] {
        let dir = tempfile::tempdir().unwrap();
        run(dir.path(), &mut toy(), "a", &StopAfter(AtomicU64::new(at))).unwrap_err();
        let log = dir.path().join("log.jsonl");
        let torn = std::fs::read_to_string(&log).unwrap() + "{\"stage\":\"toy\",\"st";
        std::fs::write(&log, torn).unwrap();
        run(dir.path(), &mut toy(), "a", &Silent).unwrap();
        assert_eq!(lines(dir.path()), lines(whole.path()), "stopped after {at}");
    }
    // A run that was killed before its first checkpoint starts again from nothing.
    let dir = tempfile::tempdir().unwrap();
    std::fs::copy(whole.path().join("log.jsonl"), dir.path().join("log.jsonl")).unwrap();
    run(dir.path(), &mut toy(), "a", &Silent).unwrap();
    assert_eq!(lines(dir.path()), lines(whole.path()));
}
