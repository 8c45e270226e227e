use crate::{Result, StoreError};
use serde::{Serialize, de::DeserializeOwned};
use std::fs::File;
use std::io::{BufWriter, Read, Write};
use std::path::{Path, PathBuf};

/// Creates a folder and its parents.
pub fn create_dir(path: &Path) -> Result<()> {
    std::fs::create_dir_all(path).map_err(|e| StoreError::io("create", path, e))
}

/// Writes a file through a temporary name in the same folder: written, synced, renamed, folder synced.
/// A reader sees the old file or the whole new one, never a part. The temporary is removed on error.
pub fn write_atomic(path: &Path, fill: impl FnOnce(&mut dyn Write) -> std::io::Result<()>) -> Result<()> {
    let parent = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    create_dir(parent)?;
    let temporary = temporary_name(path);
    let outcome = (|| {
        let mut writer = BufWriter::with_capacity(1 << 20, File::create(&temporary)?);
        fill(&mut writer)?;
        writer.flush()?;
        writer.into_inner().map_err(std::io::IntoInnerError::into_error)?.sync_all()?;
        std::fs::rename(&temporary, path)?;
        File::open(parent)?.sync_all()
    })();
    outcome.map_err(|source| {
        let _ = std::fs::remove_file(&temporary);
        StoreError::io("write", path, source)
    })
}

fn temporary_name(path: &Path) -> PathBuf {
    let mut name = path.file_name().map(ToOwned::to_owned).unwrap_or_default();
    name.push(format!(".{}.tmp", std::process::id()));
    path.with_file_name(name)
}

/// Writes pretty JSON with a final newline, atomically.
pub fn write_json_atomic<T: Serialize>(path: &Path, value: &T) -> Result<()> {
    write_atomic(path, |w| {
        serde_json::to_writer_pretty(&mut *w, value)?;
        w.write_all(b"\n")
    })
}

/// Reads a whole file of at most `limit` bytes. A pipe or device is refused, which would be waited for without end.
pub fn read_limited(path: &Path, limit: u64) -> Result<Vec<u8>> {
    let io = |e| StoreError::io("read", path, e);
    let too_large = || StoreError::Limit { path: path.to_owned(), reason: format!("more than {limit} bytes") };
    let length = regular(path)?;
    if length > limit {
        return Err(too_large());
    }
    let mut bytes = Vec::new();
    bytes.try_reserve_exact(length as usize).map_err(|_| too_large())?;
    File::open(path).map_err(io)?.take(limit + 1).read_to_end(&mut bytes).map_err(io)?;
    if bytes.len() as u64 > limit {
        return Err(too_large());
    }
    Ok(bytes)
}

/// Bytes of a regular file; anything else is refused before it is opened.
pub fn regular(path: &Path) -> Result<u64> {
    let meta = std::fs::metadata(path).map_err(|e| StoreError::io("read", path, e))?;
    if meta.is_file() {
        return Ok(meta.len());
    }
    let what = if meta.is_dir() { "a folder" } else { "a pipe or device" };
    Err(StoreError::corrupt(path, format!("it is {what}, expected a file; check the path")))
}

/// Reads JSON of at most 64 MiB.
pub fn read_json<T: DeserializeOwned>(path: &Path) -> Result<T> {
    let bytes = read_limited(path, 64 << 20)?;
    serde_json::from_slice(&bytes).map_err(|e| StoreError::corrupt(path, format!("{e}; make it again")))
}
