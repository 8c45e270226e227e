use super::assembly::Assembly;
use super::columns::{Columns, Tissue};
use super::config::{FleshConfig, FleshLaw, Material};
use super::contact::Limbs;
use super::interval::Interval;
use super::law::{Gent, Law, Stiffening};
use super::state::{State, Statistics};
use super::targets::{Target, check_motion};
use crate::{Result, SynthError};
use softtissue_body::procedural::Anatomy;
use softtissue_body::{BodyModel, ShapedBody};
use softtissue_clips::MotionClip;
use softtissue_geometry::Frames;

/// The flesh of one person, ready for any motion.
#[derive(Clone, Debug)]
pub struct Simulator<'a> {
    pub(super) body: &'a BodyModel,
    pub(super) shaped: ShapedBody,
    pub(super) columns: Columns,
    pub(super) assembly: Assembly,
    pub(super) limbs: Limbs,
    pub(super) config: FleshConfig,
}

/// What a simulation gives.
#[derive(Clone, Debug, PartialEq)]
pub struct FleshRun {
    /// Displacement of the skin in the rest frame `[T, V, 3]`, m; the first frame is zero.
    pub deltas: Frames,
    /// How it went.
    pub statistics: Statistics,
}

impl<'a> Simulator<'a> {
    /// Prepares the flesh of `body` at shape `beta`. The rest pose is the neutral one of gravity.
    pub fn new(
        body: &'a BodyModel,
        anatomy: &Anatomy,
        beta: &[f32],
        material: &Material,
        config: &FleshConfig,
    ) -> Result<Self> {
        let shaped = body.shaped(beta);
        let tissue = Tissue::new(anatomy, beta, &shaped);
        Self::with_tissue(body, shaped, &tissue, material, config)
    }

    pub(super) fn with_tissue(
        body: &'a BodyModel,
        shaped: ShapedBody,
        tissue: &Tissue,
        material: &Material,
        config: &FleshConfig,
    ) -> Result<Self> {
        material.check()?;
        config.check()?;
        let columns = Columns::new(body, &shaped, tissue, material, config);
        let assembly = Assembly::new(&columns, body, material, config);
        let limbs = Limbs::new(&body.skeleton, body, &shaped);
        Ok(Self { body, shaped, columns, assembly, limbs, config: config.clone() })
    }

    /// Elements that are computed.
    pub fn element_count(&self) -> usize {
        self.assembly.element_count()
    }

    /// Depth of the shell under each skin vertex `[V]`, m; zero where the flesh stands still.
    pub fn depths(&self) -> Vec<f32> {
        let v = self.shaped.vertices.len();
        let core = self.columns.layers * v;
        (0..v)
            .map(|i| {
                let depth = (self.columns.rest[core + i] - self.columns.rest[i]).length();
                if self.columns.free[i] { depth } else { 0.0 }
            })
            .collect()
    }

    /// Moves the flesh with `motion` from rest at its first frame. Runs on the calling thread alone, so that the
    /// result depends on nothing else.
    pub fn run(&self, motion: &MotionClip) -> Result<FleshRun> {
        let failed = |reason: String| SynthError::Flesh { clip: motion.id.to_string(), reason };
        check_motion(self.body, motion).map_err(failed)?;
        match self.config.law {
            FleshLaw::Stiffening => self.run_law::<Stiffening>(motion),
            FleshLaw::Second => self.run_law::<Gent>(motion),
        }
        .map_err(failed)
    }

    fn run_law<L: Law>(&self, motion: &MotionClip) -> std::result::Result<FleshRun, String> {
        let steps = ((self.config.substeps as f32 * 60.0 / motion.fps).round() as usize).max(1);
        let dt = 1.0 / (motion.fps * steps as f32);
        let target =
            |frame: usize| Target::new(self.body, &self.shaped, &self.assembly, motion, frame.min(motion.len() - 1));
        let mut window = [target(0), target(0), target(1), target(2)];
        let mut state = State::new(self, &window, motion.fps);
        let mut deltas = Frames::zeros(self.body.vertex_count(), 1);
        for frame in 1..motion.len() {
            let interval = Interval::new(self, &window, motion.fps);
            for step in 0..steps {
                state.step::<L>(self, &window, &interval, step, steps, dt);
            }
            deltas.push(&state.deltas(self, &window[2]));
            state.end_frame(self, &window[2]);
            if !state.is_finite() {
                return Err(format!("the flesh is not finite in frame {frame}; raise flesh.substeps"));
            }
            window.rotate_left(1);
            window[3] = target(frame + 2);
        }
        Ok(FleshRun { deltas, statistics: state.statistics })
    }
}
