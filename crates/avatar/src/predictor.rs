use crate::avatar::{AvatarBody, AvatarField, Playback};
use crate::clip::AvatarClip;
use crate::config::Conditioning;
use crate::features::PoseTrack;
use crate::network::AvatarNetwork;
use crate::{AvatarError, Result};
use glam::Vec3;
use softtissue_geometry::Mesh;
use softtissue_implicit::{
    ImplicitError, MarchingCubes, ObserverFrame, PredictedSurface, RolloutClip, SignedDistance, SurfacePredictor,
};
use softtissue_monitor::Monitor;
use std::borrow::Cow;

/// How far from an observer a surface is sought, metres.
pub const REACH: f32 = 0.1;

/// A network that is judged.
#[derive(Clone, Copy)]
pub struct Candidate<'a> {
    /// What it stands on.
    pub body: &'a AvatarBody,
    /// What it sees.
    pub conditioning: Conditioning,
    /// Without autodiff.
    pub network: &'a AvatarNetwork,
    /// Cells along the longest side of the grid that surfaces are drawn from.
    pub grid: usize,
}

impl<'a> Candidate<'a> {
    /// What it predicts of a clip.
    pub fn on(self, clip: &'a AvatarClip, monitor: &'a dyn Monitor) -> AvatarPredictor<'a> {
        AvatarPredictor { candidate: self, clip, monitor, playback: None }
    }

    /// Plays a motion of any length from the heights of its first frames, the newest last, and shows the heights of each
    /// frame after them, `[M]`, metres. `observers` gives the observers of a frame, so that a long motion need not be kept.
    ///
    /// # Errors
    /// Fewer frames of heights than the network sees, or a stop.
    pub fn heights_over(
        self,
        track: &PoseTrack,
        start: &[Vec<f32>],
        mut observers: impl FnMut(usize) -> ObserverFrame,
        monitor: &dyn Monitor,
        see: &mut dyn FnMut(&[f32]),
    ) -> Result<()> {
        let mut playback = Playback::new(self.body, self.network, self.conditioning, start)?;
        for t in start.len()..track.len() {
            if monitor.should_stop() {
                return Err(AvatarError::Stopped);
            }
            see(playback.step(track, t, &observers(t)).heights());
        }
        Ok(())
    }
}

/// A network's predictions of one clip; a rollout starts from true heights.
pub struct AvatarPredictor<'a> {
    candidate: Candidate<'a>,
    clip: &'a AvatarClip,
    monitor: &'a dyn Monitor,
    playback: Option<Playback<'a>>,
}

/// A field that is drawn by marching cubes.
struct Drawn<'a> {
    field: AvatarField<'a>,
    grid: usize,
}

impl SignedDistance for Drawn<'_> {
    fn values(&self, points: &[Vec3], out: &mut [f32]) {
        self.field.values(points, out);
    }

    fn normals(&self, points: &[Vec3], step: f32) -> Vec<Vec3> {
        self.field.normals(points, step)
    }
}

impl PredictedSurface for Drawn<'_> {
    fn mesh(&self, points: &[Vec3]) -> std::result::Result<Cow<'_, Mesh>, ImplicitError> {
        let cubes = MarchingCubes { resolution: self.grid, ..MarchingCubes::default() };
        Ok(Cow::Owned(cubes.mesh_near(&self.field, points, REACH)?))
    }

    fn heights(&self) -> &[f32] {
        self.field.heights()
    }
}

impl SurfacePredictor for AvatarPredictor<'_> {
    type Error = AvatarError;

    fn restart(&mut self, start: usize) -> Result<()> {
        let Candidate { body, conditioning, network, .. } = self.candidate;
        let history = self.clip.history(start, body.config.history);
        self.playback = Some(Playback::new(body, network, conditioning, history)?);
        Ok(())
    }

    fn predict(&mut self, t: usize) -> Result<Box<dyn PredictedSurface + '_>> {
        if self.monitor.should_stop() {
            return Err(AvatarError::Stopped);
        }
        let playback = self.playback.as_mut().expect("a rollout is started before it predicts");
        let field = playback.step(&self.clip.track, t, &self.clip.observers[t]);
        Ok(Box::new(Drawn { field, grid: self.candidate.grid }))
    }
}

