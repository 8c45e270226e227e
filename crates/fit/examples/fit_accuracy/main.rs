//! Accuracy of the fit against the truth of generated scans:
//!
//! ```text
//! softtissue synth --config CONFIG --out DIR
//! cargo run --release -p softtissue-fit --example fit_accuracy -- DIR [from=N] [frames=N] [clips=TEXT,...] [SETTING=VALUE ...]
//! ```
//!
//! `from` cuts every clip's first frames off, so that none starts in an A-pose; `frames` keeps so many at most; `clips`
//! keeps those whose names hold one of the texts; other settings are the fit's (`trunk_hz=0.0`). Clips of the test
//! motions are fitted, but training and validation alone are measured.
//!
//! Printed are:
//!
//! - [`softtissue_fit::FitAccuracy`] as JSON: errors of joint angles, joint positions and deltas, and what the scanner
//!   hides;
//! - the acceleration error of the soft vertices of the body alone, without deltas, as a share of the true accelerations
//!   (second differences over four frames);
//! - for each soft region what became of the flesh's motion, clips' means left out: found deltas times true over true
//!   squared (1: all of it was found; less: the pose took the rest), ratio of the rms, correlation; the same three of
//!   velocities;
//! - for each joint the rms angle error that moves within a clip, and the clip's mean error, degrees; the rms error of the
//!   angular acceleration and the true one, degrees a frame squared;
//! - seconds that the fit took.

mod accelerations;
mod arguments;
mod flesh;
mod joints;

use accelerations::Accelerations;
use arguments::Arguments;
use flesh::Flesh;
use joints::Joints;
use softtissue_body::BodyModel;
use softtissue_body::procedural::{ProceduralConfig, generate};
use softtissue_clips::{ClipId, DeltaClip, FitSet, MotionClip, ScanClip, ScanSet, SplitConfig, TruthSet};
use softtissue_fit::{AccuracySum, ClipComparison, fit_set};
use softtissue_monitor::Silent;
use std::path::Path;
use std::time::Instant;

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

fn main() -> Outcome<()> {
    let arguments = Arguments::read(std::env::args().skip(1))?;
    let truth = TruthSet::open(&arguments.root.join("truth"))?;
    let folder = tempfile::tempdir()?;
    let scans = cut_set(&arguments, &folder.path().join("scans"))?;
    let level = u8::from(scans.vertex_count() > 2000);
    let body = generate(&ProceduralConfig { level, ..Default::default() })?.model;
    let split = SplitConfig::default().split(&scans.ids())?;
    let start = Instant::now();
    let fit = fit_set(&scans, &split, &body, &arguments.config, &folder.path().join("fit"), &Silent)?;
    let seconds = start.elapsed().as_secs_f64();
    let mut report = Report::new(&body);
    for id in split.train.iter().chain(&split.validation) {
        report.add(id, &scans, &fit, &truth, &arguments)?;
    }
    println!("{}", serde_json::to_string_pretty(&report.accuracy.finish())?);
    println!("{}{}{}{seconds:.1} s", report.accelerations, report.flesh, report.joints);
    Ok(())
}

/// The wanted frames of the wanted clips as a set of their own.
fn cut_set(arguments: &Arguments, out: &Path) -> Outcome<ScanSet> {
    let scans = ScanSet::open(&arguments.root.join("scans"))?;
    let mut entries = Vec::new();
    for clip in scans.clips().iter().filter(|clip| arguments.takes(&clip.id)) {
        let scan = scans.scan(&clip.id)?;
        ScanClip { vertices: arguments.cut(&scan.vertices), ..scan }.write(&ScanSet::scan_path(out, &clip.id))?;
        entries.push(arguments.entry(clip));
    }
    Ok(ScanSet::finish(out, scans.vertex_count(), scans.topology(), serde_json::Value::Null, entries)?)
}

/// Everything that is printed, over the clips added.
struct Report<'a> {
    body: &'a BodyModel,
    accuracy: AccuracySum,
    accelerations: Accelerations,
    flesh: Flesh,
    joints: Joints,
}

impl<'a> Report<'a> {
    fn new(body: &'a BodyModel) -> Self {
        let (accuracy, accelerations, flesh) = Default::default();
        Self { body, accuracy, accelerations, flesh, joints: Joints::new(body.joint_count()) }
    }

    fn add(&mut self, id: &ClipId, scans: &ScanSet, fit: &FitSet, truth: &TruthSet, cut: &Arguments) -> Outcome<()> {
        let beta = &truth.subject(&id.subject).ok_or("a subject without truth")?.beta;
        let own = &fit.subject(&id.subject)?.beta;
        let (motion, deltas, scan) = (fit.motion(id)?, fit.deltas(id)?, scans.scan(id)?);
        let true_motion = truth.motion(id)?;
        let true_motion = MotionClip {
            rotations: cut.cut(&true_motion.rotations),
            translations: true_motion.translations[cut.range(true_motion.len())].to_vec(),
            ..true_motion
        };
        let true_deltas = truth.deltas(id)?;
        let true_deltas = DeltaClip { deltas: cut.cut(&true_deltas.deltas), ..true_deltas };
        let clean = truth.clean(id)?;
        let clean = ScanClip { vertices: cut.cut(&clean.vertices), ..clean };
        let comparison = ClipComparison {
            fitted: (own, &motion),
            truth: (beta, &true_motion),
            deltas: (&deltas, &true_deltas),
            scan: (&scan, &clean),
        };
        self.accuracy.add(self.body, &comparison);
        self.accelerations.add(self.body, &comparison);
        self.flesh.add(self.body, &deltas, &true_deltas);
        self.joints.add(&motion, &true_motion);
        Ok(())
    }
}
