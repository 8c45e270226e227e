//! Prints how well raw scans are registered: generated ones, whose truth is known. Arguments, each with a default:
//! `level=0 frames=90 points=10000 bmi=29 motions=hips,jumping_jacks seed=1`, and settings of the registration by name:
//! `smoothing coupling memory outlier`.
//!
//! Distances are those of the scan's points outside hands, feet and head from the registered surface; deltas are those
//! that the fit recovers from registered raw scans, against the simulator's, on soft vertices.

use softtissue_clips::{ClipEntry, ClipId, RawFrame, RawScans, ScanClip, ScanSet, Split, TruthSet};
use softtissue_fit::{AccuracySum, ClipComparison, FitConfig, RegistrationConfig, fit_set, register_set};
use softtissue_monitor::Silent;
use softtissue_synth::dataset::{Bodies, SynthConfig, scans_path, truth_path, write_with};
use softtissue_synth::scanner::RawScanner;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::Instant;

type Error = Box<dyn std::error::Error>;

/// Raw scans made when they are asked for.
struct Scanner<'a> {
    clean: BTreeMap<ClipId, ScanClip>,
    scanners: BTreeMap<ClipId, RawScanner<'a>>,
}

impl RawScans for Scanner<'_> {
    fn clips(&self) -> Vec<ClipEntry> {
        let entry = |c: &ScanClip| ClipEntry { id: c.id.clone(), frames: c.vertices.len(), fps: c.fps };
        self.clean.values().map(entry).collect()
    }
    fn frame(&self, id: &ClipId, t: usize) -> softtissue_clips::Result<Option<RawFrame>> {
        Ok(Some(self.scanners[id].scan(t, self.clean[id].vertices.frame(t))))
    }
    fn provenance(&self) -> serde_json::Value {
        serde_json::json!({"source": "generated raw scans"})
    }
}

fn main() -> Result<(), Error> {
    let given: BTreeMap<String, String> =
        std::env::args().skip(1).filter_map(|a| a.split_once('=').map(|(k, v)| (k.into(), v.into()))).collect();
    let argument = |name: &str, default: &str| given.get(name).cloned().unwrap_or_else(|| default.to_owned());
    let list = |text: String| text.split(',').map(str::to_owned).collect::<Vec<String>>();
    let config = SynthConfig {
        level: argument("level", "0").parse()?,
        frames: argument("frames", "90").parse()?,
        seed: argument("seed", "1").parse()?,
        bmi: list(argument("bmi", "29")).iter().map(|b| b.parse()).collect::<Result<_, _>>()?,
        motions: list(argument("motions", "hips,jumping_jacks")),
        ..SynthConfig::default()
    };
    let points: usize = argument("points", "10000").parse()?;
    let home = PathBuf::from("target/registration").join(&config.fingerprint()?[..16]);
    let bodies = Bodies::generate(&config)?;
    let registered = write_with(&config, &bodies, &home, &Silent)?;
    let (body, truth) = (&bodies.scanned().model, TruthSet::open(&truth_path(&home))?);
    let mut scans = Scanner { clean: BTreeMap::new(), scanners: BTreeMap::new() };
    for id in registered.ids() {
        scans.clean.insert(id.clone(), truth.clean(&id)?);
        scans.scanners.insert(id.clone(), RawScanner::new(body, points, &id.to_string(), config.seed));
    }
    let mut registration = RegistrationConfig::default();
    for (name, field) in [
        ("smoothing", &mut registration.smoothing),
        ("coupling", &mut registration.coupling),
        ("memory", &mut registration.memory),
        ("outlier", &mut registration.outlier),
    ] {
        if let Some(value) = given.get(name) {
            *field = value.parse()?;
        }
    }
    let out = home.join(format!("registered-{}", std::process::id()));
    let frames: usize = registered.clips().iter().map(|c| c.frames).sum();
    let (started, cpu) = (Instant::now(), cpu_seconds());
    let set = register_set(&scans, body, &registration, &out, &Silent)?;
    let seconds = started.elapsed().as_secs_f64();
    println!(
        "{} vertices, {points} points, {frames} frames: {:.2} frames/s",
        body.vertex_count(),
        frames as f64 / seconds
    );
    if let (Some(before), Some(after)) = (cpu, cpu_seconds()) {
        println!("{:.3} s of processor time a frame, the person's shape included", (after - before) / frames as f64);
    }
    let quality: Vec<serde_json::Value> = serde_json::from_slice(&std::fs::read(out.join("registration.json"))?)?;
    for clip in quality {
        println!("{} median {} mm, p95 {} mm", clip["id"]["motion"], clip["median_mm"], clip["p95_mm"]);
    }
    for (name, set, home) in [
        ("deltas from registered raw scans", &set, out.join("fit")),
        ("deltas from scans with correspondence", &ScanSet::open(&scans_path(&home))?, home.join("fit")),
    ] {
        let split = Split { train: set.ids(), validation: vec![], test: vec![] };
        let fit = fit_set(set, &split, body, &FitConfig::default(), &home, &Silent)?;
        let mut sum = AccuracySum::default();
        for id in set.ids() {
            let person = truth.subject(&id.subject).ok_or("the truth knows everybody")?;
            let beta = fit.subject(&id.subject)?.beta;
            sum.add(
                body,
                &ClipComparison {
                    fitted: (&beta, &fit.motion(&id)?),
                    truth: (&person.beta, &truth.motion(&id)?),
                    deltas: (&fit.deltas(&id)?, &truth.deltas(&id)?),
                    scan: (&set.scan(&id)?, &truth.clean(&id)?),
                },
            );
        }
        println!("{name}: {:?}", sum.finish());
    }
    std::fs::remove_dir_all(&out)?;
    Ok(())
}

/// Processor time of this process so far, where the system tells: a fair measure on a busy machine.
fn cpu_seconds() -> Option<f64> {
    let stat = std::fs::read_to_string("/proc/self/stat").ok()?;
    let fields: Vec<&str> = stat.rsplit_once(')')?.1.split_ascii_whitespace().collect();
    let ticks: f64 = fields.get(11)?.parse::<f64>().ok()? + fields.get(12)?.parse::<f64>().ok()?;
    Some(ticks / 100.0)
}
