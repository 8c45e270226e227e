use super::{Bodies, SynthConfig};
use crate::flesh::Simulator;
use crate::motion::{self, Request};
use crate::scanner::{RawScanner, clean, rough_motion, scan, write_ply};
use crate::subject::{Subject, subject_name};
use crate::{Result, SynthError};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use softtissue_body::ShapedBody;
use softtissue_clips::{ClipEntry, ClipId, DeltaClip, MotionClip, ScanSet, TrueSubject, TruthSet};
use softtissue_monitor::Monitor;
use softtissue_store::{read_json, write_json_atomic};
use std::path::{Path, PathBuf};

/// What lies beside the two sets: how they were made.
#[derive(Serialize, Deserialize)]
struct Recipe {
    fingerprint: String,
    config: SynthConfig,
}

/// The scans of a generated set.
pub fn scans_path(out: &Path) -> PathBuf {
    out.join("scans")
}
/// The truth of a generated set.
pub fn truth_path(out: &Path) -> PathBuf {
    out.join("truth")
}

/// The raw scans of a generated set, where `scanner.raw_points` asks for them.
pub fn raw_path(out: &Path) -> PathBuf {
    out.join("raw")
}

/// Makes a set in `out`: `scans/` (what the scanner saw), `truth/` (what was true) and `synth.json` (how). Clips
/// that are already there are kept, so that an interrupted run goes on; a finished set is returned as it is. The
/// same configuration gives the same bytes, whatever the number of threads.
///
/// # Errors
/// A configuration that makes no sense, a folder with clips of another configuration, the disk, or
/// [`SynthError::Stopped`] where the monitor asks to stop.
pub fn write(config: &SynthConfig, out: &Path, monitor: &dyn Monitor) -> Result<ScanSet> {
    config.check()?;
    if let Some(set) = begin(config, out)? {
        monitor.say(&format!("{}: {} clips are there already", out.display(), set.clips().len()));
        return Ok(set);
    }
    write_with(config, &Bodies::generate(config)?, out, monitor)
}

/// [`write()`] with a body made before. It must be of the configuration's level.
pub fn write_with(config: &SynthConfig, bodies: &Bodies, out: &Path, monitor: &dyn Monitor) -> Result<ScanSet> {
    config.check()?;
    if let Some(set) = begin(config, out)? {
        return Ok(set);
    }
    let makers: Vec<Maker> = config
        .bmi
        .par_iter()
        .enumerate()
        .map(|(index, bmi)| Maker::new(config, bodies, index, *bmi))
        .collect::<Result<_>>()?;
    let jobs: Vec<(&Maker, ClipId)> = makers.iter().flat_map(|m| m.ids().into_iter().map(move |id| (m, id))).collect();
    monitor.begin("synth", jobs.len() as u64, "clips");
    let entries: Result<Vec<ClipEntry>> = jobs
        .par_iter()
        .map(|(maker, id)| {
            if monitor.should_stop() {
                return Err(SynthError::Stopped);
            }
            if !is_written(config, out, id) {
                maker.make(id, out)?;
            }
            monitor.advance(1, &id.to_string());
            Ok(ClipEntry { id: id.clone(), frames: config.frames, fps: config.fps })
        })
        .collect();
    monitor.end();
    let entries = entries?;
    TruthSet::finish(&truth_path(out), makers.iter().map(Maker::truth).collect())?;
    let body = &bodies.scanned().model;
    // the scans' list says where they came from, but nothing about the people in them
    let provenance =
        serde_json::json!({ "source": "synth", "fingerprint": config.fingerprint()?, "level": config.level });
    Ok(ScanSet::finish(&scans_path(out), body.vertex_count(), &body.topology.hash(), provenance, entries)?)
}

/// One more motion of a person of a set, true motion and true deltas: for questions to the simulator that need no
/// scan. `subject` is a name as in the set's clips, `config.frames` the length.
///
/// # Errors
/// As [`write()`], less the disk; a subject that the set has not.
pub fn true_clip(
    config: &SynthConfig,
    bodies: &Bodies,
    subject: &str,
    motion: &str,
) -> Result<(MotionClip, DeltaClip)> {
    config.check()?;
    let mut people = config.bmi.iter().enumerate();
    let Some((index, bmi)) = people.find(|(index, _)| subject_name(*index) == subject) else {
        let reason = format!("{} subjects are stated, and {subject} is none of them", config.bmi.len());
        return Err(SynthError::Config { field: "bmi", reason });
    };
    let maker = Maker::new(config, bodies, index, *bmi)?;
    let motion = maker.motion(&ClipId::new(subject, motion, 0))?;
    let deltas = maker.true_deltas(&motion)?;
    Ok((motion, deltas))
}

/// The deltas of a person of shape `beta` whose flesh is the mean of all: what of a person whom no scan shows can be
/// known at best. Neither the hidden material nor the pose deformation outside the correctives is in it.
///
/// # Errors
/// A configuration that makes no sense, or a shape whose flesh cannot be built.
pub fn mean_flesh(config: &SynthConfig, bodies: &Bodies, beta: &[f32], motion: &MotionClip) -> Result<DeltaClip> {
    config.check()?;
    let coarse = &bodies.coarse;
    let simulator = Simulator::new(&coarse.model, &coarse.anatomy, beta, &config.material, &config.flesh)?;
    let deltas = bodies.lifted(simulator.run(motion)?.deltas);
    Ok(DeltaClip { id: motion.id.clone(), fps: motion.fps, deltas })
}

