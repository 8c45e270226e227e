//! Cases 28 to 38: frames, their numbers and their rate, and skeletons.

use super::files::{Lay, came_in, clip, fixture, frame, npy, obj, take, vertices, zip};
use super::{Case, Door, Then};
use softtissue_clips::{MotionClip, ScanSet};
use std::path::Path;

fn refused(number: u8, source: &str, lay: Vec<Lay>, words: &[&'static str]) -> Case {
    Case::new(number, Door::Scans, source, lay, Then::Refused(words.to_vec()))
}

fn fine(number: u8, source: &str, lay: Vec<Lay>, words: &[&'static str]) -> Case {
    Case::new(number, Door::Scans, source, lay, Then::Fine(words.to_vec(), came_in))
}

/// The template's frames under these names.
fn named(source: &str, frames: &[(&'static str, usize)]) -> Vec<Lay> {
    clip(source, frames.iter().map(|(name, t)| (*name, obj(&frame(*t), &[]).into_bytes())).collect())
}

/// The take in BVH with something else in the place of a part of it.
fn bvh(number: u8, name: &str, from: &str, to: &str, words: &[&'static str]) -> Case {
    let text = take("cmu_01_01.bvh");
    assert!(text.contains(from), "{from}");
    Case::refused(number, Door::Motion, name, text.replacen(from, to, 1), words)
}

/// The take in AMC beside its skeleton, both as given.
fn acclaim(number: u8, name: &str, asf: String, amc: String, words: &[&'static str]) -> Case {
    let lay = vec![Lay::Bytes("01.asf".into(), asf.into()), Lay::Bytes(name.into(), amc.into())];
    Case::new(number, Door::Motion, name, lay, Then::Refused(words.to_vec()))
}

fn amass(number: u8, file: &str, words: &[&'static str]) -> Case {
    Case::fixture(number, Door::Motion, &format!("motion/{file}"), file, words)
}

pub fn cases() -> Vec<Case> {
    let mut cases = counts();
    cases.extend(numbers());
    cases.extend(rates());
    cases.extend(skeletons());
    cases
}

/// 28 and 29.
fn counts() -> Vec<Case> {
    let (asf, amc) = (take("01.asf"), take("01_01.amc"));
    let head = amc.split_once("\n1261\n").expect("frames").0.to_owned() + "\n";
    let single = amc.split_once("\n1262\n").expect("frames").0.to_owned() + "\n";
    let no_frame = zip(&[("vertices.npy", &npy("<f4", false, "(0, 1724, 3)", &[]))]);
    let one_frame = zip(&[("vertices.npy", &vertices(&[frame(0)]))]);
    vec![
        refused(28, "none", named("none", &[]), &["anna/hips", "no frame"]),
        Case::fixture(28, Door::Scans, "scans/no_frame.hdf5", "no_frame.hdf5", &["50004_hips", "no frame"]),
        Case::refused(28, Door::Scans, "anna_none.npz", no_frame, &["array vertices", "0 frames"]),
        bvh(28, "none.bvh", "Frames: 200", "Frames: 0", &["none.bvh, line 186", "no frame"]),
        acclaim(28, "01_none.amc", asf.clone(), head, &["no frame"]),
        refused(29, "one", named("one", &[("1.obj", 0)]), &["anna/hips", "no velocity"]),
        Case::fixture(29, Door::Scans, "scans/one_frame.hdf5", "one_frame.hdf5", &["50004_hips", "no velocity"]),
        Case::refused(29, Door::Scans, "anna_one.npz", one_frame, &["array vertices", "no velocity"]),
        refused(29, "lone.obj", vec![Lay::Bytes("lone.obj".into(), obj(&frame(0), &[]).into())], &["single frame"]),
        bvh(29, "one.bvh", "Frames: 200", "Frames: 1", &["one.bvh, line 186", "no velocity"]),
        acclaim(29, "01_one.amc", asf, single, &["no velocity"]),
        amass(29, "bad_one.npz", &["array trans", "no velocity"]),
    ]
}

/// 30 to 33.
fn numbers() -> Vec<Case> {
    let gap = [("8.obj", 0), ("9.obj", 1), ("12.obj", 4)];
    let filled = [("8.obj", 0), ("9.obj", 1), ("10.obj", 2), ("13.obj", 5)];
    let span = [("0.obj", 0), ("1.obj", 1), ("18446744073709551615.obj", 2)];
    let people = [("anna1.obj", 0), ("anna2.obj", 1), ("ben3.obj", 2)];
    let left_right = [("left.obj", 0), ("right.obj", 1)];
    let (asf, amc) = (take("01.asf"), take("01_01.amc"));
    let jump = amc.replace("\n1300\n", "\n1301\n");
    let again = amc.replace("\n1300\n", "\n1299\n");
    let pair = "ROOT Second\n{\nOFFSET 0 0 0\n}\nMOTION";
    let last = take("cmu_01_01.bvh").lines().last().expect("frames").to_owned();
    vec![
        refused(30, "gap", named("gap", &gap), &["9.obj and 12.obj", "--fill-gaps"]),
        fine(30, "filled", named("filled", &filled), &["interpolated"]).with(&["--fill-gaps"]),
        refused(30, "twice", named("twice", &[("1.obj", 0), ("01.obj", 1), ("2.obj", 2)]), &["01.obj", "same frame"]),
        refused(30, "span", named("span", &span), &["span", "more than"]).with(&["--fill-gaps"]),
        refused(30, "unnamed", named("unnamed", &left_right), &["left.obj", "frame number"]),
        acclaim(30, "01_gap.amc", asf.clone(), jump, &["01_gap.amc, line", "frame 1301 follows frame 1299"]),
        acclaim(30, "01_twice.amc", asf, again, &["01_twice.amc, line", "frame 1299 follows frame 1299"]),
        bvh(30, "short.bvh", &format!("{last}\n"), "", &["short.bvh, line", "200 frames are stated"]),
        bvh(30, "more.bvh", "Frames: 200", "Frames: 199", &["more.bvh, line 387", "follows the 199 frames"]),
        fine(
            31,
            "natural",
            named("natural", &[("f100.obj", 91), ("f9.obj", 0), ("f99.obj", 90), ("f10.obj", 1)]),
            &["interpolated"],
        )
        .with(&["--fill-gaps"]),
        refused(32, "people", named("people", &people), &["anna1.obj and ben3.obj", "two sequences"]),
        bvh(32, "people.bvh", "MOTION", pair, &["people.bvh, line 185", "two people"]),
        amass(33, "bad_counts.npz", &["array poses", "[11, 156]"]),
    ]
}

/// 34 to 36.
fn rates() -> Vec<Case> {
    let two = || named("rate", &[("1.obj", 0), ("2.obj", 1)]);
    let said = |source: &str, fps: &'static str| {
        let lay = named(source, &[("1.obj", 0), ("2.obj", 1)]);
        refused(34, source, lay, &["frames a second"]).with(&[fps])
    };
    let archive = |fps: f64| {
        let rate = npy("<f8", false, "()", &fps.to_le_bytes());
        zip(&[("vertices.npy", &vertices(&[frame(0), frame(1)])), ("fps.npy", &rate)])
    };
    let fast = |out: &Path| assert_eq!(ScanSet::open(out).expect("a set").clips()[0].fps, 120.0);
    let other = |out: &Path| {
        let clip = MotionClip::read(out).expect("a clip");
        assert_eq!((clip.fps, clip.len()), (60.0, 100));
    };
    let lay = vec![Lay::Bytes("take.bvh".into(), take("cmu_01_01.bvh").into())];
    vec![
        said("zero", "--fps=0"),
        said("negative", "--fps=-5"),
        said("no-number", "--fps=NaN"),
        Case::refused(34, Door::Scans, "anna_zero.npz", archive(0.0), &["array fps", "--fps"]),
        Case::refused(34, Door::Scans, "anna_back.npz", archive(-60.0), &["array fps", "--fps"]),
        Case::refused(34, Door::Scans, "anna_nan.npz", archive(f64::NAN), &["array fps", "finite"]),
        bvh(34, "zero.bvh", ".0083333", "0", &["zero.bvh, line 187", "--source-fps"]),
        bvh(34, "back.bvh", ".0083333", "-0.01", &["back.bvh, line 187", "frame time"]),
        bvh(34, "nan.bvh", ".0083333", "nan", &["nan.bvh, line 187", "frame time"]),
        amass(34, "bad_rate.npz", &["array mocap_framerate", "--source-fps"]),
        Case::new(35, Door::Scans, "rate", two(), Then::Fine(vec!["1 clips"], fast)).with(&["--fps", "120"]),
        Case::new(35, Door::Motion, "take.bvh", lay, Then::Fine(vec!["resampled to 60"], other)).with(&["--fps", "60"]),
        bvh(36, "huge.bvh", "Frames: 200", "Frames: 4000000000", &["huge.bvh, line 186", "4000000000"]),
        bvh(36, "overflow.bvh", "Frames: 200", "Frames: 99999999999999999999", &["line 186", "no number of frames"]),
    ]
}

/// 37 and 38.
fn skeletons() -> Vec<Case> {
    let (asf, amc) = (take("01.asf"), take("01_01.amc"));
    let deep: String = (0..100_000).map(|i| format!("{} j{i}\n{{\n", if i == 0 { "ROOT" } else { "JOINT" })).collect();
    // One motion in other orders of rotation, units and axes: NumPy wrote it from the same rotations.
    let orders = ["plain.bvh", "daz.bvh", "motion_builder.bvh"].into_iter().map(|file| {
        let bytes = std::fs::read(fixture("motion").join(file)).expect("a fixture");
        Case::new(38, Door::Motion, file, vec![Lay::Bytes(file.into(), bytes)], Then::Fine(vec!["30 frames"], as_plain))
    });
    let mut cases = vec![
        bvh(37, "twice.bvh", "JOINT RightKnee", "JOINT LeftKnee", &["twice.bvh, line 43", "\"LeftKnee\"", "twice"]),
        acclaim(
            37,
            "01_double.amc",
            asf.clone(),
            amc.replacen("\nthorax ", "\nhead ", 1),
            &["line", "head stands twice"],
        ),
        bvh(37, "dog.bvh", "JOINT LeftKnee", "JOINT LeftHock", &["left shank"]),
        Case::refused(
            37,
            Door::Motion,
            "deep.bvh",
            format!("HIERARCHY\n{deep}"),
            &["deep.bvh, line 1026", "512 joints"],
        ),
        Case::refused(37, Door::Motion, "lonely.amc", ":DEGREES\n1\nroot 1 2 3 4 5 6\n", &["--skeleton"]),
    ];
    // Here the skeleton is at fault, and it is its file that is named.
    let lay = vec![
        Lay::Bytes("01_bones.asf".into(), asf.replacen("name ltibia", "name lfemur", 1).into()),
        Lay::Bytes("01_bones.amc".into(), amc.into()),
    ];
    let mut twice = Case::new(37, Door::Motion, "01_bones.amc", lay, Then::Refused(vec!["lfemur"]));
    twice.names = Some("01_bones.asf");
    cases.push(twice);
    cases.extend(orders);
    cases
}

/// The pelvis turns and moves as in `plain.bvh`, which is read first.
fn as_plain(out: &Path) {
    let read = |path: &Path| MotionClip::read(path).expect("a clip");
    let (plain, found) = (read(&out.with_file_name("38-plain.bvh.out")), read(out));
    assert_eq!((plain.len(), found.len()), (30, 30));
    for t in 0..30 {
        for (a, b) in plain.rotations.frame(t).iter().zip(found.rotations.frame(t)) {
            // half turns have two vectors
            assert!(a.distance(*b) < 2e-3 || a.length() > 3.0, "{}, frame {t}: {a} and {b}", out.display());
        }
        assert!(plain.translations[t].distance(found.translations[t]) < 2e-3);
    }
}
