//! What every stage needs: settings, device, progress, and where to write.

use crate::config::Config;
use crate::exit::InputError;
use crate::run_folder::RunFolder;
use anyhow::Result;
use burn::tensor::Device;
use serde_json::json;
use softtissue_monitor::Monitor;
use softtissue_store::sha256_bytes;
use softtissue_train::{CheckpointFolder, LoopConfig, RunLog, State, TrainError, Trainee, train_to_end};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::Instant;

/// One run in progress.
pub struct Context<'a> {
    /// Resolved settings.
    pub config: &'a Config,
    /// Where tensors live, without autodiff.
    pub device: Device,
    /// Progress and stopping.
    pub monitor: &'a dyn Monitor,
    /// The run folder.
    pub run: &'a RunFolder,
    /// `log.jsonl` and TensorBoard.
    pub log: RunLog,
    /// Generated and imported clips.
    pub data_dir: PathBuf,
    /// Whether stages without a result may be learned; otherwise a missing one is an error.
    pub learns: bool,
    /// Seconds by stage.
    times: Mutex<Vec<(String, f64)>>,
}

/// Where learned stages of one fold are kept, and the fingerprint of what they were learned from.
#[derive(Clone, Debug)]
pub struct Place {
    /// Prefix of stage names, empty for the run itself.
    pub prefix: String,
    /// Names configuration, data and split.
    pub fingerprint: String,
    /// Where the scans came from.
    pub scans: serde_json::Value,
}

impl Place {
    /// A stage's full name.
    pub fn stage(&self, name: &str) -> String {
        if self.prefix.is_empty() { name.to_owned() } else { format!("{}/{name}", self.prefix) }
    }

    /// Refuses the result of a stage that was made from something else.
    pub fn check(&self, path: &Path, fingerprint: &str) -> Result<()> {
        if fingerprint == self.fingerprint {
            return Ok(());
        }
        let reason = "it was made with other settings, data or topology; choose another --out".into();
        Err(TrainError::Checkpoint { path: path.to_owned(), reason }.into())
    }
}

/// The result of a stage that cannot be read back.
pub fn damaged(path: &Path, reason: String) -> anyhow::Error {
    let reason = format!("{reason}; delete it and go on with `softtissue train --resume`");
    TrainError::Checkpoint { path: path.to_owned(), reason }.into()
}

impl<'a> Context<'a> {
    /// Opens the log of a run.
    pub fn new(config: &'a Config, monitor: &'a dyn Monitor, run: &'a RunFolder, data_dir: PathBuf) -> Result<Self> {
        let device = softtissue_train::device::parse(&config.device)?;
        let log = RunLog::open(run.root())?;
        Ok(Self { config, device, monitor, run, log, data_dir, learns: true, times: Mutex::default() })
    }

    /// Whether a stage's result is there. Where nothing may be learned, it must be.
    pub fn has(&self, result: &Path) -> Result<bool> {
        if result.exists() || self.learns {
            return Ok(result.exists());
        }
        let message = format!("{} is missing: finish the run with `softtissue train --resume` first", result.display());
        Err(InputError(message).into())
    }

    /// Runs a stage and keeps its time. A stop request ends the run between stages.
    pub fn timed<T>(&self, stage: &str, work: impl FnOnce() -> Result<T>) -> Result<T> {
        if self.monitor.should_stop() {
            return Err(TrainError::Stopped { stage: stage.to_owned(), step: 0 }.into());
        }
        let begun = Instant::now();
        let done = work()?;
        let seconds = begun.elapsed().as_secs_f64();
        self.monitor.say(&format!("  {stage:<28} {seconds:7.1} s"));
        self.log.event(json!({"event": "stage", "name": stage, "seconds": seconds}))?;
        self.times.lock().unwrap_or_else(std::sync::PoisonError::into_inner).push((stage.to_owned(), seconds));
        Ok(done)
    }

    /// Seconds by stage so far, in order.
    pub fn times(&self) -> Vec<(String, f64)> {
        self.times.lock().unwrap_or_else(std::sync::PoisonError::into_inner).clone()
    }

    /// Trains a stage to its end, or takes its finished result; leaves the trainee in its best state.
    /// Returns the best step (0: validation kept the start) and its validation error in mm.
    pub fn train(&self, place: &Place, name: &str, trainee: &mut dyn Trainee, steps: u64) -> Result<(u64, f64)> {
        let stage = place.stage(name);
        let result = self.run.stage(&stage);
        if self.has(&result)? {
            let file = softtissue_store::TensorFile::open(&result)?;
            place.check(&result, file.require_meta("fingerprint")?)?;
            let number = |key: &str| file.require_meta(key).ok().and_then(|t| t.parse::<f64>().ok());
            let (Some(step), Some(mm)) = (number("best_step"), number("best_mm")) else {
                return Err(damaged(&result, "its best step is missing".into()));
            };
            let state = softtissue_train::read_state(&result)?;
            trainee.load_state(&state).map_err(|e| damaged(&result, e.to_string()))?;
            return Ok((step as u64, mm));
        }
        let config: &LoopConfig = &self.config.train;
        let folder = CheckpointFolder::new(self.run.checkpoints(&stage), place.fingerprint.clone(), config.keep_last);
        let finished = train_to_end(&stage, trainee, steps, config, &folder, &self.log, self.monitor)?;
        let state: State = trainee.state().into_iter().map(|a| (a.name.clone(), a)).collect();
        let meta = [
            ("fingerprint", place.fingerprint.clone()),
            ("best_step", finished.best_step.to_string()),
            ("best_mm", finished.best_mm.to_string()),
        ];
        softtissue_train::write_state(&result, &state, &meta)?;
        folder.clear();
        Ok((finished.best_step, finished.best_mm))
    }
}

/// A short name for anything that serialises: equal content, equal name.
pub fn fingerprint<T: serde::Serialize>(value: &T) -> Result<String> {
    Ok(sha256_bytes(&serde_json::to_vec(value)?)[..16].to_owned())
}
