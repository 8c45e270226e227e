//! Draws shaded meshes into PNG pictures without a window: a small z-buffer rasteriser for the README's picture,
//! the report's thumbnails and `inspect`.
//!
//! ```
//! use glam::Vec3;
//! use softtissue_render::{Camera, PLAIN, Scene};
//! let positions = [Vec3::ZERO, Vec3::X, Vec3::Y];
//! let mut scene = Scene::new();
//! scene.add(&positions, &[[0, 1, 2]], PLAIN);
//! let png = scene.draw(&Camera::framing(&positions, 0.3, 0.1), 64, 64).to_png().unwrap();
//! assert_eq!(&png[1..4], b"PNG");
//! ```
//!
//! This room knows meshes and colours only, nothing of bodies or clips.

mod camera;
mod colour;
mod picture;
mod scene;

pub use camera::Camera;
pub use colour::{Colour, bytes_of_colour, colour_of_magnitude, colours_of_magnitudes};
pub use picture::{Picture, PictureError};
pub use scene::{PLAIN, Scene};
