use crate::checks::within;
use crate::{Result, SynthError};
use serde::{Deserialize, Serialize};

/// Which physics moves the flesh.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FleshLaw {
    /// Stable neo-Hookean with a shear modulus that grows with stretch; two layers.
    #[default]
    Stiffening,
    /// Gent's energy, three layers, less of the damping that grows with frequency: a second world for tests,
    /// never for training data.
    Second,
}

/// How the flesh is computed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct FleshConfig {
    /// The physics. Default `stiffening`.
    pub law: FleshLaw,
    /// Steps in 1/60 s. Default 32: the stable step of 7 mm elements is about 0.7 ms; more only costs time.
    pub substeps: usize,
    /// Acceleration of gravity, m/s^2. Default 9.81; 0 takes away the lift in flight and the sag of turned parts.
    pub gravity: f32,
    /// Greatest depth of the shell under the skin, m. Default 0.11; more makes the belly slower and larger.
    pub depth: f32,
    /// Columns shallower than this stand still, m. Default 0.014; less needs a smaller step.
    pub shallow: f32,
}

impl Default for FleshConfig {
    fn default() -> Self {
        Self { law: FleshLaw::default(), substeps: 32, gravity: 9.81, depth: 0.11, shallow: 0.014 }
    }
}

impl FleshConfig {
    /// Refuses what cannot be simulated, naming the field.
    ///
    /// # Errors
    /// A number out of its range.
    pub fn check(&self) -> Result<()> {
        if !(1..=4096).contains(&self.substeps) {
            let reason = format!("{} is out of range; write 1 to 4096", self.substeps);
            return Err(SynthError::Config { field: "flesh.substeps", reason });
        }
        within([
            ("flesh.gravity", self.gravity, 0.0..=100.0),
            ("flesh.depth", self.depth, 0.01..=0.5),
            ("flesh.shallow", self.shallow, 0.001..=0.5),
        ])
    }
}

/// What a person's flesh is made of. The two scales carry a subject's hidden scatter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Material {
    /// Times all stiffnesses. Default 1; higher raises every frequency by its root.
    pub stiffness: f32,
    /// Times all damping. Default 1.
    pub damping: f32,
    /// Shear modulus of fat, Pa. Default 190: linear tetrahedra of 2-3 cm are about three times too stiff against
    /// the 500-750 Pa of fat in vivo.
    pub fat: f32,
    /// How fast fat softens with body mass: `exp(-softening m)` at `m` units over the mean. Default 0.2: the walls
    /// between the lobes thin out as they grow.
    pub softening: f32,
    /// Breast tissue relative to fat. Default 0.75.
    pub breast: f32,
    /// All flesh of the belly relative to its place in the body. Default 1, as for the next three.
    pub belly: f32,
    /// The same of the buttocks. Default 1.
    pub buttocks: f32,
    /// The same of the thighs. Default 1.
    pub thighs: f32,
    /// The same of the upper arms. Default 1.
    pub upper_arms: f32,
    /// Shear modulus of relaxed muscle, Pa. Default 2500.
    pub muscle: f32,
    /// Shear modulus of the abdomen's content in a lean body, Pa above `viscera`, at one unit of mass under the mean;
    /// falls by `e` per unit. Default 3600.
    pub viscera_lean: f32,
    /// Shear modulus of the abdomen's content in a heavy body, Pa. Default 600.
    pub viscera: f32,
    /// Resistance to change of volume, Pa. Default 36000; higher keeps volume better and needs a smaller step.
    pub bulk: f32,
    /// Mass density, kg/m^3. Default 960.
    pub density: f32,
    /// Viscosity of fat over its shear modulus, s. Default 0.010: damping that grows with frequency.
    pub viscosity: f32,
    /// The same for breast tissue, s. Default 0.018.
    pub breast_viscosity: f32,
    /// Drag relative to the skinned body, 1/s. Default 4.5: damping that falls with frequency.
    pub drag: f32,
    /// Tension of slack skin per strain and per length of an edge of the mesh, N/m. Default 20; a quarter of it in
    /// compression.
    pub skin: f32,
    /// The same per cubed strain, N/m. Default 35000: what makes large movements stiffer than small ones.
    pub skin_growth: f32,
    /// Skin of the breast relative to the rest. Default 0.6.
    pub breast_skin: f32,
}

impl Default for Material {
    fn default() -> Self {
        Self {
            stiffness: 1.0,
            damping: 1.0,
            fat: 190.0,
            softening: 0.2,
            breast: 0.75,
            belly: 1.0,
            buttocks: 1.0,
            thighs: 1.0,
            upper_arms: 1.0,
            muscle: 2500.0,
            viscera_lean: 3600.0,
            viscera: 600.0,
            bulk: 36_000.0,
            density: 960.0,
            viscosity: 0.010,
            breast_viscosity: 0.018,
            drag: 4.5,
            skin: 20.0,
            skin_growth: 35_000.0,
            breast_skin: 0.6,
        }
    }
}

impl Material {
    /// Refuses what cannot be simulated, naming the field.
    ///
    /// # Errors
    /// A number out of its range.
    pub fn check(&self) -> Result<()> {
        let factor = || 0.01..=100.0;
        let modulus = || 1.0..=1e7;
        within([
            ("material.stiffness", self.stiffness, factor()),
            ("material.damping", self.damping, factor()),
            ("material.fat", self.fat, modulus()),
            ("material.softening", self.softening, 0.0..=2.0),
            ("material.breast", self.breast, factor()),
            ("material.belly", self.belly, factor()),
            ("material.buttocks", self.buttocks, factor()),
            ("material.thighs", self.thighs, factor()),
            ("material.upper_arms", self.upper_arms, factor()),
            ("material.muscle", self.muscle, modulus()),
            ("material.viscera_lean", self.viscera_lean, 0.0..=1e7),
            ("material.viscera", self.viscera, modulus()),
            ("material.bulk", self.bulk, modulus()),
            ("material.density", self.density, 10.0..=1e5),
            ("material.viscosity", self.viscosity, 0.0..=10.0),
            ("material.breast_viscosity", self.breast_viscosity, 0.0..=10.0),
            ("material.drag", self.drag, 0.0..=1e4),
            ("material.skin", self.skin, 0.0..=1e6),
            ("material.skin_growth", self.skin_growth, 0.0..=1e8),
            ("material.breast_skin", self.breast_skin, 0.0..=100.0),
        ])
    }
}
