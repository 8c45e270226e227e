use super::assembly::Assembly;
use super::interval::Interval;
use super::kernel::{NodeState, add_element_forces, add_spring_forces};
use super::law::Law;
use super::simulator::Simulator;
use super::targets::{Target, catmull_rom, catmull_rom_rate};
use glam::{Mat3, Vec3, Vec3A};
use softtissue_geometry::signed_volume;

/// How a simulation went.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Statistics {
    /// Elements times steps.
    pub element_steps: u64,
    /// How many of them were inside out in the world.
    pub inverted_element_steps: u64,
    /// Elements under the skin that were inside out at the end of a frame, over all frames.
    pub inverted_surface_at_frame_end: u64,
    /// Smallest and largest enclosed volume at a frame's end over that of the skinned body.
    pub volume_ratio: [f64; 2],
    /// Greatest speed of a node relative to the skinned body, m/s.
    pub max_speed: f32,
    /// Node steps whose speed was capped.
    pub capped_node_steps: u64,
}

/// Greatest speed relative to the skinned body, m/s; only a fault is faster.
const SPEED_CAP: f32 = 4.0;
/// Smallest determinant of a skinning matrix through which displacements are taken to the rest frame.
const SMALLEST_DETERMINANT: f32 = 0.1;

/// The moving part of a simulation: displacements and velocities.
pub struct State {
    nodes: Vec<NodeState>,
    /// World velocity of the free nodes, m/s.
    velocity: Vec<Vec3A>,
    forces: Vec<[f32; 4]>,
    next: Vec<[f32; 4]>,
    /// What happened so far.
    pub statistics: Statistics,
}

impl State {
    /// At rest in the first frame, moving with the skinned body.
    pub fn new(simulator: &Simulator, window: &[Target; 4], fps: f32) -> Self {
        let assembly = &simulator.assembly;
        let count = assembly.nodes.len();
        let rates = catmull_rom_rate(0.0).map(|r| r * fps);
        let nodes = window[1].nodes.iter().map(|x| NodeState { x: *x, ..NodeState::default() }).collect();
        let velocity = (0..assembly.free).map(|n| blend(window, &rates, n)).collect();
        let statistics = Statistics { volume_ratio: [1.0, 1.0], ..Statistics::default() };
        Self { nodes, velocity, forces: vec![[0.0; 4]; count], next: vec![[0.0; 4]; count], statistics }
    }

    /// One step of symplectic Euler: step `step` of `steps` in the interval.
    pub fn step<L: Law>(
        &mut self,
        simulator: &Simulator,
        window: &[Target; 4],
        interval: &Interval,
        step: usize,
        steps: usize,
        dt: f32,
    ) {
        let assembly = &simulator.assembly;
        let s = step as f32 / steps as f32;
        self.forces.fill([0.0; 4]);
        for (chunk, state) in assembly.chunks.iter().zip(&interval.chunks) {
            let six_volume = add_element_forces::<L>(chunk, state, s, &self.nodes, &mut self.forces);
            let inverted = six_volume.0[..chunk.count].iter().filter(|x| **x <= 0.0).count();
            self.statistics.inverted_element_steps += inverted as u64;
        }
        self.statistics.element_steps += assembly.element_count() as u64;
        for chunk in &assembly.springs {
            add_spring_forces(chunk, &self.nodes, &mut self.forces);
        }
        for contact in &interval.contacts {
            let n = contact.node as usize;
            let a = contact.acceleration(vec3(self.nodes[n].x), vec3(self.nodes[n].u), s) * assembly.mass[n];
            (0..3).for_each(|r| self.forces[n][r] += a[r]);
        }
        self.integrate(assembly, window, interval, (step + 1) as f32 / steps as f32, dt, steps);
    }

