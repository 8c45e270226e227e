//! The scanner: registered meshes that slide along the skin and tremble, a rough guess of the pose, and raw scans,
//! which are points with holes, webbing and outliers.

mod raw;
mod rough;

pub use raw::{RawScanner, write_ply};
pub use rough::rough_motion;

use crate::Result;
use crate::checks::within;
use crate::subject::Waves;
use glam::Vec3;
use serde::{Deserialize, Serialize};
use softtissue_body::{BodyModel, Pose, ShapedBody};
use softtissue_clips::{DeltaClip, MotionClip, ScanClip};
use softtissue_geometry::{Frames, vertex_normals};
use softtissue_random::Draws;

/// What the scanner gets wrong.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ScannerConfig {
    /// Root mean square of the smooth sliding of vertices along the skin, metres. Default 0.003.
    pub drift: f32,
    /// Standard deviation of the noise along each axis, metres. Default 0.0005 (0.87 mm rms length).
    pub noise: f32,
    /// Root mean square angle of the rough pose channel's error, degrees. Default 1.5; 0 writes no such channel.
    pub rough_degrees: f32,
    /// Points of a raw scan, before holes: `raw/SUBJECT/MOTION.TAKE/*.ply` beside the registered scans, for trials of the
    /// registration. Default 0, no raw scans.
    pub raw_points: usize,
}

impl Default for ScannerConfig {
    fn default() -> Self {
        Self { drift: 0.003, noise: 0.0005, rough_degrees: 1.5, raw_points: 0 }
    }
}

impl ScannerConfig {
    /// Noise off: no drift, no noise; the rough channel stays.
    pub fn off() -> Self {
        Self { drift: 0.0, noise: 0.0, ..Self::default() }
    }

    /// Refuses what makes no sense, naming the field.
    ///
    /// # Errors
    /// A number out of its range.
    pub fn check(&self) -> Result<()> {
        if self.raw_points > 1_000_000 {
            let reason = format!("{} points a frame; write at most 1000000", self.raw_points);
            return Err(crate::SynthError::Config { field: "scanner.raw_points", reason });
        }
        within([
            ("scanner.drift", self.drift, 0.0..=0.05),
            ("scanner.noise", self.noise, 0.0..=0.05),
            ("scanner.rough_degrees", self.rough_degrees, 0.0..=30.0),
        ])
    }
}

/// Waves of a drift; each has its own slow rhythm.
const WAVES: usize = 8;

/// Posed vertices of every frame: `posed(T + Bs + Bp + rest displacement)`, where the displacement of the rest mesh
/// is `detail` plus the frame's delta plus what `extra` adds to frame `t`.
fn posed_frames(
    body: &BodyModel,
    shaped: &ShapedBody,
    motion: &MotionClip,
    deltas: &DeltaClip,
    detail: &[Vec3],
    extra: impl Fn(usize, &mut [Vec3]),
) -> Frames {
    assert_eq!(motion.len(), deltas.deltas.len(), "frames of motion and deltas");
    let mut frames = Frames::new(body.vertex_count());
    let mut rest = vec![Vec3::ZERO; body.vertex_count()];
    for t in 0..motion.len() {
        for (r, (detail, delta)) in rest.iter_mut().zip(detail.iter().zip(deltas.deltas.frame(t))) {
            *r = *detail + *delta;
        }
        extra(t, &mut rest);
        let pose = Pose { rotations: motion.rotations.frame(t), translation: motion.translations[t] };
        frames.push(&body.posed(shaped, pose, Some(&rest)));
    }
    frames
}

/// The posed body before the scanner: static detail and true deltas, no drift, no noise.
pub fn clean(
    body: &BodyModel,
    shaped: &ShapedBody,
    motion: &MotionClip,
    deltas: &DeltaClip,
    detail: &[Vec3],
) -> ScanClip {
    let vertices = posed_frames(body, shaped, motion, deltas, detail, |_, _| {});
    ScanClip { id: motion.id.clone(), fps: motion.fps, vertices }
}

/// What the scanner sees: the clean body with vertices that slide along the skin, and noise. The same clip and seed
/// give the same scan.
pub fn scan(
    body: &BodyModel,
    shaped: &ShapedBody,
    motion: &MotionClip,
    deltas: &DeltaClip,
    detail: &[Vec3],
    config: &ScannerConfig,
    seed: u64,
) -> ScanClip {
    let name = motion.id.to_string();
    let drift = Drift::draw(body, config.drift, &mut Draws::new(seed, &format!("synth-drift/{name}"), 0, 0));
    let mut vertices = posed_frames(body, shaped, motion, deltas, detail, |t, rest| {
        drift.add(t as f32 / motion.fps, rest);
    });
    if config.noise > 0.0 {
        let stage = format!("synth-noise/{name}");
        for t in 0..vertices.len() {
            let mut draws = Draws::new(seed, &stage, 0, t as u64);
            for x in vertices.frame_mut(t) {
                *x += Vec3::from_array(std::array::from_fn(|_| draws.normal() as f32)) * config.noise;
            }
        }
    }
    ScanClip { id: motion.id.clone(), fps: motion.fps, vertices }
}

/// A tangential displacement of the rest mesh that changes slowly, `sum_k F_k sin(w_k t + p_k)`.
struct Drift {
    /// Displacement, angular rate and phase of each wave.
    waves: Vec<(Vec<Vec3>, f32, f32)>,
}

impl Drift {
    fn draw(body: &BodyModel, size: f32, draws: &mut Draws) -> Self {
        if size <= 0.0 {
            return Self { waves: vec![] };
        }
        let normals = vertex_normals(&body.template, &body.topology.faces);
        let waves = (0..WAVES).map(|_| {
            let pattern = Waves::draw(draws, 3, 0.25, 0.8);
            let direction = Vec3::from_array(std::array::from_fn(|_| draws.normal() as f32)).normalize_or(Vec3::X);
            let mut field: Vec<Vec3> = body
                .template
                .iter()
                .zip(&normals)
                .map(|(p, n)| (direction - *n * n.dot(direction)) * pattern.at(*p))
                .collect();
            // sin^2 is one half in the mean, and the waves are independent
            let scale = size * (2.0 / WAVES as f32).sqrt() / crate::subject::rms(&field).max(1e-9);
            field.iter_mut().for_each(|x| *x *= scale);
            let rate = std::f64::consts::TAU * draws.range(0.15, 0.9);
            (field, rate as f32, draws.range(0.0, std::f64::consts::TAU) as f32)
        });
        Self { waves: waves.collect() }
    }

    fn add(&self, seconds: f32, rest: &mut [Vec3]) {
        for (field, rate, phase) in &self.waves {
            let s = (rate * seconds + phase).sin();
            rest.iter_mut().zip(field).for_each(|(r, f)| *r += *f * s);
        }
    }
}
