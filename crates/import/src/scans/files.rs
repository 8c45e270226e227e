use super::{FrameMesh, ply};
use crate::{ImportError, ImportLimits, Result, natural_cmp, read_obj_frame};
use softtissue_store::StoreError;
use std::path::{Path, PathBuf};

/// A clip with one file a frame.
#[derive(Clone, Debug)]
pub(crate) struct FrameFiles {
    pub folder: PathBuf,
    /// In order of their frame numbers; `None` where a number is missing between two others.
    pub slots: Vec<Option<PathBuf>>,
}

/// Format of a frame, by its name's end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum FrameFormat {
    Obj,
    Ply,
}

impl FrameFormat {
    pub fn of(path: &Path) -> Option<Self> {
        match path.extension()?.to_str()?.to_ascii_lowercase().as_str() {
            "obj" => Some(Self::Obj),
            "ply" => Some(Self::Ply),
            _ => None,
        }
    }
}

/// Reads one frame, by its name's end.
pub(crate) fn read_frame(path: &Path, limits: &ImportLimits) -> Result<FrameMesh> {
    match FrameFormat::of(path) {
        Some(FrameFormat::Ply) => ply::read_ply(path, limits),
        _ => Ok(read_obj_frame(path, limits)?.into()),
    }
}

/// Entries of a folder, in natural order.
pub(crate) fn entries(folder: &Path) -> Result<Vec<(String, PathBuf)>> {
    let entries = std::fs::read_dir(folder).map_err(|e| StoreError::io("read", folder, e))?;
    let mut found: Vec<(String, PathBuf)> =
        entries.flatten().map(|e| (e.file_name().to_string_lossy().into_owned(), e.path())).collect();
    found.sort_by(|a, b| natural_cmp(&a.0, &b.0));
    Ok(found)
}

impl FrameFiles {
    /// The frames of a folder in order of the last number in their names. Numbers may go by any constant step.
    ///
    /// # Errors
    /// No frame, one frame, two formats, names of two sequences, a number that stands twice, and, unless gaps are to be
    /// filled, a number that is missing.
    pub fn list(folder: &Path, fill_gaps: bool, limits: &ImportLimits) -> Result<Self> {
        let bad = |reason: String| ImportError::file(folder, reason);
        let files: Vec<(String, PathBuf)> =
            entries(folder)?.into_iter().filter(|(_, p)| FrameFormat::of(p).is_some() && p.is_file()).collect();
        match files.len() {
            0 => return Err(bad("it holds no frame (*.obj, *.ply); remove the folder or add its frames".into())),
            1 => return Err(bad("it holds one frame, which has no velocity; a clip needs at least two".into())),
            n if n > limits.frames => return Err(bad(format!("{n} frames are more than {}", limits.frames))),
            _ => {}
        }
        let mut numbered = Vec::with_capacity(files.len());
        for (name, path) in files {
            let (around, number) =
                frame_number(&name).ok_or_else(|| bad(format!("{name} has no frame number in its name; rename it")))?;
            numbered.push((number, around, name, path));
        }
        let first = numbered[0].clone();
        if let Some(other) = numbered.iter().find(|n| n.1 != first.1) {
            return Err(bad(format!(
                "{} and {} are frames of two sequences or formats; give each a folder of its own",
                first.2, other.2
            )));
        }
        numbered.sort_by_key(|n| n.0);
        if let Some(pair) = numbered.windows(2).find(|w| w[0].0 == w[1].0) {
            return Err(bad(format!("{} and {} have the same frame number; remove one", pair[0].2, pair[1].2)));
        }
        let steps: Vec<u64> = numbered.windows(2).map(|w| w[1].0 - w[0].0).collect();
        let step = steps.iter().copied().min().unwrap_or(1);
        if let Some(at) = steps.iter().position(|s| *s != step) {
            let (before, after) = (&numbered[at].2, &numbered[at + 1].2);
            let remedy = if !steps[at].is_multiple_of(step) {
                "their numbers keep no common step; rename them"
            } else if fill_gaps {
                ""
            } else {
                "add the missing ones, split the folder there, or pass --fill-gaps"
            };
            if !remedy.is_empty() {
                return Err(bad(format!("frames are missing between {before} and {after}: {remedy}")));
            }
        }
        let last = (numbered[numbered.len() - 1].0 - numbered[0].0) / step;
        if last >= limits.frames as u64 {
            return Err(bad(format!("its numbers span {last} frames and one, more than {}", limits.frames)));
        }
        let mut slots = vec![None; last as usize + 1];
        let start = numbered[0].0;
        for (number, _, _, path) in numbered {
            slots[((number - start) / step) as usize] = Some(path);
        }
        Ok(Self { folder: folder.to_owned(), slots })
    }

    /// Slots without a file.
    pub fn missing(&self) -> Vec<usize> {
        (0..self.slots.len()).filter(|t| self.slots[*t].is_none()).collect()
    }

    /// Files in order.
    pub fn paths(&self) -> impl Iterator<Item = &Path> {
        self.slots.iter().flatten().map(PathBuf::as_path)
    }
}

/// The last number of a name, and the name without it, its extension in lower case.
fn frame_number(name: &str) -> Option<(String, u64)> {
    let (stem, extension) = name.rsplit_once('.')?;
    let end = stem.rfind(|c: char| c.is_ascii_digit())? + 1;
    let start = stem[..end]
        .rfind(|c: char| !c.is_ascii_digit())
        .map_or(0, |i| i + stem[i..].chars().next().map_or(1, char::len_utf8));
    let number = stem[start..end].parse().ok()?;
    Some((format!("{}#{}.{}", &stem[..start], &stem[end..], extension.to_ascii_lowercase()), number))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_number_of_a_name_counts() {
        assert_eq!(frame_number("50004.hips.000123.ply"), Some(("50004.hips.#.ply".into(), 123)));
        assert_eq!(frame_number("f9.OBJ"), Some(("f#.obj".into(), 9)));
        assert_eq!(frame_number("büste7é.obj"), Some(("büste#é.obj".into(), 7)));
        assert_eq!(frame_number("frame.obj"), None);
        assert_eq!(frame_number("99999999999999999999999.obj"), None);
    }
}
