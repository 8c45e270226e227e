//! Protocols as lists of folds: who trains, who selects, who is judged. Training them is the caller's business.

use crate::{EvalError, Result};
use serde::{Deserialize, Serialize};
use softtissue_clips::{ClipId, Split, SplitConfig};
use std::collections::BTreeSet;

/// One round of a protocol: train on `split.train`, select on `split.validation`, judge on `split.test`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Fold {
    /// What is left out, e.g. `s02/one_leg_jump`.
    pub name: String,
    /// Who sees what.
    pub split: Split,
}

/// Which folds of a protocol to run.
#[derive(Clone, Debug, PartialEq)]
pub enum FoldChoice {
    /// All of them.
    All,
    /// Those of [`NETWORK_MOTIONS`] of one subject, usually the heaviest: the default for networks.
    Networks {
        /// Whose.
        subject: String,
    },
    /// Those that are named: a motion, a subject, `subject/motion`, or one of Dyna's cases.
    Named(Vec<String>),
}

/// Motions that Casas and Otaduy leave out in their evidence (2018, section 6).
pub const NETWORK_MOTIONS: [&str; 3] = ["one_leg_jump", "running_on_spot", "jumping_jacks"];

/// Leave one sequence out: a fold for each motion of each subject, all its takes together. The validation motions of
/// the split go on selecting, less what is left out.
pub fn leave_one_sequence_out(clips: &[ClipId], split: &SplitConfig, choice: &FoldChoice) -> Result<Vec<Fold>> {
    let sequences: BTreeSet<(&str, &str)> = clips.iter().map(|c| (c.subject.as_str(), c.motion.as_str())).collect();
    let folds = sequences.into_iter().map(|(subject, motion)| {
        let name = format!("{subject}/{motion}");
        let fold = fold(name, clips, split, |c| c.subject == subject && c.motion == motion);
        (subject, motion, fold)
    });
    choose(folds, choice)
}

/// Leave one subject out: a fold for each subject.
pub fn leave_one_subject_out(clips: &[ClipId], split: &SplitConfig, choice: &FoldChoice) -> Result<Vec<Fold>> {
    let subjects: BTreeSet<&str> = clips.iter().map(|c| c.subject.as_str()).collect();
    if subjects.len() < 2 {
        return Err(EvalError::Refused(
            "leaving one subject out needs at least two subjects; import or make more".into(),
        ));
    }
    let folds = subjects.into_iter().map(|s| (s, "", fold(s.to_owned(), clips, split, |c| c.subject == s)));
    choose(folds, choice)
}

/// Dyna's four cases (Pons-Moll et al. 2015, section 6.1): a motion that a known subject did not perform in training but
/// others did, a motion that nobody did, a known motion of a new subject, and both new. One fold each, all judged on the
/// last take of one sequence, whose other takes nobody sees; a case that the clips do not allow (nobody else performs
/// the motion, no second subject) is left out. `choice` names cases.
pub fn dyna_cases(
    clips: &[ClipId],
    split: &SplitConfig,
    subject: &str,
    motion: &str,
    choice: &FoldChoice,
) -> Result<Vec<Fold>> {
    let is = |c: &ClipId| (c.subject == subject, c.motion == motion);
    let last_take = clips.iter().filter(|c| is(c) == (true, true)).map(|c| c.take).max();
    let Some(last_take) = last_take else {
        return Err(EvalError::Refused(format!(
            "there is no clip {subject}/{motion}; `softtissue inspect` lists what is there"
        )));
    };
    let test = |c: &ClipId| is(c) == (true, true) && c.take == last_take;
    let case = |name: &str, unseen: &dyn Fn(&ClipId) -> bool| {
        let known: Vec<ClipId> = clips.iter().filter(|c| test(c) || !unseen(c)).cloned().collect();
        fold(name.to_owned(), &known, split, test)
    };
    let mut folds: Vec<(&str, &str, Result<Fold>)> = Vec::new();
    let mut push = |name: &'static str, unseen: &dyn Fn(&ClipId) -> bool| folds.push((name, "", case(name, unseen)));
    if clips.iter().any(|c| is(c) == (false, true)) {
        push("new-instance", &|c| is(c) == (true, true));
    }
    // a new motion is new for everybody: others' takes of it would show it
    push("new-motion", &|c| is(c).1);
    if clips.iter().any(|c| c.subject != subject) {
        push("new-subject", &|c| is(c).0);
        push("new-both", &|c| is(c).0 || is(c).1);
    }
    choose(folds.into_iter(), choice)
}

fn fold(name: String, clips: &[ClipId], split: &SplitConfig, left_out: impl Fn(&ClipId) -> bool) -> Result<Fold> {
    let of = |take: &dyn Fn(&ClipId) -> bool| {
        let mut ids: Vec<ClipId> = clips.iter().filter(|c| take(c)).cloned().collect();
        ids.sort();
        ids
    };
    let selects =
        |c: &ClipId| split.validation_motions.contains(&c.motion) || split.validation_subjects.contains(&c.subject);
    let split = Split {
        train: of(&|c| !left_out(c) && !selects(c)),
        validation: of(&|c| !left_out(c) && selects(c)),
        test: of(&|c| left_out(c)),
    };
    split.check()?;
    Ok(Fold { name, split })
}

