//! The viewer as a page of its own: its layers add up, and what it holds is what went in.

mod figure;

use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use figure::{OnBody, Oscillator, World, body, motion, truth};
use glam::Vec3;
use serde_json::Value;
use softtissue_eval::viewer::{MOST_POINTS, Surface, View, ViewClip, fitted, plan, playback, true_clip, write};
use softtissue_geometry::Frames;
use std::io::Read;
use std::path::Path;

fn world(root: &Path) -> World {
    World::make(root, body(12, 10), &[motion("s01", "hop", 1.6, 60, 60), motion("s02", "hop", 1.9, 60, 60)])
}

fn view<'a>(w: &'a World, clips: &'a [ViewClip]) -> View<'a> {
    let surface = Surface { faces: &w.body.topology.faces, regions: Some(&w.body.regions) };
    View { title: "a <set>", about: "about", notes: &[], surface, reference: Some("reference"), clips }
}

fn frames<'a>(clip: &'a ViewClip, key: &str) -> &'a Frames {
    &clip.layer(key).unwrap_or_else(|| panic!("no layer {key}")).frames
}

/// Largest distance between the sum of layers and points.
fn off(layers: &[&Frames], points: &Frames) -> f32 {
    let sum = |i: usize| layers.iter().map(|l| l.points()[i]).sum::<Vec3>();
    points.points().iter().enumerate().map(|(i, p)| sum(i).distance(*p)).fold(0.0, f32::max)
}

#[test]
fn layers_add_up_to_scan_and_truth() {
    let folder = tempfile::tempdir().unwrap();
    let w = world(folder.path());
    let id = &w.clips[0];
    let scan = w.scans.scan(id).unwrap();
    let clip = true_clip(&w.body, &w.truth, &scan).unwrap();
    let [scanned, soft, alone] = ["scan", "reference", "alone"].map(|key| frames(&clip, key));
    assert!(off(&[alone, soft], &w.truth.clean(id).unwrap().vertices) < 1e-5);
    assert!(off(&[alone, soft, scanned], &scan.vertices) < 1e-5);
    let rest = OnBody(&w.body, Oscillator { gain: 0.0, ..truth() });
    let played = playback(&w.scene(), &rest, id).unwrap();
    assert!(off(&[frames(&played, "alone")], alone) < 1e-5, "the true body alone is the posed body");
    assert!(off(&[frames(&played, "reference")], soft) < 1e-5);
    assert!(frames(&played, "predicted").points().iter().all(|d| *d == Vec3::ZERO));

    let found = fitted(&w.body, &w.fit, Some(&scan), id).unwrap();
    let [scanned, fit, deltas] = ["scan", "fit", "deltas"].map(|key| frames(&found, key));
    assert!(off(&[fit, deltas, scanned], &scan.vertices) < 1e-5);
    // the fitted pose is off by 0.2 degrees, the shape is right
    let pose_error = off(&[fit], alone);
    assert!((1e-4..0.02).contains(&pose_error), "{pose_error}");
    let keys: Vec<&str> = fitted(&w.body, &w.fit, None, id).unwrap().layers.iter().map(|l| l.key).collect();
    assert_eq!(keys, ["fit", "deltas"]);
}

fn data(html: &str) -> Value {
    let (_, rest) = html.split_once("id=\"data\">").expect("data");
    serde_json::from_str(rest.split_once("</script>").expect("an end").0).expect("JSON")
}

/// The numbers of a packed layer, metres, `[T, V]`.
fn unpacked(layer: &Value, frames: usize, vertices: usize) -> Vec<Vec3> {
    let mut bytes = Vec::new();
    let zlib = BASE64_STANDARD.decode(layer["data"].as_str().expect("text")).expect("base64");
    flate2::read::ZlibDecoder::new(zlib.as_slice()).read_to_end(&mut bytes).expect("zlib");
    let (stride, count) = (3 * vertices, 3 * vertices * frames);
    let mut q = vec![0i16; count];
    for i in 0..count {
        let z = u16::from(bytes[i]) | u16::from(bytes[count + i]) << 8;
        let second = (z >> 1) as i16 ^ -((z & 1) as i16);
        q[i] = match i / stride {
            0 => second,
            1 => second.wrapping_add(q[i - stride]),
            _ => second.wrapping_add(q[i - stride].wrapping_mul(2)).wrapping_sub(q[i - 2 * stride]),
        };
    }
    let step = layer["step"].as_f64().expect("a step");
    let at = |t: usize, v: usize| {
        Vec3::from_array(std::array::from_fn(|axis| {
            let centre = layer["centre"][axis].as_f64().expect("a number");
            (f64::from(q[t * stride + axis * vertices + v]) * step + centre) as f32
        }))
    };
    (0..frames).flat_map(|t| (0..vertices).map(move |v| (t, v))).map(|(t, v)| at(t, v)).collect()
}

