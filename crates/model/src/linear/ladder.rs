use super::ar2::{Ar2Config, fit_ar2};
use super::readout::{ReadoutConfig, Selected, fit_readout};
use super::score::{Score, SoftScore};
use crate::{ModelError, Predictor, TrainingClip, deltas_of, plain};
use glam::Vec3;
use serde::{Deserialize, Serialize};
use softtissue_body::BodyModel;
use softtissue_bundle::descriptor::{Descriptor, DescriptorConfig, FeatureBlock, FeatureKind, FeatureScaling};
use softtissue_bundle::{Ar2, DeltaBasis};
use softtissue_geometry::Frames;

/// The closed-form models and the basis that they predict in.
#[derive(Clone, Debug, PartialEq)]
pub struct Ladder {
    /// `K` components of the deltas. Descriptors project forces on the first of them.
    pub basis: DeltaBasis,
    /// Models by name, in the order of the ladder.
    pub models: Vec<LadderModel>,
}

/// One rung.
#[derive(Clone, Debug, PartialEq)]
pub struct LadderModel {
    /// Name in tables and files; a variant follows a slash.
    pub name: String,
    /// How the motion is described to it; `None` if it does not look.
    pub descriptor: Option<DescriptorConfig>,
    /// What it computes.
    pub rule: Rule,
}

/// What a rung computes.
#[derive(Clone, Debug, PartialEq)]
#[expect(clippy::large_enum_variant, reason = "a ladder holds a dozen of them")]
pub enum Rule {
    /// Nothing: the body model alone.
    Body,
    /// The mean coefficients of the subject in training; of all subjects for an unknown one.
    Mean {
        /// `[K]` of each subject.
        subjects: Vec<(String, Vec<f32>)>,
        /// `[K]` of all.
        pooled: Vec<f32>,
    },
    /// A linear readout of features or resonators; its latent is the coefficients.
    Readout(plain::Regressor),
    /// Autoregressions: of the subject, or the pooled one for an unknown subject.
    Ar2 {
        /// From the descriptor's features.
        scaling: FeatureScaling,
        /// One for each subject; empty for the pooled baseline.
        subjects: Vec<(String, Ar2)>,
        /// Of all subjects together.
        pooled: Ar2,
    },
}

/// How the ladder is fitted.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LadderConfig {
    /// The readout of resonators. Its shape terms, strengths and stride serve the static ridge as well.
    pub resonators: ReadoutConfig,
    /// The autoregressions.
    pub ar2: Ar2Config,
}

/// Clips with one set of features.
#[derive(Clone, Copy, Debug)]
pub struct FeatureSet<'a> {
    /// How the features were computed.
    pub descriptor: &'a DescriptorConfig,
    /// Their blocks, [`Descriptor::blocks`].
    pub blocks: &'a [FeatureBlock],
    /// Clips to learn from.
    pub train: &'a [TrainingClip],
    /// Clips to choose ridge strengths on.
    pub validation: &'a [TrainingClip],
}

/// What validation said of a rung.
#[derive(Clone, Debug, PartialEq)]
pub struct LadderScore {
    /// The rung.
    pub name: String,
    /// Chosen ridge strength (of the first subject, where each has its own); `None` where there is none.
    pub strength: Option<f64>,
    /// Score on the validation clips.
    pub score: Score,
}

/// Dyna's features: joint angular velocities and accelerations, root velocity and acceleration in the root's frame
/// (eq. 20), by backward differences so that they can be had while the motion goes on.
pub fn dyna_descriptor(own: &DescriptorConfig) -> DescriptorConfig {
    DescriptorConfig { features: FeatureKind::Pose, root_angular_velocity: false, ..own.clone() }
}

