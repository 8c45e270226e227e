//! Foreign motions: brought in, animated, inspected. What is refused stands with the doors.

use crate::support::{Said, data_dir, folder, softtissue, tiny_config, tiny_run};
use softtissue_clips::MotionClip;
use std::path::{Path, PathBuf};

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
    let frames = |kind: &str| -> Vec<u64> {
        let problems = facts["problems"].as_array().expect("a list");
        let of_kind =
            problems.iter().filter(|p| p["kind"] == kind).flat_map(|p| p["first"].as_array().expect("places"));
        of_kind.filter_map(|place| place["frame"].as_u64()).collect()
    };
    assert_eq!((frames("repeated-frames"), frames("teleport")), (vec![20], vec![60, 61]), "{}", facts["problems"]);
    assert!(softtissue(&["inspect", &clip("01_01.amc")]).fine().out.contains("skeleton: 01.asf"));
}

#[test]
fn options_that_make_no_sense() {
    let home = folder("motion-options");
    let bvh = clip("cmu_01_01.bvh");
    for fps in ["0", "-5", "NaN", "0.3", "5000"] {
        import(&home, &bvh, "a.safetensors", &[&format!("--fps={fps}")]).refused(2, &["--fps"]);
        import(&home, &bvh, "a.safetensors", &[&format!("--source-fps={fps}")]).refused(3, &["frames a second"]);
    }
    import(&home, &bvh, "a.safetensors", &["--units", "metres"]).refused(3, &["--units", "tall"]);
    assert_eq!(import(&home, &bvh, "a.safetensors", &["--units", "cubits"]).code, 2);
    assert_eq!(import(&home, &bvh, "a.safetensors", &["--up", "x"]).code, 2);
    import(&home, &clip("01.asf"), "a.safetensors", &[]).refused(3, &["01.asf", ".amc"]);
    assert!(!home.join("a.safetensors").exists());
}
