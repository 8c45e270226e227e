//! What a person is: shape and static detail, from frames at the starts of the clips, in which flesh hangs still.

use super::align::ShapeSpace;
use super::frame::check_points;
use super::model::Registrar;
use crate::normal::shape_translations;
use crate::pose_state::PoseState;
use crate::shape::{Joint, joint_step};
use crate::template::subject_template;
use crate::{FitError, Result};
use glam::{Vec3, Vec3A};
use rayon::prelude::*;
use softtissue_body::ShapedBody;
use softtissue_clips::{ClipEntry, RawFrame, RawScans};
use softtissue_monitor::Monitor;

/// A person.
pub(crate) struct Subject {
    pub beta: Vec<f32>,
    pub shaped: ShapedBody,
    /// Displacement of the shaped rest mesh, `[V]`.
    pub detail: Vec<Vec3>,
    /// Pose of the first frame, to start other clips from.
    pub start: PoseState,
}

/// Steps of shape and poses together; points are forgotten sooner from step to step.
const SHAPE_STEPS: usize = 14;
/// Weight of `|beta|^2`, m^2.
const SHAPE_PRIOR: f64 = 1e-6;
/// Damping of the joint step.
const DAMPING: f64 = 1e-3;
/// Largest turn, move or change of a shape coefficient in a step.
const LARGEST_STEP: f64 = 0.6;
/// Points of each frame that the shape is fitted to.
const POINTS: usize = 4000;

impl Registrar<'_> {
    /// Shape, detail and a first pose of one person from its clips.
    pub fn subject(&self, scans: &dyn RawScans, clips: &[ClipEntry], monitor: &dyn Monitor) -> Result<Subject> {
        let frames = self.first_frames(scans, clips)?;
        let (mut beta, mut detail) = (vec![0.0f64; self.body.shape_count()], self.zeros());
        let mean = self.body.shaped(&[]);
        let first = self.start(&mean, &detail, &frames[0], None);
        let others = frames[1..].par_iter().map(|frame| self.start(&mean, &detail, frame, Some(&first)));
        let mut states: Vec<PoseState> = std::iter::once(first.clone()).chain(others.collect::<Vec<_>>()).collect();
        for step in 0..SHAPE_STEPS {
            if monitor.should_stop() {
                return Err(FitError::Stopped);
            }
            let outlier = (0.06 * 0.8f32.powi(step as i32)).max(self.config.outlier);
            self.shape_step(&frames, &mut states, &mut beta, outlier);
        }
        let beta: Vec<f32> = beta.iter().map(|b| *b as f32).collect();
        let shaped = self.body.shaped(&beta);
        // each pass sees the body with the detail of the one before
        for _ in 0..2 {
            let fields: Vec<Vec<Vec3>> = frames
                .par_iter()
                .zip(&mut states)
                .map(|(frame, state)| {
                    let predicted = state.clone();
                    *state = self.pose(&shaped, &detail, frame, &predicted);
                    self.frame_surface(&shaped, &detail, &detail, frame, state).0
                })
                .collect();
            detail = subject_template(fields.iter().map(|f| (0.0, f.as_slice())).collect(), 1.0);
        }
        Ok(Subject { beta, shaped, detail, start: states.swap_remove(0) })
    }

    pub(crate) fn zeros(&self) -> Vec<Vec3> {
        vec![Vec3::ZERO; self.body.vertex_count()]
    }

    /// First frames of the clips in turn, then frames a twelfth of a second later, and so on.
    fn first_frames(&self, scans: &dyn RawScans, clips: &[ClipEntry]) -> Result<Vec<RawFrame>> {
        let wanted = self.config.subject_frames;
        let mut frames = Vec::with_capacity(wanted);
        for round in 0..wanted.div_ceil(clips.len()) {
            for clip in clips {
                let t = round * (clip.fps / 12.0).ceil() as usize;
                if t < clip.frames
                    && frames.len() < wanted
                    && let Some(frame) = scans.frame(&clip.id, t)?
                {
                    check_points(&clip.id, t, &frame)?;
                    frames.push(frame);
                }
            }
        }
        if frames.is_empty() { Err(FitError::Empty(clips[0].id.clone())) } else { Ok(frames) }
    }

    fn shape_step(&self, frames: &[RawFrame], states: &mut [PoseState], beta: &mut [f64], outlier: f32) {
        let (count, directions) = (self.body.vertex_count(), &self.body.shape_directions);
        let moved: Vec<Vec<Vec3A>> = directions
            .chunks_exact(count)
            .map(|d| self.body.joint_regressor.joints(d).into_iter().map(Vec3A::from).collect())
            .collect();
        let shaped = self.body.shaped(&beta.iter().map(|b| *b as f32).collect::<Vec<f32>>());
        let still = self.zeros();
        let each = |(frame, state): (&RawFrame, &PoseState)| {
            let posed = self.posed(&shaped, state, &still);
            let stride = frame.points.len().div_ceil(POINTS).max(1);
            let pairs = self.pairs(&posed, frame, stride, 4.0 * outlier, outlier);
            let translations = shape_translations(&self.parents, &posed.kinematics, &moved);
            let mut normal = self.normal(&posed, &pairs, Some(&ShapeSpace { directions, translations }));
            self.add_priors(&mut normal, &posed, state, None);
            (normal, posed)
        };
        let (normals, posed): (Vec<_>, Vec<_>) = frames.par_iter().zip(&*states).map(each).unzip();
        let joint = Joint { value: 0.0, frames: normals };
        let Some((shape_step, pose_steps)) = joint_step(&joint, beta, SHAPE_PRIOR, DAMPING) else { return };
        let largest = shape_step.iter().chain(pose_steps.iter().flatten()).fold(0.0f64, |m, x| m.max(x.abs()));
        let scale = (LARGEST_STEP / largest.max(1e-12)).min(1.0);
        beta.iter_mut().zip(&shape_step).for_each(|(b, d)| *b += scale * d);
        for ((state, step), posed) in states.iter_mut().zip(pose_steps).zip(&posed) {
            let step: Vec<f64> = step.iter().map(|d| d * scale).collect();
            *state = state.stepped(&step, &posed.kinematics);
        }
    }
}
