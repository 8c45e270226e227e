use crate::descriptor::DescriptorConfig;
use crate::{
    AutoregressiveModel, Bundle, BundleError, BundleInfo, FeedbackModel, Hardening, MassLaw, Model, Precision,
    RecurrentModel, Resonator, Result,
};
use serde::{Deserialize, Serialize};
use softtissue_store::{StoreError, read_limited};
use std::path::Path;

/// Version of the format that this program writes, and the newest that it reads.
pub const FORMAT_VERSION: u64 = 7;
/// The oldest that it reads: a network of version 5 is as sure of everybody.
const OLDEST_VERSION: u64 = 5;
/// First word of every manifest.
const FORMAT: &str = "softtissue-bundle";
/// First word of another kind of model, which is no bundle.
const AVATAR_FORMAT: &str = "softtissue-avatar";
/// Largest manifest.
const MANIFEST_BYTES: u64 = 16 << 20;

/// `manifest.json`: what a program must know before it reads the arrays.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Manifest {
    format: String,
    version: u64,
    units: String,
    up_axis: String,
    front_axis: String,
    pub(crate) fps: f32,
    pub(crate) precision: Precision,
    look_ahead_frames: usize,
    /// Group delay of the features at rest.
    lag_frames: f32,
    pub(crate) topology: String,
    vertices: usize,
    pub(crate) joints: Vec<String>,
    pub(crate) descriptor: DescriptorConfig,
    pub(crate) model: ModelForm,
    pub(crate) info: BundleInfo,
    limits: TrainingLimits,
    pub(crate) files: Vec<FileEntry>,
}

/// What the arrays' names and shapes do not say, a variant for each of [`Model`]'s.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub(crate) enum ModelForm {
    Recurrent(RecurrentForm),
    Feedback(FeedbackForm),
    Autoregressive(AutoregressiveForm),
}

/// A recurrent model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RecurrentForm {
    pub(crate) features: usize,
    pub(crate) beta_count: usize,
    pub(crate) shape_terms: Vec<Vec<u8>>,
    pub(crate) mass: MassLaw,
    pub(crate) bank: Option<BankForm>,
    pub(crate) direct: bool,
    pub(crate) recurrent: bool,
    pub(crate) acquaintance: Option<AcquaintanceForm>,
    pub(crate) encoder_units: usize,
    pub(crate) decoder_units: usize,
    /// Layers of the pose encoder, where there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) pose_encoder_layers: Option<usize>,
}

/// How a network is mixed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct AcquaintanceForm {
    pub(crate) share: f32,
    pub(crate) stranger: f32,
}

/// A model that is fed back.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct FeedbackForm {
    /// Names, in the order of the arrays.
    pub(crate) people: Vec<String>,
    /// Whether the fed back latents are clipped.
    pub(crate) latent_limits: bool,
}

/// An autoregressive model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct AutoregressiveForm {
    pub(crate) features: usize,
    /// Kernel width of the mixture, kg/m^2.
    pub(crate) tau: f32,
    pub(crate) people: Vec<PersonForm>,
}

/// Somebody in the mixture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PersonForm {
    pub(crate) name: String,
    /// Body mass index, kg/m^2.
    pub(crate) bmi: f32,
}

/// A resonator bank.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct BankForm {
    pub(crate) channels: usize,
    pub(crate) resonators: Vec<Resonator>,
    #[serde(default)]
    pub(crate) hardening: Option<Hardening>,
}

/// Limits of the training data for a reader's eye; the arrays hold them all.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct TrainingLimits {
    /// Index, least and greatest value of each shape coefficient that the regressor sees.
    beta: Vec<(u32, f32, f32)>,
    /// Largest delta of a vertex, metres.
    largest_delta_m: f32,
}

/// A file of the bundle.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct FileEntry {
    pub(crate) name: String,
    pub(crate) bytes: u64,
    pub(crate) sha256: String,
}

/// The part of a manifest that every version has.
#[derive(Deserialize)]
struct Head {
    format: String,
    version: u64,
}

impl ModelForm {
    fn of(model: &Model) -> Self {
        match model {
            Model::Recurrent(m) => Self::Recurrent(RecurrentForm::of(m)),
            Model::Feedback(m) => Self::Feedback(FeedbackForm::of(m)),
            Model::Autoregressive(m) => Self::Autoregressive(AutoregressiveForm::of(m)),
        }
    }
}

