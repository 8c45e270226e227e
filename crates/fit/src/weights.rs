//! The two weights, which must not be confused: the fit's, high on rigid parts, and Casas-Otaduy's, high on flesh.

use glam::Vec3;
use softtissue_body::{Region, RegionMap};
use softtissue_geometry::Frames;

/// Least weight of a vertex in a loss that weighs by flesh.
const RIGIDITY_FLOOR: f64 = 0.05;

/// Fit weights from the template's regions alone, `[V]`, mean 1: high where bone lies under the skin, and so low on the
/// trunk's flesh that the spine does not follow it (at 0.1 the pose took up a quarter of the flesh's motion).
pub fn region_weights(regions: &RegionMap) -> Vec<f32> {
    let weight = |region: &Region| match region {
        Region::Head | Region::Hands | Region::Feet | Region::Rest => 1.0,
        Region::Calves => 0.5,
        Region::UpperArms | Region::Thighs => 0.2,
        Region::Chest | Region::Buttocks => 0.03,
        Region::Belly => 0.02,
    };
    mean_one(regions.0.iter().map(weight).collect())
}

/// Fit weights refined by what the first deltas show: divided by `1 + (s / s0)^2`, where `s` is how far a vertex
/// strays from its own mean, metres, and `s0` half its median over the vertices of no soft region. Mean 1.
pub(crate) fn refined_weights(regions: &RegionMap, first: &[f32], strays: &[f64]) -> Vec<f32> {
    let mut rigid: Vec<f64> = regions.rigid().iter().map(|v| strays[*v as usize]).collect();
    if rigid.is_empty() {
        rigid = strays.to_vec();
    }
    rigid.sort_by(f64::total_cmp);
    let usual = rigid[rigid.len() / 2].max(1e-6);
    mean_one(first.iter().zip(strays).map(|(w, s)| f64::from(*w) / (1.0 + (2.0 * s / usual).powi(2))).collect())
}

/// Rms distance of each vertex from its mean over frames, `[V]`, metres.
pub(crate) fn strays(deltas: &[Frames]) -> Vec<f64> {
    let v = deltas[0].points_per_frame();
    let frames = deltas.iter().map(Frames::len).sum::<usize>().max(1) as f64;
    let (mut sums, mut squares) = (vec![glam::DVec3::ZERO; v], vec![0.0; v]);
    for frame in deltas.iter().flat_map(Frames::iter) {
        for (i, d) in frame.iter().enumerate() {
            sums[i] += d.as_dvec3();
            squares[i] += d.as_dvec3().length_squared();
        }
    }
    let stray =
        |(sum, square): (&glam::DVec3, &f64)| (square / frames - (*sum / frames).length_squared()).max(0.0).sqrt();
    sums.iter().zip(&squares).map(stray).collect()
}

/// Casas-Otaduy eq. 7 before normalising: for each vertex the sum over frames of the squared change of the delta's
/// velocity, m^2/s^2, and the frames summed.
pub(crate) struct VelocityChange {
    pub sums: Vec<f64>,
    pub frames: usize,
}

impl VelocityChange {
    pub fn of(deltas: &Frames, fps: f32) -> Self {
        let mut sums = vec![0.0; deltas.points_per_frame()];
        for t in 2..deltas.len() {
            let [a, b, c]: [&[Vec3]; 3] = [deltas.frame(t - 2), deltas.frame(t - 1), deltas.frame(t)];
            for (i, sum) in sums.iter_mut().enumerate() {
                *sum += f64::from(((c[i] - 2.0 * b[i] + a[i]) * fps).length_squared());
            }
        }
        Self { sums, frames: deltas.len().saturating_sub(2) }
    }
}

/// Casas-Otaduy eq. 7 over clips, scaled to mean 1 with floor 0.05, `[V]`. Ones where nothing moves or no clip has
/// three frames.
pub(crate) fn rigidity_weights<'a>(changes: impl Iterator<Item = &'a VelocityChange>, vertex_count: usize) -> Vec<f32> {
    let changes: Vec<&VelocityChange> = changes.collect();
    let frames = changes.iter().map(|c| c.frames).sum::<usize>();
    let mut mean = vec![0.0; vertex_count];
    for change in changes {
        mean.iter_mut().zip(&change.sums).for_each(|(m, s)| *m += s / frames.max(1) as f64);
    }
    let total: f64 = mean.iter().sum();
    if !(total > 0.0 && total.is_finite()) {
        return vec![1.0; vertex_count];
    }
    // the scale at which the mean with the floor applied is one: the mean rises with the scale, so halve
    let floored = |scale: f64| mean.iter().map(|m| (scale * m).max(RIGIDITY_FLOOR)).sum::<f64>() / vertex_count as f64;
    let (mut low, mut high) = (0.0, vertex_count as f64 / total);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if floored(middle) < 1.0 { low = middle } else { high = middle }
    }
    mean.iter().map(|m| (high * m).max(RIGIDITY_FLOOR) as f32).collect()
}

/// The mean over subjects, `[V]`.
pub(crate) fn mean_weights<'a>(subjects: impl Iterator<Item = &'a [f32]>) -> Option<Vec<f32>> {
    let mut sum: Vec<f64> = vec![];
    for weights in subjects {
        sum.resize(weights.len(), 0.0);
        sum.iter_mut().zip(weights).for_each(|(s, w)| *s += f64::from(*w));
    }
    (!sum.is_empty()).then(|| mean_one(sum))
}

fn mean_one(weights: Vec<f64>) -> Vec<f32> {
    let mean = weights.iter().sum::<f64>() / weights.len().max(1) as f64;
    weights.iter().map(|w| (w / mean) as f32).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rigidity_weights_have_mean_one_and_a_floor_and_follow_flesh() {
        let mut deltas = Frames::new(4);
        for t in 0..30 {
            let wave = |a: f32| Vec3::X * a * (t as f32 * 1.3).sin();
            deltas.push(&[Vec3::Y * 0.1, wave(0.001), wave(0.01), wave(0.02)]);
        }
        let weights = rigidity_weights([VelocityChange::of(&deltas, 60.0)].iter(), 4);
        let mean = weights.iter().sum::<f32>() / 4.0;
        assert!((mean - 1.0).abs() < 1e-5, "{weights:?}");
        assert_eq!(weights[0], 0.05);
        assert!(weights[1] == 0.05 && weights[3] > 3.5 * weights[2], "{weights:?}");
        assert_eq!(rigidity_weights([VelocityChange::of(&deltas.slice(0..2), 60.0)].iter(), 4), [1.0; 4]);
    }

    #[test]
    fn what_strays_loses_weight() {
        let regions = RegionMap(vec![Region::Head, Region::Hands, Region::Belly, Region::Head]);
        let first = region_weights(&regions);
        assert!((first.iter().sum::<f32>() / 4.0 - 1.0).abs() < 1e-6 && first[0] > 9.0 * first[2]);
        let mut deltas = Frames::new(4);
        for t in 0..10 {
            let sign = if t % 2 == 0 { 1.0 } else { -1.0 };
            deltas.push(&[0.001, 0.001, 0.003, 0.004].map(|a| Vec3::new(0.02, a * sign, 0.0)));
        }
        let strays = strays(&[deltas]);
        assert!((strays[3] - 0.004).abs() < 1e-6, "{strays:?}: the mean is no straying");
        let refined = refined_weights(&regions, &first, &strays);
        assert!(refined[0] == refined[1] && refined[0] > 5.0 * refined[3], "{refined:?}");
    }
}
