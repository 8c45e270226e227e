use crate::advance::Clock;
use crate::controls::{Controls, Mixer};
use crate::correctives::Correctives;
use crate::descriptor::{Descriptor, DescriptorState};
use crate::detail::{Detail, Part};
use crate::posing::Posing;
use crate::retarget::Retarget;
use crate::times::{StepPart, StepTimes, Stopwatch, Watch};
use crate::{Bundle, BundleError, ModelState, Result};
use glam::Vec3;
use softtissue_body::{Pose, ShapedBody};
use softtissue_geometry::Frames;
use std::collections::VecDeque;
use std::ops::{Deref, Range};
use std::sync::Arc;

/// A root that moves faster than this between two frames was set down elsewhere, m/s.
const TELEPORT_SPEED: f32 = 30.0;
/// A rotation vector longer than this many radians, or a root further away than [`FARTHEST`], is no pose.
const LONGEST_ROTATION: f32 = 1e3;
/// Farthest root, metres: beyond it f32 positions are coarser than the motion of flesh.
const FARTHEST: f32 = 1e5;

/// Runs a bundle on one body, frame by frame. `B` is `&Bundle`, `Arc<Bundle>` or a box.
///
/// Whatever the input, the output is finite: an unusable pose is replaced by the last good one, a teleport of the
/// root leaves the flesh alone, and features outside their range in training are clipped to it.
/// [`Player::step`] allocates nothing.
pub struct Player<B: Deref<Target = Bundle>> {
    bundle: B,
    shaped: ShapedBody,
    descriptor: Arc<Descriptor>,
    descriptor_state: DescriptorState,
    beta: Vec<f32>,
    model_state: ModelState,
    /// In the place of the model, where an animator asked for changes.
    mixer: Option<Mixer>,
    /// Of the deltas, where not all are wanted.
    part: Option<Part>,
    /// In the place of the moving body, where another shows the deltas.
    shown_on: Option<Retarget>,
    posing: Posing,
    /// Whether `posing` holds the frame that is shown.
    posed: bool,
    features: Vec<f32>,
    deltas: Vec<Vec3>,
    vertices: Vec<Vec3>,
    input: HeldPose,
    shown: HeldPose,
    /// Poses that wait for their features, where the model looks ahead; as many as it looks ahead.
    waiting: VecDeque<HeldPose>,
    /// What teleports have moved the root by: the motion is read as if they had not happened.
    teleported: Vec3,
    last_move: Vec3,
    frames: u64,
    pub(crate) clock: Clock,
}

/// A copy of a pose.
#[derive(Clone, Debug)]
struct HeldPose {
    rotations: Vec<Vec3>,
    /// As given, teleports included.
    translation: Vec3,
    /// Teleports up to here.
    teleported: Vec3,
}

/// What a step had to do to stay sane.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StepReport {
    /// The pose was unusable (not finite, absurdly large, or of another number of joints): the last good one stands in.
    pub pose_held: bool,
    /// The root jumped; the jump was not taken for motion.
    pub teleported: bool,
    /// Features outside their range in training, clipped to it.
    pub features_clipped: usize,
    /// The motion started over: the state was no longer finite, or too much time had passed.
    pub restarted: bool,
    /// The time step was no positive number.
    pub time_ignored: bool,
    /// No delta yet: the model looks ahead and has not seen far enough.
    pub waiting: bool,
}

impl HeldPose {
    fn rest(joints: usize) -> Self {
        Self { rotations: vec![Vec3::ZERO; joints], translation: Vec3::ZERO, teleported: Vec3::ZERO }
    }
    fn clear(&mut self) {
        self.rotations.fill(Vec3::ZERO);
        (self.translation, self.teleported) = (Vec3::ZERO, Vec3::ZERO);
    }
    /// Copies without allocating.
    fn set(&mut self, other: &Self) {
        self.rotations.copy_from_slice(&other.rotations);
        (self.translation, self.teleported) = (other.translation, other.teleported);
    }
    /// With the root where it would be without teleports.
    fn steady(&self) -> Pose<'_> {
        Pose { rotations: &self.rotations, translation: self.translation - self.teleported }
    }
}

