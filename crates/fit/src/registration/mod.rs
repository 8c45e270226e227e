//! Registration: raw scans, points without correspondence, become frames in the body's topology.
//!
//! First the person: shape (Gauss-Newton with the poses of a few frames, point to plane) and static detail. Then frame
//! after frame: the pose from where the two frames before lead, by closest points and Gauss-Newton with weak priors;
//! then displacements of the rest mesh that bring its surface onto the points, held together along edges, coupled to
//! the model, and so carried on where the scan has holes. Points count the less the farther they lie (Geman and
//! McClure), and find no place where the body faces another way.
//!
//! As in Dyna (2015, sec. 3) and FAUST the model regularises; unlike there, there is no texture: how skin slides along
//! itself comes from the coupling alone.

mod align;
mod config;
mod frame;
mod model;
mod start;
mod subject;
mod surface;

pub use config::RegistrationConfig;

use crate::pose_state::PoseState;
use crate::{FitError, Result};
use frame::check_points;
use glam::Vec3;
use model::Registrar;
use rayon::prelude::*;
use serde::Serialize;
use softtissue_body::BodyModel;
use softtissue_clips::{ClipEntry, ClipId, RawScans, ScanClip, ScanSet, interpolate_missing};
use softtissue_geometry::Frames;
use softtissue_monitor::Monitor;
use std::collections::BTreeMap;
use std::path::Path;
use subject::Subject;

/// How well a clip was registered; one line of `registration.json`.
#[derive(Clone, Debug, Serialize)]
pub struct ClipRegistration {
    /// Which clip.
    pub id: ClipId,
    /// Median distance of the scan's points from the surface outside hands, feet and head, mm.
    pub median_mm: f32,
    /// 95th percentile of the same.
    pub p95_mm: f32,
    /// Frames that were found anew because the frame before led nowhere.
    pub restarts: usize,
    /// Frames that the scan lacks and that lie between their neighbours.
    pub interpolated: Vec<usize>,
}

/// Registers raw scans and writes them as a scan set, with `registration.json` beside it.
///
/// # Errors
/// A frame that cannot be read, that is no body, or that the body cannot be brought near.
pub fn register_set(
    scans: &dyn RawScans,
    body: &BodyModel,
    config: &RegistrationConfig,
    out: &Path,
    monitor: &dyn Monitor,
) -> Result<ScanSet> {
    config.check()?;
    let registrar = Registrar::new(body, config);
    let mut people: BTreeMap<String, Vec<ClipEntry>> = BTreeMap::new();
    for clip in scans.clips() {
        people.entry(clip.id.subject.clone()).or_default().push(clip);
    }
    ScanSet::begin(out)?;
    monitor.begin("register: people", people.len() as u64, "people");
    let mut subjects = BTreeMap::new();
    for (name, clips) in &people {
        subjects.insert(name.as_str(), registrar.subject(scans, clips, monitor)?);
        monitor.advance(1, name);
    }
    monitor.end();
    let clips: Vec<&ClipEntry> = people.values().flatten().collect();
    monitor.begin("register: frames", clips.iter().map(|c| c.frames as u64).sum(), "frames");
    let register = |clip: &&ClipEntry| {
        let subject = &subjects[clip.id.subject.as_str()];
        let (vertices, quality) = registrar.clip(subject, scans, clip, monitor)?;
        let scan = ScanClip { id: clip.id.clone(), fps: clip.fps, vertices };
        scan.write(&ScanSet::scan_path(out, &clip.id))?;
        Ok(quality)
    };
    let quality: Vec<ClipRegistration> = clips.par_iter().map(register).collect::<Result<_>>()?;
    monitor.end();
    softtissue_store::write_json_atomic(&out.join("registration.json"), &quality)?;
    let shapes: BTreeMap<&str, &[f32]> = subjects.iter().map(|(name, s)| (*name, s.beta.as_slice())).collect();
    let provenance = serde_json::json!({
        "stage": "registration", "config": config, "shapes": shapes, "scans": scans.provenance(),
    });
    let entries = clips.into_iter().cloned().collect();
    Ok(ScanSet::finish(out, body.vertex_count(), &body.topology.hash(), provenance, entries)?)
}

impl Registrar<'_> {
    /// All frames of a clip, `[T, V]`.
    fn clip(
        &self,
        subject: &Subject,
        scans: &dyn RawScans,
        clip: &ClipEntry,
        monitor: &dyn Monitor,
    ) -> Result<(Frames, ClipRegistration)> {
        let (shaped, detail) = (&subject.shaped, &subject.detail);
        let mut frames = Frames::zeros(self.body.vertex_count(), clip.frames);
        let mut flesh = self.zeros();
        let mut before: Option<PoseState> = None;
        let mut last: Option<PoseState> = None;
        let (mut judged, mut restarts, mut interpolated) = (Vec::new(), 0, Vec::new());
        for t in 0..clip.frames {
            if monitor.should_stop() {
                return Err(FitError::Stopped);
            }
            monitor.advance(1, &clip.id.to_string());
            let Some(scan) = scans.frame(&clip.id, t)? else {
                interpolated.push(t);
                before = None;
                continue;
            };
            check_points(&clip.id, t, &scan)?;
            let predicted = match (&last, &before) {
                (Some(last), Some(before)) => last.extrapolated(before),
                (Some(last), None) => last.clone(),
                _ => self.start(shaped, detail, &scan, Some(&subject.start)),
            };
            let prior = with_flesh(detail, &flesh, self.config.memory);
            let mut state = self.pose(shaped, &prior, &scan, &predicted);
            let mut found = self.frame_surface(shaped, detail, &prior, &scan, &state);
            let mut distances = self.distances(&found.1, &scan);
            if distances.median > self.config.refuse_beyond {
                restarts += 1;
                let anew = self.start(shaped, detail, &scan, Some(&subject.start));
                state = self.pose(shaped, detail, &scan, &anew);
                found = self.frame_surface(shaped, detail, detail, &scan, &state);
                distances = self.distances(&found.1, &scan);
            }
            if distances.median > self.config.refuse_beyond {
                return Err(FitError::Lost { clip: clip.id.clone(), frame: t, distance_m: distances.median });
            }
            flesh = found.0.iter().zip(detail).map(|(d, s)| *d - *s).collect();
            frames.frame_mut(t).copy_from_slice(&found.1);
            judged.extend(distances.judged);
            before = last.replace(state);
        }
        interpolate_missing(&mut frames, &interpolated);
        let quality = ClipRegistration {
            id: clip.id.clone(),
            median_mm: 1e3 * percentile(&mut judged, 0.5),
            p95_mm: 1e3 * percentile(&mut judged, 0.95),
            restarts,
            interpolated,
        };
        Ok((frames, quality))
    }
}

fn with_flesh(detail: &[Vec3], flesh: &[Vec3], share: f32) -> Vec<Vec3> {
    detail.iter().zip(flesh).map(|(d, f)| *d + *f * share).collect()
}

/// Zero where there are no values.
fn percentile(values: &mut [f32], share: f32) -> f32 {
    if values.is_empty() {
        return 0.0;
    }
    let i = ((values.len() - 1) as f32 * share) as usize;
    *values.select_nth_unstable_by(i, f32::total_cmp).1
}
