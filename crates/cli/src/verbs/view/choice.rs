//! Which clips, and which frames of them.

use crate::args::{FrameRange, ViewArgs};
use crate::exit::{InputError, UsageError};
use anyhow::Result;
use softtissue_clips::{ClipEntry, ClipId};
use softtissue_eval::viewer::{Pick, plan};
use std::ops::Range;
use std::path::Path;

/// Names that are told where one is unknown.
const TOLD: usize = 6;

/// What the command line asks for.
pub struct Asked {
    clips: Vec<ClipId>,
    range: Option<FrameRange>,
}

/// Clips to show, each with its frames.
pub struct Chosen {
    /// The clips.
    pub clips: Vec<(ClipId, Pick)>,
    /// What of them is not shown, a sentence each.
    pub notes: Vec<String>,
}

impl Asked {
    /// Reads the clips' names.
    pub fn new(args: &ViewArgs) -> Result<Self> {
        let clips: Vec<ClipId> = args.clips.iter().map(|c| Ok(c.parse()?)).collect::<Result<_>>()?;
        if let Some(twice) = clips.iter().enumerate().find(|(i, c)| clips[..*i].contains(c)) {
            return Err(UsageError(format!("--clip {} stands twice; name it once", twice.1)).into());
        }
        Ok(Self { clips, range: args.range })
    }

    /// The same with one clip, unless others were asked for.
    pub fn or_only(&self, id: &ClipId) -> Self {
        let clips = if self.clips.is_empty() { vec![id.clone()] } else { self.clips.clone() };
        Self { clips, range: self.range }
    }

    /// Chooses among `listed` clips, which lie at `place`: those that were asked for, or the first of `likely` that fit.
    /// `points` are those of one frame, in all layers.
    pub fn choose(&self, listed: &[ClipEntry], likely: &[ClipId], points: usize, place: &Path) -> Result<Chosen> {
        let find =
            |id: &ClipId| listed.iter().find(|c| c.id == *id).ok_or_else(|| InputError(unknown(id, listed, place)));
        let wanted: &[ClipId] = if self.clips.is_empty() { likely } else { &self.clips };
        let entries: Vec<&ClipEntry> = wanted.iter().map(find).collect::<Result<_, _>>()?;
        if entries.is_empty() {
            return Err(InputError(format!("{} holds no clip", place.display())).into());
        }
        let ranges = entries.iter().map(|e| self.frames_of(e)).collect::<Result<Vec<Range<usize>>>>()?;
        let plan = plan(&ranges, points, !self.clips.is_empty());
        let shown = plan.picks.len();
        let mut notes = Vec::new();
        if shown < listed.len() && self.clips.is_empty() {
            let of = if shown == 1 { "1 clip".into() } else { format!("{shown} clips") };
            notes.push(format!("{of} of {} shown; --clip SUBJECT/MOTION.TAKE shows others.", listed.len()));
        }
        if plan.every > 1 {
            notes.push(format!(
                "Every {} frame shown: all would make too large a page; --range A..B shows a part of them.",
                ordinal(plan.every)
            ));
        }
        let clips = entries.iter().zip(plan.picks).map(|(e, pick)| (e.id.clone(), pick)).collect();
        Ok(Chosen { clips, notes })
    }

    /// [`choose`](Self::choose) for something that is one clip.
    pub fn only(&self, entry: &ClipEntry, points: usize, place: &Path) -> Result<(Pick, Vec<String>)> {
        let mut chosen = self.or_only(&entry.id).choose(std::slice::from_ref(entry), &[], points, place)?;
        let pick = chosen.clips.pop().map(|c| c.1);
        Ok((pick.unwrap_or(Pick { start: 0, every: 1, count: entry.frames }), chosen.notes))
    }

    fn frames_of(&self, clip: &ClipEntry) -> Result<Range<usize>> {
        let Some(FrameRange { start, end }) = self.range else { return Ok(0..clip.frames) };
        let end = end.unwrap_or(clip.frames);
        if start >= end || end > clip.frames {
            return Err(UsageError(format!(
                "--range {start}..{end}: {} has {} frames; write A..B with A below B and B at most {}",
                clip.id, clip.frames, clip.frames
            ))
            .into());
        }
        Ok(start..end)
    }
}