impl<B: Deref<Target = Bundle>> Player<B> {
    /// A player of a body of shape `beta` at rest. Missing coefficients count as zero, surplus ones are ignored.
    pub fn new(bundle: B, beta: &[f32]) -> Result<Self> {
        let descriptor = Descriptor::with_parts(
            &bundle.descriptor,
            &bundle.body,
            bundle.model.descriptor_parts(&bundle.descriptor),
        )?;
        let (found, expected) = (descriptor.len(), bundle.model.feature_count());
        if found != expected {
            return Err(BundleError::Input(format!(
                "a bundle whose descriptor makes {found} features where its model takes {expected}; export it again"
            )));
        }
        let correctives = Correctives::new(&bundle.body, bundle.model.precision());
        Self::sharing(bundle, beta, Arc::new(descriptor), Arc::new(correctives))
    }

    /// A player of another body, at rest, that shares with this one what does not depend on the body.
    pub fn another(&self, beta: &[f32]) -> Result<Self>
    where
        B: Clone,
    {
        Self::sharing(self.bundle.clone(), beta, Arc::clone(&self.descriptor), Arc::clone(self.posing.correctives()))
    }

    fn sharing(bundle: B, beta: &[f32], descriptor: Arc<Descriptor>, correctives: Arc<Correctives>) -> Result<Self> {
        if let Some(i) = beta.iter().position(|b| !b.is_finite()) {
            return Err(BundleError::Input(format!("shape coefficient {i} as {}; give finite numbers", beta[i])));
        }
        let shaped = bundle.body.shaped(beta);
        let (v, j) = (bundle.body.vertex_count(), bundle.body.joint_count());
        let look_ahead = bundle.descriptor.look_ahead;
        Ok(Self {
            descriptor_state: descriptor.state(),
            beta: beta.to_vec(),
            model_state: bundle.model.start(beta),
            mixer: None,
            part: None,
            shown_on: None,
            posing: Posing::sharing(&bundle.body, correctives),
            posed: false,
            features: vec![0.0; descriptor.len()],
            deltas: vec![Vec3::ZERO; v],
            vertices: vec![Vec3::ZERO; v],
            input: HeldPose::rest(j),
            shown: HeldPose::rest(j),
            waiting: std::iter::repeat_n(HeldPose::rest(j), look_ahead).collect(),
            teleported: Vec3::ZERO,
            last_move: Vec3::ZERO,
            frames: 0,
            clock: Clock::new(j),
            shaped,
            descriptor,
            bundle,
        })
    }

    /// Changes what was learned as an animator asks, from rest on. What is asked for is bounded like the model itself:
    /// gains are factors, frequencies and damping ratios of stable resonators stay stable.
    ///
    /// # Errors
    /// A number out of its range, painted gains of another mesh, or a damping for a model without resonators.
    pub fn set_controls(&mut self, controls: &Controls) -> Result<()> {
        let Bundle { model, body, descriptor, .. } = &*self.bundle;
        self.mixer = match *controls == Controls::default() {
            true => None,
            false => Some(Mixer::new(controls, model, body, &self.beta, descriptor.fps)?),
        };
        self.reset();
        Ok(())
    }

    /// Computes less of the flesh, or all of it again, from the next frame on.
    ///
    /// # Errors
    /// No component, more than there are, or a model without components.
    pub fn set_detail(&mut self, detail: &Detail) -> Result<()> {
        self.part = Part::new(detail, &self.bundle.model, &self.bundle.body)?;
        Ok(())
    }

    /// Shows the deltas on another body in the same topology, whose rest mesh is `mesh [V]`, metres; `None` goes back
    /// to the body that moves. [`Player::deltas`] stay those of the moving body.
    ///
    /// # Errors
    /// Another number of vertices, or one that is not finite.
    pub fn show_on(&mut self, mesh: Option<Vec<Vec3>>) -> Result<()> {
        let retarget = |mesh| Retarget::new(&self.bundle.body, &self.shaped, mesh);
        self.shown_on = mesh.map(retarget).transpose()?;
        Ok(())
    }

