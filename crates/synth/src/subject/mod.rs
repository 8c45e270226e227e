//! People: a shape of given body mass index, a style of moving, hidden material, and what no model has a
//! coefficient for: static detail outside the shape space and pose deformation outside the correctives.

mod detail;
mod field;
mod mismatch;

pub(crate) use field::{Waves, rms};
pub use mismatch::PoseMismatch;

use crate::checks::within;
use crate::flesh::Material;
use crate::motion::Style;
use crate::{Result, SynthError};
use glam::Vec3;
use serde::{Deserialize, Serialize};
use softtissue_body::BodyModel;
use softtissue_body::procedural::Anatomy;
use softtissue_random::Draws;

/// How far people differ from what a model can say of them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SubjectConfig {
    /// Standard deviation of the shape coefficients other than body mass. Default 0.7; 0 gives bodies that differ in
    /// mass alone.
    pub shape_scatter: f32,
    /// Whether each person has a style of moving. Default true; false moves everybody neutrally.
    pub style: bool,
    /// Largest relative difference of hidden stiffness from the mean. Default 0.2; 0 gives everybody the mean.
    pub stiffness_scatter: f32,
    /// Largest relative difference of the hidden stiffness of each region (belly, breasts, buttocks, thighs, upper
    /// arms) from the person's own, beside `stiffness_scatter`. Default 0.2; 0 gives all regions one scale.
    pub regional_scatter: f32,
    /// Largest relative difference of hidden damping from the mean. Default 0.3.
    pub damping_scatter: f32,
    /// Other than 0: the same people, shapes and styles with other hidden flesh. Default 0.
    pub other_flesh: u64,
    /// Root mean square length of the static detail outside the shape space, metres: each person's is drawn between
    /// these. Default 0.004 to 0.008; zeros turn it off.
    pub detail: [f32; 2],
    /// Whether poses deform people beyond the body's correctives. Default true.
    pub pose_mismatch: bool,
}

impl Default for SubjectConfig {
    fn default() -> Self {
        Self {
            shape_scatter: 0.7,
            style: true,
            stiffness_scatter: 0.2,
            regional_scatter: 0.2,
            damping_scatter: 0.3,
            other_flesh: 0,
            detail: [0.004, 0.008],
            pose_mismatch: true,
        }
    }
}

impl SubjectConfig {
    /// Bodies of mean shape and material, moving neutrally: what the flesh is measured on.
    pub fn neutral() -> Self {
        Self {
            shape_scatter: 0.0,
            style: false,
            stiffness_scatter: 0.0,
            regional_scatter: 0.0,
            damping_scatter: 0.0,
            other_flesh: 0,
            detail: [0.0; 2],
            pose_mismatch: false,
        }
    }

    /// Refuses what makes no sense, naming the field.
    ///
    /// # Errors
    /// A number out of its range, or sizes of detail in the wrong order.
    pub fn check(&self) -> Result<()> {
        within([
            ("subjects.shape_scatter", self.shape_scatter, 0.0..=2.0),
            ("subjects.stiffness_scatter", self.stiffness_scatter, 0.0..=0.9),
            ("subjects.regional_scatter", self.regional_scatter, 0.0..=0.9),
            ("subjects.damping_scatter", self.damping_scatter, 0.0..=0.9),
            ("subjects.detail", self.detail[0], 0.0..=0.05),
            ("subjects.detail", self.detail[1], 0.0..=0.05),
        ])?;
        if self.detail[0] > self.detail[1] {
            let reason = "the first number is the smaller one; exchange them".into();
            return Err(SynthError::Config { field: "subjects.detail", reason });
        }
        Ok(())
    }
}

/// One person.
#[derive(Clone, Debug)]
pub struct Subject {
    /// `s00`, `s01`, ...
    pub name: String,
    /// Shape coefficients `[S]`.
    pub beta: Vec<f32>,
    /// Body mass index, kg/m^2.
    pub bmi: f64,
    /// How the person moves.
    pub style: Style,
    /// Hidden material.
    pub material: Material,
    /// Static detail outside the shape space, `[V]`, metres, rest frame.
    pub detail: Vec<Vec3>,
    /// Pose deformation outside the correctives.
    pub mismatch: PoseMismatch,
}

/// Name of person number `index` of a set: `s00`, `s01`, ...
pub fn subject_name(index: usize) -> String {
    format!("s{index:02}")
}

impl Subject {
    /// Person number `index` of a run: of body mass index `bmi`, everything else from the seed. `mean` is the
    /// material that the hidden one scatters about.
    ///
    /// # Errors
    /// A body mass index that the body cannot reach.
    pub fn draw(
        body: &BodyModel,
        anatomy: &Anatomy,
        mean: &Material,
        config: &SubjectConfig,
        seed: u64,
        index: usize,
        bmi: f64,
    ) -> Result<Self> {
        let number = index as u64;
        let mut draws = Draws::new(seed, "synth-subject", number, 0);
        let shapes: Vec<f32> =
            (0..body.shape_count()).map(|_| draws.normal().clamp(-1.8, 1.8) as f32 * config.shape_scatter).collect();
        let drawn = [draws.range(-1.0, 1.0), draws.range(-1.0, 1.0)];
        let drawn = match config.other_flesh {
            0 => drawn,
            other => {
                let mut draws = Draws::new(seed, "synth-subject-flesh", number, other);
                [draws.range(-1.0, 1.0), draws.range(-1.0, 1.0)]
            }
        };
        let scatter = |drawn: f64, by: f32| 1.0 + drawn as f32 * by;
        let (stiffness, damping) =
            (scatter(drawn[0], config.stiffness_scatter), scatter(drawn[1], config.damping_scatter));
        let mut draws_of_regions = Draws::new(seed, "synth-subject-regions", number, config.other_flesh);
        let mut regional = || 1.0 + draws_of_regions.range(-1.0, 1.0) as f32 * config.regional_scatter;
        let material = Material {
            stiffness: mean.stiffness * stiffness,
            damping: mean.damping * damping,
            belly: mean.belly * regional(),
            breast: mean.breast * regional(),
            buttocks: mean.buttocks * regional(),
            thighs: mean.thighs * regional(),
            upper_arms: mean.upper_arms * regional(),
            ..mean.clone()
        };
        let beta = anatomy.beta_for_bmi(bmi, &shapes)?;
        let size = draws.range(f64::from(config.detail[0]), f64::from(config.detail[1])) as f32;
        let mut detail = vec![Vec3::ZERO; body.vertex_count()];
        if size > 0.0 {
            detail = detail::static_detail(body, &mut draws, size);
        }
        Ok(Self {
            name: subject_name(index),
            bmi: anatomy.bmi(&beta),
            style: if config.style { Style::draw(seed, number) } else { Style::neutral() },
            material,
            detail,
            mismatch: if config.pose_mismatch { PoseMismatch::draw(body, seed, number) } else { PoseMismatch::none() },
            beta,
        })
    }
}
