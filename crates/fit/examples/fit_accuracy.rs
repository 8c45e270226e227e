//! Accuracy of the fit against the truth of generated scans:
//!
//! ```text
//! softtissue synth --config CONFIG --out DIR
//! cargo run --release -p softtissue-fit --example fit_accuracy -- DIR [from=N] [frames=N] [clips=TEXT] [SETTING=VALUE ...]
//! ```
//!
//! `from` cuts every clip's first frames off, so that none starts in an A-pose; `clips` keeps those whose names hold the
//! text; other settings are the fit's. Clips of the test motions are fitted but not looked at unless `all=true`.

use glam::Vec3;
use softtissue_body::procedural::{ProceduralConfig, generate};
use softtissue_clips::{ClipEntry, DeltaClip, MotionClip, ScanClip, ScanSet, SplitConfig, TruthSet};
use softtissue_fit::{AccuracySum, ClipComparison, FitConfig, fit_set};
use softtissue_monitor::Silent;
use std::path::Path;
use std::time::Instant;

const SOFT: [softtissue_body::Region; 5] = {
    use softtissue_body::Region::{Belly, Buttocks, Chest, Thighs, UpperArms};
    [Belly, Chest, Buttocks, Thighs, UpperArms]
};

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

fn main() -> Outcome<()> {
    let mut arguments = std::env::args().skip(1);
    let root =
        arguments.next().ok_or("usage: fit_accuracy DIR [from=N] [frames=N] [clips=TEXT] [SETTING=VALUE ...]")?;
    let (mut from, mut frames, mut clips, mut settings) = (0, usize::MAX, String::new(), String::new());
    for argument in arguments {
        match argument.split_once('=').ok_or("write NAME=VALUE")? {
            ("from", n) => from = n.parse()?,
            ("frames", n) => frames = n.parse()?,
            ("clips", text) => clips = text.to_owned(),
            _ => settings += &format!("{argument}\n"),
        }
    }
    let config: FitConfig = toml::from_str(&settings)?;
    let root = Path::new(&root);
    let (scans, truth) = (ScanSet::open(&root.join("scans"))?, TruthSet::open(&root.join("truth"))?);
    let level = u8::from(scans.vertex_count() > 2000);
    let body = generate(&ProceduralConfig { level, ..Default::default() })?.model;
    let folder = tempfile::tempdir()?;
    let cut = |v: &softtissue_geometry::Frames| v.slice(from..v.len().min(from.saturating_add(frames)));
    let chosen: Vec<ClipEntry> =
        scans.clips().iter().filter(|c| clips.split(',').any(|p| c.id.to_string().contains(p))).cloned().collect();
    let scans = cut_set(&scans, &folder.path().join("scans"), chosen, &cut)?;
    let split = SplitConfig::default().split(&scans.ids())?;
    let start = Instant::now();
    let fit = fit_set(&scans, &split, &body, &config, &folder.path().join("fit"), &Silent)?;
    let seconds = start.elapsed().as_secs_f64();
    let mut report = Report::default();
    let mut all = AccuracySum::default();
    for id in split.train.iter().chain(&split.validation) {
        let beta = truth.subject(&id.subject).ok_or("a subject without truth")?.beta.clone();
        let own = fit.subject(&id.subject)?.beta;
        let true_motion = truth.motion(id)?;
        let range = from..true_motion.len().min(from.saturating_add(frames));
        let true_motion = MotionClip {
            rotations: cut(&true_motion.rotations),
            translations: true_motion.translations[range].to_vec(),
            ..true_motion
        };
        let true_deltas = truth.deltas(id)?;
        let true_deltas = DeltaClip { deltas: cut(&true_deltas.deltas), ..true_deltas };
        let clean = truth.clean(id)?;
        let clean = ScanClip { vertices: cut(&clean.vertices), ..clean };
        let (motion, deltas, scan) = (fit.motion(id)?, fit.deltas(id)?, scans.scan(id)?);
        report.add_accelerations(&body, (&own, &motion), (&beta, &true_motion));
        report.add(&body, &motion, &true_motion, &deltas, &true_deltas);
        all.add(
            &body,
            &ClipComparison {
                fitted: (&own, &motion),
                truth: (&beta, &true_motion),
                deltas: (&deltas, &true_deltas),
                scan: (&scan, &clean),
            },
        );
    }
    let accuracy = all.finish();
    println!("{}", serde_json::to_string_pretty(&accuracy)?);
    report.print();
    println!("{seconds:.1} s");
    Ok(())
}

fn cut_set(
    scans: &ScanSet,
    out: &Path,
    chosen: Vec<ClipEntry>,
    cut: &impl Fn(&softtissue_geometry::Frames) -> softtissue_geometry::Frames,
) -> Outcome<ScanSet> {
    let mut entries = Vec::new();
    for mut entry in chosen {
        let scan = scans.scan(&entry.id)?;
        let scan = ScanClip { vertices: cut(&scan.vertices), ..scan };
        entry.frames = scan.vertices.len();
        scan.write(&ScanSet::scan_path(out, &entry.id))?;
        entries.push(entry);
    }
    Ok(ScanSet::finish(out, scans.vertex_count(), scans.topology(), serde_json::Value::Null, entries)?)
}

