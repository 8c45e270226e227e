use crate::{ClipError, ClipId, Result};
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

/// Which clips are left out of training. The rest trains.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SplitConfig {
    /// Motions whose every clip is for testing. Default `running_on_spot`, `one_leg_jump`.
    pub test_motions: Vec<String>,
    /// Motions whose every clip is for model selection. Default `jumping_jacks`, `hips`.
    pub validation_motions: Vec<String>,
    /// Subjects whose every clip is for testing. Default none.
    pub test_subjects: Vec<String>,
    /// Subjects whose every clip is for model selection. Default none.
    pub validation_subjects: Vec<String>,
}

impl Default for SplitConfig {
    fn default() -> Self {
        let words = |w: &[&str]| w.iter().map(|s| (*s).to_owned()).collect();
        Self {
            test_motions: words(&["running_on_spot", "one_leg_jump"]),
            validation_motions: words(&["jumping_jacks", "hips"]),
            test_subjects: vec![],
            validation_subjects: vec![],
        }
    }
}

/// A part of a split.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Part {
    /// Seen by training.
    Train,
    /// Seen by model selection only.
    Validation,
    /// Seen by evaluation only.
    Test,
}

/// Clips by part, each sorted; no clip in two parts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Split {
    /// Seen by training.
    pub train: Vec<ClipId>,
    /// Seen by model selection only.
    pub validation: Vec<ClipId>,
    /// Seen by evaluation only.
    pub test: Vec<ClipId>,
}

impl Split {
    /// Clips to select a model by: those of validation, or those of training where there are none.
    pub fn selection(&self) -> &[ClipId] {
        if self.validation.is_empty() { &self.train } else { &self.validation }
    }
}

impl SplitConfig {
    /// Refuses a motion or subject that is named in two parts.
    pub fn check(&self) -> Result<()> {
        for (what, validation, test) in [
            ("motion", &self.validation_motions, &self.test_motions),
            ("subject", &self.validation_subjects, &self.test_subjects),
        ] {
            if let Some(both) = validation.iter().find(|name| test.contains(name)) {
                return Err(error(format!("{what} {both} is in both the validation and the test part; name it once")));
            }
        }
        Ok(())
    }

    /// Sorts clips into parts. A motion or subject named in two parts, and an empty training part, are errors.
    pub fn split(&self, clips: &[ClipId]) -> Result<Split> {
        self.check()?;
        let part_of = |id: &ClipId| {
            if self.test_motions.contains(&id.motion) || self.test_subjects.contains(&id.subject) {
                Part::Test
            } else if self.validation_motions.contains(&id.motion) || self.validation_subjects.contains(&id.subject) {
                Part::Validation
            } else {
                Part::Train
            }
        };
        let of = |part| {
            let mut ids: Vec<ClipId> = clips.iter().filter(|id| part_of(id) == part).cloned().collect();
            ids.sort();
            ids
        };
        let split = Split { train: of(Part::Train), validation: of(Part::Validation), test: of(Part::Test) };
        split.check()?;
        Ok(split)
    }
}

impl Split {
    /// Refuses a clip in two parts or twice in one, and an empty training part.
    pub fn check(&self) -> Result<()> {
        let mut seen = BTreeSet::new();
        for id in self.train.iter().chain(&self.validation).chain(&self.test) {
            if !seen.insert(id) {
                return Err(error(format!("clip {id} stands in it twice; every clip belongs to one part")));
            }
        }
        if self.train.is_empty() {
            return Err(error(
                "no clip is left to train on; name fewer motions or subjects for test and validation".into(),
            ));
        }
        Ok(())
    }
    /// The part a clip belongs to.
    pub fn part(&self, id: &ClipId) -> Option<Part> {
        [(&self.train, Part::Train), (&self.validation, Part::Validation), (&self.test, Part::Test)]
            .into_iter()
            .find(|(ids, _)| ids.contains(id))
            .map(|(_, part)| part)
    }
}

fn error(reason: String) -> ClipError {
    ClipError::Split { reason }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn clips() -> Vec<ClipId> {
        ["hips", "punching", "one_leg_jump"]
            .iter()
            .flat_map(|m| [ClipId::new("a", *m, 0), ClipId::new("b", *m, 1)])
            .collect()
    }

    #[test]
    fn parts_follow_motions_and_subjects() {
        let mut config = SplitConfig::default();
        let split = config.split(&clips()).unwrap();
        assert_eq!(split.train, [ClipId::new("a", "punching", 0), ClipId::new("b", "punching", 1)]);
        assert_eq!(split.part(&ClipId::new("b", "hips", 1)), Some(Part::Validation));
        config.test_subjects = vec!["a".into()];
        let split = config.split(&clips()).unwrap();
        assert_eq!(split.train, [ClipId::new("b", "punching", 1)]);
    }

    #[test]
    fn leaks_and_empty_training_are_refused() {
        let leak = SplitConfig { validation_motions: vec!["one_leg_jump".into()], ..Default::default() };
        assert!(leak.split(&clips()).unwrap_err().to_string().contains("one_leg_jump"));
        let all = SplitConfig { test_subjects: vec!["a".into(), "b".into()], ..Default::default() };
        assert!(all.split(&clips()).unwrap_err().to_string().contains("train on"));
        let twice = Split { train: clips(), validation: vec![clips()[0].clone()], test: vec![] };
        assert!(twice.check().is_err());
    }
}