/// Opens the folder: a finished set, or `None` where there is work left. Refuses another configuration's folder.
fn begin(config: &SynthConfig, out: &Path) -> Result<Option<ScanSet>> {
    let path = out.join("synth.json");
    let fingerprint = config.fingerprint()?;
    if path.exists() {
        let there: Recipe = read_json(&path)?;
        if there.fingerprint != fingerprint {
            return Err(SynthError::Foreign { path: out.to_owned() });
        }
    } else {
        write_json_atomic(&path, &Recipe { fingerprint, config: config.clone() })?;
    }
    let finished = scans_path(out).join("index.json").exists() && truth_path(out).join("subjects.json").exists();
    Ok(if finished { Some(ScanSet::open(&scans_path(out))?) } else { None })
}

/// Whether every file of a clip is there. Files appear whole or not at all.
fn is_written(config: &SynthConfig, out: &Path, id: &ClipId) -> bool {
    let (scans, truth) = (scans_path(out), truth_path(out));
    let rough = config.scanner.rough_degrees > 0.0;
    ScanSet::scan_path(&scans, id).exists()
        && (!rough || ScanSet::rough_path(&scans, id).exists())
        && TruthSet::motion_path(&truth, id).exists()
        && TruthSet::delta_path(&truth, id).exists()
        && TruthSet::clean_path(&truth, id).exists()
}

/// One subject with everything that its clips share.
struct Maker<'a> {
    config: &'a SynthConfig,
    bodies: &'a Bodies,
    subject: Subject,
    shaped: ShapedBody,
    simulator: Simulator<'a>,
}

impl<'a> Maker<'a> {
    fn new(config: &'a SynthConfig, bodies: &'a Bodies, index: usize, bmi: f64) -> Result<Self> {
        let body = bodies.scanned();
        let subject =
            Subject::draw(&body.model, &body.anatomy, &config.material, &config.subjects, config.seed, index, bmi)?;
        let shaped = body.model.shaped(&subject.beta);
        let coarse = &bodies.coarse;
        let simulator =
            Simulator::new(&coarse.model, &coarse.anatomy, &subject.beta, &subject.material, &config.flesh)?;
        Ok(Self { config, bodies, subject, shaped, simulator })
    }

    fn ids(&self) -> Vec<ClipId> {
        let config = self.config;
        let takes = |motion: &'a String| (0..config.takes).map(move |take| (motion, take));
        config.motions.iter().flat_map(takes).map(|(m, take)| ClipId::new(&self.subject.name, m, take)).collect()
    }

    /// The motion of a clip, made for the body that carries it: joints of both levels agree only nearly.
    fn motion(&self, id: &ClipId) -> Result<MotionClip> {
        let config = self.config;
        let request = Request {
            subject: &id.subject,
            motion: &id.motion,
            take: id.take,
            frames: config.frames,
            fps: config.fps,
            seed: config.seed,
        };
        motion::generate(&request, &self.shaped, &self.subject.style)
    }

    /// Makes and writes one clip; the scan is written last.
    fn make(&self, id: &ClipId, out: &Path) -> Result<()> {
        let config = self.config;
        let motion = self.motion(id)?;
        let deltas = self.true_deltas(&motion)?;
        let (scans, truth) = (scans_path(out), truth_path(out));
        let body = &self.bodies.scanned().model;
        motion.write(&TruthSet::motion_path(&truth, id))?;
        deltas.write(&TruthSet::delta_path(&truth, id))?;
        let clean = clean(body, &self.shaped, &motion, &deltas, &self.subject.detail);
        clean.write(&TruthSet::clean_path(&truth, id))?;
        if config.scanner.raw_points > 0 {
            let scanner = RawScanner::new(body, config.scanner.raw_points, &id.to_string(), config.seed);
            let folder = raw_path(out).join(&id.subject).join(format!("{}.{}", id.motion, id.take));
            for (t, vertices) in clean.vertices.iter().enumerate() {
                write_ply(&folder.join(format!("{t:05}.ply")), &scanner.scan(t, vertices))?;
            }
        }
        if config.scanner.rough_degrees > 0.0 {
            let rough = rough_motion(&motion, config.scanner.rough_degrees, config.seed);
            rough.write(&ScanSet::rough_path(&scans, id))?;
        }
        let seen = scan(body, &self.shaped, &motion, &deltas, &self.subject.detail, &config.scanner, config.seed);
        Ok(seen.write(&ScanSet::scan_path(&scans, id))?)
    }

    /// Simulated flesh, lifted to the scanned level, plus the pose deformation outside the correctives.
    fn true_deltas(&self, motion: &MotionClip) -> Result<DeltaClip> {
        let mut deltas = self.bodies.lifted(self.simulator.run(motion)?.deltas);
        for t in 0..deltas.len() {
            self.subject.mismatch.add(motion.rotations.frame(t), deltas.frame_mut(t));
        }
        Ok(DeltaClip { id: motion.id.clone(), fps: motion.fps, deltas })
    }

    fn truth(&self) -> TrueSubject {
        let s = &self.subject;
        TrueSubject {
            subject: s.name.clone(),
            beta: s.beta.clone(),
            bmi: s.bmi as f32,
            notes: serde_json::json!({
                "material": s.material,
                "style": s.style,
                "detail_rms_m": crate::subject::rms(&s.detail),
            }),
        }
    }
}
