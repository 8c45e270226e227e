use super::angles::{AngleFeatures, AngleState};
use super::disentangled::{DisentangledFeatures, DisentangledState};
use super::forces::{ForceFeatures, ForceState};
use super::pose::{PoseFeatures, PoseState};
use super::root::RootFeatures;
use super::{DescriptorConfig, FeatureBlock, FeatureKind, LowPass, PoseEncoder};
use crate::posing::Posing;
use crate::times::{StepPart, Watch};
use glam::{Affine3A, Vec3};
use softtissue_body::{BodyModel, Pose, Region, ShapedBody};
use softtissue_geometry::Frames;
use std::borrow::Cow;
use std::sync::Arc;

/// Why a descriptor cannot be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DescriptorError {
    /// A setting out of range.
    #[error("descriptor: {reason}")]
    Config {
        /// What is wrong and what to do.
        reason: String,
    },
    /// Delta modes are missing or of another size.
    #[error("descriptor: modal forces need {needed} modes of {vertices} vertices, got {found} numbers of modes")]
    Modes {
        /// Modes asked for.
        needed: usize,
        /// Vertices of the body.
        vertices: usize,
        /// Numbers given.
        found: usize,
    },
    /// The pose encoder is missing, or another body's.
    #[error("descriptor: disentangled-pose needs the pose encoder that it was learned with: {reason}")]
    Encoder {
        /// What is wrong.
        reason: String,
    },
}

/// What a descriptor needs beside its settings; each kind of features takes its own.
#[derive(Clone, Debug, Default)]
pub struct DescriptorParts<'a> {
    /// Orthonormal delta modes `[at least config.modes, V, 3]`, the most important first, for modal forces.
    pub modes: Option<Cow<'a, [f32]>>,
    /// For disentangled poses.
    pub encoder: Option<&'a Arc<PoseEncoder>>,
}

/// Turns poses into features, frame by frame. Holds no frame's data: that lies in [`DescriptorState`].
#[derive(Clone, Debug)]
pub struct Descriptor {
    config: DescriptorConfig,
    kind: Kind,
    blocks: Vec<FeatureBlock>,
    low_pass: LowPass,
    vertex_count: usize,
    joint_count: usize,
}

#[derive(Clone, Debug)]
enum Kind {
    Pose(PoseFeatures),
    Disentangled(DisentangledFeatures),
    Forces(ForceFeatures),
    Angles(AngleFeatures),
}

/// What a descriptor remembers of the frames before, and its scratch.
#[derive(Clone, Debug)]
pub struct DescriptorState(State);

#[derive(Clone, Debug)]
enum State {
    Pose(PoseState),
    Disentangled(DisentangledState),
    Forces(ForceState),
    Angles(AngleState),
}

impl Descriptor {
    /// For features that need no encoder: see [`DescriptorParts::modes`].
    pub fn new(config: &DescriptorConfig, body: &BodyModel, modes: Option<&[f32]>) -> Result<Self, DescriptorError> {
        Self::with_parts(config, body, DescriptorParts { modes: modes.map(Cow::Borrowed), encoder: None })
    }

    /// Any features. Forces on the head, hands, feet and the bony rest are left out.
    pub fn with_parts(
        config: &DescriptorConfig,
        body: &BodyModel,
        parts: DescriptorParts,
    ) -> Result<Self, DescriptorError> {
        check(config)?;
        let (fps, joints) = (config.fps, body.joint_count());
        let low_pass = LowPass::new(config.cutoff_hz, fps);
        let root = RootFeatures::new(config.root_angular_velocity, low_pass, fps);
        let kind = match config.features {
            FeatureKind::Pose => Kind::Pose(PoseFeatures::new(joints, root, low_pass, fps)),
            FeatureKind::DisentangledPose => {
                let fail = |reason| DescriptorError::Encoder { reason };
                let encoder = parts.encoder.ok_or_else(|| fail("there is none".into()))?;
                encoder.check(joints).map_err(fail)?;
                Kind::Disentangled(DisentangledFeatures::new(Arc::clone(encoder), root, low_pass, fps))
            }
            FeatureKind::Angles => Kind::Angles(AngleFeatures::new(joints, config.root_position, low_pass, fps)),
            FeatureKind::ModalForces => Kind::Forces(forces(config, body, parts.modes.as_deref(), low_pass)?),
        };
        let blocks = match &kind {
            Kind::Pose(k) => k.blocks(),
            Kind::Disentangled(k) => k.blocks(),
            Kind::Forces(k) => k.blocks(),
            Kind::Angles(k) => k.blocks(),
        };
        let (vertex_count, joint_count) = (body.vertex_count(), joints);
        Ok(Self { config: config.clone(), kind, blocks, low_pass, vertex_count, joint_count })
    }

