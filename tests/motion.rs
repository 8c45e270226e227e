//! Foreign motions: brought in, animated, inspected, refused.

use crate::support::{Said, command, data_dir, folder, softtissue, tiny_config, tiny_run};
use softtissue_clips::MotionClip;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

fn clip(name: &str) -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/motion").join(name).display().to_string()
}

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures").join(name)
}

fn import(home: &Path, source: &str, out: &str, more: &[&str]) -> Said {
    let [config, data, out] = [tiny_config(home), data_dir(), home.join(out)].map(|p| p.display().to_string());
    let always = ["import", "motion", source, "--out", &out, "--config", &config, "--data-dir", &data];
    softtissue(&[&always[..], more].concat())
}

fn json(args: &[&str]) -> serde_json::Value {
    serde_json::from_str(&softtissue(args).fine().out).expect("JSON")
}

#[test]
fn a_motion_becomes_a_clip_that_tells_where_it_came_from() {
    let home = folder("motion-import");
    let said = import(&home, &clip("01_01.amc"), "amc.safetensors", &["--fps", "60"]);
    for part in ["ASF/AMC", "Y up (guessed)", "120.00 a second (guessed)", "CMU units (0.0564 m),", "resampled to 60"] {
        assert!(said.fine().out.contains(part), "{part}: {}", said.out);
    }
    let said = import(&home, &clip("cmu_01_01.bvh"), "bvh.safetensors", &["--fps", "60"]);
    assert!(said.fine().out.contains("CMU units (0.0564 m) (guessed)"), "{}", said.out);
    let [amc, bvh] =
        ["amc", "bvh"].map(|n| MotionClip::read(&home.join(n).with_extension("safetensors")).expect("a clip"));
    assert_eq!((amc.len(), amc.fps, amc.rotations.points_per_frame()), (100, 60.0, 24));
    assert_eq!(bvh.id.to_string(), "imported/cmu_01_01.0");
    // the same take: 1 degree (for the axis-angle vectors as well, away from half turns) and 5 mm
    let far = |a: &[glam::Vec3], b: &[glam::Vec3]| a.iter().zip(b).map(|(a, b)| a.distance(*b)).fold(0.0, f32::max);
    assert!(far(&amc.translations, &bvh.translations) < 0.005);
    for j in 0..24 {
        let turns = |c: &MotionClip| c.rotations.iter().map(|f| f[j]).collect::<Vec<_>>();
        let (a, b) = (turns(&amc), turns(&bvh));
        if a.iter().all(|w| w.length() < 2.5) {
            assert!(far(&a, &b) < 1f32.to_radians(), "joint {j}");
        }
    }
    let facts = json(&["inspect", "--json", &home.join("bvh.safetensors").display().to_string()]);
    assert_eq!(facts["what"], "motion clip");
    assert_eq!(facts["provenance"]["source"], "cmu_01_01.bvh");
    assert_eq!(facts["provenance"]["read"]["guessed"], serde_json::json!(["units", "up"]));
    // What is stated is taken.
    let stated = ["--units", "0.056444", "--up", "y", "--source-fps", "60"];
    let said = import(&home, &clip("cmu_01_01.bvh"), "stated.safetensors", &stated);
    assert!(!said.fine().out.contains("guessed") && said.out.contains("200 frames at 60"), "{}", said.out);
}

#[test]
fn foreign_motions_are_animated_at_the_rate_of_the_bundle() {
    let home = folder("motion-animate");
    let bundle = tiny_run().path.join("bundle").display().to_string();
    let frames = |motion: &str, more: &[&str]| {
        let out = home.join("frames");
        let _ = std::fs::remove_dir_all(&out);
        let out_text = out.display().to_string();
        let args = ["animate", "--bundle", &bundle, "--motion", motion, "--out", &out_text];
        let said = softtissue(&[&args[..], more].concat());
        said.fine();
        (
            std::fs::read_dir(&out).expect("a folder").count(),
            said.err,
            std::fs::read_to_string(out.join("frame_00000.obj")),
        )
    };
    let (count, said, first) = frames(&clip("cmu_01_01.bvh"), &[]);
    assert_eq!(count, 100);
    assert!(said.contains("BVH, 31 joints") && said.contains("resampled to 60 a second"), "{said}");
    // A person who stands on the floor.
    let first = first.expect("a frame");
    let heights = first.lines().filter_map(|l| l.strip_prefix("v ")).filter_map(|l| l.split(' ').nth(1)?.parse().ok());
    let (low, high) = heights.fold((f32::MAX, f32::MIN), |(l, h), y: f32| (l.min(y), h.max(y)));
    assert!((-0.03..0.06).contains(&low) && (1.0..1.9).contains(&high), "{low} to {high}");
    let (count, said, _) = frames(&fixture("motion/amass_2.npz").display().to_string(), &[]);
    assert!(count == 6 && said.contains("AMASS"), "{count} {said}");
    // our own clips too
    import(&home, &clip("cmu_01_01.bvh"), "own.safetensors", &[]).fine();
    let (count, said, _) = frames(&home.join("own.safetensors").display().to_string(), &[]);
    assert!(count == 100 && said.contains("120 frames a second, resampled to 60"), "{count} {said}");
}

