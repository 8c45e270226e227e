use crate::{Bundle, BundleError, Player, Result, RolloutReport};
use glam::Vec3;
use softtissue_body::Pose;
use softtissue_geometry::Frames;
use std::ops::Deref;

impl<B: Deref<Target = Bundle>> Player<B> {
    /// A whole motion from its start: rotations `[T, J]`, radians, and translations `[T]`, metres. `show` is called for
    /// each frame in order, look-ahead taken out; an error of its own ends the play. Returns what the steps had to do.
    pub fn play(
        &mut self,
        rotations: &Frames,
        translations: &[Vec3],
        show: impl FnMut(usize, &mut Self) -> Result<()>,
    ) -> Result<RolloutReport> {
        self.reset();
        self.play_on(rotations, translations, show)
    }

    /// The same without a reset: after [`Player::pre_roll`].
    pub fn play_on(
        &mut self,
        rotations: &Frames,
        translations: &[Vec3],
        mut show: impl FnMut(usize, &mut Self) -> Result<()>,
    ) -> Result<RolloutReport> {
        self.check_motion(rotations, translations)?;
        let (frames, delay) = (translations.len(), self.delay_frames());
        let mut sum = RolloutReport { frames, ..Default::default() };
        for t in 0..frames {
            let report = self.step(Pose { rotations: rotations.frame(t), translation: translations[t] });
            sum.add(t.saturating_sub(delay), &report);
            if !report.waiting {
                show(t - delay, self)?;
            }
        }
        // The newest features last for the frames that still wait.
        for t in frames.saturating_sub(delay)..frames {
            let report = self.step_on(delay + t - frames);
            sum.add(t, &report);
            show(t, self)?;
        }
        Ok(sum)
    }

    /// Deltas `[T, V]` of a whole motion from its start.
    pub fn rollout(&mut self, rotations: &Frames, translations: &[Vec3]) -> Result<Frames> {
        let mut frames = Frames::new(self.deltas().len());
        self.play(rotations, translations, |_, player| {
            frames.push(player.deltas());
            Ok(())
        })?;
        Ok(frames)
    }
    /// Posed vertices with deltas `[T, V]` of a whole motion from its start.
    pub fn rollout_vertices(&mut self, rotations: &Frames, translations: &[Vec3]) -> Result<Frames> {
        let mut frames = Frames::new(self.deltas().len());
        self.play(rotations, translations, |_, player| {
            frames.push(player.vertices());
            Ok(())
        })?;
        Ok(frames)
    }

    /// Whether a motion is one of this body.
    pub(crate) fn check_motion(&self, rotations: &Frames, translations: &[Vec3]) -> Result<()> {
        let (frames, joints) = (translations.len(), self.bundle().body.joint_count());
        if rotations.len() != frames || rotations.points_per_frame() != joints {
            return Err(BundleError::Input(format!(
                "{} frames of {} joints with {frames} root translations, expected as many of each and {joints} joints",
                rotations.len(),
                rotations.points_per_frame()
            )));
        }
        Ok(())
    }
}
