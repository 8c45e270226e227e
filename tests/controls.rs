//! What an animator changes of an animation.

use crate::support::{Said, folder, softtissue, tiny_run, tiny_scans};
use std::fmt::Write;
use std::path::Path;

fn animate(out: &Path, more: &[&str]) -> Said {
    let bundle = tiny_run().path.join("bundle").display().to_string();
    let out = out.display().to_string();
    let always = ["animate", "--bundle", &bundle, "--motion", "synth:one_leg_jump", "--frames", "40", "--out", &out];
    softtissue(&[&always[..], more].concat())
}

/// Vertices of the last frame.
fn last(out: &Path) -> Vec<[f32; 3]> {
    let text = std::fs::read_to_string(out.join("frame_00039.obj")).expect("a frame");
    let vertices = text.lines().filter_map(|l| l.strip_prefix("v "));
    let numbers = |l: &str| l.split_whitespace().map(|x| x.parse().expect("a number")).collect::<Vec<f32>>();
    vertices.map(|l| numbers(l).try_into().expect("three numbers")).collect()
}

/// How far each vertex is from where it would be without flesh.
fn moved(a: &[[f32; 3]], b: &[[f32; 3]]) -> Vec<f32> {
    let distance = |(a, b): (&[f32; 3], &[f32; 3])| (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f32>().sqrt();
    a.iter().zip(b).map(distance).collect()
}

/// The vertices as an OBJ file, brighter from left to right or all of one colour.
fn painted(path: &Path, vertices: &[[f32; 3]], brightness: impl Fn(&[f32; 3]) -> f32) {
    let mut text = String::new();
    for v in vertices {
        let c = brightness(v);
        writeln!(text, "v {} {} {} {c} {c} {c}", v[0], v[1], v[2]).expect("text");
    }
    std::fs::write(path, text).expect("a file");
}

#[test]
fn flesh_is_controlled_by_region_by_paint_and_shown_on_other_bodies() {
    let home = folder("controlled");
    let play = |name: &str, more: &[&str]| {
        animate(&home.join(name), more).fine();
        last(&home.join(name))
    };
    let heavy = ["--shape", "0,-2"];
    let still = play("still", &[&heavy[..], &["--gain", "0"]].concat());
    let soft = moved(&play("soft", &heavy), &still);
    let sum = |x: &[f32]| x.iter().sum::<f32>();
    assert!(sum(&soft) > 0.1, "{}", sum(&soft));
    let loud = moved(&play("loud", &[&heavy[..], &["--control", "everywhere:gain=2"]].concat()), &still);
    assert!((sum(&loud) / sum(&soft) - 2.0).abs() < 1e-2);
    let one = moved(&play("belly", &[&heavy[..], &["--control", "belly:gain=0,lag=0.1"]].concat()), &still);
    let share = sum(&one) / sum(&soft);
    assert!(share > 0.2 && share < 0.95, "{share}");
    let softer = play("softer", &[&heavy[..], &["--control", "everywhere:softness=2,damping=0.5"]].concat());
    assert!(sum(&moved(&softer, &still)) > 0.01);

    let paint = home.join("paint.obj");
    painted(&paint, &still, |v| if v[0] > 0.0 { 1.0 } else { 0.0 });
    let paint_text = paint.display().to_string();
    let half = moved(&play("painted", &[&heavy[..], &["--paint", &paint_text]].concat()), &still);
    for ((v, half), soft) in still.iter().zip(&half).zip(&soft) {
        let wanted = if v[0] > 0.0 { *soft } else { 0.0 };
        assert!((half - wanted).abs() < 1e-4, "{half} {wanted}");
    }

    // heavy flesh on a light body moves more than that body's own
    let light = ["--shape", "0,1"];
    let light_still = play("light-still", &[&light[..], &["--gain", "0"]].concat());
    let light_own = sum(&moved(&play("light", &light), &light_still));
    let lent = sum(&moved(&play("lent", &[&light[..], &["--flesh", "0,-2"]].concat()), &light_still));
    assert!(lent > 1.2 * light_own, "{lent} {light_own}");
    // a mesh of our topology in the place of the body's rest mesh keeps its form and gets the flesh's motion
    let mesh = home.join("mesh.obj");
    let tall: Vec<[f32; 3]> = light_still.iter().map(|[x, y, z]| [*x, 1.3 * y, *z]).collect();
    painted(&mesh, &tall, |_| 0.5);
    let mesh = ["--mesh", &mesh.display().to_string()];
    let stylised_still = play("stylised-still", &[&mesh[..], &["--gain", "0"]].concat());
    let height = |v: &[[f32; 3]]| v.iter().map(|v| v[1]).fold(0.0, f32::max);
    assert!(height(&stylised_still) > 1.15 * height(&still), "{}", height(&stylised_still));
    let stylised = moved(&play("stylised", &mesh), &stylised_still);
    assert!(sum(&stylised) > 0.1, "{}", sum(&stylised));
}

#[test]
fn controls_that_cannot_be_are_refused_in_a_sentence() {
    let home = folder("uncontrolled");
    let out = home.join("a.glb");
    let mesh = home.join("mesh.obj");
    std::fs::write(&mesh, "v 0 0 0 2 0 0\nv 1 0 0 0 0 0\nv 0 1 0 0 0 0\nf 1 2 3\n").expect("a file");
    let mesh = mesh.display().to_string();
    for (code, more, words) in [
        (2, ["--control", "bely:gain=2"], ["bely", "belly"]),
        (2, ["--control", "belly"], ["colon", "belly:gain=2"]),
        (2, ["--control", "belly:gian=2"], ["gian", "softness"]),
        (2, ["--control", "belly:gain=much"], ["much", "number"]),
        (2, ["--control", "belly:gain=1000"], ["gain", "100"]),
        (2, ["--gain", "1000"], ["gain", "100"]),
        (2, ["--gain", "nan"], ["gain", "100"]),
        (2, ["--control", "everywhere:lag=9"], ["lag", "0.5"]),
        (2, ["--flesh", "0,99"], ["--flesh", "-10"]),
        (3, ["--mesh", &mesh], ["mesh.obj", "3 vertices"]),
        (3, ["--paint", &mesh], ["mesh.obj", "3 vertices"]),
        (3, ["--paint", "nowhere.obj"], ["nowhere.obj", "exist"]),
    ] {
        animate(&out, &more).refused(code, &words);
        assert!(!out.exists());
    }
}

#[test]
fn flesh_is_tuned_to_a_clip_and_played_so() {
    let home = folder("tuned");
    let (bundle, scans) = (tiny_run().path.join("bundle").display().to_string(), tiny_scans().display().to_string());
    let file = home.join("person.txt");
    let out = file.display().to_string();
    let tune = |more: &[&str]| softtissue(&[&["tune", &bundle, "--scans", &scans, "--out", &out], more].concat());
    tune(&["--clip", "s01/jumping_jacks.0"]).fine();
    let text = std::fs::read_to_string(&file).expect("controls");
    for region in ["belly:", "chest:", "buttocks:", "thighs:", "upper-arms:"] {
        assert_eq!(text.lines().filter(|l| l.starts_with(region)).count(), 1, "{text}");
    }
    // The file is worth what its lines say.
    let lines = text.lines().filter(|l| !l.starts_with('#'));
    let typed: Vec<&str> = lines.flat_map(|l| ["--control", l]).collect();
    animate(&home.join("typed"), &typed).fine();
    animate(&home.join("kept"), &["--controls", &out]).fine();
    assert_eq!(last(&home.join("typed")), last(&home.join("kept")));

    tune(&[]).refused(2, &["--clip", "s00/jumping_jacks.0"]);
    tune(&["--clip", "s01/juggling.0"]).refused(3, &["juggling", "s00/jumping_jacks.0"]);
    std::fs::write(&file, "belly:gain=1\nbelly:colour=2\n").expect("a file");
    animate(&home.join("bad"), &["--controls", &out]).refused(2, &["person.txt line 2", "colour"]);
}
