use crate::Result;
use crate::set::{ClipQuality, FittedPeople};
use softtissue_clips::{ClipEntry, ClipId, FitSet, FittedSubject, Split};
use std::collections::BTreeSet;
use std::path::Path;

/// People of a split whose fit is taken from finished sets.
pub(crate) struct TakenPeople(Vec<Taken>);

struct Taken {
    set: FitSet,
    subject: FittedSubject,
    clips: Vec<ClipEntry>,
    quality: Vec<ClipQuality>,
}

impl TakenPeople {
    /// Those of `fitted` who train in this split and whose set has every clip of theirs that is asked for.
    pub(crate) fn read(fitted: &FittedPeople, split: &Split, ids: &BTreeSet<&ClipId>) -> Result<Self> {
        let trains: BTreeSet<&str> = split.train.iter().map(|id| id.subject.as_str()).collect();
        let mut taken = vec![];
        for (name, root) in fitted.iter().filter(|(name, _)| trains.contains(name.as_str())) {
            let set = FitSet::open(root)?;
            let wanted = |id: &ClipId| id.subject == *name && ids.contains(id);
            let clips: Vec<ClipEntry> = set.clips().iter().filter(|c| wanted(&c.id)).cloned().collect();
            if clips.len() == ids.iter().filter(|id| id.subject == *name).count() {
                let quality: Vec<ClipQuality> = softtissue_store::read_json(&root.join("quality.json"))?;
                let quality = quality.into_iter().filter(|q| wanted(&q.id)).collect();
                taken.push(Taken { subject: set.subject(name)?, set, clips, quality });
            }
        }
        Ok(Self(taken))
    }

    pub(crate) fn holds(&self, name: &str) -> bool {
        self.0.iter().any(|t| t.subject.subject == name)
    }

    pub(crate) fn subjects(&self) -> impl Iterator<Item = &FittedSubject> {
        self.0.iter().map(|t| &t.subject)
    }

    pub(crate) fn quality(&self) -> impl Iterator<Item = &ClipQuality> {
        self.0.iter().flat_map(|t| &t.quality)
    }

    pub(crate) fn clips(&self) -> impl Iterator<Item = ClipEntry> {
        self.0.iter().flat_map(|t| t.clips.iter().cloned())
    }

    /// Writes what was taken into another set, read and checked on the way.
    pub(crate) fn copy(&self, out: &Path) -> Result<()> {
        for taken in &self.0 {
            taken.subject.write(&FitSet::subject_path(out, &taken.subject.subject))?;
            for clip in &taken.clips {
                taken.set.motion(&clip.id)?.write(&FitSet::motion_path(out, &clip.id))?;
                taken.set.deltas(&clip.id)?.write(&FitSet::delta_path(out, &clip.id))?;
            }
        }
        Ok(())
    }
}