impl RecurrentForm {
    fn of(RecurrentModel { regressor, subspace, pose_encoder }: &RecurrentModel) -> Self {
        let (bank, known) = (regressor.bank.as_ref(), regressor.acquaintance.as_ref());
        Self {
            features: regressor.input.input_size,
            beta_count: regressor.shape.input_size,
            shape_terms: regressor.shape_terms.clone(),
            mass: regressor.mass,
            bank: bank.map(|b| BankForm {
                channels: b.channels(),
                resonators: b.resonators().to_vec(),
                hardening: b.hardening(),
            }),
            direct: regressor.direct,
            recurrent: regressor.recurrent.is_some(),
            acquaintance: known.map(|a| AcquaintanceForm { share: a.share, stranger: a.stranger }),
            encoder_units: subspace.encoder.units.len(),
            decoder_units: subspace.decoder.units.len(),
            pose_encoder_layers: pose_encoder.as_ref().map(|e| e.layers.len()),
        }
    }
}

impl FeedbackForm {
    fn of(FeedbackModel { people }: &FeedbackModel) -> Self {
        Self {
            people: people.iter().map(|p| p.name.clone()).collect(),
            latent_limits: people.iter().any(|p| p.latent_limits.is_some()),
        }
    }
}

impl AutoregressiveForm {
    fn of(model: &AutoregressiveModel) -> Self {
        let people = model.people.iter().map(|p| PersonForm { name: p.name.clone(), bmi: p.bmi });
        Self { features: model.input.input_size, tau: model.tau, people: people.collect() }
    }
}

impl Manifest {
    /// The manifest of a bundle, without files yet.
    pub(crate) fn of(bundle: &Bundle, lag_frames: f32) -> Self {
        let Bundle { info, body, descriptor, model, .. } = bundle;
        Self {
            format: FORMAT.into(),
            version: FORMAT_VERSION,
            units: "metre, radian, second".into(),
            up_axis: "+Y".into(),
            front_axis: "+Z".into(),
            fps: descriptor.fps,
            precision: model.precision(),
            look_ahead_frames: descriptor.look_ahead,
            lag_frames,
            topology: body.topology.hash(),
            vertices: body.vertex_count(),
            joints: body.skeleton.names.clone(),
            descriptor: descriptor.clone(),
            model: ModelForm::of(model),
            info: info.clone(),
            limits: TrainingLimits { beta: model.shape_limits(), largest_delta_m: info.largest_delta_m },
            files: vec![],
        }
    }

    /// Reads a manifest: format and version first, then the rest strictly.
    pub(crate) fn read(path: &Path) -> Result<Self> {
        Self::parse(path, &read_limited(path, MANIFEST_BYTES)?)
    }

    /// A manifest's text; errors call it `path`.
    pub(crate) fn parse(path: &Path, bytes: &[u8]) -> Result<Self> {
        let broken = |e: serde_json::Error| StoreError::corrupt(path, format!("{e}; export the bundle again"));
        let head: Head = serde_json::from_slice(bytes).map_err(broken)?;
        if head.format == AVATAR_FORMAT {
            return Err(BundleError::refused(
                path,
                "it is an AutoAvatar, a neural field that no real-time player runs; play it with `softtissue animate`",
            ));
        }
        if head.format != FORMAT {
            return Err(BundleError::refused(
                path,
                format!("its format is {:?}, expected {FORMAT:?}; name the folder of a bundle", head.format),
            ));
        }
        if head.version > FORMAT_VERSION {
            return Err(BundleError::Newer { path: path.to_owned(), found: head.version, supported: FORMAT_VERSION });
        }
        if head.version < OLDEST_VERSION {
            let reason = format!(
                "it has version {}, this program reads {OLDEST_VERSION} to {FORMAT_VERSION}; write it again \
                 with `softtissue train --resume`, or train again",
                head.version
            );
            return Err(BundleError::refused(path, reason));
        }
        let manifest: Self = serde_json::from_slice(bytes).map_err(broken)?;
        manifest.check(path)?;
        Ok(manifest)
    }

    fn check(&self, path: &Path) -> Result<()> {
        let words = [
            ("units", self.units.as_str(), "metre, radian, second"),
            ("up axis", &self.up_axis, "+Y"),
            ("front axis", &self.front_axis, "+Z"),
        ];
        if let Some((what, found, expected)) = words.into_iter().find(|(_, found, expected)| found != expected) {
            return Err(BundleError::refused(
                path,
                format!("its {what} is {found:?}, this program reads {expected:?}; export the bundle again"),
            ));
        }
        if self.fps != self.descriptor.fps || self.look_ahead_frames != self.descriptor.look_ahead {
            return Err(BundleError::refused(
                path,
                "its rate or look-ahead differs from its descriptor's; export the bundle again",
            ));
        }
        Ok(())
    }
}
