//! Judging from disk, on a toy whose right answers are known.

mod figure;

use figure::{FPS, OnBody, Oscillator, World, body, motion, truth};
use glam::Vec3;
use softtissue_clips::{ClipId, MotionClip};
use softtissue_eval::{
    Codec, CodecPair, EvalError, FrameTime, LongRollout, Method, MethodError, Metrics, Scene, StopProbe, SubspaceTable,
    Tally, curves, judge, judge_bmi, judge_bounded, judge_fit, judge_shapes, judge_stops, judge_subspace, judge_timing,
    training_peaks,
};
use softtissue_geometry::Frames;
use softtissue_monitor::{Monitor, Silent};

fn world(root: &std::path::Path) -> World {
    let motions =
        [motion("s01", "hop", 1.6, 120, 120), motion("s01", "run", 2.3, 90, 90), motion("s02", "hop", 1.4, 120, 120)];
    World::make(root, body(12, 10), &motions)
}

fn run(scene: &Scene, methods: &[&dyn Method], clips: &[ClipId]) -> Result<Metrics, EvalError> {
    let mut tally = Tally::default();
    judge(&mut tally, scene, methods, clips, None, &Silent)?;
    Ok(tally.metrics("held-out", 3))
}

#[test]
fn the_truth_itself_half_of_it_and_nothing_get_the_figures_they_must() {
    let folder = tempfile::tempdir().unwrap();
    let w = world(folder.path());
    let (exact, half) = (OnBody(&w.body, truth()), OnBody(&w.body, Oscillator { name: "half", gain: 0.5, ..truth() }));
    let m = run(&w.scene(), &[&exact, &half], &w.clips).unwrap();
    assert!(m.truth && m.data.frames == 330 && m.data.subjects == ["s01", "s02"] && m.clips.len() == 3);
    let soft = |name: &str| (m.methods[name].soft_ratio.unwrap(), m.methods[name].regions["soft"]);
    let near = |x: f64, y: f64| assert!((x - y).abs() < 1e-5, "{x} {y}");
    let (ratio, truth) = soft("truth");
    near(ratio, 0.0);
    near(truth.energy_ratio.unwrap(), 1.0);
    near(truth.lag_ms.unwrap(), 0.0);
    near(truth.spectral_distance.unwrap(), 0.0);
    assert!((truth.scan_mean_mm.unwrap() - 1.0).abs() < 0.02, "the noise has a mean length of 1 mm");
    let (ratio, half) = soft("half");
    near(ratio, 0.5);
    near(half.energy_ratio.unwrap(), 0.5);
    near(half.peak_hz_error.unwrap(), 0.0);
    let (ratio, alone) = soft("body");
    near(ratio, 1.0);
    near(alone.energy_ratio.unwrap(), 0.0);
    assert_eq!(alone.peak_hz_error, None, "silence has no peak");
    near(alone.mean_mm.unwrap(), 2.0 * half.mean_mm.unwrap());
    assert_eq!(m.methods["half"].regions["rigid"].energy_ratio, None, "still regions have no ratio");
    assert!(m.methods["half"].frames_per_second.unwrap() > 0.0);
    assert!(!m.methods["half"].regions.contains_key("calves"), "the toy has none");
}

#[test]
fn pose_channels_stand_under_their_names_and_without_truth_scans_are_the_reference() {
    let folder = tempfile::tempdir().unwrap();
    let w = world(folder.path());
    let exact = OnBody(&w.body, truth());
    let m = run(&w.scene(), &[&exact], &w.clips).unwrap();
    let names: Vec<&str> = m.methods.keys().map(String::as_str).collect();
    assert_eq!(names, ["body", "truth", "truth/fitted", "truth/rough"]);
    std::fs::remove_dir_all(folder.path().join("truth")).unwrap();
    let m = run(&Scene { truth: None, ..w.scene() }, &[&exact], &w.clips).unwrap();
    assert!(!m.truth);
    let all = m.methods["truth"].regions["all"];
    assert_eq!(all.mean_mm, all.scan_mean_mm);
    assert!((all.mean_mm.unwrap() - 1.0).abs() < 0.02);
    assert_eq!(m.methods.keys().map(String::as_str).collect::<Vec<_>>(), ["body", "truth", "truth/rough"]);
}

