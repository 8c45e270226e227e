use crate::{Camera, Colour, Picture, bytes_of_colour};
use glam::Vec3;
use rayon::prelude::*;
use softtissue_geometry::vertex_normals;

/// Skin under neutral light, for meshes without colours of their own.
pub const PLAIN: Colour = [0.60, 0.47, 0.40];

/// Shaded triangle meshes to be drawn together.
#[derive(Clone, Debug)]
pub struct Scene {
    meshes: Vec<Surface>,
    /// Behind everything, linear RGB. Default near white.
    pub background: Colour,
    /// Samples along each side of a pixel. Default 2; 1 is four times faster and jagged.
    pub samples: usize,
}

#[derive(Clone, Debug)]
struct Surface {
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
    faces: Vec<[u32; 3]>,
    colours: Vec<Colour>,
}

impl Default for Scene {
    fn default() -> Self {
        Self { meshes: Vec::new(), background: [0.93, 0.94, 0.95], samples: 2 }
    }
}

/// A vertex after projection: pixel coordinates, inverse depth.
#[derive(Clone, Copy)]
struct Projected {
    x: f32,
    y: f32,
    inverse_depth: f32,
}

struct Corner {
    screen: Projected,
    world: Vec3,
    normal: Vec3,
    colour: Vec3,
}

impl Scene {
    /// An empty scene.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a mesh with one colour a vertex. Panics if the counts differ or a face points past the end.
    pub fn add_coloured(&mut self, positions: &[Vec3], faces: &[[u32; 3]], colours: Vec<Colour>) -> &mut Self {
        assert_eq!(colours.len(), positions.len(), "one colour a vertex");
        assert!(faces.iter().flatten().all(|i| (*i as usize) < positions.len()), "faces within the vertices");
        self.meshes.push(Surface {
            normals: vertex_normals(positions, faces),
            positions: positions.to_vec(),
            faces: faces.to_vec(),
            colours,
        });
        self
    }

    /// Adds a mesh of one colour.
    pub fn add(&mut self, positions: &[Vec3], faces: &[[u32; 3]], colour: Colour) -> &mut Self {
        self.add_coloured(positions, faces, vec![colour; positions.len()])
    }

    /// Draws the scene: z-buffer, smooth shading by a key, a fill and a sky light, both sides visible. Triangles that
    /// reach behind the eye are left out.
    pub fn draw(&self, camera: &Camera, width: usize, height: usize) -> Picture {
        let n = self.samples.max(1);
        let (w, h) = (width * n, height * n);
        let mut corners = Vec::new();
        for mesh in &self.meshes {
            self.project(mesh, camera, w, h, &mut corners);
        }
        let light = Lights::new(camera);
        // bands of rows are independent, so that the picture does not depend on the number of threads
        let band_rows = 16 * n;
        let background = Vec3::from_array(self.background);
        let mut linear = vec![background; w * h];
        linear.par_chunks_mut(w * band_rows).enumerate().for_each(|(band, pixels)| {
            let mut depth = vec![0.0f32; pixels.len()];
            let top = band * band_rows;
            for triangle in corners.as_chunks::<3>().0 {
                fill(triangle, &light, w, top, pixels, &mut depth);
            }
        });
        let scale = 1.0 / (n * n) as f32;
        let pixels = (0..width * height)
            .into_par_iter()
            .map(|i| {
                let (x, y) = (i % width * n, i / width * n);
                let sum: Vec3 = (0..n * n).map(|s| linear[(y + s / n) * w + x + s % n]).sum();
                bytes_of_colour((sum * scale).to_array())
            })
            .collect();
        Picture { width, height, pixels }
    }

    fn project(&self, mesh: &Surface, camera: &Camera, w: usize, h: usize, corners: &mut Vec<Corner>) {
        let [right, up, back] = camera.axes();
        let focal = 0.5 * h as f32 / (camera.field_of_view * 0.5).tan();
        let screen: Vec<Option<Projected>> = mesh
            .positions
            .iter()
            .map(|p| {
                let d = *p - camera.eye;
                let q = Vec3::new(right.dot(d), up.dot(d), back.dot(d));
                (q.z < -1e-3 && q.is_finite()).then(|| Projected {
                    x: 0.5 * w as f32 + q.x / -q.z * focal,
                    y: 0.5 * h as f32 - q.y / -q.z * focal,
                    inverse_depth: -1.0 / q.z,
                })
            })
            .collect();
        for f in &mesh.faces {
            let corner = |i: u32| {
                screen[i as usize].map(|screen| Corner {
                    screen,
                    world: mesh.positions[i as usize],
                    normal: mesh.normals[i as usize],
                    colour: Vec3::from_array(mesh.colours[i as usize]),
                })
            };
            if let (Some(a), Some(b), Some(c)) = (corner(f[0]), corner(f[1]), corner(f[2])) {
                corners.extend([a, b, c]);
            }
        }
    }
}

struct Lights {
    eye: Vec3,
    key: Vec3,
    fill: Vec3,
}

impl Lights {
    fn new(camera: &Camera) -> Self {
        let [right, up, back] = camera.axes();
        Self {
            eye: camera.eye,
            key: (back * 0.75 - right * 0.55 + up * 0.75).normalize(),
            fill: (back * 0.5 + right * 0.9 + up * 0.1).normalize(),
        }
    }