impl AvatarClip {
    /// What is true of it, for the protocol; starts need `history` frames, and volume and motion count at the observers
    /// `judged`.
    pub fn truth<'a>(&'a self, history: usize, judged: &'a [usize]) -> RolloutClip<'a> {
        RolloutClip {
            frames: self.frames.clone(),
            history,
            observers: &self.observers,
            scans: &self.scans,
            heights: &self.heights,
            known: &self.known,
            judged,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::AvatarConfig;
    use crate::checks::{ball, breathing, short, trainee};
    use burn::module::Module;
    use burn::tensor::Device;
    use softtissue_clips::{ClipId, MotionClip};
    use softtissue_geometry::Frames;
    use softtissue_implicit::{FreeRollout, RolloutConfig, RolloutTally};
    use softtissue_monitor::Silent;
    use softtissue_train::Trainee;
    use std::sync::Arc;

    /// Both stages, of so many steps.
    fn learned(body: &Arc<AvatarBody>, steps: [u64; 2]) -> AvatarNetwork {
        let mut network = None;
        for (whole, steps) in AvatarConfig::default().stages().into_iter().zip(steps) {
            let config = short(whole, steps);
            let mut trainee = trainee(body, Conditioning::Autoregressive, &config, network.take(), &Device::flex());
            (0..steps).for_each(|step| drop(trainee.step(step).expect("a step")));
            network = Some(trainee.into_network());
        }
        network.expect("two stages").valid()
    }

    /// A minute of frames on the network's own heights, of which it has learned half a second: they stay where the true
    /// ones are, and the protocol reads the same heights off its surfaces.
    #[test]
    fn heights_stay_bounded_over_3600_frames() {
        let body = Arc::new(ball(&Device::flex()));
        let network = learned(&body, [300, 300]);
        let candidate =
            Candidate { body: &body, conditioning: Conditioning::Autoregressive, network: &network, grid: 24 };
        let clip = breathing(60, 0.0);
        let history = body.config.history;
        let motion = MotionClip {
            id: ClipId::new("ball", "still", 0),
            fps: 60.0,
            rotations: Frames::zeros(3, 3600),
            translations: vec![Vec3::ZERO; 3600],
        };
        let mut rms = Vec::new();
        let mut see = |heights: &[f32]| {
            let squares: f32 = heights.iter().map(|h| (h - 0.015).powi(2)).sum();
            rms.push((squares / heights.len() as f32).sqrt());
        };
        let at = |_: usize| clip.observers[0].clone();
        candidate
            .heights_over(&PoseTrack::new(&motion), clip.history(history, history), at, &Silent, &mut see)
            .expect("a rollout");
        assert_eq!(rms.len(), 3600 - history);
        let greatest = |part: &[f32]| part.iter().copied().fold(0.0, f32::max);
        // true heights swing by 10 mm about 15
        let (first, last) = (greatest(&rms[..600]), greatest(&rms[3000 - history..]));
        println!("greatest rms in the first 600 frames {first}, in the last {last}");
        assert!(greatest(&rms) < 0.015 && last < 1.2 * first, "{first} {last}");

        let judged: Vec<usize> = (0..64).collect();
        let truth = clip.truth(history, &judged);
        let free = FreeRollout::of(&mut candidate.on(&clip, &Silent), &truth, false).expect("a rollout");
        let squares = |h: &Vec<f32>| h.iter().map(|h| (h - 0.015).powi(2)).sum::<f32>();
        for (heights, rms) in free.heights.iter().zip(&rms) {
            assert!(((squares(heights) / 64.0).sqrt() - rms).abs() < 1e-6);
        }
        let mut tally = RolloutTally::default();
        tally.add(&mut candidate.on(&clip, &Silent), &truth, &RolloutConfig::default()).expect("rollouts");
        let figures = tally.figures();
        assert_eq!(figures.rollouts, 2);
        assert!(figures.distance_mm[&1] < 8.0 && figures.height_energy.is_some_and(|e| e > 0.1), "{figures:?}");
    }
}