#[test]
fn the_thread_count_changes_no_figure() {
    let folder = tempfile::tempdir().unwrap();
    let w = world(folder.path());
    let method = OnBody(&w.body, Oscillator { name: "softtissue", hz: 3.3, ..truth() });
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| run(&w.scene(), &[&method], &w.clips).unwrap().without_times())
    };
    assert_eq!(with(1), with(3));
}

struct Broken(&'static str);

impl Method for Broken {
    fn name(&self) -> &str {
        self.0
    }
    fn rollout(&self, _: &str, _: &[f32], motion: &MotionClip) -> Result<Frames, MethodError> {
        let mut frames = Frames::zeros(122, motion.len());
        match self.0 {
            "diverges" => frames.frame_mut(5)[3] = Vec3::splat(f32::INFINITY),
            "short" => frames = frames.slice(0..motion.len() - 1),
            _ => return Err("it has no weights".into()),
        }
        Ok(frames)
    }
}

#[test]
fn what_fails_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let w = world(folder.path());
    let m = run(&w.scene(), &[&Broken("diverges")], &w.clips).unwrap();
    assert_eq!(m.methods["diverges"].diverged_clips, Some(3));
    assert!(m.methods["diverges"].regions.is_empty() && m.methods["diverges"].soft_ratio.is_none());
    let message = |name| run(&w.scene(), &[&Broken(name)], &w.clips[1..2]).unwrap_err().to_string();
    assert!(message("short").contains("s01/run.0") && message("short").contains("expected 90"), "{}", message("short"));
    assert_eq!(message("fails"), "fails failed on s01/run.0: it has no weights");
    struct Stop;
    impl Monitor for Stop {
        fn begin(&self, _: &str, _: u64, _: &'static str) {}
        fn advance(&self, _: u64, _: &str) {}
        fn end(&self) {}
        fn say(&self, _: &str) {}
        fn should_stop(&self) -> bool {
            true
        }
    }
    let stopped = judge(&mut Tally::default(), &w.scene(), &[], &w.clips, None, &Stop);
    assert!(matches!(stopped, Err(EvalError::Stopped)));
}

#[test]
fn rest_and_free_decay_are_those_of_the_oscillator() {
    let folder = tempfile::tempdir().unwrap();
    let w = world(folder.path());
    let stop_motion = motion("s01", "hop_stand", 1.6, 230, 100);
    let real = truth().deltas(&w.body, &stop_motion);
    let probe = StopProbe { beta: vec![0.0], motion: stop_motion, stop_frame: 103, truth: Some(real) };
    let off = OnBody(&w.body, Oscillator { name: "off", hz: 3.5, damping_ratio: 0.10, ..truth() });
    let still = Broken("fails");
    let mut metrics = Tally::default().metrics("held-out", 1);
    let traces =
        judge_stops(&mut metrics, &w.body, &[&OnBody(&w.body, truth()), &off], std::slice::from_ref(&probe), &Silent)
            .unwrap();
    assert!(judge_stops(&mut metrics, &w.body, &[&still], std::slice::from_ref(&probe), &Silent).is_err());
    let belly = metrics.decays.iter().find(|d| d.region == "belly").unwrap();
    // damped frequency of 3 Hz at ratio 0.15 is 2.966 Hz; symplectic steps shift it by less than 1 %
    assert!((belly.truth.hz - 2.966).abs() < 0.03 && (belly.truth.damping_ratio - 0.15).abs() < 0.01, "{belly:?}");
    assert!((belly.methods["off"].hz - 3.482).abs() < 0.04, "{belly:?}");
    let exact = &metrics.methods["truth"];
    assert!(exact.decay_hz_error.unwrap() < 1e-6 && exact.decay_damping_error.unwrap() < 1e-6);
    // the worst region is the fastest one, 1.8 times the belly's frequency
    assert!(metrics.methods["off"].decay_hz_error.unwrap() > 0.5);
    assert!((metrics.methods["off"].decay_damping_error.unwrap() - 0.05).abs() < 0.01);
    assert!(exact.rest_ratio.unwrap() < 0.05 && metrics.methods["off"].rest_ratio.unwrap() > exact.rest_ratio.unwrap());
    assert_eq!(metrics.rest_truth, exact.rest_ratio);
    assert_eq!(traces.len(), metrics.decays.len());
    assert_eq!(traces[0].curves["off"].len(), 230 - 103);
    // Infinite long before the stop, finite in both seconds that rest is told from.
    judge_stops(&mut metrics, &w.body, &[&Broken("diverges")], std::slice::from_ref(&probe), &Silent).unwrap();
    let diverged = &metrics.methods["diverges"];
    assert_eq!((diverged.diverged_clips, diverged.rest_ratio), (Some(1), None));
    let silent = softtissue_eval::BodyAlone { vertex_count: w.body.vertex_count() };
    judge_stops(&mut metrics, &w.body, &[&silent], &[probe], &Silent).unwrap();
    assert_eq!(metrics.methods["body"].decay_missing, Some(traces.len() as u32));
    assert_eq!(metrics.methods["body"].rest_ratio, None);
}

#[test]
fn a_long_rollout_is_held_against_the_training_maximum() {
    let folder = tempfile::tempdir().unwrap();
    let w = world(folder.path());
    let training = training_peaks(&w.scene(), &w.clips).unwrap();
    let motions = [motion("s01", "hop", 1.6, 120, 120)];
    let long = LongRollout { subject: &w.clips[0], motions: &motions, seconds: 60.0, training: &training };
    let mut metrics = Tally::default().metrics("held-out", 1);
    let triple = OnBody(&w.body, Oscillator { name: "triple", gain: 3.0, ..truth() });
    judge_bounded(&mut metrics, &w.scene(), &[&OnBody(&w.body, truth()), &triple], &long, &Silent).unwrap();
    let ratio = |name: &str| metrics.methods[name].bounded_ratio.unwrap();
    assert!(ratio("truth") > 0.4 && ratio("truth") < 1.5, "{}", ratio("truth"));
    assert!((ratio("triple") / ratio("truth") - 3.0).abs() < 1e-4);
    assert_eq!(metrics.methods["truth"].bounded_seconds, Some(60.0));
    let none = LongRollout { motions: &[], ..long };
    assert!(judge_bounded(&mut metrics, &w.scene(), &[&triple], &none, &Silent).is_err());
}

/// Moves as much as the second shape coefficient says.
struct ByShape;

impl Method for ByShape {
    fn name(&self) -> &str {
        "by-shape"
    }
    fn rollout(&self, _: &str, beta: &[f32], motion: &MotionClip) -> Result<Frames, MethodError> {
        let mut frames = Frames::zeros(122, motion.len());
        for t in 0..motion.len() {
            frames.frame_mut(t).fill(Vec3::Y * (1.0 - beta[1]) * 0.001 * t as f32);
        }
        Ok(frames)
    }
}

#[test]
fn speed_follows_the_shape() {
    let folder = tempfile::tempdir().unwrap();
    let w = world(folder.path());
    let mut metrics = Tally::default().metrics("held-out", 1);
    let m = motion("s01", "hop", 1.6, 30, 30);
    judge_shapes(&mut metrics, &w.body, &[&ByShape], &[0.3], &m, &[-2.0, 0.0, 1.0], &Silent).unwrap();
    // (1 - beta) mm a frame at 60 frames a second
    for ([beta, speed], expected) in metrics.shape_response["by-shape"].iter().zip([180.0, 60.0, 0.0]) {
        assert!((speed - expected).abs() < 1e-2, "{beta} {speed}");
    }
}

#[test]
fn amplitude_and_speed_follow_the_body_mass_index_at_one_height() {
    let mut w = body(12, 10);
    let taller: Vec<Vec3> = w.template.iter().map(|p| Vec3::Y * 0.05 * p.y).collect();
    w.shape_directions.extend(taller);
    let build = softtissue_body::BodyBuild::fit(&w);
    /// Swings by as many millimetres as the body mass index says.
    struct Swings<'a>(&'a softtissue_body::BodyModel, softtissue_body::BodyBuild);
    impl Method for Swings<'_> {
        fn name(&self) -> &str {
            "swings"
        }
        fn rollout(&self, _: &str, beta: &[f32], motion: &MotionClip) -> Result<Frames, MethodError> {
            let mut frames = Frames::zeros(self.0.vertex_count(), motion.len());
            for t in 0..motion.len() {
                let sign = if t.is_multiple_of(2) { 1.0 } else { -1.0 };
                frames.frame_mut(t).fill(Vec3::Y * 1e-3 * self.1.bmi(beta) * sign + Vec3::X);
            }
            Ok(frames)
        }
    }
    let mut metrics = Tally::default().metrics("held-out", 1);
    let m = motion("s01", "hop", 1.6, 30, 30);
    let method = Swings(&w, build);
    judge_bmi(&mut metrics, &w, &[&method], &[0.3, -0.5], &m, &[18.0, 26.0, 34.0, 900.0], &Silent).unwrap();
    let curve = &metrics.bmi_response["swings"];
    assert_eq!(curve.len(), 3, "nobody has a body mass index of 900");
    for (point, bmi) in curve.iter().zip([18.0, 26.0, 34.0]) {
        assert!(point.bmi == bmi && (point.amplitude_mm - bmi).abs() < 0.05, "{point:?}");
        assert!((point.speed_mm_s / (2.0 * 60.0 * bmi) - 1.0).abs() < 1e-2, "{point:?}");
    }
}

