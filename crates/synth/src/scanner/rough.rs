use glam::Vec3;
use softtissue_clips::MotionClip;
use softtissue_geometry::{axis_angle_from_rotation, rotation_from_axis_angle};
use softtissue_random::Draws;

/// Waves of the error of each joint.
const WAVES: usize = 3;
/// Error of the translation for each degree of angular error, metres (rms length).
const METRES_PER_DEGREE: f32 = 0.003;

/// A motion with the smooth error of a rough tracker: each joint is turned by an angle of rms `degrees` that
/// changes at 0.2-1.5 Hz, the root wanders by a few millimetres.
pub fn rough_motion(motion: &MotionClip, degrees: f32, seed: u64) -> MotionClip {
    let joints = motion.rotations.points_per_frame();
    let mut rough = motion.clone();
    let stage = format!("synth-rough/{}", motion.id);
    for joint in 0..=joints {
        let mut draws = Draws::new(seed, &stage, joint as u64, 0);
        let size = if joint < joints { degrees.to_radians() } else { METRES_PER_DEGREE * degrees };
        let error = Wander::draw(&mut draws, size);
        for t in 0..motion.len() {
            let e = error.at(t as f32 / motion.fps);
            if joint < joints {
                let w = &mut rough.rotations.frame_mut(t)[joint];
                *w = axis_angle_from_rotation(rotation_from_axis_angle(e) * rotation_from_axis_angle(*w));
            } else {
                rough.translations[t] += e;
            }
        }
    }
    rough
}

/// A smooth random vector of time, of a given rms length.
struct Wander {
    waves: Vec<(Vec3, f32, f32)>,
}

impl Wander {
    fn draw(draws: &mut Draws, size: f32) -> Self {
        // each wave's vector has unit length; sin^2 is one half in the mean
        let scale = size * (2.0 / WAVES as f32).sqrt();
        let waves = (0..WAVES).map(|_| {
            let v = Vec3::from_array(std::array::from_fn(|_| draws.normal() as f32)).normalize_or(Vec3::X);
            let rate = std::f64::consts::TAU * draws.range(0.2, 1.5);
            (v * scale, rate as f32, draws.range(0.0, std::f64::consts::TAU) as f32)
        });
        Self { waves: waves.collect() }
    }
    fn at(&self, seconds: f32) -> Vec3 {
        self.waves.iter().map(|(v, rate, phase)| *v * (rate * seconds + phase).sin()).sum()
    }
}
