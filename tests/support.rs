//! Running the command, and one small run that many tests look at.

use softtissue_eval::Metrics;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

/// What a run of the command said.
pub struct Said {
    /// Exit code, or -1 where a signal ended it.
    pub code: i32,
    /// Standard output.
    pub out: String,
    /// Standard error.
    pub err: String,
}

impl Said {
    /// Of a finished process.
    pub fn of(output: &Output) -> Self {
        Self {
            code: output.status.code().unwrap_or(-1),
            out: String::from_utf8_lossy(&output.stdout).into_owned(),
            err: String::from_utf8_lossy(&output.stderr).into_owned(),
        }
    }
    /// Asserts an exit code and that the last line of standard error is one sentence that holds `words`.
    #[track_caller]
    pub fn refused(&self, code: i32, words: &[&str]) {
        let last = self.err.trim_end().lines().last().unwrap_or_default();
        assert_eq!(self.code, code, "{}", self.err);
        assert!(!self.err.contains("panicked"), "{}", self.err);
        assert!(last.starts_with("softtissue: "), "{last}");
        for word in words {
            assert!(last.contains(word), "{word:?} is missing in: {last}");
        }
    }
    /// Asserts success.
    #[track_caller]
    pub fn fine(&self) -> &Self {
        assert_eq!(self.code, 0, "{}{}", self.out, self.err);
        self
    }
}

/// The command.
pub fn command() -> Command {
    Command::new(env!("CARGO_BIN_EXE_softtissue"))
}

/// Runs the command.
pub fn softtissue(args: &[&str]) -> Said {
    Said::of(&command().args(args).output().expect("the command starts"))
}

/// Generated clips, shared by all tests and kept between test runs.
pub fn data_dir() -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR")).join("data")
}

/// A folder of a test's own, empty.
pub fn folder(name: &str) -> PathBuf {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_dir_all(&path);
    std::fs::create_dir_all(&path).expect("a folder for tests");
    path
}

/// The settings of the smallest job that goes through every stage: two people, four motions, a second each.
pub const TINY: &str = r#"
[synth]
bmi = [20.0, 29.0]
motions = ["jumping_jacks", "one_leg_jump", "punching", "shake_hips"]
frames = 48
[split]
test_motions = ["one_leg_jump"]
validation_motions = ["jumping_jacks"]
[subspace]
sizes = [8, 16]
[subspace.pca]
components = 24
[subspace.training]
steps = 12
batch = 16
[regressor]
latents = 16
[regressor.training]
steps = 12
batch = 3
[regressor.training.network]
width = 16
[descriptor]
modes = 12
[softsmpl]
transfer_steps = 6
[softsmpl.poses.training]
epochs = 2
batch = 64
[softsmpl.training]
steps = 12
batch = 3
width = 16
[train]
validate_every = 5
checkpoint_every = 4
[eval]
bounded_seconds = 10.0
decay_subjects = 1
playback_clips = 1
oracle = false
"#;

/// Writes [`TINY`] into a folder and returns the file.
pub fn tiny_config(folder: &Path) -> PathBuf {
    let path = folder.join("tiny.toml");
    std::fs::write(&path, TINY).expect("a configuration");
    path
}

/// Arguments of a tiny training into `out`.
pub fn tiny_train(config: &Path, out: &Path) -> Command {
    let mut command = command();
    command.arg("train").arg("--config").arg(config).arg("--out").arg(out).arg("--data-dir").arg(data_dir());
    command
}

/// One finished tiny run.
pub struct TinyRun {
    /// Its folder.
    pub path: PathBuf,
    /// Its configuration.
    pub config: PathBuf,
    /// What the command said.
    pub said: Said,
}

/// The run that tests share. Nobody changes it.
pub fn tiny_run() -> &'static TinyRun {
    static RUN: OnceLock<TinyRun> = OnceLock::new();
    RUN.get_or_init(|| {
        let home = folder("shared-run");
        let config = tiny_config(&home);
        let path = home.join("run");
        let said = Said::of(&tiny_train(&config, &path).output().expect("the command starts"));
        assert_eq!(said.code, 0, "{}", said.err);
        TinyRun { path, config, said }
    })
}

/// Scans of [`TINY`], shared like the run, as `softtissue synth` says where they lie.
pub fn tiny_scans() -> PathBuf {
    let config = tiny_run().config.display().to_string();
    let said = softtissue(&["synth", "--config", &config, "--data-dir", &data_dir().display().to_string()]);
    let line = said.fine().out.lines().find(|l| l.contains(" clips: ")).expect("where the scans lie").to_owned();
    PathBuf::from(line.split_once(": ").expect("a path").1)
}

/// Copies a folder with all that is below it.
pub fn copy_below(from: &Path, to: &Path) {
    for (path, bytes) in bytes_below(from) {
        let to = to.join(path);
        std::fs::create_dir_all(to.parent().expect("a parent")).expect("a folder");
        std::fs::write(to, bytes).expect("a file");
    }
}

/// A copy of the shared run for a test that changes it.
pub fn copy_of_the_run(name: &str) -> PathBuf {
    let copy = folder(name).join("run");
    copy_below(&tiny_run().path, &copy);
    copy
}

/// The measures of a run without what depends on the clock.
pub fn measures(run: &Path) -> Metrics {
    Metrics::read(&run.join("metrics.json")).expect("measures").without_times()
}

/// Every file below a folder with its bytes, sorted, paths relative.
pub fn bytes_below(root: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut files = Vec::new();
    let mut waiting = vec![root.to_owned()];
    while let Some(dir) = waiting.pop() {
        for entry in std::fs::read_dir(&dir).expect("a folder").flatten() {
            let path = entry.path();
            if path.is_dir() {
                waiting.push(path);
            } else {
                let relative = path.strip_prefix(root).expect("below the root").to_owned();
                files.push((relative, std::fs::read(&path).expect("a file")));
            }
        }
    }
    files.sort();
    files
}
