use super::ar2::{Ar2Config, Lags, Moments};
use super::ladder::FeatureSet;
use super::readout::{Selected, select};
use super::score::{Score, SoftScore};
use crate::{ModelError, TrainingClip};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use softtissue_body::{BodyBuild, BodyModel};
use softtissue_bundle::descriptor::{FeatureBlock, FeatureScaling};
use softtissue_bundle::{AutoregressiveModel, DeltaBasis, PersonDynamics};

/// Dyna (Pons-Moll et al. 2015) in the vertex form of DMPL: how it is learned.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct DynaConfig {
    /// Order of the autoregression: 2 (default), or 0, which sees the motion of this frame alone (the paper's fig. 6).
    pub order: usize,
    /// Principal components at most. Default 300, as published; `subspace.pca.components` are learned.
    pub components: usize,
    /// Part of the variance that the components hold; where fewer do, fewer are taken. Default 0.95, as published.
    pub variance: f64,
    /// Kernel width of the mixture over people, kg/m^2: smaller follows the person nearest in body mass index, larger
    /// the mean of all. Default 2, as published.
    pub tau: f32,
    /// Whether mirrored clips are added. Default false: the paper does not.
    pub mirror: bool,
    /// Ridge strengths and pole radius of the autoregressions; the paper says "careful regularization" and no more.
    pub ar2: Ar2Config,
}

impl Default for DynaConfig {
    fn default() -> Self {
        Self { order: 2, components: 300, variance: 0.95, tau: 2.0, mirror: false, ar2: Ar2Config::default() }
    }
}

impl DynaConfig {
    /// Refuses settings that nothing can be learned with.
    pub fn check(&self) -> Result<(), ModelError> {
        let refuse = |reason: String| Err(ModelError::Config(reason));
        if !matches!(self.order, 0 | 2) {
            return refuse(format!("dyna.order is {}; write 2, or 0 for no memory", self.order));
        }
        if self.components == 0 {
            return refuse("dyna.components is 0; write 1 or more".into());
        }
        if !(self.variance > 0.0 && self.variance <= 1.0) {
            return refuse(format!("dyna.variance is {}; write more than 0 and at most 1", self.variance));
        }
        if !(0.01..=1e4).contains(&self.tau) {
            return refuse(format!("dyna.tau is {}; write 0.01 to 10000 kg/m^2", self.tau));
        }
        if self.ar2.strengths.is_empty() {
            return refuse("dyna.ar2.strengths is empty; write one or more ridge strengths".into());
        }
        self.ar2.check()
    }
}

/// Learns everybody's autoregression by weighted risk (eqs. 24-25) and mixes them by body mass index (eqs. 21-22). One
/// ridge strength serves all; free rollouts of the mixture on the validation clips choose it by their soft ratio.
///
/// `set` holds [`dyna_descriptor`](super::dyna_descriptor)'s features, and coefficients in `basis`.
pub fn fit_dyna(
    config: &DynaConfig,
    basis: &DeltaBasis,
    body: &BodyModel,
    set: FeatureSet,
) -> Result<Selected<AutoregressiveModel>, ModelError> {
    config.check()?;
    // The pose itself is no input of Dyna.
    let blocks: Vec<FeatureBlock> = set.blocks.iter().filter(|b| b.name != "rotations").cloned().collect();
    let features: Vec<&[f32]> = set.train.iter().map(|c| c.features.as_slice()).collect();
    let input = FeatureScaling::fit(&features, &blocks);
    let build = BodyBuild::fit(body);
    let people = People::gather(set.train, &input, &build)?;
    let (rest, measure) = (basis.rest_coefficients(), SoftScore::new(basis, body));
    let held: Vec<Vec<f32>> = set.validation.par_iter().map(|c| input.apply_clip(&c.features)).collect();
    let lags = if config.order == 0 { Lags::None } else { Lags::Two { radius: config.ar2.pole_radius } };
    let (model, strength, score, tried) = select(&config.ar2.strengths, |strength| {
        let model = AutoregressiveModel {
            input: input.clone(),
            basis: basis.clone(),
            build: build.clone(),
            tau: config.tau,
            people: people.solve(strength, lags)?,
        };
        let clip = |(clip, x): (&TrainingClip, &Vec<f32>)| {
            measure.clip(&model.mixed(&clip.beta).rollout(x, &rest), &clip.coefficients)
        };
        let clips: Vec<Score> = set.validation.par_iter().zip(&held).map(clip).collect();
        Ok((model, clips))
    })?;
    Ok(Selected { model, strength, score, tried })
}

/// Everybody's data, summed once for all strengths.
struct People {
    /// Name, body mass index, sums.
    each: Vec<(String, f32, Moments)>,
}

impl People {
    fn gather(train: &[TrainingClip], input: &FeatureScaling, build: &BodyBuild) -> Result<Self, ModelError> {
        let each = super::ladder::subjects_of(train)
            .into_par_iter()
            .map(|name| {
                let own: Vec<&TrainingClip> = train.iter().filter(|c| c.id.subject == name).collect();
                let bmi = build.bmi(own.first().map_or(&[], |c| &c.beta));
                if !(bmi.is_finite() && bmi > 0.0) {
                    return Err(ModelError::Data(format!(
                        "{name}'s shape has a body mass index of {bmi}; fit it again"
                    )));
                }
                Ok((name, bmi, Moments::new(input, &own)?))
            })
            .collect::<Result<Vec<_>, _>>()?;
        if each.is_empty() {
            return Err(ModelError::Data("dyna needs at least one clip to learn from".into()));
        }
        Ok(Self { each })
    }

    /// Everybody's model from everybody's data: mean squared error on the own data `2 (N - 1)` times, so that it weighs
    /// twice what all others weigh together.
    fn solve(&self, strength: f64, lags: Lags) -> Result<Vec<PersonDynamics>, ModelError> {
        let own = (2.0 * (self.each.len() as f64 - 1.0)).max(1.0);
        let person = |(j, (name, bmi, _)): (usize, &(String, f32, Moments))| {
            let share = |i: usize| if i == j { own } else { 1.0 };
            let all = self.each.iter().enumerate();
            let parts: Vec<(f64, &Moments)> = all.map(|(i, (_, _, sums))| (share(i) / sums.frames(), sums)).collect();
            let dynamics = Moments::weighted(&parts).solve(strength, lags)?;
            Ok(PersonDynamics { name: name.clone(), bmi: *bmi, dynamics })
        };
        self.each.par_iter().enumerate().map(person).collect()
    }
}
