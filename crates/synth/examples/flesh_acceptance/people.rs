//! The bodies and motions that are judged.

use glam::Vec3;
use softtissue_body::procedural::{ProceduralBody, ProceduralConfig, generate};
use softtissue_body::{Region, ShapedBody};
use softtissue_clips::{ClipId, MotionClip};
use softtissue_geometry::Frames;
use softtissue_synth::flesh::{FleshConfig, FleshRun, Material, Simulator};
use softtissue_synth::motion::{self, Request, Style};

/// Frames before this one belong to the A-pose and its blend: 0.9 s.
pub const FIRST_FRAME: usize = 54;

/// One neutral person of a given BMI.
pub struct Person<'a> {
    pub body: &'a ProceduralBody,
    pub bmi: f64,
    pub beta: Vec<f32>,
    pub shaped: ShapedBody,
}

pub fn body() -> ProceduralBody {
    generate(&ProceduralConfig { level: 0, ..ProceduralConfig::default() }).expect("the embedded body")
}

pub fn simulate(
    body: &ProceduralBody,
    beta: &[f32],
    material: &Material,
    config: &FleshConfig,
    clip: &MotionClip,
) -> FleshRun {
    Simulator::new(&body.model, &body.anatomy, beta, material, config)
        .expect("good settings")
        .run(clip)
        .unwrap_or_else(|e| panic!("{e}"))
}

impl<'a> Person<'a> {
    pub fn new(body: &'a ProceduralBody, bmi: f64) -> Self {
        let beta = body.anatomy.beta_for_bmi(bmi, &[]).expect("a BMI in range");
        let shaped = body.model.shaped(&beta);
        Self { body, bmi, beta, shaped }
    }

    pub fn simulate(&self, material: &Material, config: &FleshConfig, clip: &MotionClip) -> FleshRun {
        simulate(self.body, &self.beta, material, config, clip)
    }

    pub fn motion(&self, name: &str, frames: usize) -> MotionClip {
        let subject = format!("bmi-{:.0}", self.bmi);
        let request = Request { subject: &subject, motion: name, take: 0, frames, fps: 60.0, seed: 1 };
        motion::generate(&request, &self.shaped, &Style::default()).expect("a known motion")
    }

    /// Stands in the rest pose while the root is moved.
    pub fn moved_root(&self, name: &str, frames: usize, height: impl Fn(f32) -> f32) -> MotionClip {
        let joints = self.body.model.joint_count();
        MotionClip {
            id: ClipId::new("acceptance", name, 0),
            fps: 60.0,
            rotations: Frames::zeros(joints, frames),
            translations: (0..frames).map(|t| Vec3::new(0.0, height(t as f32 / 60.0), 0.0)).collect(),
        }
    }

    /// Vertices of the soft regions.
    pub fn soft(&self) -> Vec<usize> {
        self.body.model.regions.soft().into_iter().map(|v| v as usize).collect()
    }

    /// Vertices of a region; of the chest only those that are mostly breast.
    pub fn vertices(&self, region: Region) -> Vec<usize> {
        let breast = self.body.anatomy.breast();
        let all = self.body.model.regions.vertices(region).into_iter().map(|v| v as usize);
        all.filter(|&v| region != Region::Chest || breast[v] > 0.3).collect()
    }
}
