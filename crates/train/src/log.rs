use crate::{EventWriter, Result, StepStats};
use serde_json::{Value, json};
use softtissue_store::{StoreError, write_atomic};
use std::fs::{File, OpenOptions};
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::Instant;

/// `log.jsonl` of a run, one line a step, validation or stage; mirrored as TensorBoard scalars.
pub struct RunLog {
    path: PathBuf,
    file: Mutex<File>,
    events: Mutex<EventWriter>,
    start: Instant,
}

impl RunLog {
    /// Opens the log of a run folder for appending.
    pub fn open(run: &Path) -> Result<Self> {
        let path = run.join("log.jsonl");
        let file =
            OpenOptions::new().create(true).append(true).open(&path).map_err(|e| StoreError::io("write", &path, e))?;
        Ok(Self { path, file: Mutex::new(file), events: Mutex::new(EventWriter::create(&run.join("tensorboard"))?), start: Instant::now() })
    }

    /// Drops a stage's lines at and after `step`: they will be written again after a resume.
    pub fn rewind(&self, stage: &str, step: u64) -> Result<()> {
        let mut file = self.file.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        let old = File::open(&self.path).map_err(|e| StoreError::io("read", &self.path, e))?;
        let keep = |line: &String| match serde_json::from_str::<Value>(line) {
            Ok(v) => v["stage"] != stage || v["step"].as_u64().is_none_or(|s| s < step),
            Err(_) => false,
        };
        let lines: Vec<String> = BufReader::new(old).lines().map_while(std::io::Result::ok).filter(keep).collect();
        write_atomic(&self.path, |w| lines.iter().try_for_each(|line| writeln!(w, "{line}")))?;
        *file = OpenOptions::new().append(true).open(&self.path).map_err(|e| StoreError::io("write", &self.path, e))?;
        Ok(())
    }

    /// One step.
    pub fn step(&self, stage: &str, step: u64, stats: &StepStats) -> Result<()> {
        let mut line = json!({"stage": stage, "step": step, "loss": stats.loss, "learning_rate": stats.learning_rate});
        for (name, value) in &stats.terms {
            line[*name] = json!(value);
        }
        let scalars = [("loss", stats.loss), ("learning_rate", stats.learning_rate)];
        self.write(line, stage, step, scalars.into_iter().chain(stats.terms.iter().copied()))
    }

    /// One validation.
    pub fn validation(&self, stage: &str, step: u64, mm: f64) -> Result<()> {
        self.write(json!({"stage": stage, "step": step, "validation_mm": mm}), stage, step, [("validation_mm", mm)])
    }

    /// Anything else worth a line, e.g. a stage's time.
    pub fn event(&self, line: Value) -> Result<()> {
        self.write(line, "", 0, [])
    }

    fn write(&self, mut line: Value, stage: &str, step: u64, scalars: impl IntoIterator<Item = (&'static str, f64)>) -> Result<()> {
        line["elapsed_s"] = json!((self.start.elapsed().as_secs_f64() * 1e3).round() / 1e3);
        let mut text = line.to_string();
        text.push('\n');
        let mut file = self.file.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        file.write_all(text.as_bytes()).map_err(|e| StoreError::io("write", &self.path, e))?;
        let mut events = self.events.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        for (name, value) in scalars {
            events.scalar(&format!("{stage}/{name}"), step, value)?;
        }
        Ok(())
    }
}
