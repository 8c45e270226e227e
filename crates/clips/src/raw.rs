use crate::{ClipEntry, ClipId, Result};
use glam::Vec3;
use softtissue_geometry::Frames;

/// One frame of a raw scan: points on a surface, without correspondence to any template or other frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RawFrame {
    /// Metres, Y up, in any order and number.
    pub points: Vec<Vec3>,
    /// Unit outward normals, one a point (zero where unknown), or empty where there are none.
    pub normals: Vec<Vec3>,
}

/// Raw scans, handed out a frame at a time so that no clip need lie in memory whole.
pub trait RawScans: Sync {
    /// Clips with their frames and rates.
    fn clips(&self) -> Vec<ClipEntry>;
    /// A frame; `None` where it is missing from the sequence.
    ///
    /// # Errors
    /// A frame that cannot be read.
    fn frame(&self, id: &ClipId, t: usize) -> Result<Option<RawFrame>>;
    /// Where they came from.
    fn provenance(&self) -> serde_json::Value;
}

/// Fills the frames `missing`, ascending, by interpolating linearly between their neighbours in time; at the ends the
/// nearest frame is repeated.
pub fn interpolate_missing(frames: &mut Frames, missing: &[usize]) {
    let present = |t: &usize| missing.binary_search(t).is_err();
    for &t in missing {
        let before = (0..t).rev().find(present);
        let after = (t + 1..frames.len()).find(present);
        let blend: Vec<Vec3> = match (before, after) {
            (Some(a), Some(b)) => {
                let s = (t - a) as f32 / (b - a) as f32;
                frames.frame(a).iter().zip(frames.frame(b)).map(|(p, q)| p.lerp(*q, s)).collect()
            }
            (Some(only), None) | (None, Some(only)) => frames.frame(only).to_vec(),
            (None, None) => return,
        };
        frames.frame_mut(t).copy_from_slice(&blend);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn missing_frames_lie_between_their_neighbours() {
        let mut frames = Frames::from_points(1, [0.0, 9.0, 9.0, 3.0, 9.0].map(|x| Vec3::X * x).to_vec());
        interpolate_missing(&mut frames, &[1, 2, 4]);
        let x: Vec<f32> = frames.points().iter().map(|p| p.x).collect();
        assert_eq!(x, [0.0, 1.0, 2.0, 3.0, 3.0]);
    }
}
