use crate::{EvalError, FrameTime, Method, Metrics, Result};
use serde::{Deserialize, Serialize};
use softtissue_clips::MotionClip;
use softtissue_monitor::Monitor;

/// Frames that are timed, after as many that only warm up.
const FRAMES: usize = 300;

/// Time of a frame, milliseconds: medians over many frames, so that what else runs on the machine counts little.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TimingMetrics {
    /// Frames timed.
    pub frames: u32,
    /// The parts that the method has, in the order in which a frame runs through them.
    pub parts: Vec<PartTime>,
    /// The whole frame: from a pose to posed vertices.
    pub whole_ms: f64,
    /// Its 95th percentile.
    pub whole_p95_ms: f64,
}

/// Time of a part of a frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PartTime {
    /// `skinning`, `descriptor`, `encoder` (of the pose), `regressor`, `decoder`, `feedback`.
    pub part: String,
    /// Median, milliseconds.
    pub ms: f64,
}

impl TimingMetrics {
    /// Median time of a part, milliseconds.
    pub fn part(&self, name: &str) -> Option<f64> {
        self.parts.iter().find(|p| p.part == name).map(|p| p.ms)
    }
}

/// Times a frame of each method that is a player, on one motion and one core. Fills `metrics`.
pub fn judge_timing(
    metrics: &mut Metrics,
    methods: &[&dyn Method],
    beta: &[f32],
    motion: &MotionClip,
    monitor: &dyn Monitor,
) -> Result<()> {
    monitor.begin("time a frame", methods.len() as u64, "methods");
    for method in methods {
        if monitor.should_stop() {
            return Err(EvalError::Stopped);
        }
        let times = method.frame_times(&motion.id.subject, beta, motion, 2 * FRAMES);
        let times = times.map_err(|source| EvalError::Method {
            method: method.name().to_owned(),
            clip: motion.id.clone(),
            source,
        })?;
        if let Some(timing) = summed_up(times.get(FRAMES..).unwrap_or_default()) {
            metrics.timing.insert(method.name().to_owned(), timing);
        }
        monitor.advance(1, method.name());
    }
    monitor.end();
    Ok(())
}

fn summed_up(times: &[FrameTime]) -> Option<TimingMetrics> {
    let names = times.first()?.parts.iter().map(|(name, _)| *name);
    let part = |name: &'static str| {
        let seconds = times.iter().filter_map(|t| t.parts.iter().find(|p| p.0 == name)).map(|p| p.1).collect();
        PartTime { part: name.to_owned(), ms: 1e3 * quantile(seconds, 0.5) }
    };
    let whole = || times.iter().map(|t| t.whole_s).collect();
    Some(TimingMetrics {
        frames: times.len() as u32,
        parts: names.map(part).collect(),
        whole_ms: 1e3 * quantile(whole(), 0.5),
        whole_p95_ms: 1e3 * quantile(whole(), 0.95),
    })
}

/// The number under which a part of them lies.
fn quantile(mut numbers: Vec<f64>, share: f64) -> f64 {
    numbers.sort_by(f64::total_cmp);
    numbers[((numbers.len() - 1) as f64 * share).round() as usize]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_disturbed_frame_does_not_move_the_median() {
        let frame = |i: usize| {
            let slow = if i.is_multiple_of(10) { 1.0 } else { 0.0 };
            FrameTime { parts: vec![("descriptor", 0.001), ("regressor", 0.002 + slow)], whole_s: 0.004 + slow }
        };
        let timing = summed_up(&(0..300).map(frame).collect::<Vec<_>>()).expect("frames");
        assert_eq!((timing.frames, timing.whole_ms), (300, 4.0));
        assert_eq!((timing.part("descriptor"), timing.part("regressor")), (Some(1.0), Some(2.0)));
        assert!(timing.whole_p95_ms > 1000.0 && timing.part("decoder").is_none());
        assert_eq!(summed_up(&[]), None);
    }
}
