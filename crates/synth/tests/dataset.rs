//! Sets of clips, scanner and subjects on the procedural body.
use glam::Vec3;
use softtissue_body::Pose;
use softtissue_clips::{ClipId, ScanSet, TruthSet};
use softtissue_geometry::{rotation_from_axis_angle, vertex_normals};
use softtissue_monitor::{Monitor, Silent};
use softtissue_synth::SynthError;
use softtissue_synth::dataset::{Bodies, SynthConfig, mean_flesh, scans_path, true_clip, truth_path, write_with};
use softtissue_synth::flesh::{FleshConfig, Material};
use softtissue_synth::motion::{Figure, MOTIONS, Request, Style, ground_reaction, landing_peaks, perform};
use softtissue_synth::scanner::{ScannerConfig, clean, rough_motion, scan};
use softtissue_synth::subject::{Subject, SubjectConfig};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicUsize, Ordering};

fn small() -> SynthConfig {
    SynthConfig {
        bmi: vec![20.0, 28.0],
        motions: vec!["punching".into(), "jumping_jacks".into()],
        frames: 6,
        ..Default::default()
    }
}

/// Both levels, made once.
fn fine_bodies() -> &'static Bodies {
    static BODIES: OnceLock<Bodies> = OnceLock::new();
    BODIES.get_or_init(|| Bodies::generate(&SynthConfig { level: 1, ..small() }).unwrap())
}

fn bodies() -> &'static Bodies {
    static BODIES: OnceLock<Bodies> = OnceLock::new();
    BODIES.get_or_init(|| Bodies { coarse: fine_bodies().coarse.clone(), fine: None })
}

fn subject(index: usize, bmi: f64) -> Subject {
    let body = bodies().scanned();
    Subject::draw(&body.model, &body.anatomy, &Default::default(), &SubjectConfig::default(), 1, index, bmi).unwrap()
}

/// Every file below a folder with its bytes.
fn files(root: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut all = BTreeMap::new();
    let mut folders = vec![root.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                all.insert(path.strip_prefix(root).unwrap().display().to_string(), std::fs::read(&path).unwrap());
            }
        }
    }
    all
}

/// Stops after some clips.
struct StopAfter(AtomicUsize);