#[test]
fn people_are_told_apart_and_chosen_clips_keep_their_curves() {
    let folder = tempfile::tempdir().unwrap();
    let w = world(folder.path());
    let half = OnBody(&w.body, Oscillator { name: "half", gain: 0.5, ..truth() });
    let mut tally = Tally::default();
    judge(&mut tally, &w.scene(), &[&half], &w.clips, None, &Silent).unwrap();
    let m = tally.metrics("held-out", 3);
    assert_eq!(m.people.keys().collect::<Vec<_>>(), ["s01", "s02"]);
    let person = &m.people["s02"];
    assert_eq!(person.methods.keys().collect::<Vec<_>>(), ["body", "half"], "the other channels are left out");
    assert!((person.methods["half"].soft_ratio.unwrap() - 0.5).abs() < 1e-5);
    let only = m.clips.iter().find(|c| c.subject == "s02").unwrap();
    assert_eq!(Some(person.methods["half"].mean_mm), only.methods["half"].regions["all"].mean_mm);
    let kept = curves(&tally, &SubspaceTable::default(), &["half", "nobody"], |id| id.subject == "s01");
    assert_eq!(kept.iter().map(|c| c.motion.as_str()).collect::<Vec<_>>(), ["hop", "run"]);
    let all = &kept[1].methods["half"]["all"];
    let run = m.clips.iter().find(|c| c.motion == "run").unwrap().methods["half"].regions["all"];
    let mean = all.iter().sum::<f64>() / 90.0;
    assert!(all.len() == 90 && (mean - run.mean_mm.unwrap()).abs() < 1e-4);
    let variance = all.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / 90.0;
    assert!((variance.sqrt() - run.frame_std_mm.unwrap()).abs() < 1e-3, "{run:?}");
    assert!(run.frame_std_mm < run.std_mm, "a frame's mean varies less than its vertices");
}

