//! Every setting in one place. Each section's defaults live beside the code that uses them.

mod softsmpl;

pub use softsmpl::SoftsmplConfig;

use serde::{Deserialize, Serialize};
use softtissue_avatar::AvatarConfig;
use softtissue_body::Region;
use softtissue_bundle::descriptor::DescriptorConfig;
use softtissue_clips::{ClipId, Split, SplitConfig};
use softtissue_fit::{FitConfig, RegistrationConfig};
use softtissue_model::linear::{DynaConfig, LadderConfig};
use softtissue_model::{PcaConfig, TuningConfig};
use softtissue_synth::dataset::SynthConfig;
use softtissue_train::{
    AutoencoderStart, DeltaAutoencoderTraining, FeedbackTraining, LoopConfig, RegressorTraining, SubspaceTraining,
};

/// The whole configuration.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    /// What is learned. Default `softtissue`.
    pub method: Method,
    /// The one number all random draws come from. Default 1. `synth.seed` follows it unless it is stated.
    pub seed: u64,
    /// Where tensors live: `flex`, `ndarray` or `wgpu`. Default `flex`.
    pub device: String,
    /// Licence that the bundle carries, which follows that of the scans. Default `CC0-1.0`, for generated scans.
    pub licence: String,
    /// Generated scans.
    pub synth: SynthConfig,
    /// Who is left out.
    pub split: SplitConfig,
    /// Raw scans onto the template.
    pub registration: RegistrationConfig,
    /// Shape, pose and deltas.
    pub fit: FitConfig,
    /// The deltas' subspace.
    pub subspace: SubspaceConfig,
    /// How a motion is described.
    pub descriptor: DescriptorConfig,
    /// Closed-form baselines.
    pub ladder: LadderConfig,
    /// The recurrent regressor.
    pub regressor: RegressorSection,
    /// What `method = "softsmpl"` learns.
    pub softsmpl: SoftsmplConfig,
    /// The method of Casas and Otaduy.
    pub casas_otaduy: CasasOtaduyConfig,
    /// Dyna.
    pub dyna: DynaConfig,
    /// AutoAvatar.
    pub autoavatar: AvatarConfig,
    /// A person's flesh fitted to one clip.
    pub tuning: TuningConfig,
    /// The loop that drives every training.
    pub train: LoopConfig,
    /// What is measured.
    pub eval: EvalConfig,
}

/// What `train` learns.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// Ours.
    #[default]
    Softtissue,
    /// SoftSMPL (Santesteban et al. 2020).
    Softsmpl,
    /// Casas and Otaduy (2018).
    CasasOtaduy,
    /// Dyna (Pons-Moll et al. 2015), on vertices.
    Dyna,
    /// AutoAvatar (Bai et al. 2022): one person's surface as a neural field, from raw scans.
    Autoavatar,
}

impl Method {
    /// Name in tables, files and settings.
    pub fn name(self) -> &'static str {
        match self {
            Self::Softtissue => softtissue_eval::OURS,
            Self::Softsmpl => "softsmpl",
            Self::CasasOtaduy => "casas-otaduy",
            Self::Dyna => "dyna",
            Self::Autoavatar => "autoavatar",
        }
    }
}

/// The deltas' subspace.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SubspaceConfig {
    /// Latent sizes to train. Default 25, 50, 100.
    pub sizes: Vec<usize>,
    /// Whether mirrored deltas are added. Default true.
    pub mirror: bool,
    /// Regions that `method = "softtissue"` leaves rigid: what is left there after a fit is its error and the scanner's.
    /// Default head, hands and feet, which have no flesh to speak of, and calves, whose motion is learned no nearer to scans
    /// than none. Published methods leave nothing out, as published.
    pub still: Vec<Region>,
    /// Principal components.
    pub pca: PcaConfig,
    /// Autoencoders.
    pub training: SubspaceTraining,
}

/// What stands round the recurrent unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ShortcutKind {
    /// A linear layer on the regressor's input, trained along: the published form.
    Linear,
    /// A ridge readout of damped resonators; the network learns the whole apart from it, and validation mixes the two.
    Resonators,
}

/// The recurrent regressor.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RegressorSection {
    /// Latent size that is regressed; one of `subspace.sizes`. Default 100.
    pub latents: usize,
    /// `resonators` (default) or `linear`. Of `method = "softtissue"`; `softsmpl` always has the linear one.
    pub shortcut: ShortcutKind,
    /// Whether mirrored clips are added. Default true.
    pub mirror: bool,
    /// Part by which the soft ratio on validation may rise for the sake of livelier motion: least squares predicts
    /// less motion than there is. Beside resonators only; the published form has no such gain. Default 0.03.
    pub given_for_motion: f64,
    /// What is left of the network's share in the prediction for a body unlike all that it has learned, 0 to 1; the resonators
    /// have the rest. Default 0.5.
    pub stranger: f32,
    /// The network and its training.
    pub training: RegressorTraining,
}

