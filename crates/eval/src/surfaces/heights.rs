use super::CycleFigures;
use crate::measures::{RegionPeaks, STILL_MM_S, region_mean, spectral_distance, spectrum};
use crate::tally::MOVING;
use glam::Vec3;
use softtissue_body::RegionMap;
use softtissue_geometry::Frames;
use std::time::Instant;

/// Heights over the observers of one clip as the scans have them.
#[derive(Clone, Copy, Debug)]
pub struct HeightTrace<'a> {
    /// The region of each observer, `[N]`.
    pub regions: &'a RegionMap,
    /// Frames a second.
    pub fps: f32,
    /// `[T]` of `[N]`, metres.
    pub heights: &'a [Vec<f32>],
    /// Whether the scan was seen there, `[T]` of `[N]`.
    pub known: &'a [Vec<bool>],
}

impl HeightTrace<'_> {
    /// Changes from frame to frame, as displacements along one axis, `[T - 1, N]`; where a scan was not seen in either
    /// frame nothing counts as changed.
    fn changes(&self, heights: &[Vec<f32>]) -> Frames {
        let mut out = Frames::new(self.regions.0.len());
        for t in 1..heights.len() {
            let change = |i: usize| {
                let seen = self.known[t][i] && self.known[t - 1][i];
                if seen { Vec3::X * (heights[t][i] - heights[t - 1][i]) } else { Vec3::ZERO }
            };
            out.push(&(0..self.regions.0.len()).map(change).collect::<Vec<Vec3>>());
        }
        out
    }

    /// How far the spectrum of predicted heights, `[T]` of `[N]`, metres, is from the true one: of regional means of the
    /// changes from frame to frame, decibels, mean over the regions whose true heights change by more than 20 mm/s rms.
    /// Changes and not heights, so that what stands still weighs nothing, however wrong it is. Absent if nothing moves or
    /// the prediction is not finite.
    pub fn spectral_db(&self, predicted: &[Vec<f32>]) -> Option<f64> {
        assert_eq!(predicted.len(), self.heights.len(), "frames of heights");
        if predicted.iter().flatten().any(|h| !h.is_finite()) {
            return None;
        }
        let (truth, own) = (self.changes(self.heights), self.changes(predicted));
        let fps = f64::from(self.fps);
        let distance = |region: softtissue_body::Region| {
            let observers = self.regions.vertices(region);
            let squares = truth.iter().flat_map(|f| observers.iter().map(|i| f64::from(f[*i as usize].x).powi(2)));
            let count = (truth.len() * observers.len()).max(1) as f64;
            let speed_mm_s = 1000.0 * fps * (squares.sum::<f64>() / count).sqrt();
            if speed_mm_s <= STILL_MM_S {
                return None;
            }
            let of = |changes: &Frames| spectrum(&region_mean(changes, &observers), fps);
            spectral_distance(&of(&own), &of(&truth))
        };
        let distances: Vec<f64> = MOVING.into_iter().filter_map(distance).collect();
        let mean = distances.iter().sum::<f64>() / distances.len().max(1) as f64;
        (!distances.is_empty()).then_some(mean)
    }

    /// Mean of each observer's known heights, `[N]`; absent where it was never seen.
    fn means(&self) -> Vec<Option<f32>> {
        let mean = |i: usize| {
            let seen = self.heights.iter().zip(self.known).filter(|(_, k)| k[i]).map(|(h, _)| h[i]);
            let (sum, count) = seen.fold((0.0f32, 0u32), |(sum, n), h| (sum + h, n + 1));
            (count > 0).then(|| sum / count as f32)
        };
        (0..self.regions.0.len()).map(mean).collect()
    }
}