impl Ladder {
    /// Fits every rung. `own` holds the regressor's features, `dyna` the same clips with [`dyna_descriptor`]'s; the
    /// coefficients of both are in `basis`.
    pub fn fit(
        config: &LadderConfig,
        basis: &DeltaBasis,
        body: &BodyModel,
        own: FeatureSet,
        dyna: FeatureSet,
    ) -> Result<(Self, Vec<LadderScore>), ModelError> {
        let measure = SoftScore::new(basis, body);
        let rest = basis.rest_coefficients();
        let mut ladder = Self { basis: basis.clone(), models: vec![] };
        let mut scores = Vec::new();
        let mut add = |name: &str, descriptor: Option<&DescriptorConfig>, rule: Rule, chosen: Option<(f64, Score)>| {
            let score = chosen.map_or_else(|| constant_score(&rule, &rest, own.validation, &measure), |(_, s)| s);
            scores.push(LadderScore { name: name.to_owned(), strength: chosen.map(|(s, _)| s), score });
            ladder.models.push(LadderModel { name: name.to_owned(), descriptor: descriptor.cloned(), rule });
        };
        add("body", None, Rule::Body, None);
        add("mean", None, mean_rule(own.train)?, None);
        for (name, readout) in [("ridge", &config.resonators.without_memory()), ("resonators", &config.resonators)] {
            let fps = own.descriptor.fps;
            let fitted = fit_readout(readout, own.blocks, fps, own.train, own.validation, &measure)?;
            add(name, Some(own.descriptor), Rule::Readout(fitted.model), Some((fitted.strength, fitted.score)));
        }
        for (suffix, set) in [("", own), ("/dyna", dyna)] {
            let fits = AutoRegressions::fit(&config.ar2, set, !suffix.is_empty(), &rest, &measure)?;
            let (scaling, pooled) = (fits.scaling, fits.pooled);
            let rule = |subjects| Rule::Ar2 { scaling: scaling.clone(), subjects, pooled: pooled.model.clone() };
            let chosen = Some((pooled.strength, pooled.score));
            add(&format!("ar2-pooled{suffix}"), Some(set.descriptor), rule(vec![]), chosen);
            let mut all = Score::default();
            fits.subjects.iter().for_each(|(_, fit)| all.add(fit.score));
            let chosen = fits.subjects.first().map(|(_, fit)| (fit.strength, all));
            let subjects = fits.subjects.into_iter().map(|(name, fit)| (name, fit.model)).collect();
            add(&format!("ar2-subject{suffix}"), Some(set.descriptor), rule(subjects), chosen);
        }
        Ok((ladder, scores))
    }

    /// Every rung as a predictor.
    pub fn predictors(&self) -> Vec<LadderPredictor<'_>> {
        self.models.iter().map(|model| LadderPredictor { basis: &self.basis, model }).collect()
    }
    /// A rung by name.
    pub fn predictor(&self, name: &str) -> Option<LadderPredictor<'_>> {
        self.models.iter().find(|m| m.name == name).map(|model| LadderPredictor { basis: &self.basis, model })
    }
}

struct AutoRegressions {
    scaling: FeatureScaling,
    pooled: Selected<Ar2>,
    subjects: Vec<(String, Selected<Ar2>)>,
}

impl AutoRegressions {
    /// `velocities_only` drops the joint rotations, which Dyna's input does not hold.
    fn fit(
        config: &Ar2Config,
        set: FeatureSet,
        velocities_only: bool,
        rest: &[f32],
        measure: &SoftScore,
    ) -> Result<Self, ModelError> {
        let keep = |b: &&FeatureBlock| !(velocities_only && b.name == "rotations");
        let blocks: Vec<FeatureBlock> = set.blocks.iter().filter(keep).cloned().collect();
        let features: Vec<&[f32]> = set.train.iter().map(|c| c.features.as_slice()).collect();
        let scaling = FeatureScaling::fit(&features, &blocks);
        let fit = |config: &Ar2Config, subject: Option<&str>| {
            let of = |clips| -> Vec<&TrainingClip> { clips_of(clips, subject) };
            fit_ar2(config, &scaling, rest, &of(set.train), &of(set.validation), measure)
        };
        let pooled = fit(config, None)?;
        // Who has no clip to choose a strength by gets the one that served all.
        let common = Ar2Config { strengths: vec![pooled.strength], ..config.clone() };
        let own = |subject: &str| match clips_of(set.validation, Some(subject)).is_empty() {
            true => fit(&common, Some(subject)),
            false => fit(config, Some(subject)),
        };
        let names = subjects_of(set.train);
        let subjects = names.into_iter().map(|s| Ok((s.clone(), own(&s)?))).collect::<Result<_, ModelError>>()?;
        Ok(Self { scaling, pooled, subjects })
    }
}

fn clips_of<'a>(clips: &'a [TrainingClip], subject: Option<&str>) -> Vec<&'a TrainingClip> {
    clips.iter().filter(|c| subject.is_none_or(|s| c.id.subject == s)).collect()
}

