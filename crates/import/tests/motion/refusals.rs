use super::support::{data, fixture};
use softtissue_import::motion::{MotionConfig, MotionLimits, read_motion};
use std::path::Path;

/// Three joints would be no person; the refusals come before that.
const BVH: &str = "HIERARCHY\nROOT hips\n{\nOFFSET 0 0 0\nCHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation \
    Yrotation\nEnd Site\n{\nOFFSET 0 1 0\n}\n}\nMOTION\nFrames: 2\nFrame Time: 0.01\n1 2 3 4 5 6\n1 2 3 4 5 6\n";

fn message(name: &str, text: &str) -> String {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join(name);
    std::fs::write(&path, text).unwrap();
    read_motion(&path, &MotionConfig::default()).unwrap_err().to_string()
}

#[test]
fn bad_bvh_files_are_refused_with_their_line() {
    assert!(message("a.bvh", BVH).contains("left thigh"), "the file itself can be read");
    for (from, to, says) in [
        ("HIERARCHY", "", "HIERARCHY"),
        ("ROOT", "JOINT", "line 2"),
        ("End Site\n{\nOFFSET 0 1 0\n}\n}", "}\nROOT other\n{\nOFFSET 0 0 0\n}", "line 7: a second ROOT"),
        ("End Site\n", "JOINT hips\n", "line 6: the joint \"hips\" stands twice"),
        ("OFFSET 0 0 0", "OFFSET 0 0", "line 4: 3 numbers"),
        ("OFFSET 0 1 0", "OFFSET 0 1,5 0", "line 8: \"1,5\" is no number (write decimals with a point)"),
        ("6 Xpos", "5 Xpos", "line 5: 5 channels are announced and 6 named"),
        ("Yrotation", "Zrotation", "line 5: the channel Zrotation stands twice"),
        ("Yrotation", "Wrotation", "line 5"),
        ("}\nMOTION", "MOTION", "line 10: MOTION comes before 1"),
        ("}\n}\n", "}\n}\n}\n", "line 11: a } without"),
        ("ROOT hips\n{", "ROOT hips\n", "line 4: a { is missing"),
        ("Frames: 2", "Frames: 0", "line 12: it holds no frame"),
        ("Frames: 2", "Frames: 1", "line 12: it holds one frame, which has no velocity"),
        ("Frames: 2", "Frames: 4000000000", "line 12: it states 4000000000 frames"),
        ("Frames: 2", "Frames: 18446744073709551616", "line 12"),
        ("Frames: 2", "Frames: 3", "ends after 2"),
        ("Frames: 2\n", "Frames: 2\nFrame Time: 0.01\n", "line 14"),
        ("Time: 0.01", "Time: 0", "line 13: a frame time of \"0\""),
        ("Time: 0.01", "Time: -0.01", "line 13"),
        ("Time: 0.01", "Time: NaN", "line 13"),
        ("Time: 0.01", "Time: 1000", "line 13: a frame time of \"1000\" s; correct it, or state --source-fps"),
        ("Time: 0.01", "Time: 1e-9", "line 13"),
        ("1 2 3 4 5 6\n1", "1 2 3 4 5\n1", "line 14: 5 numbers, but the skeleton has 6 channels"),
        ("1 2 3 4 5 6\n1", "1 2 3 4 5 6 7\n1", "line 14: more than 6 numbers"),
        ("5 6\n1", "nan 6\n1", "line 14: the number nan is not finite"),
        ("5 6\n1", "1e400 6\n1", "line 14: the number 1e400 is not finite"),
        ("5 6\n1", "1e30 6\n1", "line 14: the number 1e30 is beyond"),
        ("4 5 6\n1 2 3 4 5 6\n", "4 5 6\n1 2 3 4 5 6\n7 7 7 7 7 7\n", "line 16: this line follows"),
    ] {
        assert!(BVH.contains(from), "{from}");
        let said = message("bad.bvh", &BVH.replacen(from, to, 1));
        assert!(said.contains("bad.bvh") && said.contains(says), "{from:?} -> {to:?}: {said}");
    }
}

#[test]
fn a_stated_rate_that_is_none_is_refused() {
    for fps in [0.0, -60.0, 0.99, 1001.0, f64::NAN, f64::INFINITY] {
        let config = MotionConfig { fps: Some(fps), ..Default::default() };
        let said = read_motion(&data("cmu_01_01.bvh"), &config).unwrap_err().to_string();
        assert!(said.contains("cmu_01_01.bvh") && said.contains("state 1 to 1000"), "{fps}: {said}");
    }
}

#[test]
fn a_byte_order_mark_carriage_returns_and_foreign_letters_are_no_fault() {
    let text = format!("\u{feff}{}", BVH.replace("hips", "h\u{fc}fte").replace('\n', " \r\n\t"));
    assert!(message("a.bvh", &text).contains("left thigh"));
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("latin.bvh");
    std::fs::write(
        &path,
        BVH.replace("hips", "h?fte").bytes().map(|b| if b == b'?' { 0xfc } else { b }).collect::<Vec<_>>(),
    )
    .unwrap();
    assert!(read_motion(&path, &MotionConfig::default()).unwrap_err().to_string().contains("left thigh"));
}

