use crate::controls::Mixer;
use crate::times::{StepPart, Watch};
use crate::{Bundle, Player, StepReport, Trust};
use glam::Vec3;
use std::ops::{Deref, Range};

impl<B: Deref<Target = Bundle>> Player<B> {
    /// From features to deltas.
    pub(crate) fn infer(&mut self, report: &mut StepReport, watch: &mut impl Watch) {
        self.predict(report, watch);
        self.add_deltas(0..self.blocks());
        if self.mixer.is_none() && self.bundle.model.basis().is_some() {
            watch.lap(StepPart::Decoder);
        }
        self.settle(report);
    }

    /// From features to what the deltas are summed from; to the deltas where they are no such sum, or a mixture.
    pub(crate) fn predict(&mut self, report: &mut StepReport, watch: &mut impl Watch) {
        self.judge(report);
        let (model, part) = (&self.bundle.model, self.part.as_deref());
        if let Some(mixer) = &mut self.mixer {
            report.features_clipped = mixer.step(model, &self.features, part);
            mixer.mix(0.0, &mut self.answer);
            watch.lap(StepPart::Regressor);
            return;
        }
        let deltas = bytemuck::cast_slice_mut(&mut self.answer);
        report.features_clipped = model.predict(&self.features, &mut self.model_state, deltas, watch);
        if let Some(basis) = model.basis() {
            basis.begin_sum(deltas, part);
        }
    }

    /// Some blocks of the sum.
    pub(crate) fn add_deltas(&mut self, blocks: Range<usize>) {
        let basis = self.bundle.model.basis().filter(|_| self.mixer.is_none());
        if let (Some(basis), Some(coefficients)) = (basis, self.model_state.coefficients()) {
            let deltas = bytemuck::cast_slice_mut(&mut self.answer);
            basis.add_blocks(coefficients, deltas, self.part.as_deref(), blocks);
        }
    }

    /// The end of a frame.
    pub(crate) fn settle(&mut self, report: &mut StepReport) {
        if let Some(part) = &self.part {
            part.hold(&mut self.answer);
        }
        let state_is_finite = self.mixer.as_ref().map_or(self.model_state.is_finite(), Mixer::is_finite);
        if !state_is_finite || !self.answer.iter().all(|d| d.is_finite()) {
            self.reset_model();
            self.answer.fill(Vec3::ZERO);
            report.restarted = true;
        }
        self.answer_at(0.0);
    }

    /// How far the newest features lie from the training's, and what that means for what is shown.
    fn judge(&mut self, report: &mut StepReport) {
        let trust = &self.bundle.trust;
        let distance = trust.of_features(self.descriptor.blocks(), &self.features);
        let known = !report.pose_held && !report.teleported;
        self.trust = if known { Trust::at(distance).min(Trust::at(self.shape_distance)) } else { 0.0 };
        report.trust = self.trust;
        self.fader.step(self.trust, 1.0 / self.bundle.descriptor.fps);
    }

    /// Shows the deltas this part of a frame after the newest one.
    pub(crate) fn answer_at(&mut self, part: f32) {
        let (model, factor) = (&self.bundle.model, self.fader.factor());
        if part <= 0.0 {
            self.deltas.iter_mut().zip(&self.answer).for_each(|(d, a)| *d = factor * a);
            return;
        }
        if let Some(features) = self.ahead.features(&self.features) {
            match &mut self.mixer {
                Some(mixer) => mixer.look_ahead(model, features, self.part.as_deref()),
                None => self.ahead.look(model, &self.model_state, &self.answer, self.part.as_deref()),
            }
        }
        match &self.mixer {
            Some(mixer) => {
                mixer.mix(part, &mut self.deltas);
                if let Some(detail) = &self.part {
                    detail.hold(&mut self.deltas);
                }
                self.deltas.iter_mut().for_each(|d| *d *= factor);
            }
            None => {
                let between = self.answer.iter().zip(self.ahead.deltas());
                self.deltas.iter_mut().zip(between).for_each(|(d, (a, b))| *d = factor * a.lerp(*b, part));
            }
        }
    }
}