    fn integrate(
        &mut self,
        assembly: &Assembly,
        window: &[Target; 4],
        interval: &Interval,
        s: f32,
        dt: f32,
        steps: usize,
    ) {
        let weights = catmull_rom(s);
        let rates = catmull_rom_rate(s).map(|r| r / (steps as f32 * dt));
        let [p, q, r, t] = [0, 1, 2, 3].map(|k| &window[k].nodes);
        for (n, x) in self.next.iter_mut().enumerate() {
            for k in 0..4 {
                x[k] = weights[0] * p[n][k] + weights[1] * q[n][k] + weights[2] * r[n][k] + weights[3] * t[n][k];
            }
        }
        for n in 0..assembly.free {
            let node = &mut self.nodes[n];
            let (u, w) = (Vec3A::from_slice(&node.u), Vec3A::from_slice(&node.w));
            let force = Vec3A::from_slice(&self.forces[n]);
            let acceleration = force / assembly.mass[n] + Vec3A::from(interval.gravity[n]) - w * assembly.drag;
            let target_velocity = blend(window, &rates, n);
            let mut relative = self.velocity[n] + acceleration * dt - target_velocity;
            let speed = relative.length();
            if speed > SPEED_CAP {
                relative *= SPEED_CAP / speed;
                self.statistics.capped_node_steps += 1;
            }
            self.statistics.max_speed = self.statistics.max_speed.max(speed);
            self.velocity[n] = target_velocity + relative;
            let moved = Vec3A::from_slice(&self.next[n]) - Vec3A::from_slice(&node.x);
            let u = u + self.velocity[n] * dt - moved;
            let w = relative - Vec3A::from(interval.turning[n]).cross(u);
            node.u = u.extend(0.0).to_array();
            node.w = w.extend(0.0).to_array();
        }
        for (node, x) in self.nodes.iter_mut().zip(&self.next) {
            node.x = *x;
        }
    }

    /// Displacement of every skin vertex in the rest frame, `[V]`.
    pub fn deltas(&self, simulator: &Simulator, target: &Target) -> Vec<Vec3> {
        let displaced = self.displacements(simulator);
        displaced.iter().zip(&target.linear).zip(&target.rotations).map(|((u, m), r)| unpose(*u, *m, *r)).collect()
    }

    fn displacements(&self, simulator: &Simulator) -> Vec<Vec3> {
        simulator.assembly.skin_node.iter().map(|n| n.map_or(Vec3::ZERO, |n| vec3(self.nodes[n as usize].u))).collect()
    }

    /// Takes the figures that are defined at a frame's end.
    pub fn end_frame(&mut self, simulator: &Simulator, target: &Target) {
        for chunk in &simulator.assembly.chunks {
            for lane in (0..chunk.count).filter(|&lane| chunk.surface[lane]) {
                let [a, b, c, d] = [0, 1, 2, 3].map(|k| {
                    let node = &self.nodes[chunk.nodes[k][lane] as usize];
                    vec3(node.x) + vec3(node.u)
                });
                if Mat3::from_cols(b - a, c - a, d - a).determinant() <= 0.0 {
                    self.statistics.inverted_surface_at_frame_end += 1;
                }
            }
        }
        let faces = &simulator.body.topology.faces;
        let moved: Vec<Vec3> = target.skin.iter().zip(self.displacements(simulator)).map(|(x, u)| *x + u).collect();
        let ratio = signed_volume(&moved, faces) / signed_volume(&target.skin, faces);
        let [low, high] = self.statistics.volume_ratio;
        self.statistics.volume_ratio = [low.min(ratio), high.max(ratio)];
    }

    /// Whether every free node is finite.
    pub fn is_finite(&self) -> bool {
        self.nodes.iter().all(|n| vec3(n.u).is_finite()) && self.velocity.iter().all(|v| v.is_finite())
    }
}

/// Through the inverse of the skinning matrix, or of its rotation where the matrix is near singular.
fn unpose(u: Vec3, linear: Mat3, rotation: Mat3) -> Vec3 {
    if linear.determinant() > SMALLEST_DETERMINANT { linear.inverse() * u } else { rotation.transpose() * u }
}

fn vec3(x: [f32; 4]) -> Vec3 {
    Vec3::new(x[0], x[1], x[2])
}

fn blend(window: &[Target; 4], weights: &[f32; 4], node: usize) -> Vec3A {
    window.iter().zip(weights).fold(Vec3A::ZERO, |sum, (t, w)| sum + Vec3A::from_slice(&t.nodes[node]) * *w)
}
