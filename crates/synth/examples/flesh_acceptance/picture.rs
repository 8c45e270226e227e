//! A picture of the flesh in mid-jump.

use crate::Settings;
use crate::people::{FIRST_FRAME, Person};
use softtissue_body::Pose;
use softtissue_render::{Camera, Picture, Scene, colours_of_magnitudes};

/// Draws the frames of jumping jacks with the largest mean displacement up and down, coloured by its length up to
/// 40 mm, from the front and the side.
pub fn mid_jump(person: &Person, settings: &Settings, path: &str) {
    let clip = person.motion("jumping_jacks", settings.frames);
    let run = person.simulate(&settings.material, &settings.config, &clip);
    let height = |t: usize| run.deltas.frame(t).iter().map(|d| f64::from(d.y)).sum::<f64>();
    let frames = FIRST_FRAME..clip.len();
    let highest = frames.clone().max_by(|a, b| height(*a).total_cmp(&height(*b))).expect("frames after 0.9 s");
    let lowest = frames.min_by(|a, b| height(*a).total_cmp(&height(*b))).expect("frames after 0.9 s");
    let mut pictures = Vec::new();
    for t in [highest, lowest] {
        let deltas = run.deltas.frame(t);
        let pose = Pose { rotations: clip.rotations.frame(t), translation: clip.translations[t] };
        let model = &person.body.model;
        let posed = model.posed(&person.shaped, pose, Some(deltas));
        let lengths: Vec<f32> = deltas.iter().map(|d| d.length()).collect();
        let mut scene = Scene::new();
        scene.add_coloured(&posed, &model.topology.faces, colours_of_magnitudes(&lengths, 0.04));
        for azimuth in [0.3, 1.5] {
            pictures.push(scene.draw(&Camera::framing(&posed, azimuth, 0.1), 420, 640));
        }
    }
    let file = std::fs::File::create(path).expect("a place to write");
    Picture::row(&pictures).write_png(file).expect("a picture");
    println!("wrote {path}: frames {highest} and {lowest}");
}