    /// What is played.
    pub fn bundle(&self) -> &Bundle {
        &self.bundle
    }
    /// Bytes of weights that a whole frame reads once: what it cannot be faster than, without controls and in full detail.
    pub fn weight_bytes(&self) -> usize {
        let correctives = self.posing.correctives().bytes(&self.bundle.body);
        correctives + self.descriptor.weight_bytes() + self.bundle.model.weight_bytes(&self.model_state)
    }
    /// The body at its shape.
    pub fn shaped(&self) -> &ShapedBody {
        &self.shaped
    }
    /// Frames between a pose and its deltas, where the model looks ahead.
    pub fn delay_frames(&self) -> usize {
        self.bundle.descriptor.look_ahead
    }

    /// Forgets the motion: the next pose is a first one.
    pub fn reset(&mut self) {
        self.input.clear();
        self.shown.clear();
        self.reset_motion();
    }

    /// Forgets what moved, keeps where the body stands.
    pub(crate) fn reset_motion(&mut self) {
        self.descriptor_state = self.descriptor.state();
        self.reset_model();
        self.deltas.fill(Vec3::ZERO);
        self.clock.stop();
        (self.teleported, self.last_move) = (Vec3::ZERO, Vec3::ZERO);
        (self.frames, self.posed) = (0, false);
    }

    /// One frame of the bundle's rate. The deltas are those of this pose, or of the pose [`Player::delay_frames`] ago.
    pub fn step(&mut self, pose: Pose) -> StepReport {
        self.watched_step(pose, &mut ())
    }

    /// The same and the posed vertices, with the time that it took: a whole frame of an animation.
    pub fn timed_step(&mut self, pose: Pose) -> (StepReport, StepTimes) {
        let mut watch = Stopwatch::start();
        let report = self.watched_step(pose, &mut watch);
        self.vertices();
        watch.lap(StepPart::Skinning);
        (report, watch.stop())
    }

    fn watched_step(&mut self, pose: Pose, watch: &mut impl Watch) -> StepReport {
        let mut report = self.begin(pose);
        self.correct(0..self.blocks());
        if self.feel(&mut report, watch) {
            self.infer(&mut report, watch);
        }
        report
    }

    /// Blocks that the two parts of a frame are cut into that read most: [`Self::correct`] and [`Self::add_deltas`]. A batch
    /// takes the bodies in turn in each block.
    pub(crate) fn blocks(&self) -> usize {
        self.posing.blocks()
    }

    /// The beginning of a frame.
    pub(crate) fn begin(&mut self, pose: Pose) -> StepReport {
        let mut report = StepReport::default();
        self.accept(pose, &mut report);
        self.posing.take(&self.bundle.body, &self.shaped, self.input.steady());
        report
    }

    /// Some blocks of the pose correctives.
    pub(crate) fn correct(&mut self, blocks: Range<usize>) {
        self.posing.correct(&self.bundle.body, blocks);
    }

    /// From corrected to posed vertices and features. Whether there is something to predict from them.
    pub(crate) fn feel(&mut self, report: &mut StepReport, watch: &mut impl Watch) -> bool {
        self.posing.skin(&self.bundle.body, &self.shaped);
        self.posed = true;
        watch.lap(StepPart::Skinning);
        let Posing { transforms, skinned, .. } = &self.posing;
        let (state, features) = (&mut self.descriptor_state, &mut self.features);
        self.descriptor.watched_step(state, self.input.steady(), transforms, skinned, features, watch);
        self.frames += 1;
        if let Some(mut oldest) = self.waiting.pop_front() {
            report.waiting = self.frames <= self.delay_frames() as u64;
            // While it waits there is nothing to show but the first pose.
            if !report.waiting {
                self.shown.set(&oldest);
            } else if self.frames == 1 {
                self.shown.set(&self.input);
            }
            oldest.set(&self.input);
            self.waiting.push_back(oldest);
            self.posed = false;
            !report.waiting
        } else {
            self.shown.set(&self.input);
            true
        }
    }