    fn shade(&self, world: Vec3, normal: Vec3, colour: Vec3) -> Vec3 {
        let to_eye = (self.eye - world).normalize_or(Vec3::Z);
        let n = normal.normalize_or(to_eye);
        let n = if n.dot(to_eye) < 0.0 { -n } else { n };
        let key = n.dot(self.key).max(0.0);
        let fill = n.dot(self.fill).max(0.0);
        let sky = 0.5 + 0.5 * n.y;
        let half = (self.key + to_eye).normalize_or(to_eye);
        let gloss = 0.06 * n.dot(half).max(0.0).powi(24);
        colour * (0.95 * key + 0.28 * fill + 0.22 * sky + 0.06) + Vec3::splat(gloss)
    }
}

/// Rasterises a triangle into the rows `top..` that `pixels` holds.
fn fill(t: &[Corner; 3], light: &Lights, width: usize, top: usize, pixels: &mut [Vec3], depth: &mut [f32]) {
    let [a, b, c] = [&t[0].screen, &t[1].screen, &t[2].screen];
    let area = (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
    if area == 0.0 || !area.is_finite() {
        return;
    }
    let rows = pixels.len() / width;
    let least = |x: f32, y: f32, z: f32| x.min(y).min(z);
    let most = |x: f32, y: f32, z: f32| x.max(y).max(z);
    let first_y = (least(a.y, b.y, c.y) - 0.5).ceil().max(top as f32);
    let last_y = (most(a.y, b.y, c.y) - 0.5).floor().min((top + rows) as f32 - 1.0);
    let first_x = (least(a.x, b.x, c.x) - 0.5).ceil().max(0.0);
    let last_x = (most(a.x, b.x, c.x) - 0.5).floor().min(width as f32 - 1.0);
    if first_y > last_y || first_x > last_x {
        return;
    }
    for y in first_y as usize..=last_y as usize {
        for x in first_x as usize..=last_x as usize {
            let (px, py) = (x as f32 + 0.5, y as f32 + 0.5);
            let wa = ((b.x - px) * (c.y - py) - (b.y - py) * (c.x - px)) / area;
            let wb = ((c.x - px) * (a.y - py) - (c.y - py) * (a.x - px)) / area;
            let wc = 1.0 - wa - wb;
            if wa < 0.0 || wb < 0.0 || wc < 0.0 {
                continue;
            }
            // perspective-correct weights
            let (wa, wb, wc) = (wa * a.inverse_depth, wb * b.inverse_depth, wc * c.inverse_depth);
            let inverse_depth = wa + wb + wc;
            let at = (y - top) * width + x;
            if inverse_depth <= depth[at] {
                continue;
            }
            depth[at] = inverse_depth;
            let mix = |f: fn(&Corner) -> Vec3| (f(&t[0]) * wa + f(&t[1]) * wb + f(&t[2]) * wc) / inverse_depth;
            pixels[at] = light.shade(mix(|c| c.world), mix(|c| c.normal), mix(|c| c.colour));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    type Triangles = (Vec<Vec3>, Vec<[u32; 3]>);

    fn square(z: f32) -> Triangles {
        let p = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| Vec3::new(x, y, z));
        (p.to_vec(), vec![[0, 1, 2], [0, 2, 3]])
    }

    #[test]
    fn the_nearer_surface_hides_the_farther_whatever_the_order() {
        let camera = Camera::around(Vec3::ZERO, 2.0, 0.0, 0.0);
        let (near, far) = (square(0.5), square(-0.5));
        let draw = |order: [(&Triangles, Colour); 2]| {
            let mut scene = Scene::new();
            for ((p, f), colour) in order {
                scene.add(p, f, colour);
            }
            scene.draw(&camera, 33, 33)
        };
        let (red, blue) = ([0.8, 0.0, 0.0], [0.0, 0.0, 0.8]);
        let one = draw([(&near, red), (&far, blue)]);
        assert_eq!(one, draw([(&far, blue), (&near, red)]));
        let middle = one.pixels[16 * 33 + 16];
        assert!(middle[0] > 120 && middle[2] < 90, "{middle:?}");
        assert_eq!(one.pixels[0], [247, 248, 249]);
    }

    #[test]
    fn left_is_left_and_up_is_up() {
        let camera = Camera::around(Vec3::ZERO, 2.0, 0.0, 0.0);
        let p = vec![Vec3::new(0.5, 0.5, 0.0), Vec3::new(1.0, 0.5, 0.0), Vec3::new(0.75, 1.0, 0.0)];
        let mut scene = Scene::new();
        let picture = scene.add(&p, &[[0, 1, 2]], [0.0; 3]).draw(&camera, 40, 40);
        let dark: Vec<usize> = (0..1600).filter(|i| picture.pixels[*i][0] < 128).collect();
        assert!(!dark.is_empty());
        assert!(dark.iter().all(|i| i % 40 > 20 && i / 40 < 20), "+X is to the right and +Y up when seen from +Z");
    }

    #[test]
    fn png_decodes_to_the_same_pixels() {
        let mut picture = Picture::filled(3, 2, [9, 8, 7]);
        picture.pixels[4] = [1, 2, 3];
        let bytes = picture.to_png().unwrap();
        let mut reader = png::Decoder::new(std::io::Cursor::new(&bytes)).read_info().unwrap();
        let mut out = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut out).unwrap();
        assert_eq!(out, picture.pixels.as_flattened());
    }
}
