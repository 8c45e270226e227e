use super::{RolloutClip, SurfacePredictor};
use crate::mean_distance;

/// A rollout that is never started again: through all frames of a clip that may be judged, as methods of registered meshes
/// are rolled out.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FreeRollout {
    /// Its first frame.
    pub start: usize,
    /// Predicted heights of its frames over all observers, `[frames]` of `[N]`, metres.
    pub heights: Vec<Vec<f32>>,
    /// Mean distance of scan points from the predicted surface of each frame, mm: absent where there is no scan or no
    /// surface, empty where nobody asked.
    pub distance_mm: Vec<Option<f64>>,
}

impl FreeRollout {
    /// Rolls a predictor through a clip from its first frame that has a history; with `distances` every frame's surface is
    /// drawn and measured too, which takes most of the time.
    ///
    /// # Errors
    /// The predictor's.
    pub fn of<P: SurfacePredictor>(predictor: &mut P, clip: &RolloutClip, distances: bool) -> Result<Self, P::Error> {
        let start = clip.frames.start.max(clip.history).max(1);
        let mut free = Self { start, ..Self::default() };
        if start >= clip.frames.end {
            return Ok(free);
        }
        predictor.restart(start)?;
        for t in start..clip.frames.end {
            let surface = predictor.predict(t)?;
            free.heights.push(surface.heights().to_vec());
            if distances {
                let (scan, at) = (clip.scans[t].as_ref(), &clip.observers[t].positions);
                let distance = scan.map(|s| Ok(mean_distance(s.points(), surface.mesh(at)?.as_ref())));
                free.distance_mm.push(distance.transpose()?.flatten().map(|m| 1000.0 * m));
            }
        }
        Ok(free)
    }
}