/// What the pose took of the flesh's motion.
#[derive(Default)]
struct Report {
    /// By region: sums of found x true, true x true, both less their means over the clip; and the same of velocities.
    gains: std::collections::BTreeMap<String, [f64; 6]>,
    /// By joint: squared angle less the clip's mean, squared mean, squared acceleration error, true one.
    joints: Vec<[f64; 4]>,
    frames: f64,
    /// Second differences over two frames of the skinned soft vertices: squared error, squared truth.
    accelerations: [f64; 2],
}

impl Report {
    fn add(
        &mut self,
        body: &softtissue_body::BodyModel,
        motion: &MotionClip,
        truth: &MotionClip,
        deltas: &DeltaClip,
        true_deltas: &DeltaClip,
    ) {
        let frames = motion.len();
        for region in SOFT {
            let entry = self.gains.entry(region.name().to_owned()).or_default();
            for v in body.regions.vertices(region) {
                let series = |d: &DeltaClip| (0..frames).map(|t| d.deltas.frame(t)[v as usize]).collect::<Vec<Vec3>>();
                let (a, b) = (series(deltas), series(true_deltas));
                let centre = |x: &[Vec3]| x.iter().sum::<Vec3>() / frames as f32;
                let (ma, mb) = (centre(&a), centre(&b));
                for t in 0..frames {
                    entry[0] += f64::from((a[t] - ma).dot(b[t] - mb));
                    entry[1] += f64::from((b[t] - mb).length_squared());
                    entry[2] += f64::from((a[t] - ma).length_squared());
                    if t > 0 {
                        let (va, vb) = (a[t] - a[t - 1], b[t] - b[t - 1]);
                        entry[3] += f64::from(va.dot(vb));
                        entry[4] += f64::from(vb.length_squared());
                        entry[5] += f64::from(va.length_squared());
                    }
                }
            }
        }
        self.joints.resize(body.joint_count(), [0.0; 4]);
        self.frames += frames as f64;
        for j in 0..body.joint_count() {
            let error = |t: usize| {
                let q = |m: &MotionClip| glam::Quat::from_scaled_axis(m.rotations.frame(t)[j]);
                let d = q(motion) * q(truth).inverse();
                (if d.w < 0.0 { -d } else { d }).to_scaled_axis()
            };
            let errors: Vec<Vec3> = (0..frames).map(error).collect();
            let mean = errors.iter().sum::<Vec3>() / frames as f32;
            self.joints[j][0] += errors.iter().map(|e| f64::from((*e - mean).length_squared())).sum::<f64>();
            self.joints[j][1] += frames as f64 * f64::from(mean.length_squared());
            for t in 1..frames - 1 {
                self.joints[j][2] += f64::from((errors[t + 1] - 2.0 * errors[t] + errors[t - 1]).length_squared());
                let q = |t: usize| glam::Quat::from_scaled_axis(truth.rotations.frame(t)[j]);
                let turn = |a: usize, b: usize| {
                    let d = q(b) * q(a).inverse();
                    (if d.w < 0.0 { -d } else { d }).to_scaled_axis()
                };
                self.joints[j][3] += f64::from((turn(t, t + 1) - turn(t - 1, t)).length_squared());
            }
        }
    }

    fn add_accelerations(
        &mut self,
        body: &softtissue_body::BodyModel,
        fitted: (&[f32], &MotionClip),
        truth: (&[f32], &MotionClip),
    ) {
        let posed = |(beta, motion): (&[f32], &MotionClip)| -> Vec<Vec<Vec3>> {
            let shaped = body.shaped(beta);
            let pose = |t: usize| softtissue_body::Pose {
                rotations: motion.rotations.frame(t),
                translation: motion.translations[t],
            };
            (0..motion.len()).map(|t| body.posed(&shaped, pose(t), None)).collect()
        };
        let (a, b) = (posed(fitted), posed(truth));
        let soft = body.regions.soft();
        for t in 2..a.len() - 2 {
            for v in soft.iter().map(|v| *v as usize) {
                let second = |x: &[Vec<Vec3>]| (x[t + 2][v] - 2.0 * x[t][v] + x[t - 2][v]) / 4.0;
                self.accelerations[0] += f64::from((second(&a) - second(&b)).length_squared());
                self.accelerations[1] += f64::from(second(&b).length_squared());
            }
        }
    }

    fn print(&self) {
        let [error, real] = self.accelerations;
        println!("acceleration of the skinned soft vertices: error {:.3} of the true one", (error / real).sqrt());
        println!("region: gain of found on true, rms ratio, correlation; the same of velocities");
        for (name, [ab, bb, aa, vab, vbb, vaa]) in &self.gains {
            println!(
                "  {name:10} {:5.2} {:5.2} {:5.2}   {:5.2} {:5.2} {:5.2}",
                ab / bb,
                (aa / bb).sqrt(),
                ab / (aa * bb).sqrt(),
                vab / vbb,
                (vaa / vbb).sqrt(),
                vab / (vaa * vbb).sqrt()
            );
        }
        println!(
            "joint: rms error that moves, that stands, degrees; rms acceleration error, true, degrees a frame squared"
        );
        for (j, joint) in self.joints.iter().enumerate() {
            let [a, b, c, d] = joint.map(|x| (x / self.frames).sqrt().to_degrees());
            println!("  {j:2} {a:6.2} {b:6.2}   {c:6.2} {d:6.2}");
        }
    }
}