#[test]
fn a_page_holds_what_went_in_and_offers_what_there_is() {
    let folder = tempfile::tempdir().unwrap();
    let w = world(folder.path());
    let picks = plan(&[20..50, 0..60], 3 * w.body.vertex_count(), true).picks;
    let clip = |i: usize| true_clip(&w.body, &w.truth, &w.scans.scan(&w.clips[i]).unwrap()).unwrap();
    let clips: Vec<ViewClip> = (0..2).map(|i| clip(i).picked(&picks[i])).collect();
    assert_eq!((clips[0].start_s, clips[0].fps), (20.0 / 60.0, 60.0));
    let path = folder.path().join("view.html");
    write(&view(&w, &clips), &path).unwrap();
    let html = std::fs::read_to_string(&path).unwrap();
    for part in
        ["view-scan\"", "view-reference\"", "view-alone\"", "id=\"against\"", "id=\"region\"", "id=\"clip\"", "panes-3"]
    {
        assert!(html.contains(part), "{part}");
    }
    assert!(html.contains("a &lt;set&gt;") && html.ends_with("</html>"));
    assert!(!html.contains("src=\"") && !html.contains("<link rel=\"stylesheet\""), "it loads nothing");
    let data = data(&html);
    assert_eq!(data["reference"], 1);
    assert_eq!(data["layers"][0]["over"], 1);
    assert_eq!(data["clips"][0]["frames"], 30);
    for (i, layer) in clips[0].layers.iter().enumerate() {
        let packed = &data["clips"][0]["layers"][i];
        let back = unpacked(packed, 30, w.body.vertex_count());
        let most = layer.frames.points().iter().zip(&back).map(|(a, b)| a.distance(*b)).fold(0.0, f32::max);
        assert!(f64::from(most) < packed["step"].as_f64().unwrap(), "{}: {most}", layer.key);
    }
    // the same view gives the same bytes
    write(&view(&w, &clips), &folder.path().join("again.html")).unwrap();
    assert_eq!(html, std::fs::read_to_string(folder.path().join("again.html")).unwrap());
}

#[test]
fn a_lone_layer_has_nothing_to_compare() {
    let folder = tempfile::tempdir().unwrap();
    let w = world(folder.path());
    let mut clip = true_clip(&w.body, &w.truth, &w.scans.scan(&w.clips[0]).unwrap()).unwrap();
    clip.layers.retain(|l| l.key == "alone");
    let path = folder.path().join("view.html");
    write(&View { reference: None, ..view(&w, &[clip]) }, &path).unwrap();
    let html = std::fs::read_to_string(&path).unwrap();
    for absent in ["id=\"colour\"", "id=\"gain\"", "id=\"chart-play\"", "id=\"legend-ramp\"", "id=\"clip\""] {
        assert!(!html.contains(absent), "{absent}");
    }
    assert!(html.contains("id=\"play\"") && html.contains("panes-1"));
}

#[test]
fn what_does_not_fit_together_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let w = world(folder.path());
    let clip = true_clip(&w.body, &w.truth, &w.scans.scan(&w.clips[0]).unwrap()).unwrap();
    let says = |view: &View| {
        let path = folder.path().join("refused.html");
        let said = write(view, &path).unwrap_err().to_string();
        assert!(!path.exists(), "{said}");
        said
    };
    assert!(says(&view(&w, &[])).contains("no clip"));
    let mut short = clip.clone();
    short.layers[1].frames = short.layers[1].frames.slice(0..10);
    assert!(says(&view(&w, &[short])).contains("Truth has 10 frames of 122 vertices, expected 60 of 122"));
    let mut other = clip.clone();
    other.layers.pop();
    other.layers.swap(0, 1);
    assert!(says(&view(&w, &[clip.clone(), other])).contains("other layers"));
    let mut hanging = clip.clone();
    hanging.layers[0].over = Some("nothing");
    assert!(says(&view(&w, &[hanging])).contains("not there"));
    let surface = Surface { faces: &[[0, 1, 122]], regions: None };
    assert!(says(&View { surface, ..view(&w, std::slice::from_ref(&clip)) }).contains("vertex 122 of 122"));
    let many = vec![clip; MOST_POINTS / (3 * 60 * 122) + 1];
    assert!(says(&view(&w, &many)).contains("points are more than"));
}
