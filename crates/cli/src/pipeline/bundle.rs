//! Predictors as evaluation knows them.

use softtissue_body::{BodyModel, Pose};
use softtissue_bundle::{Bundle, Controls, Player, StepPart, Subspace, ThreeLayers};
use softtissue_clips::MotionClip;
use softtissue_eval::{Codec, CodecPair, FrameTime, Method, MethodError};
use softtissue_geometry::Frames;
use softtissue_model::Predictor;
use softtissue_model::linear::Ladder;
use std::collections::BTreeMap;
use std::sync::Arc;

/// A bundle, run by the same player that ships.
pub struct BundleMethod {
    /// Name in tables.
    pub name: String,
    /// What is played.
    pub bundle: Arc<Bundle>,
    /// What is changed of it.
    pub controls: Controls,
}

impl BundleMethod {
    /// A bundle as it was learned, under the name of its method.
    pub fn as_learned(bundle: &Arc<Bundle>) -> Self {
        let name = bundle.info.method.clone();
        Self { name, bundle: Arc::clone(bundle), controls: Controls::default() }
    }

    fn player(&self, beta: &[f32]) -> Result<Player<Arc<Bundle>>, MethodError> {
        let mut player = Player::new(Arc::clone(&self.bundle), beta)?;
        player.set_controls(&self.controls)?;
        Ok(player)
    }
}

impl Method for BundleMethod {
    fn name(&self) -> &str {
        &self.name
    }
    fn rollout(&self, _: &str, beta: &[f32], motion: &MotionClip) -> Result<Frames, MethodError> {
        let mut player = self.player(beta)?;
        Ok(player.rollout(&motion.rotations, &motion.translations)?)
    }
    fn rollout_each(
        &self,
        _: &str,
        beta: &[f32],
        motion: &MotionClip,
        sink: &mut dyn FnMut(&[glam::Vec3]),
    ) -> Result<(), MethodError> {
        let mut player = self.player(beta)?;
        player.play(&motion.rotations, &motion.translations, |_, player| {
            sink(player.deltas());
            Ok(())
        })?;
        Ok(())
    }
    fn frame_times(
        &self,
        _: &str,
        beta: &[f32],
        motion: &MotionClip,
        frames: usize,
    ) -> Result<Vec<FrameTime>, MethodError> {
        let mut player = self.player(beta)?;
        let mut times = Vec::with_capacity(frames);
        for t in (0..motion.len()).cycle().take(frames) {
            if t == 0 {
                player.reset();
            }
            let pose = Pose { rotations: motion.rotations.frame(t), translation: motion.translations[t] };
            let (_, step) = player.timed_step(pose);
            let part = |p: StepPart| Some((p.name(), step.part(p)?.as_secs_f64()));
            let parts = StepPart::ALL.into_iter().filter_map(part).collect();
            times.push(FrameTime { parts, whole_s: step.whole.as_secs_f64() });
        }
        Ok(times)
    }
}

/// A rung of the ladder of baselines.
pub struct LadderMethod {
    /// Which rung.
    pub name: String,
    /// All rungs.
    pub ladder: Arc<Ladder>,
    /// The body they move.
    pub body: Arc<BodyModel>,
}

impl Method for LadderMethod {
    fn name(&self) -> &str {
        &self.name
    }
    fn rollout(&self, subject: &str, beta: &[f32], motion: &MotionClip) -> Result<Frames, MethodError> {
        let rung = self.ladder.predictor(&self.name).ok_or_else(|| format!("the ladder has no rung {}", self.name))?;
        Ok(rung.rollout(subject, beta, &self.body, &motion.rotations, &motion.translations)?)
    }
}

/// A subspace beside principal components of the same size.
pub struct LearnedCodec {
    /// Latent numbers.
    pub latents: u32,
    /// Principal components.
    pub pca: Box<dyn Codec>,
    /// The learned one.
    pub autoencoder: Box<dyn Codec>,
    /// Whether validation kept more than principal components.
    pub residual_kept: bool,
    /// Whose deltas it knows, where everyone has one of their own.
    pub subjects: Option<Vec<String>>,
}

impl LearnedCodec {
    /// Both, as evaluation takes them.
    pub fn pair(&self) -> CodecPair<'_> {
        CodecPair {
            latent: self.latents,
            pca: &*self.pca,
            autoencoder: Some(&*self.autoencoder),
            residual_kept: Some(self.residual_kept),
        }
    }
}

/// Encodes and decodes with a subspace.
pub struct SubspaceCodec(pub Subspace);

impl Codec for SubspaceCodec {
    fn reconstruct(&self, _: &str, deltas: &Frames) -> Result<Frames, MethodError> {
        let subspace = &self.0;
        let mut scratch = subspace.scratch();
        let mut latent = vec![0.0; subspace.latent_count()];
        let mut out = Vec::with_capacity(deltas.points().len() * 3);
        for frame in deltas.iter() {
            let numbers: Vec<f32> = frame.iter().flat_map(|d| d.to_array()).collect();
            let mut decoded = vec![0.0; numbers.len()];
            subspace.encode(&numbers, &mut latent, &mut scratch);
            subspace.decode(&latent, &mut decoded, &mut scratch);
            out.extend(decoded);
        }
        Ok(Frames::from_numbers(deltas.points_per_frame(), &out))
    }
}

/// Encodes and decodes with an autoencoder of Casas and Otaduy.
pub struct ThreeLayerCodec {
    /// Deltas in metres to latents.
    pub encoder: ThreeLayers,
    /// Latents to deltas in metres.
    pub decoder: ThreeLayers,
}

impl Codec for ThreeLayerCodec {
    fn reconstruct(&self, _: &str, deltas: &Frames) -> Result<Frames, MethodError> {
        let Self { encoder, decoder } = self;
        let (mut into, mut out_of) = (encoder.scratch(), decoder.scratch());
        let mut latent = vec![0.0; encoder.outputs()];
        let mut numbers = deltas.to_numbers();
        for frame in numbers.chunks_exact_mut(encoder.inputs()) {
            encoder.apply(frame, &mut into, &mut latent);
            decoder.apply(&latent, &mut out_of, frame);
        }
        Ok(Frames::from_numbers(deltas.points_per_frame(), &numbers))
    }
}

/// A codec for each person, by name.
#[derive(Default)]
pub struct PersonalCodec(pub BTreeMap<String, Box<dyn Codec>>);

impl Codec for PersonalCodec {
    fn reconstruct(&self, subject: &str, deltas: &Frames) -> Result<Frames, MethodError> {
        let own = self.0.get(subject).ok_or_else(|| format!("{subject} has no subspace of their own"))?;
        own.reconstruct(subject, deltas)
    }
}
