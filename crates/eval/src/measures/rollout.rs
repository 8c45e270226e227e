use glam::{Quat, Vec3};
use softtissue_body::{Region, RegionMap};
use softtissue_clips::MotionClip;
use softtissue_geometry::{Frames, axis_angle_from_rotation, rotation_from_axis_angle};

/// Greatest rms displacement that each region reaches in any frame, metres.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RegionPeaks([f64; Region::ALL.len()]);

impl RegionPeaks {
    /// Peaks of `[T, V, 3]` deltas.
    pub fn of(deltas: &Frames, regions: &RegionMap) -> Self {
        let mut peaks = Self::default();
        deltas.iter().for_each(|frame| peaks.include(frame, regions));
        peaks
    }
    /// Takes one more frame of `[V]` deltas into account. NaN counts as infinite.
    pub fn include(&mut self, frame: &[Vec3], regions: &RegionMap) {
        let mut sums = [(0.0f64, 0u32); Region::ALL.len()];
        for (d, r) in frame.iter().zip(&regions.0) {
            let s = &mut sums[*r as usize];
            *s = (s.0 + f64::from(d.length_squared()), s.1 + 1);
        }
        for (peak, (sum, count)) in self.0.iter_mut().zip(sums) {
            let rms = if sum.is_finite() { (sum / f64::from(count.max(1))).sqrt() } else { f64::INFINITY };
            *peak = peak.max(rms);
        }
    }
    /// Region by region the greater of two.
    pub fn max(&self, other: &Self) -> Self {
        let mut both = *self;
        both.0.iter_mut().zip(other.0).for_each(|(a, b)| *a = a.max(b));
        both
    }
    /// Peak of a region, metres.
    pub fn region(&self, region: Region) -> f64 {
        self.0[region as usize]
    }
    /// The greatest ratio over the soft regions and the calves to what training reached, and its region. Others
    /// hardly move, so that their ratio is one of noises. Absent if no such region ever moved in training.
    pub fn worst_ratio(&self, training: &Self) -> Option<(Region, f64)> {
        Region::ALL
            .into_iter()
            .filter(|r| (r.is_soft() || *r == Region::Calves) && training.region(*r) > 0.0)
            .map(|r| (r, self.region(r) / training.region(r)))
            .max_by(|a, b| a.1.total_cmp(&b.1))
    }
}

/// Seconds over which one clip's last pose turns into the next one's first.
const BLEND_S: f32 = 0.5;

/// One long motion: the clips in turn, again and again, until `seconds` are full. Between two clips stands a
/// half-second blend of poses; the next clip's root continues from where the last one stood (height excepted).
/// Panics without a clip, or if rates or joints differ.
pub fn looped(clips: &[MotionClip], seconds: f32) -> MotionClip {
    let first = &clips[0];
    assert!(clips.iter().all(|c| !c.is_empty() && c.fps == first.fps), "clips of one rate");
    let frames = (seconds * first.fps).round() as usize;
    let mut long = first.slice(0..first.len().min(frames));
    for clip in clips.iter().cycle().skip(1) {
        if long.len() >= frames {
            break;
        }
        append(&mut long, clip);
    }
    long.slice(0..frames.min(long.len()))
}

fn append(long: &mut MotionClip, clip: &MotionClip) {
    let end = long.len() - 1;
    let from = long.rotations.frame(end).to_vec();
    let (from_root, to_root) = (long.translations[end], clip.translations[0]);
    let shift = Vec3::new(from_root.x - to_root.x, 0.0, from_root.z - to_root.z);
    let steps = (BLEND_S * clip.fps).round().max(1.0) as usize;
    for i in 1..steps {
        let x = i as f32 / steps as f32;
        let s = x * x * (3.0 - 2.0 * x);
        let pose: Vec<Vec3> = from.iter().zip(clip.rotations.frame(0)).map(|(a, b)| between(*a, *b, s)).collect();
        long.rotations.push(&pose);
        long.translations.push(from_root.lerp(to_root + shift, s));
    }
    for t in 0..clip.len() {
        long.rotations.push(clip.rotations.frame(t));
        long.translations.push(clip.translations[t] + shift);
    }
}

fn between(a: Vec3, b: Vec3, s: f32) -> Vec3 {
    let [a, b] = [a, b].map(|w| Quat::from_mat3(&rotation_from_axis_angle(w)));
    axis_angle_from_rotation(glam::Mat3::from_quat(a.slerp(b, s)))
}

/// How long after the stop the flesh has to come to rest, seconds.
pub const REST_AFTER_S: f32 = 2.0;

