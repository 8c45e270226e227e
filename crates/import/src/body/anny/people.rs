use super::bones::JOINTS;
use super::cavities::Cut;
use super::mesh::BaseMesh;
use super::phenotype::Phenotype;
use super::source::Source;
use super::targets::Target;
use super::{arms, bones};
use crate::{ImportError, Result};
use glam::Vec3;
use softtissue_body::procedural::SampledPerson;
use softtissue_monitor::Monitor;

/// Everybody whom the phenotypes can make.
pub struct People<'a> {
    base: &'a BaseMesh,
    cut: &'a Cut,
    weights: &'a [[f32; JOINTS]],
    targets: Vec<Target>,
}

impl<'a> People<'a> {
    /// Reads the targets, and refuses a base mesh without the cubes that joints are read from.
    pub fn read(
        source: &Source,
        base: &'a BaseMesh,
        cut: &'a Cut,
        weights: &'a [[f32; JOINTS]],
        monitor: &dyn Monitor,
    ) -> Result<Self> {
        bones::joints(base, &base.vertices)
            .map_err(|reason| source.place("3dobjs/base.obj").refuse(format!("{reason}; get the package again")))?;
        Ok(Self { base, cut, weights, targets: Target::read_all(source, base.vertices.len(), monitor)? })
    }

    /// The middle of everything.
    pub fn neutral(&self) -> SampledPerson {
        self.person(&Phenotype::NEUTRAL)
    }

    /// `count` adults.
    pub fn sample(&self, count: usize, seed: u64, monitor: &dyn Monitor) -> Result<Vec<SampledPerson>> {
        let person = |i: usize| {
            if monitor.should_stop() {
                Err(ImportError::Stopped)
            } else {
                Ok(self.person(&Phenotype::draw(seed, i as u64)))
            }
        };
        (0..count).map(person).collect()
    }

    /// Vertices of the whole base mesh with its helpers, metres.
    pub fn whole(&self, phenotype: &Phenotype) -> Vec<Vec3> {
        let mut vertices = self.base.vertices.clone();
        self.targets.iter().for_each(|t| t.add(phenotype, &mut vertices));
        vertices
    }

    /// Somebody standing with the soles at `y = 0` and straight arms.
    fn person(&self, phenotype: &Phenotype) -> SampledPerson {
        let mut whole = self.whole(phenotype);
        let (sole, _) = self.base.body_extent(&whole);
        whole.iter_mut().for_each(|p| p.y -= sole);
        // Its cubes were looked for on reading.
        let mut joints = bones::joints(self.base, &whole).unwrap_or_default();
        let mut vertices = self.cut.vertices(&whole);
        arms::straighten(&mut vertices, &mut joints, self.weights);
        SampledPerson { vertices, joints }
    }
}
