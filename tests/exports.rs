//! What `animate` writes, by the ending of the name: the same motion in every format.

use crate::support::{Said, folder, softtissue, tiny_run};
use std::path::Path;

fn text(path: &Path) -> String {
    path.display().to_string()
}

fn animate(out: &Path) -> Said {
    let bundle = text(&tiny_run().path.join("bundle"));
    let motion = ["--motion", "synth:one_leg_jump", "--frames", "5", "--shape=-2", "--out"];
    softtissue(&[&["animate", "--bundle", &bundle], &motion[..], &[&text(out)]].concat())
}

/// The vertices of a little-endian PC2 or a big-endian MDD, as text of the OBJ files writes them.
fn numbers(path: &Path, header: usize, read: fn([u8; 4]) -> f32) -> Vec<f32> {
    let bytes = std::fs::read(path).expect("a cache");
    bytes[header..].chunks(4).map(|b| read(b.try_into().expect("whole numbers"))).collect()
}

#[test]
fn every_format_holds_the_same_motion() {
    let home = folder("exports");
    let objs = home.join("frames.v2/");
    for out in ["a.pc2", "a.MDD", "a.usda", "a.gltf", "a.glb", "frames.v2/"] {
        let said = animate(&home.join(out));
        said.fine();
        assert!(said.out.contains("5 ") && said.out.contains(&text(&home.join(out))), "{}", said.out);
    }
    let vertices = |path: &Path| -> Vec<f32> {
        let obj = std::fs::read_to_string(path).expect("an OBJ");
        assert!(obj.contains("\nvt ") && obj.contains("\nf "), "texture coordinates and faces");
        let of_vertices = obj.lines().filter_map(|l| l.strip_prefix("v "));
        of_vertices.flat_map(str::split_whitespace).map(|x| x.parse().expect("a number")).collect()
    };
    let frames: Vec<f32> = (0..5).flat_map(|t| vertices(&objs.join(format!("frame_{t:05}.obj")))).collect();
    assert_eq!(numbers(&home.join("a.pc2"), 32, f32::from_le_bytes), frames);
    assert_eq!(numbers(&home.join("a.MDD"), 8 + 4 * 5, f32::from_be_bytes), frames);
    assert_eq!(vertices(&home.join("a.obj")), frames[..frames.len() / 5]);
    let usd = std::fs::read_to_string(home.join("a.usda")).expect("a stage");
    let last = &frames[frames.len() - 3..];
    assert!(usd.contains(&format!("({}, {}, {})]", last[0], last[1], last[2])), "the last vertex of the last frame");
    assert!(usd.contains("primvars:st:indices"));
}

#[test]
fn a_format_that_is_not_written_is_refused_before_any_work() {
    let home = folder("exports-refused");
    animate(&home.join("a.fbx")).refused(2, &["a.fbx", ".usda"]);
    assert_eq!(std::fs::read_dir(&home).expect("a folder").count(), 0);
}

#[test]
fn the_network_is_written_in_both_forms_for_the_body_that_was_asked_for() {
    let home = folder("exports-onnx");
    let bundle = text(&tiny_run().path.join("bundle"));
    let (fused, plain, heavier) = (home.join("fused.onnx"), home.join("plain.onnx"), home.join("heavier.onnx"));
    let export = |more: &[&str]| softtissue(&[&["export", &bundle], more].concat());
    export(&["--onnx", &text(&fused), "--plain-onnx", &text(&plain)]).fine();
    export(&["--shape=0,-2", "--onnx", &text(&heavier)]).fine();
    let [fused, plain, heavier] = [fused, plain, heavier].map(|path| std::fs::read(path).expect("a network"));
    // protobuf keeps names as they are
    let has = |bytes: &[u8], word: &str| bytes.windows(word.len()).any(|w| w == word.as_bytes());
    for network in [&fused, &plain, &heavier] {
        assert!(
            ["features", "deltas", "memory_out", "basis.directions", "frames_per_second"]
                .iter()
                .all(|w| has(network, w))
        );
    }
    assert!(heavier.len().abs_diff(fused.len()) < 64 && heavier != fused);
    let nothing = export(&[]);
    assert!(nothing.code == 2 && nothing.err.contains("--onnx"), "{}", nothing.err);
    export(&["--onnx", &text(&home.join("a.onnx")), "--shape", "0,99"]).refused(2, &["--shape"]);
    assert!(!home.join("a.onnx").exists());
}

#[test]
fn a_bundle_in_fewer_bits_states_its_loss_and_goes_out_by_every_door() {
    let home = folder("exports-precision");
    let whole = tiny_run().path.join("bundle");
    let small = home.join("small");
    let export = |from: &Path, more: &[&str]| softtissue(&[&["export", &text(from)], more].concat());
    let said = export(&whole, &["--precision", "i8", "--out", &text(&small)]);
    said.fine();
    let manifest = |dir: &Path| -> serde_json::Value {
        serde_json::from_slice(&std::fs::read(dir.join("manifest.json")).expect("a manifest")).expect("JSON")
    };
    let (before, after) = (manifest(&whole), manifest(&small));
    assert_eq!((before["precision"].as_str(), after["precision"].as_str()), (Some("f32"), Some("i8")));
    let loss = &after["info"]["measured"]["precision_loss"];
    let number = |key: &str| loss[key].as_f64().expect("a number");
    assert!(0.0 < number("mean_mm") && number("mean_mm") < number("max_mm") && number("max_mm") < 1.0, "{loss}");
    assert!(number("frames") > 1000.0 && loss["motions"].as_array().is_some_and(|m| m.len() == 6), "{loss}");
    assert!(said.out.contains(&format!("{:.4} mm at most", number("max_mm"))), "{}", said.out);
    let size = |dir: &Path| dir.join("model.safetensors").metadata().expect("a model").len();
    assert!(3 * size(&small) < 2 * size(&whole), "{} {}", size(&small), size(&whole));

    // The same motion from both, no farther apart than was said of other motions, times ten.
    let played = |bundle: &Path, out: &str, more: &[&str]| {
        let out = home.join(out);
        let motion = ["--motion", "synth:one_leg_jump", "--frames", "40", "--out"];
        softtissue(&[&["animate", "--bundle", &text(bundle)], &motion[..], &[&text(&out)], more].concat()).fine();
        numbers(&out, 32, f32::from_le_bytes)
    };
    let apart = |a: &[f32], b: &[f32]| a.iter().zip(b).fold(0.0f32, |m, (a, b)| m.max((a - b).abs()));
    let (a, b) = (played(&whole, "whole.pc2", &[]), played(&small, "small.pc2", &[]));
    assert!(a.len() == b.len() && a != b && 1e3 * f64::from(apart(&a, &b)) < 10.0 * number("max_mm"));
    let fewer = played(&small, "fewer.pc2", &["--components", "1", "--still", "head"]);
    assert!(apart(&fewer, &b) > 1e-5, "a level of detail changes nothing");
    export(&small, &["--onnx", &text(&home.join("small.onnx"))]).fine();

    let other = text(&home.join("other"));
    export(&small, &["--precision", "f16", "--out", &other]).refused(2, &["in i8", "f32"]);
    export(&whole, &["--precision", "i4", "--out", &other]).refused(2, &["i4", "f16"]);
    export(&small, &["--precision", "f16", "--out", &text(&small)]).refused(2, &["another folder"]);
    assert!(!home.join("other").exists());
    let still = ["animate", "--bundle", &text(&small), "--motion", "synth:hips", "--out", &other, "--still", "nose"];
    softtissue(&still).refused(2, &["nose", "belly"]);
}
