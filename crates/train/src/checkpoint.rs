use crate::{NamedArray, Result, State, TrainError};
use serde::{Deserialize, Serialize};
use softtissue_store::{DType, StoreError, TensorFile, TensorFileWriter, read_json, sha256_file, write_json_atomic};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

const MANIFEST: &str = "manifest.json";
const STATE: &str = "state.safetensors";
const BEST: &str = "best.safetensors";
/// What to do about a damaged checkpoint.
const GO_ON: &str = "delete the folder to go on from the one before";

/// What a checkpoint holds beside its arrays.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Manifest {
    schema: u32,
    /// Names the configuration and data that the run was started with.
    fingerprint: String,
    steps_done: u64,
    best_step: Option<u64>,
    best_mm: Option<f64>,
    files: BTreeMap<String, String>,
}

/// The state of a trainee after `steps_done` steps, and the best state so far by validation.
#[derive(Clone, Debug, PartialEq)]
pub struct Checkpoint {
    /// Steps done.
    pub steps_done: u64,
    /// Weights and optimiser.
    pub state: State,
    /// Step count, validation error in mm, and state of the best so far.
    pub best: Option<(u64, f64, State)>,
}

/// A folder of checkpoints `step-000123/`, each complete once its `manifest.json` stands: the manifest is
/// written last and holds a hash of every file.
#[derive(Clone, Debug)]
pub struct CheckpointFolder {
    root: PathBuf,
    fingerprint: String,
    keep_last: usize,
}

impl CheckpointFolder {
    /// `fingerprint` names configuration, data and topology; a checkpoint with another one is refused.
    pub fn new(root: PathBuf, fingerprint: String, keep_last: usize) -> Self {
        Self { root, fingerprint, keep_last: keep_last.max(1) }
    }

    /// Writes a checkpoint, then removes all but the newest `keep_last`.
    pub fn save(&self, checkpoint: &Checkpoint) -> Result<PathBuf> {
        let folder = self.path_of(checkpoint.steps_done);
        // While its files are replaced, a folder must not look complete.
        remove_manifest(&folder)?;
        let mut files = BTreeMap::new();
        let mut write = |name: &str, state: &State| -> Result<()> {
            let path = folder.join(name);
            write_state(&path, state, &[])?;
            files.insert(name.to_owned(), sha256_file(&path)?);
            Ok(())
        };
        write(STATE, &checkpoint.state)?;
        if let Some((_, _, state)) = &checkpoint.best {
            write(BEST, state)?;
        }
        let manifest = Manifest {
            schema: 1,
            fingerprint: self.fingerprint.clone(),
            steps_done: checkpoint.steps_done,
            best_step: checkpoint.best.as_ref().map(|b| b.0),
            best_mm: checkpoint.best.as_ref().map(|b| b.1),
            files,
        };
        write_json_atomic(&folder.join(MANIFEST), &manifest)?;
        self.prune();
        Ok(folder)
    }

    /// The newest complete checkpoint. A folder without manifest was cut off while being written and is
    /// passed over; a complete one that is broken or of another run is an error.
    pub fn newest(&self) -> Result<Option<Checkpoint>> {
        match self.folders().into_iter().rfind(|f| is_complete(f)) {
            Some(folder) => self.load(&folder).map(Some),
            None => Ok(None),
        }
    }

    /// Removes every checkpoint, once the stage's result is written.
    pub fn clear(&self) {
        // Left-over checkpoints cost disk, nothing else: a failure here must not fail the run.
        let _ = std::fs::remove_dir_all(&self.root);
    }

    /// Where the checkpoint after `steps_done` steps lies.
    pub fn path_of(&self, steps_done: u64) -> PathBuf {
        self.root.join(format!("step-{steps_done:06}"))
    }