/// Casas and Otaduy (2018): networks of each person's own, on the features `angles`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct CasasOtaduyConfig {
    /// Latent sizes of the autoencoders. Default 50, 100, as in the paper's fig. 5.
    pub sizes: Vec<usize>,
    /// Latent size that is fed back; one of `sizes`. Default 100, as published.
    pub latents: usize,
    /// Whether mirrored clips are added. Default true; the paper has none.
    pub mirror: bool,
    /// The autoencoders.
    pub autoencoder: DeltaAutoencoderTraining,
    /// The regressor.
    pub regressor: FeedbackTraining,
}

/// What is measured beside the held-out clips.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct EvalConfig {
    /// Length of the rollout that shows whether energy gathers, seconds; an avatar's has 3600 frames at most. Default 600;
    /// 0 leaves it out.
    pub bounded_seconds: f32,
    /// Subjects whose hop-then-stand is simulated to measure rest and free decay, heaviest first. Default 2.
    pub decay_subjects: usize,
    /// Clips to play in the report. Default 2.
    pub playback_clips: usize,
    /// Motion by whose first take a new person's flesh is fitted where one subject is left out, a row of its own; no take of
    /// it is judged there. Empty: none.
    pub tuning_motion: String,
    /// Whether the clips are fitted once more with the posed objective, to be shown beside the unposed one
    /// (Casas-Otaduy 2018 fig. 3). Costs as much as the fit. Default true.
    pub compare_objectives: bool,
    /// Whether the simulator, with the mean material on each person's shape, is judged beside the methods: what could
    /// be known of a person whose flesh was never seen. Generated scans only. Default true.
    pub oracle: bool,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            method: Method::default(),
            seed: 1,
            device: "flex".into(),
            licence: "CC0-1.0".into(),
            synth: SynthConfig::default(),
            split: SplitConfig::default(),
            registration: RegistrationConfig::default(),
            fit: FitConfig::default(),
            subspace: SubspaceConfig::default(),
            descriptor: DescriptorConfig::default(),
            ladder: LadderConfig::default(),
            regressor: RegressorSection::default(),
            softsmpl: SoftsmplConfig::default(),
            casas_otaduy: CasasOtaduyConfig::default(),
            dyna: DynaConfig::default(),
            autoavatar: AvatarConfig::default(),
            tuning: TuningConfig::default(),
            train: LoopConfig::default(),
            eval: EvalConfig::default(),
        }
    }
}

impl SubspaceConfig {
    /// The regions that a method's components leave rigid.
    pub fn still_of(&self, method: Method) -> &[Region] {
        match method {
            Method::Softtissue => &self.still,
            Method::Softsmpl | Method::CasasOtaduy | Method::Dyna | Method::Autoavatar => &[],
        }
    }
}

impl Default for SubspaceConfig {
    fn default() -> Self {
        Self {
            sizes: vec![25, 50, 100],
            mirror: true,
            still: vec![Region::Head, Region::Hands, Region::Feet, Region::Calves],
            pca: PcaConfig::default(),
            training: SubspaceTraining::default(),
        }
    }
}

impl Default for RegressorSection {
    fn default() -> Self {
        Self {
            latents: 100,
            shortcut: ShortcutKind::Resonators,
            mirror: true,
            given_for_motion: 0.03,
            stranger: 0.5,
            training: RegressorTraining::default(),
        }
    }
}

impl Default for CasasOtaduyConfig {
    fn default() -> Self {
        Self {
            sizes: vec![50, 100],
            latents: 100,
            mirror: true,
            autoencoder: DeltaAutoencoderTraining::default(),
            regressor: FeedbackTraining::default(),
        }
    }
}

impl Default for EvalConfig {
    fn default() -> Self {
        Self {
            bounded_seconds: 600.0,
            decay_subjects: 2,
            playback_clips: 2,
            tuning_motion: "jumping_jacks".into(),
            compare_objectives: true,
            oracle: true,
        }
    }
}

