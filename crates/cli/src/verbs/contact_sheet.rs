//! A contact sheet: frames side by side, shaded, in rows.

use anyhow::Result;
use glam::Vec3;
use softtissue_clips::inspection::Sample;
use softtissue_geometry::{Frames, Topology};
use softtissue_render::{Camera, Colour, PLAIN, Picture, Scene};
use softtissue_store::write_atomic;
use std::path::Path;

/// Frames in a row of an animation.
const SHOWN: usize = 6;
/// The displacement of soft tissue that is fully bright, metres.
pub const FULL_SCALE_M: f32 = 0.04;
/// Where the camera stands: to the front and a little to the side and above, radians.
const AZIMUTH: f32 = 0.5;
const ELEVATION: f32 = 0.08;
/// Points of a cloud that are drawn at most, and their size over the height of the cloud.
const DRAWN: usize = 20_000;
const POINT: f32 = 0.004;

/// One frame to be drawn.
#[derive(Clone, Debug, Default)]
pub struct Tile {
    /// Metres, Y up.
    pub points: Vec<Vec3>,
    /// Triangles.
    pub faces: Vec<[u32; 3]>,
    /// One a vertex, or none for plain skin.
    pub colours: Vec<Colour>,
}

impl Tile {
    /// A mesh, or a cloud of points where there are no triangles.
    pub fn new(points: &[Vec3], faces: &[[u32; 3]]) -> Self {
        if faces.is_empty() {
            return Self::cloud(points);
        }
        Self { points: points.to_vec(), faces: faces.to_vec(), colours: vec![] }
    }

    /// A mesh coloured by how far its vertices are from `from`; `bright`, metres, and more is fully so.
    pub fn displaced(points: &[Vec3], faces: &[[u32; 3]], from: &[Vec3], bright: f32) -> Self {
        let colours = from.iter().zip(points).map(|(a, m)| colour(a.distance(*m) / bright)).collect();
        Self { points: points.to_vec(), faces: faces.to_vec(), colours }
    }

    /// Frames of a clip as a row.
    pub fn row(samples: &[Sample]) -> Vec<Self> {
        samples.iter().map(|s| Self::new(&s.points, &s.faces)).collect()
    }

    /// Every point as a small tetrahedron.
    fn cloud(points: &[Vec3]) -> Self {
        let (low, high) = bounds(points);
        let size = POINT * (high - low).max_element();
        let corners = [Vec3::ONE, Vec3::new(1.0, -1.0, -1.0), Vec3::new(-1.0, 1.0, -1.0), Vec3::new(-1.0, -1.0, 1.0)];
        let mut tile = Self::default();
        for p in points.iter().step_by(points.len().div_ceil(DRAWN).max(1)) {
            let first = tile.points.len() as u32;
            tile.points.extend(corners.map(|c| *p + c * size));
            let faces = [[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]];
            tile.faces.extend(faces.map(|f: [u32; 3]| f.map(|i| first + i)));
        }
        tile
    }

    fn draw(&self, camera: &Camera, (width, height): (usize, usize)) -> Picture {
        let mut scene = Scene::new();
        if self.colours.is_empty() {
            scene.add(&self.points, &self.faces, PLAIN);
        } else {
            scene.add_coloured(&self.points, &self.faces, self.colours.clone());
        }
        scene.draw(camera, width, height)
    }
}

/// Rows of frames.
#[derive(Clone, Debug, Default)]
pub struct ContactSheet {
    /// Tiles from the left, rows from the top; short rows end in empty tiles.
    pub rows: Vec<Vec<Tile>>,
    /// Pixels of a tile, across and down.
    pub tile: (usize, usize),
    /// Whether every tile has its frame in the middle, all at one scale; otherwise one camera sees all.
    pub centred: bool,
}

impl ContactSheet {
    /// Some frames of an animation `[T, V]`, metres: the body alone above, the soft tissue coloured by displacement
    /// below.
    pub fn of_animation(topology: &Topology, alone: &Frames, moved: &Frames) -> Self {
        let shown = SHOWN.min(moved.len());
        // The A-pose at the start tells little; the rest is shown evenly.
        let first = moved.len() / 4;
        let frames: Vec<usize> = (0..shown).map(|i| first + i * (moved.len() - first) / shown).collect();
        let plain = frames.iter().map(|t| Tile::new(alone.frame(*t), &topology.faces)).collect();
        let tile = |t: &usize| Tile::displaced(moved.frame(*t), &topology.faces, alone.frame(*t), FULL_SCALE_M);
        let coloured = frames.iter().map(tile).collect();
        Self { rows: vec![plain, coloured], tile: (240, 400), centred: false }
    }

    /// Writes the sheet as PNG.
    pub fn write(&self, path: &Path) -> Result<()> {
        let png = self.draw().to_png()?;
        Ok(write_atomic(path, |w| w.write_all(&png))?)
    }

    fn draw(&self) -> Picture {
        let all: Vec<Vec3> = self.rows.iter().flatten().flat_map(|t| t.points.iter().copied()).collect();
        let shared = Camera::framing(&all, AZIMUTH, ELEVATION);
        let half = |tile: &Tile| {
            let (low, high) = bounds(&tile.points);
            0.48 * (high - low).length()
        };
        let radius = self.rows.iter().flatten().map(half).fold(0.0, f32::max).max(1e-3);
        let columns = self.rows.iter().map(Vec::len).max().unwrap_or(0);
        let empty = Tile::default();
        let row = |tiles: &Vec<Tile>| {
            let draw = |i: usize| {
                let tile = tiles.get(i).unwrap_or(&empty);
                let (low, high) = bounds(&tile.points);
                let own = Camera::around(0.5 * (low + high), radius, AZIMUTH, ELEVATION);
                tile.draw(if self.centred { &own } else { &shared }, self.tile)
            };
            Picture::row(&(0..columns).map(draw).collect::<Vec<_>>())
        };
        Picture::column(&self.rows.iter().map(row).collect::<Vec<_>>())
    }
}

/// Lowest and highest corner of the finite points; the origin where there is none.
fn bounds(points: &[Vec3]) -> (Vec3, Vec3) {
    let start = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    let (low, high) = points.iter().filter(|p| p.is_finite()).fold(start, |(l, h), p| (l.min(*p), h.max(*p)));
    if low.x > high.x { (Vec3::ZERO, Vec3::ZERO) } else { (low, high) }
}

/// From skin over yellow to red, linear RGB; 1 and more is red.
fn colour(x: f32) -> Colour {
    const STOPS: [Colour; 3] = [PLAIN, [0.9, 0.55, 0.1], [0.55, 0.03, 0.02]];
    let x = x.clamp(0.0, 1.0) * 2.0;
    let (from, to) = (STOPS[x as usize], STOPS[(x as usize + 1).min(2)]);
    std::array::from_fn(|i| from[i] + (to[i] - from[i]) * x.fract())
}