#[test]
fn inspect_tells_of_foreign_motions() {
    let home = folder("motion-inspect");
    let picture = home.join("picture.png").display().to_string();
    let facts = json(&["inspect", "--json", &clip("cmu_01_01.bvh"), "--picture", &picture]);
    assert_eq!((&facts["what"], &facts["frames"]), (&"foreign motion (BVH)".into(), &200.into()));
    assert_eq!((&facts["up"], &facts["units"]), (&"Y".into(), &"CMU units (0.0564 m)".into()));
    assert_eq!(facts["problems"], serde_json::json!([]));
    assert!(std::fs::read(&picture).expect("a picture").starts_with(b"\x89PNG"));
    let facts = json(&["inspect", "--json", &fixture("motion/motion_builder.bvh").display().to_string()]);
    assert_eq!((&facts["up"], &facts["units"], &facts["frames"]), (&"Z".into(), &"inches".into(), &30.into()));
    // A take whose marks were lost for a moment, and one with frames that were held.
    let text = std::fs::read_to_string(clip("cmu_01_01.bvh")).expect("a clip");
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    let first = lines.iter().position(|l| l.starts_with("Frame Time")).expect("frames") + 1;
    lines[first + 20] = lines[first + 19].clone();
    lines[first + 60] = format!("99{}", lines[first + 60]);
    let bad = home.join("bad.bvh");
    std::fs::write(&bad, lines.join("\n")).expect("a file");
    let facts = json(&["inspect", "--json", &bad.display().to_string()]);
    let problems = facts["problems"].to_string();
    assert!(problems.contains("frame 20 repeats") && problems.contains("frame 60: "), "{problems}");
    assert!(softtissue(&["inspect", &clip("01_01.amc")]).fine().out.contains("skeleton: 01.asf"));
    softtissue(&["inspect", &home.display().to_string(), "--picture", &picture]).refused(2, &["--picture"]);
}

/// Runs under a limit of 1.5 GiB; it must answer within five seconds and write nothing.
fn refused(path: &Path, words: &[&str]) {
    let name = path.file_name().expect("a name").to_string_lossy();
    let home = folder(&format!("motion-refused-{name}"));
    let out = home.join("out.safetensors");
    let bundle = tiny_run().path.join("bundle");
    let [path, out_text, bundle] = [path, &out, &bundle].map(|p| p.display().to_string());
    let data = data_dir().display().to_string();
    for args in [
        &["import", "motion", &path, "--out", &out_text, "--data-dir", &data][..],
        &["animate", "--bundle", &bundle, "--motion", &path, "--out", &out_text],
        &["inspect", &path],
    ] {
        let begun = Instant::now();
        let mut limited = Command::new("sh");
        limited.args(["-c", "ulimit -v 1572864; exec \"$0\" \"$@\""]).arg(command().get_program()).args(args);
        Said::of(&limited.output().expect("a shell")).refused(3, words);
        assert!(begun.elapsed() < Duration::from_secs(5), "{path}: {:?}", begun.elapsed());
        assert!(!out.exists(), "{path}");
    }
}

