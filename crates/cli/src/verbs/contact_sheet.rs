//! A picture of an animation: some of its frames, the body alone above, the soft tissue coloured by displacement below.

use anyhow::Result;
use glam::Vec3;
use softtissue_geometry::{Frames, Topology};
use softtissue_render::{Camera, Colour, PLAIN, Picture, Scene};
use softtissue_store::write_atomic;
use std::path::Path;

/// Frames shown, pixels of one of them, and the displacement that is fully bright, metres.
const SHOWN: usize = 6;
const SIZE: (usize, usize) = (240, 400);
const FULL_SCALE_M: f32 = 0.04;
/// Where the camera stands: to the front and a little to the side and above, radians.
const AZIMUTH: f32 = 0.5;
const ELEVATION: f32 = 0.08;

/// Draws the sheet of posed vertices `[T, V]`: the body alone and with deltas. Metres.
pub fn write(path: &Path, topology: &Topology, alone: &Frames, moved: &Frames) -> Result<()> {
    let shown = SHOWN.min(moved.len());
    // The A-pose at the start tells little; the rest is shown evenly.
    let first = moved.len() / 4;
    let frame = |i: usize| first + i * (moved.len() - first) / shown;
    let all: Vec<Vec3> = (0..shown).flat_map(|i| moved.frame(frame(i)).to_vec()).collect();
    let camera = Camera::framing(&all, AZIMUTH, ELEVATION);
    let (width, height) = SIZE;
    let row = |paint: &dyn Fn(usize) -> Picture| Picture::row(&(0..shown).map(paint).collect::<Vec<_>>());
    let plain = row(&|i| {
        let mut scene = Scene::new();
        scene.add(alone.frame(frame(i)), &topology.faces, PLAIN);
        scene.draw(&camera, width, height)
    });
    let coloured = row(&|i| {
        let (a, m) = (alone.frame(frame(i)), moved.frame(frame(i)));
        let colours = a.iter().zip(m).map(|(a, m)| colour(a.distance(*m) / FULL_SCALE_M)).collect();
        let mut scene = Scene::new();
        scene.add_coloured(m, &topology.faces, colours);
        scene.draw(&camera, width, height)
    });
    let png = Picture::column(&[plain, coloured]).to_png()?;
    Ok(write_atomic(path, |w| w.write_all(&png))?)
}

/// From skin over yellow to red, linear RGB; 1 and more is red.
fn colour(x: f32) -> Colour {
    const STOPS: [Colour; 3] = [PLAIN, [0.9, 0.55, 0.1], [0.55, 0.03, 0.02]];
    let x = x.clamp(0.0, 1.0) * 2.0;
    let (from, to) = (STOPS[x as usize], STOPS[(x as usize + 1).min(2)]);
    std::array::from_fn(|i| from[i] + (to[i] - from[i]) * x.fract())
}