    /// The descriptor's features of the newest pose, `[D]`: what an exported network takes.
    pub fn features(&self) -> &[f32] {
        &self.features
    }
    /// Deltas of the rest mesh, `[V]`, metres.
    pub fn deltas(&self) -> &[Vec3] {
        &self.deltas
    }
    /// The few numbers behind the deltas, `[L]`.
    pub fn latent(&self) -> &[f32] {
        self.model_state.latent()
    }
    /// Posed vertices with deltas, `[V]`, metres.
    pub fn vertices(&mut self) -> &[Vec3] {
        if let Some(other) = &mut self.shown_on {
            let (pose, shift) = (self.shown.steady(), self.shown.teleported);
            other.show(&self.bundle.body, pose, &self.deltas, shift, &mut self.vertices);
            return &self.vertices;
        }
        if !self.posed {
            self.posing.run(&self.bundle.body, &self.shaped, self.shown.steady());
            self.posed = true;
        }
        self.posing.add_deltas(&self.deltas, self.shown.teleported, &mut self.vertices);
        &self.vertices
    }

    /// The vertices that [`Self::vertices`] has computed last.
    pub(crate) fn shown_vertices(&self) -> &[Vec3] {
        &self.vertices
    }

    /// Posed vertices of the body that moves without deltas, `[V]`, metres.
    pub fn body_alone(&mut self) -> impl ExactSizeIterator<Item = Vec3> {
        if !self.posed {
            self.posing.run(&self.bundle.body, &self.shaped, self.shown.steady());
            self.posed = true;
        }
        let shift = self.shown.teleported;
        self.posing.skinned.iter().map(move |v| *v + shift)
    }

    /// A whole motion from its start: rotations `[T, J]`, radians, and translations `[T]`, metres. `show` is called for
    /// each frame in order, look-ahead taken out. Returns what the steps had to do.
    pub fn play(
        &mut self,
        rotations: &Frames,
        translations: &[Vec3],
        mut show: impl FnMut(usize, &mut Self),
    ) -> Result<RolloutReport> {
        let (frames, joints) = (translations.len(), self.input.rotations.len());
        if rotations.len() != frames || rotations.points_per_frame() != joints {
            return Err(BundleError::Input(format!(
                "{} frames of {} joints with {frames} root translations, expected as many of each and {joints} joints",
                rotations.len(),
                rotations.points_per_frame()
            )));
        }
        self.reset();
        let delay = self.delay_frames();
        let mut sum = RolloutReport { frames, ..Default::default() };
        for t in 0..frames {
            let report = self.step(Pose { rotations: rotations.frame(t), translation: translations[t] });
            sum.add(&report);
            if !report.waiting {
                show(t - delay, self);
            }
        }
        // The newest features last for the frames that still wait.
        for t in frames.saturating_sub(delay)..frames {
            self.shown.set(&self.waiting[delay + t - frames]);
            self.posed = false;
            let mut report = StepReport::default();
            self.infer(&mut report, &mut ());
            sum.add(&report);
            show(t, self);
        }
        Ok(sum)
    }

    /// Deltas `[T, V]` of a whole motion from its start.
    pub fn rollout(&mut self, rotations: &Frames, translations: &[Vec3]) -> Result<Frames> {
        let mut frames = Frames::new(self.deltas.len());
        self.play(rotations, translations, |_, player| frames.push(player.deltas()))?;
        Ok(frames)
    }
    /// Posed vertices with deltas `[T, V]` of a whole motion from its start.
    pub fn rollout_vertices(&mut self, rotations: &Frames, translations: &[Vec3]) -> Result<Frames> {
        let mut frames = Frames::new(self.deltas.len());
        self.play(rotations, translations, |_, player| frames.push(player.vertices()))?;
        Ok(frames)
    }

