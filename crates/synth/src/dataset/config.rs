use crate::flesh::{FleshConfig, Material};
use crate::motion::{MOTIONS, is_known};
use crate::scanner::ScannerConfig;
use crate::subject::SubjectConfig;
use crate::{Result, SynthError};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use softtissue_body::procedural::ProceduralConfig;
use softtissue_store::{sha256_bytes, sha256_file};
use std::path::PathBuf;

/// Raised whenever the same configuration would give other bytes, so that cached clips are not mistaken. No test
/// pins those bytes: sines, logarithms and exponentials of the standard library differ in their last bits between
/// systems, and the flesh's contacts and creases let such bits grow.
const GENERATOR: u32 = 3;

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
    /// File of the body to put flesh on, as `softtissue import body` writes it. Default empty: the procedural body.
    pub body: PathBuf,
    /// Level of the procedural body's mesh: 0 is 1724 vertices, 1 is 6890. Default 0. The flesh is simulated on level 0.
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
            body: PathBuf::new(),
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
    /// Refuses what makes no sense, naming the field: this section's own settings, then those of its parts.
    ///
    /// # Errors
    /// A setting out of its range, or a motion that there is not.
    pub fn check(&self) -> Result<()> {
        let bad = |field: &'static str, reason: String| Err(SynthError::Config { field, reason });
        if self.bmi.is_empty() || self.bmi.len() > 100 {
            return bad("bmi", format!("{} subjects; write the body mass index of 1 to 100", self.bmi.len()));
        }
        if let Some(bmi) = self.bmi.iter().find(|b| !(18.0..=33.0).contains(*b)) {
            return bad("bmi", format!("{bmi} kg/m^2 is out of the body's reach; write 18 to 33"));
        }
        if self.motions.is_empty() {
            return bad("motions", format!("none is named; write some of {}", MOTIONS.join(", ")));
        }
        for (i, name) in self.motions.iter().enumerate() {
            if !is_known(name) {
                return Err(SynthError::UnknownMotion { name: name.clone(), known: MOTIONS.join(", ") });
            }
            if self.motions[..i].contains(name) {
                return bad(
                    "motions",
                    format!("{name} is named twice; write it once and raise `takes` for more of it"),
                );
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
        if self.has_body_file() && self.level != 0 {
            return bad("level", "it is of the procedural body; write 0 beside `body`".into());
        }
        self.subjects.check()?;
        self.scanner.check()?;
        self.flesh.check()?;
        self.material.check()
    }

    /// Whether the body comes from a file.
    pub fn has_body_file(&self) -> bool {
        !self.body.as_os_str().is_empty()
    }

    /// The procedural body that the set is made of, at its own level.
    pub fn procedural(&self) -> ProceduralConfig {
        ProceduralConfig { level: self.level, ..Default::default() }
    }

    /// SHA-256 over the configuration, the body and the generator's version: names the folder of the cached clips. Of a
    /// body's file the content counts, not the place.
    ///
    /// # Errors
    /// A body's file that cannot be read.
    pub fn fingerprint(&self) -> Result<String> {
        let value = |x: serde_json::Result<Value>| x.expect("a configuration holds finite numbers, texts and lists");
        // a `Value` keeps its keys sorted, so the text does not depend on the order of declaration
        let mut config = value(serde_json::to_value(self));
        let body = if self.has_body_file() {
            Value::String(sha256_file(&self.body)?)
        } else {
            value(serde_json::to_value(self.procedural()))
        };
        if let Value::Object(settings) = &mut config {
            settings.remove("body");
            if self.scanner.raw_points == 0 {
                // sets without raw scans are what they were before there were any
                settings.get_mut("scanner").and_then(Value::as_object_mut).map(|scanner| scanner.remove("raw_points"));
            }
        }
        Ok(sha256_bytes(json!({ "generator": GENERATOR, "config": config, "body": body }).to_string().as_bytes()))
    }
}
