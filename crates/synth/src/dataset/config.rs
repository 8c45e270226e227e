use crate::flesh::{FleshConfig, Material};
use crate::motion::{MOTIONS, is_known};
use crate::scanner::ScannerConfig;
use crate::subject::SubjectConfig;
use crate::{Result, SynthError};
use serde::{Deserialize, Serialize};
use softtissue_body::procedural::ProceduralConfig;
use softtissue_store::sha256_bytes;

/// Changes whenever the same configuration would give other bytes, so that cached clips are not mistaken.
const GENERATOR: u32 = 2;

/// A set of scans to make: subjects x motions x takes. Default is the size `quick`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SynthConfig {
    /// Body mass index of each subject, kg/m^2. Default 19, 23, 27, 31; the body reaches 18 to 33.
    pub bmi: Vec<f64>,
    /// Motions by name. Default all 14.
    pub motions: Vec<String>,
    /// Takes of each motion, with other tempo and amplitude. Default 1.
    pub takes: u32,
    /// Frames of a clip. Default 150; the motion has taken over from the A-pose after 0.9 s.
    pub frames: usize,
    /// Frames a second. Default 60.
    pub fps: f32,
    /// Level of the body's mesh: 0 is 1724 vertices, 1 is 6890. Default 0. The flesh is simulated on level 0.
    pub level: u8,
    /// Seed of everything drawn. Default 1.
    pub seed: u64,
    /// How people differ.
    pub subjects: SubjectConfig,
    /// What the scanner gets wrong.
    pub scanner: ScannerConfig,
    /// How the flesh is computed.
    pub flesh: FleshConfig,
    /// The mean of the hidden materials.
    pub material: Material,
}

impl Default for SynthConfig {
    fn default() -> Self {
        Self {
            bmi: vec![19.0, 23.0, 27.0, 31.0],
            motions: MOTIONS.map(str::to_owned).to_vec(),
            takes: 1,
            frames: 150,
            fps: 60.0,
            level: 0,
            seed: 1,
            subjects: SubjectConfig::default(),
            scanner: ScannerConfig::default(),
            flesh: FleshConfig::default(),
            material: Material::default(),
        }
    }
}

impl SynthConfig {
    /// Refuses what makes no sense, naming the field.
    pub fn check(&self) -> Result<()> {
        let bad = |field: &'static str, reason: String| Err(SynthError::Config { field, reason });
        if self.bmi.is_empty() || self.bmi.len() > 100 {
            return bad("bmi", format!("{} subjects; write the body mass index of 1 to 100", self.bmi.len()));
        }
        if let Some(bmi) = self.bmi.iter().find(|b| !(15.0..=45.0).contains(*b)) {
            return bad("bmi", format!("{bmi} is not a body mass index between 15 and 45 kg/m^2"));
        }
        if self.motions.is_empty() {
            return bad("motions", format!("none is named; write some of {}", MOTIONS.join(", ")));
        }
        for (i, name) in self.motions.iter().enumerate() {
            if !is_known(name) {
                return Err(SynthError::UnknownMotion { name: name.clone(), known: MOTIONS.join(", ") });
            }
            if self.motions[..i].contains(name) {
                return bad("motions", format!("{name} is named twice; raise `takes` for more of it"));
            }
        }
        if self.takes == 0 || self.takes > 1000 {
            return bad("takes", format!("{} takes; write 1 to 1000", self.takes));
        }
        if !(2..=36_000).contains(&self.frames) {
            return bad("frames", format!("{} frames; write 2 to 36000", self.frames));
        }
        if !(self.fps >= 15.0 && self.fps <= 1000.0) {
            return bad("fps", format!("{} frames a second; write 15 to 1000", self.fps));
        }
        if self.level > 1 {
            return bad("level", format!("level {} does not exist; write 0 or 1", self.level));
        }
        self.check_errors()
    }

    fn check_errors(&self) -> Result<()> {
        let (s, c) = (&self.subjects, &self.scanner);
        for (field, value, most) in [
            ("subjects.shape_scatter", s.shape_scatter, 2.0),
            ("subjects.stiffness_scatter", s.stiffness_scatter, 0.9),
            ("subjects.damping_scatter", s.damping_scatter, 0.9),
            ("subjects.detail", s.detail[0], 0.05),
            ("subjects.detail", s.detail[1], 0.05),
            ("scanner.drift", c.drift, 0.05),
            ("scanner.noise", c.noise, 0.05),
            ("scanner.rough_degrees", c.rough_degrees, 30.0),
        ] {
            if !(value >= 0.0 && value <= most) {
                return Err(SynthError::Config { field, reason: format!("{value} is not between 0 and {most}") });
            }
        }
        if s.detail[0] > s.detail[1] {
            return Err(SynthError::Config {
                field: "subjects.detail",
                reason: "the first number is the smaller one; exchange them".into(),
            });
        }
        Ok(())
    }

    /// The body that the set is made of, at its own level.
    pub fn body(&self) -> ProceduralConfig {
        ProceduralConfig { level: self.level, ..Default::default() }
    }

    /// SHA-256 over the configuration and the generator's version: names the folder of the cached clips.
    pub fn fingerprint(&self) -> String {
        // a `Value` keeps its keys sorted, so the text does not depend on the order of declaration
        let config = serde_json::to_value(self).expect("a configuration holds finite numbers, texts and lists");
        let body = serde_json::to_value(self.body()).expect("a configuration holds finite numbers, texts and lists");
        sha256_bytes(
            serde_json::json!({ "generator": GENERATOR, "config": config, "body": body }).to_string().as_bytes(),
        )
    }
}
