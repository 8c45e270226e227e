use crate::report::is_channel;
use crate::tally::{ClipTally, method_metrics};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

/// One person's clips taken together.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PersonMetrics {
    /// Fitted shape coefficient that falls as mass rises.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub beta_1: Option<f64>,
    /// Each method on the main source of pose; without one that diverged.
    pub methods: BTreeMap<String, PersonFigures>,
}

/// One method on one person.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PersonFigures {
    /// Mean distance to the reference deltas over all vertices, mm.
    pub mean_mm: f64,
    /// The same over soft vertices.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub soft_mm: Option<f64>,
    /// Sum of errors over sum of body-alone errors, soft vertices.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub soft_ratio: Option<f64>,
    /// Rms speed over the reference's, soft regions that move.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub energy_ratio: Option<f64>,
}

/// The clips' figures person by person.
pub(crate) fn people(clips: &[ClipTally]) -> BTreeMap<String, PersonMetrics> {
    let names: BTreeSet<&String> = clips.iter().map(|c| &c.id.subject).collect();
    names.into_iter().map(|name| (name.clone(), person(clips, name))).collect()
}

fn person(clips: &[ClipTally], name: &str) -> PersonMetrics {
    let own: Vec<&ClipTally> = clips.iter().filter(|c| c.id.subject == name).collect();
    let methods: BTreeSet<&String> = own.iter().flat_map(|c| c.methods.keys()).filter(|m| !is_channel(m)).collect();
    let figures = |method: &&String| {
        let tallies: Vec<_> = own.iter().filter_map(|c| c.methods.get(*method)).collect();
        let pooled = method_metrics(&tallies);
        let soft = pooled.regions.get("soft").copied().unwrap_or_default();
        Some(PersonFigures {
            mean_mm: pooled.regions.get("all")?.mean_mm?,
            soft_mm: soft.mean_mm,
            soft_ratio: pooled.soft_ratio,
            energy_ratio: soft.energy_ratio,
        })
    };
    PersonMetrics {
        beta_1: own.iter().find_map(|c| c.beta_1).map(f64::from),
        methods: methods.iter().filter_map(|m| Some(((*m).clone(), figures(m)?))).collect(),
    }
}
