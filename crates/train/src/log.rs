use crate::{EventWriter, Result, StepStats};
use serde_json::{Value, json};
use softtissue_store::{StoreError, write_atomic};
use std::fs::{File, OpenOptions};
use std::io::Write;
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
        drop_torn_line(&path, &file).map_err(|e| StoreError::io("write", &path, e))?;
        Ok(Self {
            path,
            file: Mutex::new(file),
            events: Mutex::new(EventWriter::create(&run.join("tensorboard"))?),
            start: Instant::now(),
        })
    }

    /// Drops the lines of a stage that will be written again when it goes on after `steps_done` steps: later steps and
    /// later validations. The validation after exactly `steps_done` steps stays where it is `validated` already.
    pub fn rewind(&self, stage: &str, steps_done: u64, validated: bool) -> Result<()> {
        let mut file = self.file.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        let text = std::fs::read(&self.path).map_err(|e| StoreError::io("read", &self.path, e))?;
        let text = String::from_utf8_lossy(&text);
        let keep = |line: &&str| {
            let Ok(line) = serde_json::from_str::<Value>(line) else { return false };
            let Some(step) = line["step"].as_u64().filter(|_| line["stage"] == stage) else { return true };
            let is_validation = line.get("validation_mm").is_some();
            step < steps_done || (is_validation && validated && step == steps_done)
        };
        let kept: Vec<&str> = text.lines().filter(keep).collect();
        if kept.len() == text.lines().count() {
            return Ok(());
        }
        write_atomic(&self.path, |w| kept.iter().try_for_each(|line| writeln!(w, "{line}")))?;
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

    fn write(
        &self,
        mut line: Value,
        stage: &str,
        step: u64,
        scalars: impl IntoIterator<Item = (&'static str, f64)>,
    ) -> Result<()> {
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

/// A last line without its end was cut off by a crash; the next line must not be glued to it.
fn drop_torn_line(path: &Path, file: &File) -> std::io::Result<()> {
    let text = std::fs::read(path)?;
    let whole = text.iter().rposition(|b| *b == b'\n').map_or(0, |at| at + 1);
    if whole < text.len() { file.set_len(whole as u64) } else { Ok(()) }
}
