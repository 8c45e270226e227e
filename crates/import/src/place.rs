use crate::ImportError;
use std::path::{Path, PathBuf};

/// Where in a foreign file something stands, for messages.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    /// Which file.
    pub path: PathBuf,
    /// Which part of it, in words: "array poses", "member a/b.txt"; empty for the whole file.
    pub part: String,
}

/// At most 40 characters of a word, none of them a control character, for messages.
pub(crate) fn excerpt(word: &str) -> String {
    word.chars().take(40).map(|c| if c.is_control() { ' ' } else { c }).collect()
}

impl Place {
    /// A whole file.
    pub fn file(path: &Path) -> Self {
        Self { path: path.to_owned(), part: String::new() }
    }
    /// A part of a file.
    pub fn part(path: &Path, part: impl Into<String>) -> Self {
        Self { path: path.to_owned(), part: part.into() }
    }
    /// A refusal that names this place; `reason` says what is wrong and what to do.
    pub fn refuse(&self, reason: impl Into<String>) -> ImportError {
        if self.part.is_empty() {
            return ImportError::file(&self.path, reason);
        }
        ImportError::Part { path: self.path.clone(), part: self.part.clone(), reason: reason.into() }
    }
}
