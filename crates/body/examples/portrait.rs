//! Draws a body into PNG pictures: `cargo run -p softtissue-body --features procedural --example portrait -- FOLDER
//! [LEVEL|FILE]`: the procedural body of that level, or the body of a file. One picture for each of five BMIs (front, three-quarter, side, back), one of a bent pose and
//! one of the regions; prints the measures of each body.

use glam::Vec3;
use softtissue_body::procedural::{Anatomy, ProceduralBody, ProceduralConfig, generate};
use softtissue_body::{BodyModel, Pose, Region};
use softtissue_render::{Camera, Colour, PLAIN, Picture, Scene};
use std::f32::consts::{FRAC_PI_2, PI};
use std::path::Path;

fn colour_of(region: Region) -> Colour {
    match region {
        Region::Belly => [0.8, 0.3, 0.2],
        Region::Chest => [0.8, 0.5, 0.7],
        Region::Buttocks => [0.3, 0.6, 0.3],
        Region::Thighs => [0.2, 0.4, 0.8],
        Region::UpperArms => [0.9, 0.7, 0.2],
        Region::Calves => [0.3, 0.7, 0.7],
        Region::Head => [0.5, 0.4, 0.3],
        Region::Hands => [0.5, 0.5, 0.9],
        Region::Feet => [0.6, 0.3, 0.6],
        Region::Rest => [0.5, 0.5, 0.5],
    }
}

fn views(model: &BodyModel, positions: &[Vec3], colours: &[Colour], radius: f32) -> Picture {
    let mut scene = Scene::new();
    scene.add_coloured(positions, &model.topology.faces, colours.to_vec());
    let pictures: Vec<Picture> = [0.0, 0.8, FRAC_PI_2, PI]
        .iter()
        .map(|a| scene.draw(&Camera::around(Vec3::new(0.0, 0.86, 0.0), radius, *a, 0.08), 420, 640))
        .collect();
    Picture::row(&pictures)
}

fn save(picture: &Picture, path: &Path) -> Result<(), Box<dyn std::error::Error>> {
    let bytes = picture.to_png()?;
    Ok(softtissue_store::write_atomic(path, |w| w.write_all(&bytes))?)
}

/// Face, hand and foot.
fn details(model: &BodyModel) -> Picture {
    let mut scene = Scene::new();
    let neutral = model.shaped(&[]);
    scene.add(&neutral.vertices, &model.topology.faces, PLAIN);
    let near = |joint: &str, radius: f32, azimuth: f32, elevation: f32| {
        let at = neutral.joints[model.skeleton.index(joint).unwrap_or(0)];
        let up = if joint == "head" { 0.07 } else { -0.01 };
        scene.draw(&Camera::around(at + Vec3::Y * up, radius, azimuth, elevation), 420, 420)
    };
    let details = [
        near("head", 0.17, 0.0, 0.0),
        near("head", 0.17, 0.7, 0.0),
        near("head", 0.17, FRAC_PI_2, 0.0),
        near("left_hand", 0.13, 0.9, 0.1),
        near("left_hand", 0.13, 0.0, 0.1),
        near("left_foot", 0.17, 0.8, 0.4),
    ];
    Picture::row(&details)
}

/// One knee up, arms bent.
fn bent(body: &ProceduralBody) -> Result<Picture, Box<dyn std::error::Error>> {
    let model = &body.model;
    let mut rotations = vec![Vec3::ZERO; model.joint_count()];
    for (joint, rotation) in [
        ("left_hip", [-1.4, 0.0, 0.1]),
        ("left_knee", [1.5, 0.0, 0.0]),
        ("right_hip", [0.4, 0.0, 0.0]),
        ("left_shoulder", [0.0, -0.6, 0.7]),
        ("left_elbow", [0.0, -1.4, 0.0]),
        ("right_shoulder", [0.0, 0.0, 0.5]),
        ("right_elbow", [0.0, 1.0, 0.0]),
        ("spine2", [0.25, 0.2, 0.0]),
        ("head", [0.1, -0.3, 0.0]),
    ] {
        rotations[model.skeleton.index(joint).ok_or("no such joint")?] = Vec3::from_array(rotation);
    }
    let shaped = model.shaped(&body.anatomy.beta_for_bmi(25.0, &[])?);
    let posed = model.posed(&shaped, Pose { rotations: &rotations, translation: Vec3::ZERO }, None);
    Ok(views(model, &posed, &vec![PLAIN; posed.len()], 0.95))
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let folder = arguments.next().ok_or("which folder?")?;
    let which = arguments.next().unwrap_or_else(|| "1".into());
    let folder = Path::new(&folder);
    softtissue_store::create_dir(folder)?;
    let start = std::time::Instant::now();
    let body = match which.parse() {
        Ok(level) => generate(&ProceduralConfig { level, ..Default::default() })?,
        Err(_) => {
            let model = BodyModel::read(Path::new(&which))?;
            ProceduralBody { anatomy: Anatomy::of(&model)?, model }
        }
    };
    let model = &body.model;
    println!("{} vertices in {:.2} s", model.vertex_count(), start.elapsed().as_secs_f64());
    let plain = vec![PLAIN; model.vertex_count()];
    for bmi in [18.0, 19.0, 23.0, 28.0, 33.0] {
        let beta = body.anatomy.beta_for_bmi(bmi, &[])?;
        println!(
            "BMI {bmi}: beta[1] {:.2}, height {:.3} m, mass {:.1} kg, {:?}",
            beta[1],
            body.anatomy.height(&beta),
            body.anatomy.mass(&beta),
            body.anatomy.parameters(&beta)
        );
        save(&views(model, &model.shaped(&beta).vertices, &plain, 0.95), &folder.join(format!("bmi{bmi}.png")))?;
    }
    save(&details(model), &folder.join("details.png"))?;
    let colours: Vec<Colour> = model.regions.0.iter().map(|r| colour_of(*r)).collect();
    save(&views(model, &model.template, &colours, 0.95), &folder.join("regions.png"))?;
    save(&bent(&body)?, &folder.join("bent.png"))?;
    for k in 0..model.shape_count().min(10) {
        let row: Vec<Picture> = [-2.0, 2.0]
            .iter()
            .map(|x| {
                let mut beta = vec![0.0; model.shape_count()];
                beta[k] = *x;
                views(model, &model.shaped(&beta).vertices, &plain, 0.95)
            })
            .collect();
        save(&Picture::column(&row), &folder.join(format!("shape{k}.png")))?;
    }
    Ok(())
}
