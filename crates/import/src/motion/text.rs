//! Lines, words and numbers of text formats.

use crate::ImportError;
pub(super) use crate::place::excerpt;
use std::path::Path;

/// Numbers beyond this are no coordinate and no angle in any unit.
pub(super) const LARGEST: f64 = 1e7;

/// A text file on its way through a reader: lines that hold something, with their numbers.
pub(super) struct Text<'a> {
    path: &'a Path,
    lines: std::iter::Enumerate<std::str::Lines<'a>>,
    /// Number of the line that was read last, from 1.
    pub line: usize,
}

impl<'a> Text<'a> {
    pub fn new(path: &'a Path, text: &'a str) -> Self {
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        Self { path, lines: text.lines().enumerate(), line: 0 }
    }
    /// The next line that is not empty, trimmed.
    pub fn next_line(&mut self) -> Option<&'a str> {
        for (n, line) in self.lines.by_ref() {
            let line = line.trim();
            if !line.is_empty() {
                self.line = n + 1;
                return Some(line);
            }
        }
        None
    }
    /// An error at the line that was read last.
    pub fn error(&self, reason: impl Into<String>) -> ImportError {
        self.error_at(self.line, reason)
    }
    /// An error at a line.
    pub fn error_at(&self, line: usize, reason: impl Into<String>) -> ImportError {
        ImportError::Line { path: self.path.to_owned(), line: line.max(1), reason: reason.into() }
    }
    /// An error of the whole file.
    pub fn file_error(&self, reason: impl Into<String>) -> ImportError {
        ImportError::file(self.path, reason)
    }
    /// Exactly `N` numbers.
    pub fn numbers<const N: usize>(&self, words: &str) -> crate::Result<[f64; N]> {
        let mut out = [0.0; N];
        let mut words = words.split_ascii_whitespace();
        for x in &mut out {
            let word = words.next().ok_or_else(|| self.error(format!("{N} numbers are expected here")))?;
            *x = number(word).map_err(|e| self.error(e))?;
        }
        match words.next() {
            Some(word) => Err(self.error(format!("{:?} follows the {N} numbers", excerpt(word)))),
            None => Ok(out),
        }
    }
}

/// A number that can be a coordinate or an angle.
pub(super) fn number(word: &str) -> Result<f64, String> {
    let x: f64 = word.parse().map_err(|_| format!("{:?} is no number (write decimals with a point)", excerpt(word)))?;
    if x.abs() <= LARGEST {
        return Ok(x);
    }
    let what = if x.is_finite() { "beyond any body or angle" } else { "not finite" };
    Err(format!("the number {} is {what}; mend or cut the clip", excerpt(word)))
}
