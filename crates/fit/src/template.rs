//! What is static in a subject beyond the shape space.

use glam::Vec3;
use rayon::prelude::*;
use softtissue_geometry::Frames;

/// Distance, metres, below which frames count alike in the robust mean: about a scanner's noise.
const NOISE: f32 = 1e-3;
/// Frames that the mean is taken of, at least, where there are so many.
const LEAST_FRAMES: usize = 8;

/// Mean speed of the vertices, m/s, at each frame `[T]`, by differences to both neighbours.
pub(crate) fn speeds(scan: &Frames, fps: f32) -> Vec<f32> {
    let v = scan.points_per_frame() as f32;
    let distance =
        |a: usize, b: usize| scan.frame(a).iter().zip(scan.frame(b)).map(|(p, q)| p.distance(*q)).sum::<f32>() / v;
    let last = scan.len() - 1;
    let at = |t: usize| {
        let (before, after) = (t.saturating_sub(1), (t + 1).min(last));
        if before == after { 0.0 } else { distance(before, after) * fps / (after - before) as f32 }
    };
    (0..scan.len()).map(at).collect()
}

/// The subject template `[V]`: for each vertex the spatial median (Weiszfeld's iteration) of the deltas of the
/// slowest frames, in which flesh hangs still. `frames` are (speed, delta field), `share` the part taken.
pub(crate) fn subject_template(mut frames: Vec<(f32, &[Vec3])>, share: f64) -> Vec<Vec3> {
    frames.sort_by(|a, b| a.0.total_cmp(&b.0));
    let wanted = (share * frames.len() as f64).ceil() as usize;
    frames.truncate(wanted.max(LEAST_FRAMES));
    let count = frames[0].1.len();
    (0..count).into_par_iter().map(|v| spatial_median(frames.iter().map(|(_, d)| d[v]))).collect()
}

fn spatial_median(points: impl Iterator<Item = Vec3> + Clone) -> Vec3 {
    let mean_of = |centre: Option<Vec3>| {
        let (mut sum, mut total) = (Vec3::ZERO, 0.0);
        for p in points.clone() {
            let w = centre.map_or(1.0, |c| NOISE / p.distance(c).max(NOISE));
            sum += p * w;
            total += w;
        }
        sum / total
    };
    let mut centre = mean_of(None);
    for _ in 0..8 {
        centre = mean_of(Some(centre));
    }
    centre
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slow_frames_decide_and_a_stray_one_does_not() {
        let still: Vec<Vec<Vec3>> = (0..9).map(|i| vec![Vec3::splat(0.005 + 1e-5 * i as f32)]).collect();
        let stray = vec![Vec3::splat(0.5)];
        let moving: Vec<Vec<Vec3>> = (0..80).map(|_| vec![Vec3::splat(-0.02)]).collect();
        let mut frames: Vec<(f32, &[Vec3])> = still.iter().map(|d| (0.01, d.as_slice())).collect();
        frames.push((0.01, &stray));
        frames.extend(moving.iter().map(|d| (1.0, d.as_slice())));
        let template = subject_template(frames, 0.1);
        assert!(template[0].distance(Vec3::splat(0.005)) < 3e-4, "{}", template[0]);
    }

    #[test]
    fn speed_is_that_of_the_vertices() {
        let mut scan = Frames::new(2);
        for t in 0..4 {
            scan.push(&[Vec3::X * 0.01 * t as f32, Vec3::Y * 0.03 * t as f32]);
        }
        let speeds = speeds(&scan, 60.0);
        assert!(speeds.iter().all(|s| (s - 1.2).abs() < 1e-4), "{speeds:?}");
        assert_eq!(super::speeds(&scan.slice(0..1), 60.0), [0.0]);
    }
}
