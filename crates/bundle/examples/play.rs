//! A body that swings its hips, frame by frame: `cargo run --release -p softtissue-bundle --example play -- BUNDLE`.

use glam::Vec3;
use softtissue_body::Pose;
use softtissue_bundle::{Bundle, Controls, Fade, Player};
use std::{error::Error, path::Path, sync::Arc};

/// Returns the largest displacement of the last frame, metres.
pub fn play(folder: &Path) -> Result<f32, Box<dyn Error>> {
    let bundle = Arc::new(Bundle::read(folder)?); // shared by as many players as there are characters
    let mut player = Player::new(Arc::clone(&bundle), &[0.0, -2.0])?; // shape; beta[1] below zero is heavier
    player.set_controls(&Controls::gain(1.2))?;
    player.set_fade(Some(Fade::default()))?; // no soft tissue where the motion is unlike all that the bundle knows

    let mut rotations = vec![Vec3::ZERO; bundle.body.joint_count()]; // axis times angle, radians, in the parent's frame
    let standing = Pose { rotations: &rotations, translation: Vec3::new(0.0, 0.9, 0.0) };
    player.pre_roll(standing, 3.0); // as if it had stood so for three seconds
    for frame in 0..120 {
        let swing = (frame as f32 * 0.2).sin();
        rotations[0] = Vec3::new(0.0, 0.3 * swing, 0.2 * swing);
        let pose = Pose { rotations: &rotations, translation: Vec3::new(0.05 * swing, 0.9, 0.0) };
        let report = player.advance(pose, 1.0 / 60.0); // any time step; nothing is allocated, nothing is ever not finite
        assert!(!report.restarted && (0.0..=1.0).contains(&report.trust));
        let _to_draw: &[Vec3] = player.vertices(); // posed, with soft tissue, metres
    }
    Ok(player.deltas().iter().map(|d| d.length()).fold(0.0, f32::max))
}

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::args().nth(1).ok_or("name a bundle")?;
    println!("{:.1} mm", 1e3 * play(Path::new(&folder))?);
    Ok(())
}