impl Config {
    /// Refuses settings that cannot work; the sentence says which and what to do.
    pub fn check(&self) -> Result<(), String> {
        softtissue_train::device::parse(&self.device).map_err(|e| e.to_string())?;
        self.synth.check().map_err(|e| e.to_string())?;
        self.split.check().map_err(|e| e.to_string())?;
        self.registration.check().map_err(|e| e.to_string())?;
        self.fit.check().map_err(|e| e.to_string())?;
        self.check_descriptor()?;
        self.check_learning()?;
        self.softsmpl.check()?;
        self.check_casas_otaduy()?;
        self.dyna.check().map_err(|e| e.to_string())?;
        self.autoavatar.check().map_err(|e| e.to_string())?;
        self.tuning.check().map_err(|e| e.to_string())?;
        let most = 3600.0;
        within("eval.bounded_seconds", f64::from(self.eval.bounded_seconds), 0.0..=most)
    }

    fn check_descriptor(&self) -> Result<(), String> {
        let d = &self.descriptor;
        if d.fps != self.synth.fps {
            return Err(format!(
                "descriptor.fps is {} but synth.fps is {}; set both to the rate of the clips",
                d.fps, self.synth.fps
            ));
        }
        within("descriptor.cutoff_hz", f64::from(d.cutoff_hz), 0.0..=1e4)?;
        within("descriptor.look_ahead", d.look_ahead as f64, 0.0..=1000.0)?;
        at_least_one("descriptor.modes", d.modes)
    }

    fn check_casas_otaduy(&self) -> Result<(), String> {
        let CasasOtaduyConfig { sizes, latents, autoencoder: ae, regressor, .. } = &self.casas_otaduy;
        for (key, count) in [
            ("autoencoder.batch", ae.batch),
            ("autoencoder.widths", ae.widths[0].min(ae.widths[1])),
            ("regressor.batch", regressor.batch),
            ("regressor.pose_history", regressor.pose_history),
            ("regressor.rollout_every", regressor.rollout_every as usize),
        ] {
            at_least_one(&format!("casas_otaduy.{key}"), count)?;
        }
        within("casas_otaduy.regressor.pose_history", regressor.pose_history as f64, 1.0..=16.0)?;
        within("casas_otaduy.regressor.width", regressor.width as f64, 0.0..=65536.0)?;
        for (key, rate) in [("autoencoder", ae.learning_rate), ("regressor", regressor.learning_rate)] {
            if !(rate.is_finite() && rate > 0.0 && rate <= 1.0) {
                return Err(format!(
                    "casas_otaduy.{key}.learning_rate is {rate}; write a number above 0 and at most 1"
                ));
            }
        }
        within("casas_otaduy.regressor.dropout", regressor.dropout, 0.0..=0.99)?;
        within("casas_otaduy.regressor.latent_noise", regressor.latent_noise, 0.0..=100.0)?;
        within("casas_otaduy.regressor.pose_noise", regressor.pose_noise, 0.0..=100.0)?;
        within("casas_otaduy.regressor.own_latents", regressor.own_latents, 0.0..=1.0)?;
        let largest = sizes.iter().copied().max().unwrap_or(0);
        if sizes.contains(&0) || !sizes.contains(latents) {
            return Err(format!(
                "casas_otaduy.latents is {latents}, which is none of casas_otaduy.sizes {sizes:?}, or one of these is 0; \
                 add it there or choose one of them"
            ));
        }
        if ae.start == AutoencoderStart::Principal && ae.widths[0].min(ae.widths[1]) < 2 * largest {
            return Err(format!(
                "casas_otaduy.autoencoder.widths are {:?}; a start as {largest} principal components needs twice as many \
                 or more; write wider ones or start = \"random\"",
                ae.widths
            ));
        }
        Ok(())
    }

    fn check_learning(&self) -> Result<(), String> {
        self.check_networks()?;
        self.check_ladder()?;
        let (subspace, regressor) = (&self.subspace, &self.regressor);
        at_least_one("subspace.pca.components", subspace.pca.components)?;
        at_least_one("train.keep_last", self.train.keep_last)?;
        within("regressor.given_for_motion", regressor.given_for_motion, 0.0..=1.0)?;
        within("regressor.stranger", f64::from(regressor.stranger), 0.0..=1.0)?;
        if subspace.sizes.contains(&0) {
            return Err("subspace.sizes holds 0; a subspace has at least one number".into());
        }
        if !subspace.sizes.contains(&regressor.latents) {
            return Err(format!(
                "regressor.latents is {}, which is none of subspace.sizes {:?}; add it there or choose one of them",
                regressor.latents, subspace.sizes
            ));
        }
        Ok(())
    }

