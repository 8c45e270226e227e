use crate::advance::Clock;
use crate::ahead::Ahead;
use crate::controls::{Controls, Mixer};
use crate::correctives::Correctives;
use crate::descriptor::{Descriptor, DescriptorState};
use crate::detail::{Detail, Part};
use crate::fade::{Fade, Fader};
use crate::held_pose::HeldPose;
use crate::posing::Posing;
use crate::retarget::Retarget;
use crate::times::{StepPart, StepTimes, Stopwatch, Watch};
use crate::{Bundle, BundleError, ModelState, Result, StepReport};
use glam::Vec3;
use softtissue_body::{Pose, ShapedBody};
use std::collections::VecDeque;
use std::ops::{Deref, Range};
use std::sync::Arc;

/// A root that moves faster than this between two frames was set down elsewhere, m/s.
const TELEPORT_SPEED: f32 = 30.0;
/// A rotation vector longer than this many radians, or a root further away than [`FARTHEST`], is no pose.
const LONGEST_ROTATION: f32 = 1e3;
/// Farthest root, metres: beyond it f32 positions are coarser than the motion of flesh.
const FARTHEST: f32 = 1e5;
/// Longest time that a body stands before it moves, seconds.
const LONGEST_PRE_ROLL: f32 = 60.0;