    /// Features a frame, `D`.
    pub fn len(&self) -> usize {
        self.blocks.last().map_or(0, |b| b.range.end)
    }
    /// Whether there is no feature.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
    /// Features by physical quantity, in order.
    pub fn blocks(&self) -> &[FeatureBlock] {
        &self.blocks
    }
    /// Bytes of the modes that a frame reads; those of an encoder are the model's.
    pub(crate) fn weight_bytes(&self) -> usize {
        match &self.kind {
            Kind::Forces(k) => k.weight_bytes(),
            Kind::Pose(_) | Kind::Disentangled(_) | Kind::Angles(_) => 0,
        }
    }
    /// The settings it was made with.
    pub fn config(&self) -> &DescriptorConfig {
        &self.config
    }
    /// Frames by which slow changes of an acceleration come late: the low-pass, and one for the second difference,
    /// whose stencil is centred on the frame before.
    pub fn lag_frames(&self) -> f32 {
        self.low_pass.lag_frames() + 1.0
    }
    /// Memory at the start of a motion: the first pose is taken to have stood still, and the first difference to have
    /// lasted, so that neither makes a spike.
    pub fn state(&self) -> DescriptorState {
        DescriptorState(match &self.kind {
            Kind::Pose(k) => State::Pose(k.state()),
            Kind::Disentangled(k) => State::Disentangled(k.state()),
            Kind::Forces(k) => State::Forces(k.state()),
            Kind::Angles(k) => State::Angles(k.state()),
        })
    }

    /// One frame. `transforms` are the vertices' blended `posed_from_rest`, `skinned` the posed vertices without deltas,
    /// both `[V]` (used by `modal-forces` only, free to be empty for the others); `out` is `[D]`. Allocates nothing. Panics if a
    /// length is wrong or the state is another descriptor's.
    pub fn step(
        &self,
        state: &mut DescriptorState,
        pose: Pose,
        transforms: &[Affine3A],
        skinned: &[Vec3],
        out: &mut [f32],
    ) {
        self.watched_step(state, pose, transforms, skinned, out, &mut ());
    }

    pub(crate) fn watched_step(
        &self,
        state: &mut DescriptorState,
        pose: Pose,
        transforms: &[Affine3A],
        skinned: &[Vec3],
        out: &mut [f32],
        watch: &mut impl Watch,
    ) {
        assert_eq!(out.len(), self.len(), "features of a frame");
        assert_eq!(pose.rotations.len(), self.joint_count, "joints of a pose");
        match (&self.kind, &mut state.0) {
            (Kind::Pose(k), State::Pose(state)) => k.step(state, pose, out),
            (Kind::Disentangled(k), State::Disentangled(state)) => k.step(state, pose, out, watch),
            (Kind::Angles(k), State::Angles(state)) => k.step(state, pose, out),
            (Kind::Forces(k), State::Forces(state)) => {
                assert_eq!(transforms.len(), self.vertex_count, "transforms of a frame");
                assert_eq!(skinned.len(), self.vertex_count, "skinned vertices of a frame");
                k.step(state, pose, transforms, skinned, out);
            }
            _ => panic!("the state belongs to another kind of descriptor"),
        }
        watch.lap(StepPart::Descriptor);
    }

    /// A whole motion from its start: rotations `[T, J]` and translations `[T]` to features `[T, D]`.
    pub fn run(&self, body: &BodyModel, shaped: &ShapedBody, rotations: &Frames, translations: &[Vec3]) -> Vec<f32> {
        assert_eq!(rotations.len(), translations.len(), "frames of a motion");
        let (frames, size) = (translations.len(), self.len());
        let mut features = vec![0.0; frames * size];
        let mut state = self.state();
        let mut posing = Posing::new(body);
        for (t, out) in features.chunks_exact_mut(size).enumerate() {
            let pose = Pose { rotations: rotations.frame(t), translation: translations[t] };
            if matches!(self.kind, Kind::Forces(_)) {
                posing.run(body, shaped, pose);
            }
            self.step(&mut state, pose, &posing.transforms, &posing.skinned, out);
        }
        self.look_ahead(&mut features);
        features
    }

    /// Moves features forward in time by the configured frames; the last one lasts.
    fn look_ahead(&self, features: &mut [f32]) {
        let (size, shift) = (self.len(), self.config.look_ahead);
        let frames = features.len() / size.max(1);
        if shift == 0 || frames == 0 {
            return;
        }
        for t in 0..frames {
            let from = (t + shift).min(frames - 1) * size;
            features.copy_within(from..from + size, t * size);
        }
    }
}

fn forces(
    config: &DescriptorConfig,
    body: &BodyModel,
    modes: Option<&[f32]>,
    low_pass: LowPass,
) -> Result<ForceFeatures, DescriptorError> {
    let (vertices, needed) = (body.vertex_count(), config.modes);
    let found = modes.map_or(0, <[f32]>::len);
    let Some(modes) = modes.filter(|_| found >= needed * vertices * 3) else {
        return Err(DescriptorError::Modes { needed, vertices, found });
    };
    let fleshy = |v: &u32| {
        let region = body.regions.0[*v as usize];
        region.is_soft() || region == Region::Calves
    };
    let fleshy: Vec<u32> = (0..vertices as u32).filter(fleshy).collect();
    let forces = ForceFeatures::new(&modes[..needed * vertices * 3], needed, fleshy, low_pass, config.fps);
    Ok(if config.pose_entries { forces.with_pose_entries(body.joint_count()) } else { forces })
}

fn check(config: &DescriptorConfig) -> Result<(), DescriptorError> {
    let fail = |reason: String| Err(DescriptorError::Config { reason });
    if !(config.fps > 0.0 && config.fps <= 1000.0) {
        return fail(format!("fps is {}, expected more than 0 and at most 1000", config.fps));
    }
    if !(config.cutoff_hz >= 0.0 && config.cutoff_hz.is_finite()) {
        return fail(format!("cutoff_hz is {}, expected 0 (off) or more", config.cutoff_hz));
    }
    if config.features == FeatureKind::ModalForces && config.modes == 0 {
        return fail("modes is 0, expected at least 1".into());
    }
    Ok(())
}
