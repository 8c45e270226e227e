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