/// Rms speed of `vertices` in the last quarter second before `stop + 2 s`, over that in the second before the
/// motion stops. Absent if the clip ends earlier or nothing moved before the stop.
pub fn rest_ratio(deltas: &Frames, vertices: &[u32], fps: f32, stop_frame: usize) -> Option<f64> {
    let end = stop_frame + (REST_AFTER_S * fps).round() as usize;
    let before = stop_frame.saturating_sub(fps.round() as usize).max(1)..stop_frame;
    if end > deltas.len() || before.is_empty() {
        return None;
    }
    let rms = |range: std::ops::Range<usize>| {
        let count = (range.len() * vertices.len()).max(1) as f64;
        let sum: f64 = range
            .flat_map(|t| vertices.iter().map(move |&v| (t, v as usize)))
            .map(|(t, v)| f64::from((deltas.frame(t)[v] - deltas.frame(t - 1)[v]).length_squared()))
            .sum();
        (sum / count).sqrt()
    };
    let moving = rms(before);
    (moving > 0.0).then(|| rms(end - (0.25 * fps).round() as usize..end) / moving)
}

#[cfg(test)]
mod tests {
    use super::*;
    use softtissue_clips::ClipId;

    fn motion(frames: usize, angle: f32, x: f32) -> MotionClip {
        let mut rotations = Frames::new(2);
        (0..frames).for_each(|_| rotations.push(&[Vec3::ZERO, Vec3::Y * angle]));
        let translations = vec![Vec3::new(x, 1.0, 0.0); frames];
        MotionClip { id: ClipId::new("a", "b", 0), fps: 60.0, rotations, translations }
    }

    #[test]
    fn loops_have_the_length_asked_for_and_no_jump() {
        let long = looped(&[motion(50, 0.0, 0.0), motion(40, 1.2, 3.0)], 20.0);
        assert_eq!((long.len(), long.rotations.len()), (1200, 1200));
        for t in 1..long.len() {
            let turn = (long.rotations.frame(t)[1] - long.rotations.frame(t - 1)[1]).length();
            // the blend's fastest step is 1.5 / 30 of 1.2 rad
            assert!(turn < 0.07, "{t} {turn}");
            assert!(
                (long.translations[t] - long.translations[t - 1]).length() < 1e-5,
                "the root goes on where it stood"
            );
        }
        assert!((long.rotations.frame(49 + 30)[1].y - 1.2).abs() < 1e-4);
        assert_eq!(looped(&[motion(50, 0.0, 0.0)], 0.5).len(), 30);
    }

    #[test]
    fn peaks_are_rms_of_the_worst_frame() {
        let regions = RegionMap(vec![Region::Belly, Region::Belly, Region::Chest, Region::Head]);
        let mut deltas = Frames::zeros(4, 3);
        deltas.frame_mut(1).copy_from_slice(&[Vec3::X * 0.03, Vec3::Y * 0.04, Vec3::ZERO, Vec3::X]);
        let peaks = RegionPeaks::of(&deltas, &regions);
        assert!((peaks.region(Region::Belly) - (0.5f64 * (0.0009 + 0.0016)).sqrt()).abs() < 1e-6);
        let mut twice = deltas.clone();
        twice.points_mut().iter_mut().for_each(|d| *d *= 2.0);
        let (region, ratio) = RegionPeaks::of(&twice, &regions).worst_ratio(&peaks).unwrap();
        assert_eq!(region, Region::Belly);
        assert!((ratio - 2.0).abs() < 1e-6);
        twice.frame_mut(0)[0].x = f32::NAN;
        assert_eq!(RegionPeaks::of(&twice, &regions).worst_ratio(&peaks).unwrap().1, f64::INFINITY);
        assert_eq!(peaks.worst_ratio(&RegionPeaks::default()), None);
    }

    #[test]
    fn rest_is_the_ratio_of_speeds() {
        // exp(-k t) from the stop on, constant speed before: after 2 s the speed is k exp(-2 k) of the unit
        let (fps, stop, k) = (60.0f32, 60usize, 2.0f32);
        let mut deltas = Frames::new(1);
        for t in 0..200 {
            let s = (t as f32 - stop as f32) / fps;
            let x = if s < 0.0 { s * k } else { 1.0 - (-k * s).exp() };
            deltas.push(&[Vec3::X * x]);
        }
        // rms of exp(-2 t) over the quarter second before 2 s, taken at the middles of the frame steps
        let (a, b) = (2.0f64 - 0.25 - 1.0 / 60.0, 2.0f64 - 1.0 / 60.0);
        let expected = (((-4.0 * a).exp() - (-4.0 * b).exp()) / (4.0 * (b - a))).sqrt();
        let found = rest_ratio(&deltas, &[0], fps, stop).unwrap();
        assert!((found / expected - 1.0).abs() < 2e-3, "{found} {expected}");
        assert_eq!(rest_ratio(&deltas, &[0], fps, 100), None, "too short to tell");
        assert_eq!(rest_ratio(&Frames::zeros(1, 200), &[0], fps, stop), None);
    }
}
