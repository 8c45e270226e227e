use crate::judge::rollout;
use crate::measures::Moments;
use crate::{EvalError, Method, Metrics, Result};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use softtissue_body::{BodyBuild, BodyModel};
use softtissue_clips::MotionClip;
use softtissue_geometry::Frames;
use softtissue_monitor::Monitor;

/// How flesh moves on a body of one body mass index.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BmiMetrics {
    /// Body mass index, kg/m^2, of the shape's map from coefficients to weight and height.
    pub bmi: f64,
    /// Mean vertex speed of the deltas, mm/s.
    pub speed_mm_s: f64,
    /// Rms distance of the soft vertices' deltas from their own mean over the motion, mm.
    pub amplitude_mm: f64,
}

/// How flesh answers to body mass (SoftSMPL fig. 8): mean vertex speed of the deltas over one motion, for a range of
/// `beta[1]` with the other coefficients held. Fills `metrics`; a value that diverges is left out.
pub fn judge_shapes(
    metrics: &mut Metrics,
    body: &BodyModel,
    methods: &[&dyn Method],
    beta: &[f32],
    motion: &MotionClip,
    values: &[f32],
    monitor: &dyn Monitor,
) -> Result<()> {
    let shape = |value: &f32| {
        let mut shape = beta.to_vec();
        shape.resize(shape.len().max(2), 0.0);
        shape[1] = *value;
        (f64::from(*value), shape)
    };
    let shapes: Vec<(f64, Vec<f32>)> = values.iter().map(shape).collect();
    let point = |value, deltas: &Frames| [value, mean_speed(deltas, motion.fps)];
    for (name, curve) in responses("judge shapes", body, methods, &shapes, motion, &point, monitor)? {
        let finite = curve.into_iter().filter(|[_, speed]| speed.is_finite()).collect();
        metrics.shape_response.insert(name, finite);
    }
    Ok(())
}

/// The same for bodies of one height and another body mass index (Dyna eq. 26 and sec. 6.3), with the amplitude beside
/// the speed. An index that the shape space does not reach is left out.
pub fn judge_bmi(
    metrics: &mut Metrics,
    body: &BodyModel,
    methods: &[&dyn Method],
    beta: &[f32],
    motion: &MotionClip,
    values: &[f32],
    monitor: &dyn Monitor,
) -> Result<()> {
    let build = BodyBuild::fit(body);
    let shape = |bmi: &f32| Some((f64::from(*bmi), build.at_bmi(beta, *bmi).ok()?));
    let shapes: Vec<(f64, Vec<f32>)> = values.iter().filter_map(shape).collect();
    let soft = body.regions.soft();
    let point = |bmi, deltas: &Frames| BmiMetrics {
        bmi,
        speed_mm_s: mean_speed(deltas, motion.fps),
        amplitude_mm: amplitude_mm(deltas, &soft),
    };
    for (name, curve) in responses("judge body mass", body, methods, &shapes, motion, &point, monitor)? {
        let finite = curve.into_iter().filter(|p| p.speed_mm_s.is_finite() && p.amplitude_mm.is_finite()).collect();
        metrics.bmi_response.insert(name, finite);
    }
    Ok(())
}

/// Each method's deltas on each shape, as `point` sums them up.
fn responses<T: Send>(
    task: &str,
    body: &BodyModel,
    methods: &[&dyn Method],
    shapes: &[(f64, Vec<f32>)],
    motion: &MotionClip,
    point: &(dyn Fn(f64, &Frames) -> T + Sync),
    monitor: &dyn Monitor,
) -> Result<Vec<(String, Vec<T>)>> {
    monitor.begin(task, (methods.len() * shapes.len()) as u64, "rollouts");
    let curve = |method: &&dyn Method| {
        let one = |(value, shape): &(f64, Vec<f32>)| {
            if monitor.should_stop() {
                return Err(EvalError::Stopped);
            }
            let deltas = rollout(*method, &motion.id, shape, motion, motion.len(), body.vertex_count())?;
            monitor.advance(1, method.name());
            Ok(point(*value, &deltas))
        };
        Ok((method.name().to_owned(), shapes.par_iter().map(one).collect::<Result<_>>()?))
    };
    let curves = methods.iter().map(curve).collect();
    monitor.end();
    curves
}

/// Mean speed over all vertices and frames, mm/s.
fn mean_speed(deltas: &Frames, fps: f32) -> f64 {
    let steps = deltas.len().saturating_sub(1) * deltas.points_per_frame();
    let pairs = deltas.points().iter().zip(deltas.points().iter().skip(deltas.points_per_frame()));
    let sum: f64 = pairs.map(|(a, b)| f64::from((*b - *a).length())).sum();
    sum / steps.max(1) as f64 * f64::from(fps) * 1e3
}

/// Rms distance of vertices from their mean over time, mm.
fn amplitude_mm(deltas: &Frames, vertices: &[u32]) -> f64 {
    let mut moments = Moments::default();
    for v in vertices.iter().map(|v| *v as usize) {
        let mean = deltas.iter().map(|f| f[v]).sum::<glam::Vec3>() / deltas.len().max(1) as f32;
        deltas.iter().for_each(|f| moments.add(f64::from((f[v] - mean).length()) * 1e3));
    }
    moments.rms().unwrap_or(0.0)
}