/// Whether a long rollout of `frames` over one motion stays where the motion's true heights are; `each` hands every
/// frame's heights, `[N]`, metres, to its argument. Absent if the clip's true heights do not move, and of a rollout that is too
/// short to have quarters. A true height that a scan does not show is the one that it showed last.
///
/// # Errors
/// Those of `each`.
pub fn cycle_figures<E>(
    truth: &HeightTrace,
    clip: &str,
    frames: usize,
    each: impl FnOnce(&mut dyn FnMut(&[f32])) -> Result<(), E>,
) -> Result<Option<CycleFigures>, E> {
    let means = truth.means();
    let about = |heights: &[f32]| -> Vec<Vec3> {
        heights.iter().zip(&means).map(|(h, mean)| mean.map_or(Vec3::ZERO, |m| Vec3::X * (h - m))).collect()
    };
    let mut wanted = RegionPeaks::default();
    let mut last: Vec<f32> = means.iter().map(|m| m.unwrap_or(0.0)).collect();
    for (heights, known) in truth.heights.iter().zip(truth.known) {
        last.iter_mut().zip(heights).zip(known).filter(|(_, k)| **k).for_each(|((l, h), _)| *l = *h);
        wanted.include(&about(&last), truth.regions);
    }
    let mut found = RegionPeaks::default();
    let begun = Instant::now();
    let (mut t, mut quarters) = (0usize, [(0.0f64, 0u64); 4]);
    each(&mut |heights| {
        let off = about(heights);
        found.include(&off, truth.regions);
        let quarter = &mut quarters[(4 * t / frames.max(1)).min(3)];
        quarter.0 += off.iter().map(|d| f64::from(d.length_squared())).sum::<f64>();
        quarter.1 += off.len() as u64;
        t += 1;
    })?;
    let rms = |(sum, count): (f64, u64)| (sum / count.max(1) as f64).sqrt();
    let growth = rms(quarters[3]) / rms(quarters[0]);
    let ratio = found.worst_ratio(&wanted).filter(|_| t >= quarters.len());
    Ok(ratio.map(|(_, bounded_ratio)| CycleFigures {
        clip: clip.to_owned(),
        frames: t,
        bounded_ratio,
        frame_ms: 1000.0 * begun.elapsed().as_secs_f64() / t.max(1) as f64,
        growth: if growth.is_finite() { growth } else { f64::MAX },
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use softtissue_body::Region;

    const FPS: f32 = 60.0;

    /// Heights of eight observers, half on the belly and half on the head, that swing by `size` metres at `hz`.
    fn swinging(frames: usize, size: f32, hz: f32) -> Vec<Vec<f32>> {
        let height = |t: usize| 0.01 + size * (std::f32::consts::TAU * hz * t as f32 / FPS).sin();
        (0..frames).map(|t| vec![height(t); 8]).collect()
    }

    fn with_truth<T>(heights: &[Vec<f32>], known: &[Vec<bool>], ask: impl FnOnce(&HeightTrace) -> T) -> T {
        let regions = RegionMap([vec![Region::Belly; 4], vec![Region::Head; 4]].concat());
        ask(&HeightTrace { regions: &regions, fps: FPS, heights, known })
    }

    /// Half the amplitude is 20 log10(2) decibels at the peak; standing still is 40 there, the floor.
    #[test]
    fn spectra_of_swings_in_closed_form() {
        let (truth, known) = (swinging(240, 0.01, 4.0), vec![vec![true; 8]; 240]);
        let db = |predicted: &[Vec<f32>]| with_truth(&truth, &known, |t| t.spectral_db(predicted));
        assert_eq!(db(&truth), Some(0.0));
        let shifted: Vec<Vec<f32>> = truth.iter().map(|h| h.iter().map(|h| h + 0.02).collect()).collect();
        assert!(db(&shifted).is_some_and(|x| x < 1e-3), "a wrong mean is no motion");
        let (half, still) = (db(&swinging(240, 0.005, 4.0)).unwrap(), db(&vec![vec![0.01; 8]; 240]).unwrap());
        let faster = db(&swinging(240, 0.01, 6.0)).unwrap();
        // three bins of a Hann window hold a swing of a whole number of periods, of 29 between 0.75 and 15 Hz
        let bins = 29.0f64;
        let floor = |below: f64| 40.0 - below;
        let wanted_still = ((floor(0.0).powi(2) + 2.0 * floor(6.02).powi(2)) / bins).sqrt();
        let wanted_half = (3.0 * 6.02f64.powi(2) / bins).sqrt();
        assert!((half - wanted_half).abs() < 0.1, "{half} {wanted_half}");
        assert!((still - wanted_still).abs() < 0.5, "{still} {wanted_still}");
        assert!(faster > still, "the wrong frequency is no better than none: {faster} {still}");
    }

    #[test]
    fn what_is_not_seen_and_what_does_not_move_says_nothing() {
        let truth = swinging(240, 0.01, 4.0);
        let still = vec![vec![0.0; 8]; 240];
        let unseen = vec![vec![false; 8]; 240];
        assert_eq!(with_truth(&truth, &unseen, |t| t.spectral_db(&still)), None);
        let known = vec![vec![true; 8]; 240];
        assert_eq!(with_truth(&still, &known, |t| t.spectral_db(&truth)), None);
        let broken = vec![vec![f32::NAN; 8]; 240];
        assert_eq!(with_truth(&truth, &known, |t| t.spectral_db(&broken)), None);
    }

    fn cycle(predicted: impl Fn(usize) -> f32) -> CycleFigures {
        cycle_of(&vec![vec![true; 8]; 120], 3600, predicted).unwrap()
    }

    fn cycle_of(known: &[Vec<bool>], frames: usize, predicted: impl Fn(usize) -> f32) -> Option<CycleFigures> {
        let truth = swinging(120, 0.01, 4.0);
        let each = |see: &mut dyn FnMut(&[f32])| {
            (0..frames).for_each(|t| see(&[predicted(t); 8]));
            Ok::<(), std::convert::Infallible>(())
        };
        with_truth(&truth, known, |t| cycle_figures(t, "s00/x.0", frames, each)).unwrap()
    }

    /// Half the observers are hidden in every second frame, the others in the rest.
    #[test]
    fn what_a_scan_hides_does_not_lower_the_true_peak() {
        let known: Vec<Vec<bool>> = (0..120).map(|t| (0..8).map(|i| (i + t) % 2 == 0).collect()).collect();
        let swing = |t: usize| 0.01 + 0.01 * (std::f32::consts::TAU * 4.0 * t as f32 / FPS).sin();
        let found = cycle_of(&known, 3600, swing).unwrap();
        assert!((found.bounded_ratio - 1.0).abs() < 0.05, "{found:?}");
        assert!(cycle_of(&known, 3, swing).is_none() && cycle_of(&known, 4, swing).is_some());
    }

    #[test]
    fn growth_over_a_minute_of_frames_is_seen() {
        let swing = |t: usize| (std::f32::consts::TAU * 4.0 * t as f32 / FPS).sin();
        let steady = cycle(|t| 0.01 + 0.01 * swing(t));
        assert_eq!((steady.frames, steady.clip.as_str()), (3600, "s00/x.0"));
        assert!((steady.bounded_ratio - 1.0).abs() < 1e-3 && (steady.growth - 1.0).abs() < 1e-3, "{steady:?}");
        let growing = cycle(|t| 0.01 + 0.01 * (1.0 + t as f32 / 1200.0) * swing(t));
        assert!((growing.bounded_ratio - 4.0).abs() < 0.05, "{growing:?}");
        // squares of a line's means over the last and the first quarter
        let mean_square = |a: f64, b: f64| (b.powi(3) - a.powi(3)) / (3.0 * (b - a));
        let wanted = (mean_square(3.25, 4.0) / mean_square(1.0, 1.75)).sqrt();
        assert!((growing.growth - wanted).abs() < 0.01, "{growing:?} {wanted}");
        let stuck = cycle(|_| 0.08);
        // 15 frames a period meet the true swing's peak to half a per cent
        assert!((stuck.bounded_ratio - 7.0).abs() < 0.05 && (stuck.growth - 1.0).abs() < 1e-3, "{stuck:?}");
    }
}