    /// Complete and torn checkpoints, by steps.
    fn folders(&self) -> Vec<PathBuf> {
        let number = |path: &Path| path.file_name()?.to_str()?.strip_prefix("step-")?.parse::<u64>().ok();
        let mut folders: Vec<(u64, PathBuf)> = std::fs::read_dir(&self.root)
            .into_iter()
            .flatten()
            .flatten()
            .filter_map(|e| number(&e.path()).map(|n| (n, e.path())))
            .collect();
        folders.sort();
        folders.into_iter().map(|(_, path)| path).collect()
    }

    /// Removes torn checkpoints and all but the newest complete ones.
    fn prune(&self) {
        let (complete, torn): (Vec<PathBuf>, Vec<PathBuf>) = self.folders().into_iter().partition(|f| is_complete(f));
        let old = &complete[..complete.len().saturating_sub(self.keep_last)];
        for folder in old.iter().chain(&torn) {
            // The manifest goes first, so that a half-removed folder is never taken for a whole one. What cannot be
            // removed costs disk, nothing else.
            let _ = remove_manifest(folder);
            let _ = std::fs::remove_dir_all(folder);
        }
    }

    fn load(&self, folder: &Path) -> Result<Checkpoint> {
        let bad = |reason: String| TrainError::Checkpoint { path: folder.to_owned(), reason };
        let manifest: Manifest = read_json(&folder.join(MANIFEST)).map_err(|e| bad(format!("{e}; {GO_ON}")))?;
        if manifest.schema != 1 {
            return Err(bad(format!("schema {} is not 1; resume with the version that wrote it", manifest.schema)));
        }
        if manifest.fingerprint != self.fingerprint {
            return Err(bad(
                "it was made with other settings, data or topology; resume with those or choose another --out".into(),
            ));
        }
        let best = manifest.best_step.zip(manifest.best_mm);
        let expected: &[&str] = if best.is_some() { &[BEST, STATE] } else { &[STATE] };
        if !manifest.files.keys().map(String::as_str).eq(expected.iter().copied()) {
            let listed: Vec<&String> = manifest.files.keys().collect();
            return Err(bad(format!("it lists {listed:?} and not {expected:?}; {GO_ON}")));
        }
        let read = |name: &str| -> Result<State> {
            let path = folder.join(name);
            let found = sha256_file(&path).map_err(|e| bad(format!("{e}; {GO_ON}")))?;
            if found != manifest.files[name] {
                return Err(bad(format!("{name} is damaged (its hash differs); {GO_ON}")));
            }
            read_state(&path).map_err(|e| bad(format!("{e}; {GO_ON}")))
        };
        let best = best.map(|(step, mm)| Ok::<_, TrainError>((step, mm, read(BEST)?))).transpose()?;
        Ok(Checkpoint { steps_done: manifest.steps_done, state: read(STATE)?, best })
    }
}

fn is_complete(folder: &Path) -> bool {
    folder.join(MANIFEST).exists()
}

fn remove_manifest(folder: &Path) -> Result<()> {
    let path = folder.join(MANIFEST);
    match std::fs::remove_file(&path) {
        Err(e) if e.kind() != std::io::ErrorKind::NotFound => Err(StoreError::io("replace", &path, e).into()),
        _ => Ok(()),
    }
}

/// Writes named arrays, and texts for the header, as one tensor file.
pub fn write_state(path: &Path, state: &State, meta: &[(&str, String)]) -> Result<()> {
    let mut file = TensorFileWriter::new();
    for (key, value) in meta {
        file.meta(key, value);
    }
    for array in state.values() {
        file.f32(&array.name, &array.shape, &array.data);
    }
    Ok(file.write(path)?)
}

/// Reads the arrays that [`write_state`] wrote.
pub fn read_state(path: &Path) -> Result<State> {
    let file = TensorFile::open(path)?;
    let mut state = State::new();
    for name in file.names() {
        let (dtype, shape) = file.shape(name).expect("a listed name has a shape");
        if dtype == DType::F32 {
            state.insert(
                name.to_owned(),
                NamedArray { name: name.to_owned(), shape: shape.to_vec(), data: file.f32(name)? },
            );
        }
    }
    Ok(state)
}