fn ordinal(n: usize) -> String {
    let end = match (n % 10, n % 100) {
        (1, r) if r != 11 => "st",
        (2, r) if r != 12 => "nd",
        (3, r) if r != 13 => "rd",
        _ => "th",
    };
    format!("{n}{end}")
}

/// A sentence with the nearest names: the subject's own motions, or those who have the motion, or any.
fn unknown(id: &ClipId, listed: &[ClipEntry], place: &Path) -> String {
    let all = || listed.iter().map(|c| &c.id);
    let start = |name: &str| name.chars().take(3).collect::<String>();
    let like = |a: &str, b: &str| a.starts_with(&start(b));
    let by = [
        all().filter(|c| c.subject == id.subject && c.motion == id.motion).collect::<Vec<_>>(),
        all().filter(|c| c.subject == id.subject && like(&c.motion, &id.motion)).collect(),
        all().filter(|c| c.motion == id.motion).collect(),
        all().filter(|c| c.subject == id.subject).collect(),
        all().collect(),
    ];
    let nearest = by.into_iter().find(|names| !names.is_empty()).unwrap_or_default();
    let told: Vec<String> = nearest.iter().take(TOLD).map(ToString::to_string).collect();
    let more = if nearest.len() > TOLD { ", ..." } else { "" };
    format!("there is no clip {id} in {}: write one of {}{more}", place.display(), told.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entries() -> Vec<ClipEntry> {
        let entry = |s: &str, m: &str, take| ClipEntry { id: ClipId::new(s, m, take), frames: 100, fps: 60.0 };
        vec![entry("s00", "hips", 0), entry("s00", "hips", 1), entry("s00", "knees", 0), entry("s01", "punching", 0)]
    }

    fn asked(clips: &[&str], range: Option<FrameRange>) -> Asked {
        Asked { clips: clips.iter().map(|c| c.parse().unwrap()).collect(), range }
    }

    fn choose(asked: &Asked, points: usize) -> Result<Chosen> {
        let entries = entries();
        let ids: Vec<ClipId> = entries.iter().map(|e| e.id.clone()).collect();
        asked.choose(&entries, &ids, points, Path::new("set"))
    }

    #[test]
    fn unknown_clips_name_the_nearest() {
        let says = |clip: &str| choose(&asked(&[clip], None), 10).map(|_| ()).unwrap_err().to_string();
        assert_eq!(says("s00/hips.7"), "there is no clip s00/hips.7 in set: write one of s00/hips.0, s00/hips.1");
        assert!(says("s00/kneeling.0").ends_with("write one of s00/knees.0"));
        assert!(says("s07/punching.0").ends_with("write one of s01/punching.0"));
        assert!(says("s01/x.0").ends_with("write one of s01/punching.0"));
        assert!(says("bob/dances.0").contains("s00/hips.0, s00/hips.1, s00/knees.0, s01/punching.0"));
    }

    #[test]
    fn what_is_not_shown_is_said() {
        let all = choose(&asked(&[], None), 10).unwrap();
        assert_eq!((all.clips.len(), all.notes.len()), (4, 0));
        let few = choose(&asked(&[], None), 9000).unwrap();
        assert_eq!(few.clips.len(), 2);
        assert!(few.notes[0].starts_with("2 clips of 4 shown"), "{:?}", few.notes);
        let thin = choose(&asked(&["s00/hips.0", "s01/punching.0"], None), 200_000).unwrap();
        assert_eq!(thin.clips[1].1, Pick { start: 0, every: 5, count: 20 });
        assert!(thin.notes[0].starts_with("Every 5th frame shown"), "{:?}", thin.notes);
        let part = choose(&asked(&["s00/hips"], Some(FrameRange { start: 90, end: None })), 10).unwrap();
        assert_eq!(part.clips[0].1, Pick { start: 90, every: 1, count: 10 });
    }

    #[test]
    fn ranges_lie_within_the_clip() {
        for (start, end) in [(0, Some(101)), (100, None), (5, Some(5))] {
            let refused = choose(&asked(&[], Some(FrameRange { start, end })), 10).map(|_| ()).unwrap_err();
            assert!(refused.to_string().contains("s00/hips.0 has 100 frames"), "{refused}");
        }
        assert_eq!([1, 2, 3, 4, 11, 12, 13, 21, 22].map(ordinal).join(" "), "1st 2nd 3rd 4th 11th 12th 13th 21st 22nd");
    }
}
