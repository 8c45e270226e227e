use crate::{CodecCurves, SubspaceTable, Tally};
use serde::{Deserialize, Serialize};
use softtissue_clips::ClipId;
use std::collections::BTreeMap;

/// Regions whose error is kept frame by frame.
const KEPT: [&str; 3] = ["all", "soft", "belly-chest"];

/// Error of one clip frame by frame, mm.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClipCurves {
    /// Who.
    pub subject: String,
    /// What.
    pub motion: String,
    /// Which take.
    pub take: u32,
    /// Which fold of the protocol judged it, where there is more than one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fold: Option<String>,
    /// Frames a second.
    pub fps: f32,
    /// Mean error of the vertices of `all`, `soft` and `belly-chest`, by method.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub methods: BTreeMap<String, BTreeMap<String, Vec<f64>>>,
    /// Mean reconstruction error of all vertices, by latent size.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub subspace: BTreeMap<u32, CodecCurves>,
}

impl ClipCurves {
    /// The clip's name.
    pub fn id(&self) -> ClipId {
        ClipId::new(&self.subject, &self.motion, self.take)
    }
}

/// Curves of the clips that `wanted` takes, of these methods and of the subspaces.
pub fn curves(
    tally: &Tally,
    subspace: &SubspaceTable,
    methods: &[&str],
    wanted: impl Fn(&ClipId) -> bool,
) -> Vec<ClipCurves> {
    let of = |clip: &crate::ClipTally| {
        let curve = |name: &&str| {
            let sums = &clip.methods.get(*name)?.as_ref()?.reference;
            let regions = KEPT.iter().map(|region| ((*region).to_owned(), rounded(&sums.over_time(region))));
            Some(((*name).to_owned(), regions.filter(|(_, c)| !c.is_empty()).collect()))
        };
        let ClipId { subject, motion, take } = clip.id.clone();
        ClipCurves {
            fold: clip.fold.clone(),
            fps: clip.fps,
            methods: methods.iter().filter_map(curve).collect(),
            subspace: subspace.over_time.get(&clip.id).cloned().unwrap_or_default(),
            subject,
            motion,
            take,
        }
    };
    tally.clips.iter().filter(|c| wanted(&c.id)).map(of).collect()
}

/// A tenth of a micrometre is enough.
pub(crate) fn rounded(mm: &[f32]) -> Vec<f64> {
    mm.iter().map(|x| (f64::from(*x) * 1e4).round() / 1e4).collect()
}