#[test]
fn bad_motions_are_refused_in_a_sentence() {
    let home = folder("motion-bad");
    let bvh = std::fs::read_to_string(clip("cmu_01_01.bvh")).expect("a clip");
    let write = |name: &str, content: &[u8]| {
        let path = home.join(name);
        std::fs::write(&path, content).expect("a file");
        path
    };
    let first = bvh.lines().position(|l| l.starts_with("Frame Time")).expect("frames") + 2;
    let cut = |lines: usize| bvh.lines().take(lines).map(|l| format!("{l}\n")).collect::<String>();
    for (name, content, words) in [
        ("empty.bvh", String::new(), ["empty.bvh", "HIERARCHY"]),
        ("void.bvh", bvh.replace("Frames: 200", "Frames: 0"), ["void.bvh, line 186", "no frame"]),
        ("single.bvh", bvh.replace("Frames: 200", "Frames: 1"), ["single.bvh, line 186", "no velocity"]),
        ("huge.bvh", bvh.replace("Frames: 200", "Frames: 4000000000"), ["huge.bvh, line 186", "4000000000"]),
        ("short.bvh", cut(first + 10), ["short.bvh, line", "200 frames are stated"]),
        ("half.bvh", bvh[..bvh.len() - 300].to_owned(), ["half.bvh, line", "96 channels"]),
        ("still.bvh", bvh.replace(".0083333", "0"), ["still.bvh, line 187", "--source-fps"]),
        ("back.bvh", bvh.replace(".0083333", "-0.01"), ["back.bvh, line 187", "frame time"]),
        ("nan.bvh", bvh.replace(".0083333", "nan"), ["nan.bvh, line 187", "frame time"]),
        ("twice.bvh", bvh.replace("JOINT RightKnee", "JOINT LeftKnee"), ["twice.bvh, line 43", "\"LeftKnee\""]),
        ("comma.bvh", bvh.replacen("15.3238", "15,3238", 1), ["comma.bvh, line 188", "point"]),
        ("infinite.bvh", bvh.replacen("15.3238", "1e400", 1), ["infinite.bvh, line 188", "finite"]),
        (
            "pair.bvh",
            bvh.replacen("MOTION", "ROOT Second\n{\nOFFSET 0 0 0\n}\nMOTION", 1),
            ["pair.bvh, line 185", "ROOT"],
        ),
        ("dog.bvh", bvh.replace("LeftKnee", "LeftHock"), ["dog.bvh", "left shank"]),
        ("feet.bvh", bvh.replace("OFFSET", "OFFSET 0"), ["feet.bvh, line 4", "follows the 3"]),
        ("wide.bvh", cut(first - 1) + &"1 ".repeat(6_000_000), ["wide.bvh, line 188", "more than 96"]),
        (
            "deep.bvh",
            format!(
                "HIERARCHY\n{}",
                (0..100_000)
                    .map(|i| format!("{} j{i}\n{{\n", if i == 0 { "ROOT" } else { "JOINT" }))
                    .collect::<String>()
            ),
            ["deep.bvh, line 1026", "512 joints"],
        ),
        ("lonely.amc", ":DEGREES\n1\nroot 1 2 3 4 5 6\n".into(), ["lonely.amc", "--skeleton"]),
    ] {
        assert!(content.len() < 300 || content != bvh, "{name} is not as it should be");
        refused(&write(name, content.as_bytes()), &words);
    }
    let junk: Vec<u8> = (0..100_000u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 13) as u8).collect();
    refused(&write("junk.bvh", &junk), &["junk.bvh", "HIERARCHY"]);
    refused(&write("junk.npz", &junk), &["junk.npz", "zip"]);
    refused(&home.join("missing.bvh"), &["missing.bvh", "exist"]);
    std::fs::create_dir_all(home.join("folder.bvh")).expect("a folder");
    refused(&home.join("folder.bvh"), &["folder.bvh"]);
    std::fs::copy(clip("01.asf"), home.join("01.asf")).expect("a copy");
    let amc = std::fs::read_to_string(clip("01_01.amc")).expect("a clip");
    refused(
        &write("01_gap.amc", amc.replace("\n1300\n", "\n1301\n").as_bytes()),
        &["01_gap.amc, line", "frame 1301 follows"],
    );
    refused(&write("01_junk.amc", &junk), &["01_junk.amc"]);
}

#[test]
fn bad_archives_are_refused_in_a_sentence() {
    for (name, words) in [
        ("motion/bad_nan.npz", ["array poses", "[3, 5] is not finite"]),
        ("motion/bad_counts.npz", ["array poses", "[11, 156]"]),
        ("motion/bad_rate.npz", ["array mocap_framerate", "--source-fps"]),
        ("motion/bad_object.npz", ["array poses", "numbers"]),
        ("motion/bad_one.npz", ["array trans", "no velocity"]),
        ("motion/bad_header.npz", ["array trans", "4294967295"]),
        ("motion/bad_overflow.npz", ["array trans", "4294967296"]),
        ("motion/bad_cut.npz", ["array trans", "280"]),
        ("motion/bad_bomb.npz", ["member poses.npy", "inflate"]),
        ("arrays/twice.npz", ["poses.npy", "twice"]),
        ("arrays/outside.npz", ["../poses.npy", "not trusted"]),
    ] {
        refused(&fixture(name), &words);
    }
}

#[test]
fn options_that_make_no_sense() {
    let home = folder("motion-options");
    let bvh = clip("cmu_01_01.bvh");
    for fps in ["0", "-5", "NaN", "5000"] {
        import(&home, &bvh, "a.safetensors", &[&format!("--fps={fps}")]).refused(2, &["--fps"]);
        import(&home, &bvh, "a.safetensors", &[&format!("--source-fps={fps}")]).refused(3, &["frames a second"]);
    }
    import(&home, &bvh, "a.safetensors", &["--units", "metres"]).refused(3, &["--units", "tall"]);
    assert_eq!(import(&home, &bvh, "a.safetensors", &["--units", "cubits"]).code, 2);
    assert_eq!(import(&home, &bvh, "a.safetensors", &["--up", "x"]).code, 2);
    import(&home, &bvh, "a.safetensors", &["--fps", "0.3"]).refused(3, &["too short"]);
    import(&home, &clip("01.asf"), "a.safetensors", &[]).refused(3, &["01.asf", ".amc"]);
    assert!(!home.join("a.safetensors").exists());
}