impl Monitor for StopAfter {
    fn begin(&self, _: &str, _: u64, _: &'static str) {}
    fn advance(&self, units: u64, _: &str) {
        let left = self.0.load(Ordering::SeqCst);
        self.0.store(left.saturating_sub(units as usize), Ordering::SeqCst);
    }
    fn end(&self) {}
    fn say(&self, _: &str) {}
    fn should_stop(&self) -> bool {
        self.0.load(Ordering::SeqCst) == 0
    }
}

#[test]
fn a_stopped_set_goes_on_to_the_same_bytes() {
    let (whole, parts) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let set = write_with(&small(), bodies(), whole.path(), &Silent).unwrap();
    assert_eq!(set.clips().len(), 4);
    // one thread, so that the stop falls between clips
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let stopped =
        one.install(|| write_with(&small(), bodies(), parts.path(), &StopAfter(AtomicUsize::new(2)))).unwrap_err();
    assert!(matches!(stopped, SynthError::Stopped), "{stopped}");
    assert!(ScanSet::open(&scans_path(parts.path())).is_err(), "an unfinished set opens");
    let kept = ScanSet::scan_path(&scans_path(parts.path()), &ClipId::new("s00", "punching", 0));
    let before = std::fs::metadata(&kept).unwrap().modified().unwrap();
    one.install(|| write_with(&small(), bodies(), parts.path(), &Silent)).unwrap();
    assert_eq!(before, std::fs::metadata(&kept).unwrap().modified().unwrap(), "a finished clip was made again");
    assert_eq!(files(whole.path()), files(parts.path()), "the bytes differ");
    // a finished set is returned as it is
    assert_eq!(write_with(&small(), bodies(), parts.path(), &StopAfter(AtomicUsize::new(0))).unwrap().clips().len(), 4);
    let other = SynthConfig { seed: 2, ..small() };
    let foreign = write_with(&other, bodies(), parts.path(), &Silent).unwrap_err();
    assert!(matches!(foreign, SynthError::Foreign { .. }), "{foreign}");
}

#[test]
fn scans_hold_nothing_of_the_truth_and_truth_explains_the_scans() {
    let out = tempfile::tempdir().unwrap();
    // half of the clip is in motion
    let motions = vec!["jumping_jacks".to_owned()];
    let config = SynthConfig { scanner: ScannerConfig::off(), bmi: vec![26.0], motions, frames: 44, ..small() };
    let set = write_with(&config, bodies(), out.path(), &Silent).unwrap();
    let truth = TruthSet::open(&truth_path(out.path())).unwrap();
    let body = &bodies().scanned().model;
    assert_eq!(set.topology(), body.topology.hash());
    let text = std::fs::read_to_string(scans_path(out.path()).join("index.json")).unwrap();
    assert!(!text.contains("bmi") && !text.contains("beta") && !text.contains("style"), "{text}");
    for id in set.ids() {
        let (scan, motion, deltas) = (set.scan(&id).unwrap(), truth.motion(&id).unwrap(), truth.deltas(&id).unwrap());
        assert_eq!(scan.vertices, truth.clean(&id).unwrap().vertices, "noise off is clean");
        let person = truth.subject(&id.subject).unwrap();
        let shaped = body.shaped(&person.beta);
        // what is left of a scan after unposing and taking out the true delta is the same in every frame
        let left = |t: usize| -> Vec<Vec3> {
            let pose = Pose { rotations: motion.rotations.frame(t), translation: motion.translations[t] };
            let delta = body.unposed_deltas(&shaped, pose, scan.vertices.frame(t)).unwrap();
            delta.iter().zip(deltas.deltas.frame(t)).map(|(a, b)| *a - *b).collect()
        };
        let (first, last) = (left(0), left(43));
        let moved = deltas.deltas.frame(43).iter().map(|d| d.length()).fold(0.0, f32::max);
        assert!(moved > 0.001, "{id}: true deltas of {moved} m");
        let worst = first.iter().zip(&last).map(|(a, b)| a.distance(*b)).fold(0.0, f32::max);
        assert!(worst < 2e-5, "{id}: the static part differs by {worst} m");
        let rms = (first.iter().map(|x| x.length_squared()).sum::<f32>() / first.len() as f32).sqrt();
        assert!((0.0035..0.0085).contains(&rms), "{id}: static detail of {rms} m rms");
        assert!(set.rough_motion(&id).unwrap().is_some());
    }
}

#[test]
fn the_fine_level_carries_the_same_flesh() {
    let config = SynthConfig {
        bmi: vec![27.0],
        motions: vec!["jumping_jacks".into()],
        frames: 40,
        subjects: SubjectConfig::neutral(),
        ..small()
    };
    let moved = |level: u8, bodies: &Bodies| {
        let out = tempfile::tempdir().unwrap();
        let set = write_with(&SynthConfig { level, ..config.clone() }, bodies, out.path(), &Silent).unwrap();
        let model = &bodies.scanned().model;
        assert_eq!((set.vertex_count(), set.topology()), (model.vertex_count(), model.topology.hash().as_str()));
        let deltas = TruthSet::open(&truth_path(out.path())).unwrap().deltas(&set.ids()[0]).unwrap().deltas;
        let soft = model.regions.soft();
        soft.iter().map(|v| deltas.frame(39)[*v as usize].length()).sum::<f32>() / soft.len() as f32
    };
    let (coarse, fine) = (moved(0, bodies()), moved(1, fine_bodies()));
    assert!(coarse > 0.0005, "{coarse} m");
    assert!((fine / coarse - 1.0).abs() < 0.15, "{fine} m on the fine level, {coarse} m on the coarse one");
}

#[test]
fn the_scanner_errs_as_much_as_it_says() {
    let body = &bodies().scanned().model;
    let s = subject(0, 24.0);
    let shaped = body.shaped(&s.beta);
    let request = Request { subject: "s00", motion: "hips", take: 0, frames: 120, fps: 60.0, seed: 4 };
    let motion = perform(&request, &Figure::new(&shaped).unwrap(), &s.style).unwrap().clip;
    let deltas = softtissue_clips::DeltaClip {
        id: motion.id.clone(),
        fps: 60.0,
        deltas: softtissue_geometry::Frames::zeros(body.vertex_count(), 120),
    };
    let truth = clean(body, &shaped, &motion, &deltas, &s.detail).vertices;
    let errors = |config: &ScannerConfig| {
        let seen = scan(body, &shaped, &motion, &deltas, &s.detail, config, 4).vertices;
        softtissue_geometry::Frames::from_points(
            body.vertex_count(),
            seen.points().iter().zip(truth.points()).map(|(a, b)| *a - *b).collect(),
        )
    };
    let rms = |points: &[Vec3]| (points.iter().map(|x| x.length_squared()).sum::<f32>() / points.len() as f32).sqrt();
    let noise = errors(&ScannerConfig { drift: 0.0, ..Default::default() });
    let expected = 0.0005 * 3f32.sqrt();
    assert!((rms(noise.points()) / expected - 1.0).abs() < 0.02, "noise of {} m", rms(noise.points()));
    let drift = errors(&ScannerConfig { noise: 0.0, ..Default::default() });
    assert!((0.002..0.004).contains(&rms(drift.points())), "drift of {} m rms", rms(drift.points()));
    // along the skin, smooth in time and over edges
    let normals = vertex_normals(truth.frame(60), &body.topology.faces);
    let across: Vec<Vec3> = drift.frame(60).iter().zip(&normals).map(|(d, n)| *n * d.dot(*n)).collect();
    assert!(rms(&across) < 0.3 * rms(drift.frame(60)), "{} of {} m across", rms(&across), rms(drift.frame(60)));
    let change: Vec<Vec3> = drift.frame(60).iter().zip(drift.frame(61)).map(|(a, b)| *a - *b).collect();
    assert!(rms(&change) < 0.1 * rms(drift.frame(60)));
    let edges: Vec<Vec3> = body
        .topology
        .edges()
        .iter()
        .map(|[a, b]| drift.frame(60)[*a as usize] - drift.frame(60)[*b as usize])
        .collect();
    assert!(rms(&edges) < 0.6 * rms(drift.frame(60)), "{} m over edges", rms(&edges));
    assert_eq!(noise.points(), errors(&ScannerConfig { drift: 0.0, ..Default::default() }).points());
}

#[test]
fn rough_poses_err_by_one_to_two_degrees_smoothly() {
    let body = &bodies().scanned().model;
    let s = subject(0, 24.0);
    let figure = Figure::new(&body.shaped(&s.beta)).unwrap();
    let request = Request { subject: "s00", motion: "punching", take: 0, frames: 300, fps: 60.0, seed: 4 };
    let motion = perform(&request, &figure, &s.style).unwrap().clip;
    let rough = rough_motion(&motion, 1.5, 4);
    let error = |t: usize, j: usize| {
        let [a, b] = [&motion, &rough].map(|m| rotation_from_axis_angle(m.rotations.frame(t)[j]));
        let trace = (a.transpose() * b).to_cols_array_2d();
        (0.5 * (trace[0][0] + trace[1][1] + trace[2][2] - 1.0)).clamp(-1.0, 1.0).acos().to_degrees()
    };
    let all: Vec<f32> = (0..300).flat_map(|t| (0..24).map(move |j| (t, j))).map(|(t, j)| error(t, j)).collect();
    let rms = (all.iter().map(|e| e * e).sum::<f32>() / all.len() as f32).sqrt();
    assert!((1.0..2.0).contains(&rms), "{rms} degrees");
    for t in 1..300 {
        for j in 0..24 {
            assert!((error(t, j) - error(t - 1, j)).abs() < 0.6, "joint {j} jumps at frame {t}");
        }
    }
}

#[test]
fn people_differ_as_configured_and_repeat_by_seed() {
    let body = bodies().scanned();
    let (a, b, again) = (subject(0, 23.0), subject(1, 23.0), subject(0, 23.0));
    assert!((a.bmi - 23.0).abs() < 0.05, "{}", a.bmi);
    assert_eq!((&a.beta, &a.detail, &a.style), (&again.beta, &again.detail, &again.style));
    assert_ne!(a.beta, b.beta);
    assert_ne!(a.style, b.style);
    for s in [&a, &b] {
        assert!((0.8..=1.2).contains(&s.material.stiffness) && (0.7..=1.3).contains(&s.material.damping));
    }
    assert_ne!(a.material, b.material);
    // the detail is outside the shape space: no coefficient explains any of it
    for direction in body.model.shape_directions.chunks_exact(body.model.vertex_count()) {
        let (along, norm): (f32, f32) =
            direction.iter().zip(&a.detail).fold((0.0, 0.0), |(s, n), (d, x)| (s + d.dot(*x), n + d.length_squared()));
        let explained =
            (along * along / norm).sqrt() / (a.detail.iter().map(|x| x.length_squared()).sum::<f32>()).sqrt();
        assert!(explained < 1e-3, "{explained}");
    }
    let neutral =
        Subject::draw(&body.model, &body.anatomy, &Default::default(), &SubjectConfig::neutral(), 1, 3, 23.0).unwrap();
    assert_eq!((neutral.style, neutral.material), (Style::neutral(), Default::default()));
    assert!(neutral.detail.iter().all(|x| *x == Vec3::ZERO));
    assert!(neutral.beta.iter().enumerate().all(|(i, b)| i == 1 || *b == 0.0));
}

#[test]
fn the_pose_mismatch_is_smooth_and_of_a_few_millimetres() {
    let body = &bodies().scanned().model;
    let s = subject(1, 26.0);
    let at = |bend: f32| {
        let mut rotations = vec![Vec3::ZERO; body.joint_count()];
        rotations[1] = Vec3::X * -bend;
        rotations[16] = Vec3::Z * bend;
        let mut out = vec![Vec3::ZERO; body.vertex_count()];
        s.mismatch.add(&rotations, &mut out);
        out
    };
    assert!(at(0.0).iter().all(|x| x.length() < 1e-7), "the rest pose is deformed");
    let (bent, more) = (at(1.2), at(1.21));
    let peak = bent.iter().map(|x| x.length()).fold(0.0, f32::max);
    assert!((0.001..0.012).contains(&peak), "{peak} m");
    let step = bent.iter().zip(&more).map(|(a, b)| a.distance(*b)).fold(0.0, f32::max);
    assert!(step < 2e-4, "{step} m for a hundredth of a radian");
}

#[test]
fn soles_stay_on_the_ground_and_landings_are_hard() {
    // the skinned body alone: 5 mm of the soles may sink in
    let body = &bodies().scanned().model;
    for (index, bmi) in [(0, 19.0), (1, 31.0)] {
        let s = subject(index, bmi);
        let shaped = body.shaped(&s.beta);
        let figure = Figure::new(&shaped).unwrap();
        for motion in MOTIONS {
            let request = Request { subject: &s.name, motion, take: 0, frames: 150, fps: 60.0, seed: 1 };
            let clip = perform(&request, &figure, &s.style).unwrap().clip;
            for peak in landing_peaks(&ground_reaction(&figure, &clip), 60.0) {
                assert!((2.5..=4.0).contains(&peak), "{motion} of BMI {bmi} lands with {peak:.2} body weights");
            }
            for t in (0..150).step_by(3) {
                let pose = Pose { rotations: clip.rotations.frame(t), translation: clip.translations[t] };
                let lowest = body.posed(&shaped, pose, None).iter().map(|v| v.y).fold(f32::INFINITY, f32::min);
                assert!(lowest > -0.005, "{motion} of BMI {bmi}, frame {t}: {lowest} m under the ground");
            }
        }
    }
}

#[test]
fn fingerprints_name_configurations() {
    let base = small().fingerprint().unwrap();
    assert_eq!(base, small().fingerprint().unwrap());
    let mut others = vec![SynthConfig { seed: 2, ..small() }, SynthConfig { takes: 2, ..small() }];
    others.push(SynthConfig { scanner: ScannerConfig::off(), ..small() });
    for other in others {
        assert_ne!(base, other.fingerprint().unwrap());
    }
}

#[test]
fn senseless_configurations_are_refused_by_name() {
    let material = |edit: fn(&mut Material)| {
        let mut config = small();
        edit(&mut config.material);
        config
    };
    let subjects = SubjectConfig { regional_scatter: 1.5, ..Default::default() };
    let cases: [(SynthConfig, &str); 14] = [
        (SynthConfig { bmi: vec![], ..small() }, "bmi"),
        (SynthConfig { bmi: vec![f64::NAN], ..small() }, "bmi"),
        (SynthConfig { bmi: vec![26.0, 40.0], ..small() }, "bmi"),
        (SynthConfig { motions: vec!["hips".into(), "hips".into()], ..small() }, "hips"),
        (SynthConfig { motions: vec!["swimming".into()], ..small() }, "swimming"),
        (SynthConfig { fps: f32::NAN, ..small() }, "fps"),
        (SynthConfig { level: 2, ..small() }, "level"),
        (SynthConfig { scanner: ScannerConfig { noise: -1.0, ..Default::default() }, ..small() }, "scanner.noise"),
        (SynthConfig { subjects, ..small() }, "subjects.regional_scatter"),
        (SynthConfig { flesh: FleshConfig { substeps: 0, ..Default::default() }, ..small() }, "flesh.substeps"),
        (SynthConfig { flesh: FleshConfig { depth: f32::NAN, ..Default::default() }, ..small() }, "flesh.depth"),
        (material(|m| m.fat = 0.0), "material.fat"),
        (material(|m| m.drag = -1.0), "material.drag"),
        (material(|m| m.skin_growth = f32::INFINITY), "material.skin_growth"),
    ];
    let out = tempfile::tempdir().unwrap();
    for (config, word) in cases {
        let error = config.check().unwrap_err().to_string();
        assert!(error.contains(word) && (error.contains("write") || error.contains("exchange")), "{error}");
        assert_eq!(write_with(&config, bodies(), out.path(), &Silent).unwrap_err().to_string(), error);
        assert!(files(out.path()).is_empty(), "something was written for {error}");
    }
}

#[test]
fn mean_flesh_is_that_of_a_person_without_hidden_material() {
    let neutral = SubjectConfig { shape_scatter: 0.7, ..SubjectConfig::neutral() };
    let config = SynthConfig { subjects: neutral, frames: 40, ..small() };
    let body = bodies().scanned();
    let person = |config: &SynthConfig| {
        Subject::draw(&body.model, &body.anatomy, &config.material, &config.subjects, config.seed, 1, 28.0).unwrap()
    };
    let (motion, truth) = true_clip(&config, bodies(), "s01", "jumping_jacks").unwrap();
    let oracle = mean_flesh(&config, bodies(), &person(&config).beta, &motion).unwrap();
    assert_eq!(oracle.deltas, truth.deltas);
    let scattered =
        SynthConfig { subjects: SubjectConfig { stiffness_scatter: 0.2, ..config.subjects.clone() }, ..config };
    let (motion, truth) = true_clip(&scattered, bodies(), "s01", "jumping_jacks").unwrap();
    let oracle = mean_flesh(&scattered, bodies(), &person(&scattered).beta, &motion).unwrap();
    assert_ne!(oracle.deltas, truth.deltas, "hidden material is not in it");
}

#[test]
fn other_flesh_leaves_the_people_as_they_are() {
    let body = bodies().scanned();
    let draw = |other_flesh| {
        let config = SubjectConfig { other_flesh, ..Default::default() };
        Subject::draw(&body.model, &body.anatomy, &Default::default(), &config, 1, 0, 25.0).unwrap()
    };
    let (own, other, third) = (draw(0), draw(1), draw(2));
    assert_eq!((&own.beta, &own.detail, &own.style), (&other.beta, &other.detail, &other.style));
    let flesh = |s: &Subject| [s.material.stiffness, s.material.damping, s.material.belly, s.material.thighs];
    for (a, b) in [(&own, &other), (&other, &third)] {
        assert!(flesh(a).iter().zip(flesh(b)).all(|(a, b)| *a != b), "{:?} {:?}", flesh(a), flesh(b));
    }
}

#[test]
fn a_body_from_a_file_carries_flesh_and_is_named_by_its_content() {
    let dir = tempfile::tempdir().unwrap();
    let paths = ["a.safetensors", "b.safetensors"].map(|name| dir.path().join(name));
    paths.iter().for_each(|path| bodies().coarse.model.write(path).unwrap());
    let [here, there] = paths.map(|body| SynthConfig { body, frames: 60, ..small() });
    assert_eq!(here.fingerprint().unwrap(), there.fingerprint().unwrap());
    assert_ne!(here.fingerprint().unwrap(), SynthConfig { frames: 60, ..small() }.fingerprint().unwrap());
    let read = Bodies::generate(&here).unwrap();
    assert_eq!(read.scanned().model.template, bodies().scanned().model.template);
    let (_, deltas) = true_clip(&here, &read, "s01", "jumping_jacks").unwrap();
    let largest = deltas.deltas.points().iter().map(|d| d.length()).fold(0.0, f32::max);
    assert!((0.002..0.1).contains(&largest), "{largest} m");
    assert!(SynthConfig { level: 1, ..here.clone() }.check().unwrap_err().to_string().contains("level"));
    let nowhere = SynthConfig { body: dir.path().join("c.safetensors"), ..small() };
    assert!(nowhere.fingerprint().unwrap_err().to_string().contains("c.safetensors"));
}