fn choose<'a>(folds: impl Iterator<Item = (&'a str, &'a str, Result<Fold>)>, choice: &FoldChoice) -> Result<Vec<Fold>> {
    let mut used = BTreeSet::new();
    let mut chosen = Vec::new();
    for (subject, motion, fold) in folds {
        let take = match choice {
            FoldChoice::All => true,
            FoldChoice::Networks { subject: s } => {
                s == subject && (motion.is_empty() || NETWORK_MOTIONS.contains(&motion))
            }
            FoldChoice::Named(names) => {
                let both = format!("{subject}/{motion}");
                let hits = names.iter().filter(|n| *n == subject || *n == motion || **n == both);
                hits.map(|n| used.insert(n.clone())).count() > 0
            }
        };
        if take {
            chosen.push(fold?);
        }
    }
    if let FoldChoice::Named(names) = choice
        && let Some(unknown) = names.iter().find(|n| !used.contains(*n))
    {
        return Err(EvalError::Refused(format!(
            "no fold leaves out {unknown:?}: name a motion, a subject, subject/motion or case that the data allow"
        )));
    }
    if chosen.is_empty() {
        return Err(EvalError::Refused(
            "the protocol has no fold on these clips; use `--folds all` or name some".into(),
        ));
    }
    Ok(chosen)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn clips() -> Vec<ClipId> {
        let mut ids = Vec::new();
        for s in ["a", "b"] {
            for m in ["one_leg_jump", "running_on_spot", "jumping_jacks", "hips", "punching"] {
                ids.extend((0..2).map(|take| ClipId::new(s, m, take)));
            }
        }
        ids
    }

    /// Every fold keeps its parts apart, and what it leaves out is in no other part.
    fn check(folds: &[Fold]) {
        for f in folds {
            f.split.check().unwrap();
            assert!(!f.split.test.is_empty() && !f.split.train.is_empty(), "{}", f.name);
        }
    }

    #[test]
    fn every_sequence_is_left_out_once_with_all_its_takes() {
        let folds = leave_one_sequence_out(&clips(), &SplitConfig::default(), &FoldChoice::All).unwrap();
        check(&folds);
        assert_eq!(folds.len(), 10);
        let mut tested: Vec<ClipId> = folds.iter().flat_map(|f| f.split.test.clone()).collect();
        tested.sort();
        let mut all = clips();
        all.sort();
        assert_eq!(tested, all);
        let jacks = folds.iter().find(|f| f.name == "b/jumping_jacks").unwrap();
        assert_eq!(jacks.split.test.len(), 2);
        assert!(jacks.split.validation.contains(&ClipId::new("a", "jumping_jacks", 0)));
        assert!(!jacks.split.validation.contains(&ClipId::new("b", "jumping_jacks", 0)));
        assert!(jacks.split.train.contains(&ClipId::new("a", "one_leg_jump", 0)), "the rest trains, test motions too");
    }

    #[test]
    fn networks_run_three_folds_of_one_subject() {
        let choice = FoldChoice::Networks { subject: "b".into() };
        let folds = leave_one_sequence_out(&clips(), &SplitConfig::default(), &choice).unwrap();
        let names: Vec<&str> = folds.iter().map(|f| f.name.as_str()).collect();
        assert_eq!(names, ["b/jumping_jacks", "b/one_leg_jump", "b/running_on_spot"]);
    }

    #[test]
    fn named_folds_must_exist() {
        let run = |names: &[&str]| {
            let choice = FoldChoice::Named(names.iter().map(|s| (*s).to_owned()).collect());
            leave_one_sequence_out(&clips(), &SplitConfig::default(), &choice)
        };
        assert_eq!(run(&["hips"]).unwrap().len(), 2);
        assert_eq!(run(&["a/hips", "b"]).unwrap().len(), 6);
        assert!(run(&["hips", "hop"]).unwrap_err().to_string().contains("\"hop\""));
    }

    #[test]
    fn a_left_out_subject_is_seen_by_nobody() {
        let folds = leave_one_subject_out(&clips(), &SplitConfig::default(), &FoldChoice::All).unwrap();
        check(&folds);
        assert_eq!(folds.len(), 2);
        for f in &folds {
            assert_eq!(f.split.test.len(), 10);
            assert!(f.split.train.iter().chain(&f.split.validation).all(|c| c.subject != f.name));
        }
        let one: Vec<ClipId> = clips().into_iter().filter(|c| c.subject == "a").collect();
        assert!(leave_one_subject_out(&one, &SplitConfig::default(), &FoldChoice::All).is_err());
    }

    #[test]
    fn dynas_cases_hide_what_their_names_say() {
        let folds = dyna_cases(&clips(), &SplitConfig::default(), "b", "one_leg_jump", &FoldChoice::All).unwrap();
        check(&folds);
        let seen = |name: &str, f: &dyn Fn(&ClipId) -> bool| {
            let fold = folds.iter().find(|x| x.name == name).unwrap();
            assert_eq!(fold.split.test, [ClipId::new("b", "one_leg_jump", 1)]);
            fold.split.train.iter().chain(&fold.split.validation).any(f)
        };
        let (subject, motion) = (|c: &ClipId| c.subject == "b", |c: &ClipId| c.motion == "one_leg_jump");
        assert!(!seen("new-instance", &|c| subject(c) && motion(c)));
        assert!(seen("new-instance", &subject) && seen("new-instance", &motion));
        assert!(!seen("new-motion", &motion) && seen("new-motion", &subject));
        assert!(!seen("new-subject", &subject) && seen("new-subject", &motion));
        assert!(!seen("new-both", &|c| subject(c) || motion(c)));
        let run = |subject: &str, names: &[&str]| {
            let choice = FoldChoice::Named(names.iter().map(|s| (*s).to_owned()).collect());
            dyna_cases(&clips(), &SplitConfig::default(), subject, "hips", &choice)
        };
        assert_eq!(run("a", &["new-both"]).unwrap()[0].name, "new-both");
        assert!(run("a", &["new-shoes"]).unwrap_err().to_string().contains("\"new-shoes\""));
        assert!(run("c", &["new-both"]).is_err(), "a subject that is not there");
    }
}
