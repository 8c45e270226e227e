//! Characters that share a bundle: `cargo run --release -p softtissue-bundle --example crowd -- BUNDLE`.

use glam::Vec3;
use softtissue_body::{Pose, Region};
use softtissue_bundle::{Batch, Bundle, Detail};
use std::{error::Error, path::Path, sync::Arc};

/// Returns the height of each character's highest vertex after two seconds, metres.
pub fn crowd(folder: &Path) -> Result<Vec<f32>, Box<dyn Error>> {
    let bundle = Arc::new(Bundle::read(folder)?);
    let shapes: [&[f32]; 3] = [&[0.0, -2.0], &[0.0, 1.0], &[]];
    let mut batch = Batch::new(Arc::clone(&bundle), &shapes, 2)?; // two threads
    let far = Detail { components: Some(5), still: vec![Region::Head, Region::Hands, Region::Feet] };
    batch.player_mut(2).set_detail(&far)?; // of the third: five components, some regions rigid

    let mut rotations = vec![Vec3::ZERO; bundle.body.joint_count()];
    for frame in 0..120 {
        rotations[0] = Vec3::new(0.0, 0.3 * (frame as f32 * 0.2).sin(), 0.0);
        let pose = |i: usize| Pose { rotations: &rotations, translation: Vec3::new(i as f32, 0.9, 0.0) };
        batch.step(&[pose(0), pose(1), pose(2)])?;
    }
    let highest = |i: usize| batch.vertices(i).iter().map(|v| v.y).fold(f32::MIN, f32::max);
    Ok((0..batch.len()).map(highest).collect())
}

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::args().nth(1).ok_or("name a bundle")?;
    println!("{:?}", crowd(Path::new(&folder))?);
    Ok(())
}