    /// Whether a pose has the body's joints and numbers that can be computed with.
    pub(crate) fn usable(&self, pose: Pose) -> bool {
        pose.rotations.len() == self.input.rotations.len()
            && pose.rotations.iter().all(|w| w.length() <= LONGEST_ROTATION)
            && pose.translation.length() <= FARTHEST
    }
    /// Whether the root cannot have moved so far in so many frames.
    pub(crate) fn is_teleport(&self, moved: Vec3, frames: f32) -> bool {
        moved.length() * self.bundle.descriptor.fps > TELEPORT_SPEED * frames
    }
    /// Shows the newest deltas on this pose, unless they belong to an earlier one.
    pub(crate) fn show_now(&mut self, pose: Pose) {
        if self.delay_frames() == 0 {
            self.shown.rotations.copy_from_slice(pose.rotations);
            (self.shown.translation, self.shown.teleported) = (pose.translation, self.teleported);
            self.posed = false;
        }
    }

    /// Takes a usable pose over; tells teleports from motion.
    fn accept(&mut self, pose: Pose, report: &mut StepReport) {
        if !self.usable(pose) {
            report.pose_held = true;
            return;
        }
        if self.frames > 0 {
            let moved = pose.translation - self.input.translation;
            if self.is_teleport(moved, 1.0) {
                self.teleported += moved - self.last_move;
                report.teleported = true;
            } else {
                self.last_move = moved;
            }
        }
        self.input.rotations.copy_from_slice(pose.rotations);
        (self.input.translation, self.input.teleported) = (pose.translation, self.teleported);
    }

    /// From features to deltas.
    fn infer(&mut self, report: &mut StepReport, watch: &mut impl Watch) {
        self.predict(report, watch);
        self.add_deltas(0..self.blocks());
        if self.mixer.is_none() && self.bundle.model.basis().is_some() {
            watch.lap(StepPart::Decoder);
        }
        self.settle(report);
    }

    /// From features to what the deltas are summed from; to the deltas where they are no such sum, or a mixture.
    pub(crate) fn predict(&mut self, report: &mut StepReport, watch: &mut impl Watch) {
        let (model, part) = (&self.bundle.model, self.part.as_ref());
        if let Some(mixer) = &mut self.mixer {
            report.features_clipped = mixer.step(model, &self.features, &mut self.deltas, part);
            watch.lap(StepPart::Regressor);
            return;
        }
        let deltas = bytemuck::cast_slice_mut(&mut self.deltas);
        report.features_clipped = model.predict(&self.features, &mut self.model_state, deltas, watch);
        if let Some(basis) = model.basis() {
            basis.begin_sum(deltas, part);
        }
    }

    /// Some blocks of the sum.
    pub(crate) fn add_deltas(&mut self, blocks: Range<usize>) {
        let basis = self.bundle.model.basis().filter(|_| self.mixer.is_none());
        if let (Some(basis), Some(coefficients)) = (basis, self.model_state.coefficients()) {
            let deltas = bytemuck::cast_slice_mut(&mut self.deltas);
            basis.add_blocks(coefficients, deltas, self.part.as_ref(), blocks);
        }
    }

    /// The end of a frame.
    pub(crate) fn settle(&mut self, report: &mut StepReport) {
        if let Some(part) = &self.part {
            part.hold(&mut self.deltas);
        }
        let state_is_finite = self.mixer.as_ref().map_or(self.model_state.is_finite(), Mixer::is_finite);
        if !state_is_finite || !self.deltas.iter().all(|d| d.is_finite()) {
            self.reset_model();
            self.deltas.fill(Vec3::ZERO);
            report.restarted = true;
        }
    }

    fn reset_model(&mut self) {
        self.model_state.reset();
        if let Some(mixer) = &mut self.mixer {
            mixer.reset();
        }
    }
}

/// The sum of the steps' reports over a motion.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RolloutReport {
    /// Frames played.
    pub frames: usize,
    /// Frames whose pose was held.
    pub poses_held: usize,
    /// Teleports.
    pub teleports: usize,
    /// Frames with clipped features.
    pub frames_clipped: usize,
    /// Times the state started over.
    pub restarts: usize,
}

impl RolloutReport {
    fn add(&mut self, step: &StepReport) {
        self.poses_held += usize::from(step.pose_held);
        self.teleports += usize::from(step.teleported);
        self.frames_clipped += usize::from(step.features_clipped > 0);
        self.restarts += usize::from(step.restarted);
    }
}