/// A player that takes a millisecond for a frame and three for each of the first hundreds.
struct Timed;

impl Method for Timed {
    fn name(&self) -> &str {
        "timed"
    }
    fn rollout(&self, _: &str, _: &[f32], motion: &MotionClip) -> Result<Frames, MethodError> {
        Ok(Frames::zeros(122, motion.len()))
    }
    fn frame_times(&self, _: &str, _: &[f32], _: &MotionClip, frames: usize) -> Result<Vec<FrameTime>, MethodError> {
        let seconds = |i| if 2 * i < frames { 3e-3 } else { 1e-3 };
        let time = |i| FrameTime { parts: vec![("regressor", 0.5 * seconds(i))], whole_s: seconds(i) };
        Ok((0..frames).map(time).collect())
    }
}

#[test]
fn frames_of_players_are_timed_once_they_are_warm() {
    let mut metrics = Tally::default().metrics("held-out", 1);
    let m = motion("s01", "hop", 1.6, 30, 30);
    judge_timing(&mut metrics, &[&Timed, &ByShape], &[0.3], &m, &Silent).unwrap();
    assert_eq!(metrics.timing.keys().collect::<Vec<_>>(), ["timed"], "the other is no player");
    let timing = &metrics.timing["timed"];
    assert!((timing.whole_ms - 1.0).abs() < 1e-9 && (timing.part("regressor").unwrap() - 0.5).abs() < 1e-9);
    assert!((timing.whole_p95_ms - 1.0).abs() < 1e-9 && timing.frames > 200);
}