pub(super) fn subjects_of(clips: &[TrainingClip]) -> Vec<String> {
    let mut names: Vec<String> = clips.iter().map(|c| c.id.subject.clone()).collect();
    names.sort();
    names.dedup();
    names
}

fn mean_rule(train: &[TrainingClip]) -> Result<Rule, ModelError> {
    let mean = |clips: &[&TrainingClip]| {
        let k = clips.first().map_or(0, |c| c.coefficient_count());
        let frames = clips.iter().map(|c| c.frames).sum::<usize>().max(1) as f64;
        let mut sum = vec![0.0f64; k];
        for row in clips.iter().flat_map(|c| c.coefficients.chunks_exact(k.max(1))) {
            sum.iter_mut().zip(row).for_each(|(s, c)| *s += f64::from(*c));
        }
        sum.into_iter().map(|s| (s / frames) as f32).collect::<Vec<f32>>()
    };
    if train.is_empty() {
        return Err(ModelError::Data("there is no clip to take a mean of".into()));
    }
    let subjects = subjects_of(train).into_iter().map(|s| (s.clone(), mean(&clips_of(train, Some(&s))))).collect();
    Ok(Rule::Mean { subjects, pooled: mean(&clips_of(train, None)) })
}

/// Score of a rule that does not look at the motion.
fn constant_score(rule: &Rule, rest: &[f32], validation: &[TrainingClip], measure: &SoftScore) -> Score {
    let mut score = Score::default();
    for clip in validation {
        let constant = match rule {
            Rule::Mean { subjects, pooled } => of_subject(subjects, &clip.id.subject).unwrap_or(pooled),
            _ => rest,
        };
        let predicted: Vec<f32> = (0..clip.frames).flat_map(|_| constant.iter().copied()).collect();
        score.add(measure.clip(&predicted, &clip.coefficients));
    }
    score
}

fn of_subject<'a, T>(subjects: &'a [(String, T)], subject: &str) -> Option<&'a T> {
    subjects.iter().find(|(name, _)| name == subject).map(|(_, value)| value)
}

/// A rung ready to predict.
#[derive(Clone, Copy, Debug)]
pub struct LadderPredictor<'a> {
    basis: &'a DeltaBasis,
    model: &'a LadderModel,
}

impl LadderPredictor<'_> {
    /// Coefficients `[T, K]` for a motion's features `[T, D]` (empty for rungs that do not look).
    pub fn coefficients(&self, subject: &str, beta: &[f32], features: &[f32], frames: usize) -> Vec<f32> {
        match &self.model.rule {
            Rule::Body => self.basis.rest_coefficients().repeat(frames),
            Rule::Mean { subjects, pooled } => of_subject(subjects, subject).unwrap_or(pooled).repeat(frames),
            Rule::Readout(regressor) => {
                let size = regressor.input.input_size;
                let mut state = regressor.start(beta);
                let mut out = Vec::with_capacity(frames * regressor.latent_count());
                for x in features.chunks_exact(size.max(1)) {
                    regressor.step(x, &mut state);
                    out.extend_from_slice(state.latent());
                }
                out
            }
            Rule::Ar2 { scaling, subjects, pooled } => {
                let model = of_subject(subjects, subject).unwrap_or(pooled);
                model.rollout(&scaling.apply_clip(features), &self.basis.rest_coefficients())
            }
        }
    }
}

impl Predictor for LadderPredictor<'_> {
    fn name(&self) -> &str {
        &self.model.name
    }
    fn rollout(
        &self,
        subject: &str,
        beta: &[f32],
        body: &BodyModel,
        rotations: &Frames,
        translations: &[Vec3],
    ) -> Result<Frames, ModelError> {
        let frames = translations.len();
        if matches!(self.model.rule, Rule::Body) {
            return Ok(Frames::zeros(body.vertex_count(), frames));
        }
        let features = match &self.model.descriptor {
            Some(config) => {
                let descriptor = Descriptor::new(config, body, Some(self.basis.directions.data()))?;
                descriptor.run(body, &body.shaped(beta), rotations, translations)
            }
            None => vec![],
        };
        Ok(deltas_of(self.basis, &self.coefficients(subject, beta, &features, frames)))
    }
}
