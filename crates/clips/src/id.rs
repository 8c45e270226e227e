use crate::ClipError;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// Who did what, which time: `subject/motion.take`.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub struct ClipId {
    /// Subject, e.g. `s02`.
    pub subject: String,
    /// Motion, e.g. `jumping_jacks`.
    pub motion: String,
    /// Take, from 0.
    pub take: u32,
}

impl ClipId {
    /// Names a clip.
    pub fn new(subject: impl Into<String>, motion: impl Into<String>, take: u32) -> Self {
        Self { subject: subject.into(), motion: motion.into(), take }
    }
    /// A file stem that sorts by subject, motion, take: `subject.motion.take`.
    pub fn stem(&self) -> String {
        format!("{}.{}.{:02}", self.subject, self.motion, self.take)
    }
    /// Whether both names can be part of a file name: letters, digits, `_` and `-`, at most 64.
    pub fn is_valid(&self) -> bool {
        let fine = |s: &str| {
            !s.is_empty() && s.len() <= 64 && s.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_' || b == b'-')
        };
        fine(&self.subject) && fine(&self.motion)
    }
}

impl fmt::Display for ClipId {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{}/{}.{}", self.subject, self.motion, self.take)
    }
}

impl FromStr for ClipId {
    type Err = ClipError;
    fn from_str(text: &str) -> Result<Self, ClipError> {
        let parse = || {
            let (subject, rest) = text.split_once('/')?;
            let (motion, take) = match rest.split_once('.') {
                Some((motion, take)) => (motion, take.parse().ok()?),
                None => (rest, 0),
            };
            Some(Self::new(subject, motion, take)).filter(Self::is_valid)
        };
        parse().ok_or_else(|| ClipError::Id { text: text.to_owned() })
    }
}
