use glam::{DMat3, Vec3};
use std::collections::VecDeque;

/// Points that are followed over several frames.
pub(super) const FOLLOWED: usize = 512;
/// Frames that are remembered for dropped ones: two steps before and after the one that is judged.
pub(super) const REMEMBERED: usize = 6;
/// Steps below this (root mean square, metres) say nothing of dropped frames.
const STILL_M: f32 = 2e-3;
/// A step across dropped frames is so many times as long as its neighbours are.
const DROPPED: std::ops::RangeInclusive<f32> = 1.6..=6.0;
/// It leaves the direction of its neighbours by this share of its length at most.
const ASTRAY: f32 = 0.35;
/// The change of the steps about it is so many times smaller than its own.
const SMOOTH: f32 = 3.0;

/// Determinant of the covariance of two sets of points over what it is where they are the same; `None` for points that
/// lie in a plane, too few, or not finite.
pub(super) fn resemblance(a: &[Vec3], b: &[Vec3]) -> Option<f64> {
    let step = a.len().div_ceil(FOLLOWED).max(1);
    let pairs: Vec<(Vec3, Vec3)> = a.iter().copied().zip(b.iter().copied()).step_by(step).collect();
    if pairs.len() < 4 {
        return None;
    }
    let n = pairs.len() as f32;
    let (ma, mb) = pairs.iter().fold((Vec3::ZERO, Vec3::ZERO), |(x, y), (p, q)| (x + *p / n, y + *q / n));
    let [mut ab, mut aa, mut bb] = [DMat3::ZERO; 3];
    for (p, q) in pairs {
        let (p, q) = ((p - ma).as_dvec3(), (q - mb).as_dvec3());
        ab += DMat3::from_cols(p * q.x, p * q.y, p * q.z);
        aa += DMat3::from_cols(p * p.x, p * p.y, p * p.z);
        bb += DMat3::from_cols(q * q.x, q * q.y, q * q.z);
    }
    let solid = |m: &DMat3| {
        let mean = (m.x_axis.x + m.y_axis.y + m.z_axis.z) / 3.0;
        m.determinant() > 1e-4 * mean.powi(3)
    };
    let r = ab.determinant() / (aa.determinant() * bb.determinant()).sqrt();
    (solid(&aa) && solid(&bb) && r.is_finite()).then_some(r)
}

/// How many times as long as its neighbours the middle step of six frames is, where frames look lost there.
pub(super) fn dropped(frames: &VecDeque<(usize, Vec<Vec3>)>) -> Option<f32> {
    let points = frames[0].1.len();
    let step = |k: usize, i: usize| frames[k + 1].1[i] - frames[k].1[i];
    let (mut mm, mut bm, mut bb) = (0.0f32, 0.0, 0.0);
    let (mut jerk, mut before, mut after) = (0.0f32, 0.0, 0.0);
    for i in 0..points {
        let [a0, a, b, c, c1] = [0, 1, 2, 3, 4].map(|k| step(k, i));
        let m = 0.5 * (a + c);
        mm += m.length_squared();
        bm += b.dot(m);
        bb += b.length_squared();
        jerk += (b - m).length_squared();
        before += (a - a0).length_squared();
        after += (c1 - c).length_squared();
    }
    let times = bm / mm;
    let astray = (bb - times * bm).max(0.0).sqrt();
    let moving = (mm / points as f32).sqrt() > STILL_M;
    let lost =
        DROPPED.contains(&times) && astray < ASTRAY * bb.sqrt() && jerk.sqrt() > SMOOTH * before.max(after).sqrt();
    (moving && lost).then_some(times)
}