/// Runs a bundle on one body, frame by frame. `B` is `&Bundle`, `Arc<Bundle>` or a box.
///
/// Whatever the input, the output is finite: an unusable pose is replaced by the last good one, a teleport of the
/// root leaves the flesh alone, and features outside their range in training are clipped to it.
/// [`Player::step`] allocates nothing.
pub struct Player<B: Deref<Target = Bundle>> {
    pub(crate) bundle: B,
    shaped: ShapedBody,
    pub(crate) descriptor: Arc<Descriptor>,
    descriptor_state: DescriptorState,
    beta: Vec<f32>,
    pub(crate) model_state: ModelState,
    /// In the place of the model, where an animator asked for changes.
    pub(crate) mixer: Option<Mixer>,
    /// What is computed of the deltas, where the model has a basis.
    pub(crate) part: Option<Arc<Part>>,
    /// All that moves, where the model has a basis.
    whole: Option<Arc<Part>>,
    /// In the place of the moving body, where another shows the deltas.
    shown_on: Option<Retarget>,
    posing: Posing,
    /// Whether `posing` holds the frame that is shown.
    pub(crate) posed: bool,
    pub(crate) features: Vec<f32>,
    /// Of the newest frame, as the model or the mixer has them.
    pub(crate) answer: Vec<Vec3>,
    pub(crate) ahead: Ahead,
    pub(crate) fader: Fader,
    /// How far the body lies from those of the training, in reaches.
    pub(crate) shape_distance: f32,
    pub(crate) trust: f32,
    /// What is shown.
    pub(crate) deltas: Vec<Vec3>,
    vertices: Vec<Vec3>,
    pub(crate) input: HeldPose,
    pub(crate) shown: HeldPose,
    /// The pose of the newest deltas, where `shown` may lie between two frames.
    pub(crate) framed: HeldPose,
    /// Poses that wait for their features, where the model looks ahead; as many as it looks ahead.
    pub(crate) waiting: VecDeque<HeldPose>,
    /// What teleports have moved the root by: the motion is read as if they had not happened.
    pub(crate) teleported: Vec3,
    pub(crate) last_move: Vec3,
    pub(crate) frames: u64,
    pub(crate) clock: Clock,
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
        bundle.trust.check(&bundle.model).map_err(BundleError::Input)?;
        let correctives = Correctives::new(&bundle.body, bundle.model.precision());
        let whole = bundle.model.basis().map(|basis| Arc::new(Part::whole(basis)));
        Self::sharing(bundle, beta, Arc::new(descriptor), Arc::new(correctives), whole)
    }

    /// A player of another body, at rest, that shares with this one what does not depend on the body.
    pub fn another(&self, beta: &[f32]) -> Result<Self>
    where
        B: Clone,
    {
        let (descriptor, correctives) = (Arc::clone(&self.descriptor), Arc::clone(self.posing.correctives()));
        Self::sharing(self.bundle.clone(), beta, descriptor, correctives, self.whole.clone())
    }

    fn sharing(
        bundle: B,
        beta: &[f32],
        descriptor: Arc<Descriptor>,
        correctives: Arc<Correctives>,
        whole: Option<Arc<Part>>,
    ) -> Result<Self> {
        if let Some(i) = beta.iter().position(|b| !b.is_finite()) {
            return Err(BundleError::Input(format!("shape coefficient {i} as {}; give finite numbers", beta[i])));
        }
        let shaped = bundle.body.shaped(beta);
        let (v, j) = (bundle.body.vertex_count(), bundle.body.joint_count());
        let look_ahead = bundle.descriptor.look_ahead;
        let model_state = bundle.model.start(beta);
        Ok(Self {
            descriptor_state: descriptor.state(),
            beta: beta.to_vec(),
            ahead: Ahead::new(&bundle.model, &model_state),
            model_state,
            fader: Fader::new(),
            shape_distance: bundle.trust.of_shape(beta),
            trust: 1.0,
            answer: vec![Vec3::ZERO; v],
            mixer: None,
            part: whole.clone(),
            whole,
            shown_on: None,
            posing: Posing::sharing(&bundle.body, correctives),
            posed: false,
            features: vec![0.0; descriptor.len()],
            deltas: vec![Vec3::ZERO; v],
            vertices: vec![Vec3::ZERO; v],
            input: HeldPose::rest(j),
            shown: HeldPose::rest(j),
            framed: HeldPose::rest(j),
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
        let part = || Part::of(detail, self.whole.as_deref(), &self.bundle.model, &self.bundle.body);
        self.part = match *detail == Detail::default() {
            true => self.whole.clone(),
            false => Some(Arc::new(part()?)),
        };
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

    /// Fades the deltas out where the motion, or the body, is unlike all that training has seen, and in again where it is
    /// not; `None` shows them whatever the trust. What is shown now does not jump: it fades.
    ///
    /// # Errors
    /// A number out of its range.
    pub fn set_fade(&mut self, fade: Option<Fade>) -> Result<()> {
        self.fader.set(fade)
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

    /// Seconds between a pose and its deltas: 0 unless the model looks ahead, at any time step. Controls that make flesh answer
    /// later ([`crate::Control::softness`], [`crate::Control::lag`]) are not counted.
    pub fn latency(&self) -> f32 {
        self.bundle.descriptor.look_ahead as f32 / self.bundle.descriptor.fps
    }
    /// Trust in the newest deltas, as the last report that had a frame in it said; 1 before the first frame.
    pub fn trust(&self) -> f32 {
        self.trust
    }
    /// Part of the deltas that is shown, where they fade: 0 to 1.
    pub fn faded(&self) -> f32 {
        self.fader.factor()
    }

    /// Forgets the motion: the next pose is a first one.
    pub fn reset(&mut self) {
        self.input.clear();
        self.shown.clear();
        self.framed.clear();
        self.fader.reset();
        self.trust = 1.0;
        self.reset_motion();
    }

    /// Forgets what moved, keeps where the body stands.
    pub(crate) fn reset_motion(&mut self) {
        self.reset_model();
        self.answer.fill(Vec3::ZERO);
        self.deltas.fill(Vec3::ZERO);
        self.begin_motion();
    }

    /// The next pose is a first one, for a model that goes on.
    fn begin_motion(&mut self) {
        self.descriptor_state = self.descriptor.state();
        self.clock.stop();
        (self.teleported, self.last_move) = (Vec3::ZERO, Vec3::ZERO);
        (self.frames, self.posed) = (0, false);
    }

    /// Begins in the steady state of a pose: as if the body had stood in it for so many seconds (0 to 60; 3 are enough
    /// for any flesh). The next pose is a first one: the motion may begin in mid-movement and makes no jolt.
    pub fn pre_roll(&mut self, pose: Pose, seconds: f32) -> StepReport {
        self.reset();
        let mut report = self.begin(pose);
        self.correct(0..self.blocks());
        self.sense(&mut ());
        let frames = (seconds.clamp(0.0, LONGEST_PRE_ROLL) * self.bundle.descriptor.fps).round() as usize;
        // Of a pose that stands still nothing changes but the answer of the flesh.
        for _ in 0..frames {
            self.infer(&mut report, &mut ());
        }
        self.shown.set(&self.input);
        self.begin_motion();
        report
    }

    /// One frame of the bundle's rate. The deltas are those of this pose, or of the pose [`Player::delay_frames`] ago.
    pub fn step(&mut self, pose: Pose) -> StepReport {
        self.step_after(pose, false)
    }

    /// The same where the root has jumped since the last frame and [`Player::relocate`] knows of it.
    pub(crate) fn step_after(&mut self, pose: Pose, jumped: bool) -> StepReport {
        self.watched_step(pose, jumped, &mut ())
    }

    /// A frame with the newest features, shown on a pose that waits.
    pub(crate) fn step_on(&mut self, waiting: usize) -> StepReport {
        self.shown.set(&self.waiting[waiting]);
        self.posed = false;
        let mut report = StepReport::default();
        self.infer(&mut report, &mut ());
        report
    }

    /// The same and the posed vertices, with the time that it took: a whole frame of an animation.
    pub fn timed_step(&mut self, pose: Pose) -> (StepReport, StepTimes) {
        let mut watch = Stopwatch::start();
        let report = self.watched_step(pose, false, &mut watch);
        self.vertices();
        watch.lap(StepPart::Skinning);
        (report, watch.stop())
    }

    fn watched_step(&mut self, pose: Pose, jumped: bool, watch: &mut impl Watch) -> StepReport {
        let mut report = self.begin(pose);
        report.teleported |= jumped;
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
        self.sense(watch);
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
            self.framed.set(&self.shown);
            self.posed = false;
            !report.waiting
        } else {
            self.shown.set(&self.input);
            true
        }
    }

    /// From corrected to posed vertices and features.
    fn sense(&mut self, watch: &mut impl Watch) {
        self.posing.skin(&self.bundle.body, &self.shaped);
        self.posed = true;
        watch.lap(StepPart::Skinning);
        let Posing { transforms, skinned, .. } = &self.posing;
        let (state, features) = (&mut self.descriptor_state, &mut self.features);
        self.ahead.begin(features);
        self.descriptor.watched_step(state, self.input.steady(), transforms, skinned, features, watch);
        self.frames += 1;
        if self.frames == 1 {
            self.ahead.begin(features);
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
    /// From here on the root is read as if it had not been moved by `shift`.
    pub(crate) fn relocate(&mut self, shift: Vec3) {
        self.teleported += shift;
        self.input.translation += shift;
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

    pub(crate) fn reset_model(&mut self) {
        self.model_state.reset();
        if let Some(mixer) = &mut self.mixer {
            mixer.reset();
        }
    }
}
