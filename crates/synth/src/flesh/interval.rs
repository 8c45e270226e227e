use super::assembly::{Chunk, DESIGN_ALTITUDE};
use super::contact::Candidate;
use super::kernel::ChunkState;
use super::number::{LANES, Lanes, Matrix};
use super::simulator::Simulator;
use super::targets::{Target, angular_velocity, nearest_rotation};
use glam::{Mat3, Vec3};

/// Relative volume of the skinned element under which its reference blends to the rotated rest shape.
const CRUSHED: f32 = 0.4;

/// What is constant between two frames.
pub struct Interval {
    /// Per chunk of elements.
    pub chunks: Vec<ChunkState>,
    /// Nodes near limbs.
    pub contacts: Vec<Candidate>,
    /// Gravity that the rest shape does not already carry, `[free]`, m/s^2.
    pub gravity: Vec<Vec3>,
    /// Angular velocity of the skinned body, `[free]`, rad/s.
    pub turning: Vec<Vec3>,
}

impl Interval {
    /// From the two frames in the middle of `window`.
    pub fn new(simulator: &Simulator, window: &[Target; 4], fps: f32) -> Self {
        let (from, to) = (&window[1], &window[2]);
        let assembly = &simulator.assembly;
        let g = Vec3::new(0.0, -simulator.config.gravity, 0.0);
        let per_node = |f: &dyn Fn(usize) -> Vec3| -> Vec<Vec3> {
            assembly.nodes[..assembly.free].iter().map(|n| f(n.vertex as usize)).collect()
        };
        Self {
            chunks: assembly.chunks.iter().map(|chunk| chunk_state(chunk, simulator, from, to)).collect(),
            contacts: simulator.limbs.candidates(assembly, from, to),
            gravity: per_node(&|v| g - (from.rotations[v] * g + to.rotations[v] * g) * 0.5),
            turning: per_node(&|v| angular_velocity(from.rotations[v], to.rotations[v], 1.0 / fps)),
        }
    }
}

/// Softening by the posed altitude and, where skinning crushes an element, the way from its edge matrix to that
/// of the turned rest shape.
fn chunk_state(chunk: &Chunk, simulator: &Simulator, from: &Target, to: &Target) -> ChunkState {
    let assembly = &simulator.assembly;
    let mut softening = [1.0f32; LANES];
    let mut correction: Option<Box<[Matrix<Lanes>; 2]>> = None;
    for lane in 0..LANES {
        let nodes = [0, 1, 2, 3].map(|k| chunk.nodes[k][lane] as usize);
        let rest =
            Mat3::from_cols_array_2d(&std::array::from_fn(|c| std::array::from_fn(|r| chunk.rest[r][c].0[lane])));
        let corrections = [from, to].map(|target| {
            let [a, b, c, d] = nodes.map(|n| Vec3::from_slice(&target.nodes[n][..3]));
            let posed = Mat3::from_cols(b - a, c - a, d - a);
            let part = (posed.determinant() / rest.determinant() / CRUSHED).clamp(0.0, 1.0);
            let reference = if part < 1.0 {
                let vertices = nodes.map(|n| assembly.nodes[n].vertex as usize);
                let mean = vertices.iter().fold(Mat3::ZERO, |m, &v| m + target.rotations[v]) * 0.25;
                let turned = nearest_rotation(mean).unwrap_or(target.rotations[vertices[0]]) * rest;
                posed * part + turned * (1.0 - part)
            } else {
                posed
            };
            softening[lane] = softening[lane].min((altitude(reference) / DESIGN_ALTITUDE).powi(2));
            (part < 1.0).then_some(reference - posed)
        });
        if corrections.iter().any(Option::is_some) {
            let zero = Lanes([0.0; LANES]);
            let c = correction.get_or_insert_with(|| Box::new([[[zero; 3]; 3]; 2]));
            let [start, end] = corrections.map(|c| c.unwrap_or(Mat3::ZERO));
            for r in 0..3 {
                for k in 0..3 {
                    c[0][r][k].0[lane] = start.col(k)[r];
                    c[1][r][k].0[lane] = end.col(k)[r] - start.col(k)[r];
                }
            }
        }
    }
    ChunkState { softening: Lanes(softening), correction }
}

/// Smallest altitude of the tetrahedron with these edge vectors.
fn altitude(m: Mat3) -> f32 {
    let [a, b, c] = [m.x_axis, m.y_axis, m.z_axis];
    let largest =
        a.cross(b).length().max(b.cross(c).length()).max(c.cross(a).length()).max((b - a).cross(c - a).length());
    m.determinant().abs() / largest.max(1e-12)
}
