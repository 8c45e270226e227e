//! The folder of one run: who holds it, where everything lies.

use crate::exit::{InputError, UsageError};
use anyhow::{Context, Result};
use softtissue_store::{StoreError, create_dir};
use std::fs::{File, OpenOptions};
use std::path::{Path, PathBuf};

/// The measures, in a run's folder.
pub const METRICS_FILE: &str = "metrics.json";
/// The report, in a run's folder.
pub const REPORT_FILE: &str = "report/index.html";

/// A run folder, held by this process alone until dropped.
pub struct RunFolder {
    root: PathBuf,
    _lock: File,
}

impl RunFolder {
    /// Creates or opens the folder and locks it. A folder that holds a run already is an error unless `resume`.
    pub fn take(root: &Path, resume: bool) -> Result<Self> {
        if root.exists() && !root.is_dir() {
            return Err(UsageError(format!("{} is a file; --out names a folder", root.display())).into());
        }
        let has_run = root.join("config.toml").exists();
        if has_run && !resume {
            return Err(UsageError(format!(
                "{} holds a run already: pass --resume to go on with it, or another --out",
                root.display()
            ))
            .into());
        }
        if resume && !has_run {
            return Err(InputError(format!("{} holds no run to resume; train without --resume", root.display())).into());
        }
        create_dir(root)?;
        let path = root.join("run.lock");
        let lock = OpenOptions::new()
            .create(true)
            .truncate(false)
            .write(true)
            .open(&path)
            .map_err(|e| StoreError::io("write", &path, e))?;
        if lock.try_lock().is_err() {
            return Err(UsageError(format!(
                "{} is in use by another softtissue; wait for it or choose another --out",
                root.display()
            ))
            .into());
        }
        let folder = Self { root: root.to_owned(), _lock: lock };
        folder.sweep();
        Ok(folder)
    }

    /// Removes what a killed process left half-made: temporary files and the fits that are only compared.
    fn sweep(&self) {
        let _ = std::fs::remove_dir_all(self.objectives());
        let mut waiting = vec![self.root.clone()];
        while let Some(folder) = waiting.pop() {
            for entry in std::fs::read_dir(&folder).into_iter().flatten().flatten() {
                let (path, kind) = (entry.path(), entry.file_type());
                if kind.as_ref().is_ok_and(std::fs::FileType::is_dir) {
                    waiting.push(path);
                } else if kind.is_ok_and(|k| k.is_file()) && path.extension().is_some_and(|e| e == "tmp") {
                    // A left-over costs disk, nothing else.
                    let _ = std::fs::remove_file(path);
                }
            }
        }
    }

    /// The folder.
    pub fn root(&self) -> &Path {
        &self.root
    }
    /// Checkpoints of a stage.
    pub fn checkpoints(&self, stage: &str) -> PathBuf {
        self.root.join("checkpoints").join(stage)
    }
    /// The result of a stage.
    pub fn stage(&self, stage: &str) -> PathBuf {
        self.root.join("stages").join(format!("{stage}.safetensors"))
    }
    /// Fits with another objective, while they are compared.
    pub fn objectives(&self) -> PathBuf {
        self.root.join("stages").join("objectives")
    }
    /// The bundle.
    pub fn bundle(&self) -> PathBuf {
        self.root.join("bundle")
    }
    /// An AutoAvatar, which is no bundle.
    pub fn avatar(&self) -> PathBuf {
        self.root.join("avatar")
    }
    /// The report.
    pub fn report(&self) -> PathBuf {
        self.root.join(REPORT_FILE)
    }
    /// The measures.
    pub fn metrics(&self) -> PathBuf {
        self.root.join(METRICS_FILE)
    }
    /// Measures and report with other runs beside this one, or on other scans.
    pub fn comparison(&self, scans: Option<&Path>) -> PathBuf {
        let name = scans.and_then(Path::file_name).map(|n| format!("on-{}", n.to_string_lossy()));
        self.root.join(name.as_deref().unwrap_or("comparison"))
    }
    /// Writes a text file.
    pub fn write_text(&self, name: &str, text: &str) -> Result<()> {
        softtissue_store::write_atomic(&self.root.join(name), |w| w.write_all(text.as_bytes()))
            .context("the run folder cannot be written")
    }
}