#[test]
fn bad_acclaim_files_are_refused_with_their_line() {
    let (asf, amc) = ["01.asf", "01_01.amc"].map(|n| std::fs::read_to_string(data(n)).unwrap()).into();
    let said = |asf: &str, amc: &str| {
        let dir = tempfile::tempdir().unwrap();
        std::fs::write(dir.path().join("01.asf"), asf).unwrap();
        std::fs::write(dir.path().join("01_01.amc"), amc).unwrap();
        let outcome = read_motion(&dir.path().join("01_01.amc"), &MotionConfig::default());
        outcome.map_or_else(|e| e.to_string(), |_| "fine".into())
    };
    assert_eq!(said(&asf, &amc), "fine");
    let first: String = amc.lines().take(4 + 29).map(|l| format!("{l}\n")).collect();
    assert!(said(&asf, &first).contains("one frame, which has no velocity"));
    assert!(said(&asf, ":DEGREES\n").contains("no frame"));
    for (from, to, says) in [
        ("\n1262\n", "\n1261\n", "frame 1261 follows frame 1261"),
        ("\n1262\n", "\n1270\n", "frame 1270 follows frame 1261"),
        ("\nlowerback ", "\nlowback ", "line 6: the skeleton has no bone \"lowback\""),
        ("\nthorax ", "\nhead ", "head stands twice"),
        ("\nrradius ", "\nrradius nan", "is no number"),
        ("\nrradius ", "\nrradius 1 ", "rradius has more than 1"),
        (":DEGREES\n1261", ":DEGREES\nroot", "does not begin with a frame number"),
    ] {
        assert!(amc.contains(from), "{from:?}");
        let said = said(&asf, &amc.replacen(from, to, 1));
        assert!(said.contains("01_01.amc") && said.contains(says), "{from:?}: {said}");
    }
    let missing: String = amc.lines().filter(|l| !l.starts_with("rfoot")).map(|l| format!("{l}\n")).collect();
    assert!(said(&asf, &missing).contains("has no rfoot"));
    for (from, to, says) in [
        ("name ltibia", "name lfemur", "lfemur"),
        ("lfemur ltibia", "ltibia lfemur", "second parent"),
        ("    lfemur ltibia\n", "", "missing in :hierarchy"),
        ("root lhipjoint", "ltoes lhipjoint", "leads to the root"),
        ("dof rx ry rz", "dof rx ry l", "\"l\" is no degree of freedom"),
        ("length 0.45", "length 0", "line 7: a unit of length"),
        ("axis 0 0 20", "axis 0 20", "3 numbers"),
        (":bonedata", ":bones", "no bone"),
    ] {
        assert!(asf.contains(from), "{from:?}");
        let said = said(&asf.replacen(from, to, 1), &amc);
        assert!(said.contains("01.asf") && said.contains(says), "{from:?}: {said}");
    }
}

#[test]
fn a_skeleton_that_is_not_there_is_asked_for() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::copy(data("01_01.amc"), dir.path().join("09_01.amc")).unwrap();
    let amc = dir.path().join("09_01.amc");
    let said = |config: &MotionConfig| read_motion(&amc, config);
    assert!(said(&MotionConfig::default()).unwrap_err().to_string().contains("--skeleton"));
    let config = MotionConfig { skeleton: Some(data("01.asf")), ..Default::default() };
    assert_eq!(said(&config).unwrap().facts.skeleton.unwrap(), "01.asf");
}

#[test]
fn bad_amass_files_are_refused_with_their_array() {
    for (name, says) in [
        ("bad_nan.npz", "array poses: entry [3, 5] is not finite"),
        ("bad_counts.npz", "array poses: its shape is [11, 156], expected [12, any]"),
        ("bad_rate.npz", "array mocap_framerate: a rate of 0"),
        ("bad_object.npz", "array poses: it holds Python objects"),
        ("bad_one.npz", "array trans: it holds one frame"),
    ] {
        let said = read_motion(&fixture(name), &MotionConfig::default()).unwrap_err().to_string();
        assert!(said.contains(name) && said.contains(says), "{said}");
    }
    let arrays = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/fixtures/arrays");
    for (name, says) in
        [("stored.npz", "array trans: it is missing"), ("twice.npz", "twice"), ("outside.npz", "../poses")]
    {
        let said = read_motion(&arrays.join(name), &MotionConfig::default()).unwrap_err().to_string();
        assert!(said.contains(says), "{said}");
    }
}

#[test]
fn limits_hold() {
    let refused = |limits: MotionLimits| {
        let config = MotionConfig { limits, ..Default::default() };
        ["cmu_01_01.bvh", "01_01.amc"].map(|name| read_motion(&data(name), &config).unwrap_err().to_string())
    };
    let limits = MotionLimits::default;
    for said in refused(MotionLimits { file_bytes: 1000, ..limits() }) {
        assert!(said.contains("more than 1000 bytes"), "{said}");
    }
    for limits in [
        MotionLimits { joints: 5, ..limits() },
        MotionLimits { frames: 50, ..limits() },
        MotionLimits { rotations: 1000, ..limits() },
    ] {
        for said in refused(limits) {
            assert!(said.contains("more than") || said.contains("at most"), "{said}");
        }
    }
}