struct Shrink(f32);

impl Codec for Shrink {
    fn reconstruct(&self, _: &str, deltas: &Frames) -> Result<Frames, MethodError> {
        let mut out = deltas.clone();
        out.points_mut().iter_mut().for_each(|p| *p *= self.0);
        Ok(out)
    }
}

#[test]
fn the_subspace_table_is_against_truth_and_against_the_input() {
    let folder = tempfile::tempdir().unwrap();
    let w = world(folder.path());
    let pair = |latent, autoencoder| CodecPair { latent, pca: &Shrink(0.0), autoencoder, residual_kept: None };
    let identity = Shrink(1.0);
    let table = judge_subspace(&w.scene(), &[pair(25, Some(&identity)), pair(50, None)], &w.clips, &Silent).unwrap();
    let SubspaceTable { pooled: table, by_subject, over_time } = table;
    let row = table[&25];
    assert!((row.ae_mm.unwrap() - 1.0).abs() < 0.02, "what comes through whole is the noise");
    assert_eq!(row.scan_ae_mm, Some(0.0));
    let alone = run(&w.scene(), &[], &w.clips).unwrap().methods["body"].regions["all"];
    assert!((row.pca_mm.unwrap() - alone.mean_mm.unwrap()).abs() < 1e-6, "nothing comes through: the body alone");
    assert!((row.scan_pca_mm.unwrap() - alone.scan_mean_mm.unwrap()).abs() < 1e-6);
    assert_eq!((table[&50].ae_mm, table[&50].scan_ae_mm), (None, None));
    // two clips of s01 with 120 and 90 frames, one of s02 with 120: people and frames make up the whole
    let pca = |name: &str| by_subject[name][&25].pca_mm.unwrap();
    assert_eq!(by_subject.len(), 2);
    assert!(((210.0 * pca("s01") + 120.0 * pca("s02")) / 330.0 - row.pca_mm.unwrap()).abs() < 1e-6);
    let frames: Vec<f64> = over_time.values().flat_map(|c| c[&25].pca_mm.clone()).collect();
    assert_eq!((frames.len(), over_time[&w.clips[1]][&50].ae_mm.len()), (330, 0));
    assert!((frames.iter().sum::<f64>() / 330.0 - row.pca_mm.unwrap()).abs() < 1e-4);
}

#[test]
fn the_fit_is_held_against_truth() {
    let folder = tempfile::tempdir().unwrap();
    let w = world(folder.path());
    let fit = judge_fit(&w.scene(), &w.clips, &Silent).unwrap().unwrap();
    // every joint is off by 0.2 degrees round X of the axis-angle: exactly that where it is at rest, near it elsewhere
    assert!((fit.joint_deg_median.unwrap() - 0.2).abs() < 0.02, "{fit:?}");
    // the spine turns about the pelvis and the head about both: 0.6 m of lever at 0.2 degrees is 2 mm
    assert!(fit.joint_mm_median.unwrap() > 0.5 && fit.joint_mm_p95.unwrap() < 6.0, "{fit:?}");
    assert!(
        (fit.delta_mm_mean.unwrap() - 1.0).abs() < 0.02 && (fit.scan_noise_mm.unwrap() - 1.0).abs() < 0.03,
        "{fit:?}"
    );
    assert!(judge_fit(&Scene { truth: None, ..w.scene() }, &w.clips, &Silent).unwrap().is_none());
    assert_eq!(FPS, 60.0);
}
