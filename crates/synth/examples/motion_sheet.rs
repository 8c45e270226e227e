//! Draws motions as a contact sheet: one row a motion, frames from left to right, from the front and from the side.
//!
//! `cargo run -p softtissue-synth --example motion_sheet -- sheet.png [bmi] [motion ...]`
use glam::Vec3;
use softtissue_body::Pose;
use softtissue_body::procedural::{ProceduralBody, ProceduralConfig, generate};
use softtissue_render::{Camera, Picture, Scene};
use softtissue_synth::motion::{Figure, MOTIONS, Request, Style, ground_reaction, landing_peaks, perform};
use std::error::Error;

/// Frames drawn of each motion.
const FRAMES: [usize; 9] = [0, 50, 64, 72, 80, 88, 96, 104, 112];

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let path = arguments.first().ok_or("name the picture to write")?;
    let bmi: f64 = arguments.get(1).map_or(Ok(23.0), |b| b.parse())?;
    let named: Vec<&str> = arguments.iter().skip(2).map(String::as_str).collect();
    let motions = if named.is_empty() { MOTIONS.to_vec() } else { named };
    let body = generate(&ProceduralConfig { level: 0, ..Default::default() })?;
    let rows = motions.iter().map(|motion| row(&body, motion, bmi)).collect::<Result<Vec<_>, _>>()?;
    std::fs::write(path, Picture::column(&rows).to_png()?)?;
    println!("{path}");
    Ok(())
}

fn row(body: &ProceduralBody, motion: &str, bmi: f64) -> Result<Picture, Box<dyn Error>> {
    let beta = body.anatomy.beta_for_bmi(bmi, &[])?;
    let shaped = body.model.shaped(&beta);
    let figure = Figure::new(&shaped)?;
    let frames = if motion.ends_with("_then_stand") { 270 } else { 150 };
    let request = Request { subject: "sheet", motion, take: 0, frames, fps: 60.0, seed: 1 };
    let performance = perform(&request, &figure, &Style::neutral())?;
    let reaction = ground_reaction(&figure, &performance.clip);
    let peaks: Vec<String> = landing_peaks(&reaction, 60.0).iter().map(|p| format!("{p:.2}")).collect();
    println!("{motion}: landings {} body weights", if peaks.is_empty() { "none".into() } else { peaks.join(" ") });
    let floor =
        [Vec3::new(-1.0, 0.0, -1.0), Vec3::new(-1.0, 0.0, 1.0), Vec3::new(1.0, 0.0, 1.0), Vec3::new(1.0, 0.0, -1.0)];
    let mut pictures = Vec::new();
    for t in FRAMES {
        let clip = &performance.clip;
        let pose = Pose { rotations: clip.rotations.frame(t), translation: clip.translations[t] };
        let posed = body.model.posed(&shaped, pose, None);
        let mut scene = Scene::new();
        scene.add(&floor, &[[0, 1, 2], [0, 2, 3]], [0.7, 0.72, 0.74]);
        scene.add(&posed, &body.model.topology.faces, softtissue_render::PLAIN);
        for azimuth in [0.25, 1.35] {
            pictures.push(scene.draw(&Camera::around(Vec3::new(0.0, 0.95, 0.05), 1.15, azimuth, 0.06), 120, 170));
        }
    }
    Ok(Picture::row(&pictures))
}