    /// The trainings of the autoencoders and of the recurrent network.
    fn check_networks(&self) -> Result<(), String> {
        let (ae, gru) = (&self.subspace.training, &self.regressor.training);
        for (key, count) in [
            ("subspace.training.batch", ae.batch),
            ("subspace.training.network.width", ae.network.width),
            ("regressor.training.batch", gru.batch),
            ("regressor.training.network.width", gru.network.width),
        ] {
            at_least_one(key, count)?;
        }
        for (key, rate) in [
            ("subspace.training.learning_rate", ae.learning_rate),
            ("regressor.training.learning_rate", gru.learning_rate),
        ] {
            if !(rate.is_finite() && rate > 0.0 && rate <= 1.0) {
                return Err(format!("{key} is {rate}; write a number above 0 and at most 1"));
            }
        }
        for (key, factor) in [
            ("position", gru.terms.position),
            ("velocity", gru.terms.velocity),
            ("acceleration", gru.terms.acceleration),
        ] {
            within(&format!("regressor.training.terms.{key}"), factor, 0.0..=1e6)?;
        }
        within("subspace.training.dropout", ae.dropout, 0.0..=0.99)?;
        within("subspace.training.input_noise", ae.input_noise, 0.0..=1e3)?;
        within("subspace.training.normal_weight", ae.normal_weight, 0.0..=1e9)?;
        for (key, adam) in [("subspace.training.adam", &ae.adam), ("regressor.training.adam", &gru.adam)] {
            within(&format!("{key}.beta_1"), adam.beta_1, 0.0..=1.0 - 1e-9)?;
            within(&format!("{key}.beta_2"), adam.beta_2, 0.0..=1.0 - 1e-9)?;
            within(&format!("{key}.epsilon"), adam.epsilon, 1e-300..=1.0)?;
        }
        Ok(())
    }

    /// The closed-form methods.
    fn check_ladder(&self) -> Result<(), String> {
        let (resonators, ar2, dyna) = (&self.ladder.resonators, &self.ladder.ar2, &self.dyna.ar2);
        at_least_one("ladder.resonators.frame_stride", resonators.frame_stride)?;
        for (key, strengths) in [
            ("ladder.resonators.strengths", &resonators.strengths),
            ("ladder.ar2.strengths", &ar2.strengths),
            ("dyna.ar2.strengths", &dyna.strengths),
        ] {
            if strengths.is_empty() {
                return Err(format!("{key} is empty; write one or more ridge strengths"));
            }
            strengths.iter().try_for_each(|s| within(key, *s, f64::MIN_POSITIVE..=1e6))?;
        }
        resonators.check(self.descriptor.fps).map_err(|e| format!("ladder.resonators: {e}"))?;
        ar2.check().map_err(|e| format!("ladder.ar2: {e}"))?;
        dyna.check().map_err(|e| format!("dyna.ar2: {e}"))?;
        let constant = resonators.shape_terms.iter().any(|powers| powers.iter().all(|p| *p == 0));
        if self.regressor.shortcut == ShortcutKind::Resonators && !(resonators.direct && constant) {
            return Err(
                "regressor.shortcut = \"resonators\" needs ladder.resonators.direct = true and the constant [] \
                        among ladder.resonators.shape_terms; set these, or choose \"linear\""
                    .into(),
            );
        }
        Ok(())
    }

    /// The split of the clips that the generator will make.
    pub fn planned_split(&self) -> softtissue_clips::Result<Split> {
        let synth = &self.synth;
        let ids: Vec<ClipId> = (0..synth.bmi.len())
            .flat_map(|s| {
                synth
                    .motions
                    .iter()
                    .flat_map(move |m| (0..synth.takes).map(move |t| ClipId::new(format!("s{s:02}"), m, t)))
            })
            .collect();
        self.split.split(&ids)
    }

    /// The name under which the learned method is reported: its own, what of it is switched off, and how far it looks
    /// ahead.
    pub fn method_name(&self) -> String {
        let part = match self.method {
            Method::Softtissue => None,
            Method::Softsmpl => self.softsmpl.ablation(),
            Method::CasasOtaduy => (!self.casas_otaduy.regressor.weighted).then_some("unweighted"),
            Method::Dyna => (self.dyna.order == 0).then_some("zero-order"),
            Method::Autoavatar => None,
        };
        let own = self.method.name();
        let name = part.map_or_else(|| own.to_owned(), |part| format!("{own}/{part}"));
        match self.descriptor.look_ahead {
            0 => name,
            frames => format!("{name}/look-ahead-{frames}"),
        }
    }
}

fn within(key: &str, value: f64, range: std::ops::RangeInclusive<f64>) -> Result<(), String> {
    if range.contains(&value) {
        return Ok(());
    }
    Err(format!("{key} is {value}; write {} to {}", range.start(), range.end()))
}

fn at_least_one(key: &str, count: usize) -> Result<(), String> {
    if count == 0 { Err(format!("{key} is 0; write 1 or more")) } else { Ok(()) }
}
