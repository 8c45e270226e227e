use super::columns::Columns;
use super::config::{FleshConfig, FleshLaw, Material};
use super::elements::{edge_matrix, smallest_altitude};
use super::number::{LANES, Lanes, Matrix};
use glam::Vec3;
use softtissue_body::BodyModel;
use std::collections::BTreeMap;

/// The step that caps on viscosity and skin tension are made for, s: they are part of the material, so that a
/// smaller step gives the same flesh.
pub const DESIGN_STEP: f32 = 1.0 / (60.0 * 32.0);
/// Elements flatter than this are softened by the square of their altitude, m: the explicit step's limit.
pub const DESIGN_ALTITUDE: f32 = 0.008;

/// A node that takes part: its column and layer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Node {
    /// Skin vertex above it.
    pub vertex: u32,
    /// Layer, 0 the skin.
    pub layer: u32,
}

/// [`LANES`] tetrahedra side by side; the last chunk is filled up with elements of no volume.
#[derive(Clone, Debug)]
pub struct Chunk {
    /// `nodes[corner][lane]`.
    pub nodes: [[u32; LANES]; 4],
    /// Real elements.
    pub count: usize,
    /// Shear modulus, Pa.
    pub mu: Lanes,
    /// Bulk-like modulus, Pa.
    pub lambda: Lanes,
    /// Viscosity, Pa s.
    pub eta: Lanes,
    /// Rest volume, m^3.
    pub volume: Lanes,
    /// Which lanes have a face in the skin.
    pub surface: [bool; LANES],
    /// Rest edge matrices, for the reference of crushed elements.
    pub rest: Matrix<Lanes>,
}

/// [`LANES`] springs of the skin.
#[derive(Clone, Debug)]
pub struct SpringChunk {
    /// `nodes[end][lane]`.
    pub nodes: [[u32; LANES]; 2],
    /// Tension per strain, N; 0 in filling.
    pub linear: Lanes,
    /// Tension per cubed strain, N.
    pub cubic: Lanes,
}

/// The discrete body: everything that depends on shape and material but not on the motion.
#[derive(Clone, Debug)]
pub struct Assembly {
    /// Nodes in use; the first `free` of them move by themselves.
    pub nodes: Vec<Node>,
    /// How many are free.
    pub free: usize,
    /// Rest positions, `[nodes]`.
    pub rest: Vec<Vec3>,
    /// Lumped masses of the free nodes, kg.
    pub mass: Vec<f32>,
    /// Drag of the free nodes, 1/s.
    pub drag: f32,
    /// Elements.
    pub chunks: Vec<Chunk>,
    /// Skin.
    pub springs: Vec<SpringChunk>,
    /// Node of each skin vertex, if it is free.
    pub skin_node: Vec<Option<u32>>,
}

impl Assembly {
    /// Numbers the nodes and gathers elements and springs in chunks.
    pub fn new(columns: &Columns, body: &BodyModel, material: &Material, config: &FleshConfig) -> Self {
        let v = columns.viscosity.len();
        let used: Vec<_> =
            columns.tetrahedra.iter().filter(|t| t.nodes.iter().any(|&n| columns.free[n as usize])).collect();
        let mut number = vec![u32::MAX; columns.rest.len()];
        let mut order: Vec<u32> = used.iter().flat_map(|t| t.nodes).collect();
        order.sort_unstable();
        order.dedup();
        order.sort_by_key(|&n| (!columns.free[n as usize], n as usize % v, n));
        order.iter().enumerate().for_each(|(i, &n)| number[n as usize] = i as u32);
        let free = order.iter().filter(|&&n| columns.free[n as usize]).count();
        let nodes: Vec<Node> = order.iter().map(|&n| Node { vertex: n % v as u32, layer: n / v as u32 }).collect();
        let rest: Vec<Vec3> = order.iter().map(|&n| columns.rest[n as usize]).collect();

        let damping = material.damping * if config.law == FleshLaw::Second { 0.5 } else { 1.0 };
        let mut mass: Vec<f32> = order[..free].iter().map(|&n| material.density * columns.untied[n as usize]).collect();
        let mut elements = Vec::with_capacity(used.len());
        for t in &used {
            let volume = t.volume(&columns.rest);
            let moduli = |n: u32| columns.shear[t.layer * v + n as usize % v];
            let mean = 4.0 / t.nodes.iter().map(|&n| 1.0 / moduli(n)).sum::<f32>();
            let delay = t.nodes.iter().map(|&n| columns.viscosity[n as usize % v]).sum::<f32>() / 4.0;
            let altitude = smallest_altitude(t.nodes, &columns.rest);
            let cap = 0.04 * material.density * altitude * altitude / DESIGN_STEP;
            let local = t.nodes.map(|n| number[n as usize]);
            for &n in &local {
                if (n as usize) < free {
                    mass[n as usize] += 0.25 * material.density * volume;
                }
            }
            let eta = damping * (delay * mean).min(cap);
            elements.push(Element { nodes: local, mu: mean, eta, volume, surface: t.layer == 0 });
        }
        elements.sort_by_key(|e| *e.nodes.iter().min().unwrap_or(&0));
        let chunks = elements.chunks(LANES).map(|e| pack(e, &rest, material.bulk)).collect();
        let drag = material.damping * material.drag * if config.law == FleshLaw::Second { 2.0 } else { 1.0 };
        let springs = springs(columns, body, &number, &mass, material);
        let skin_node = (0..v).map(|i| Some(number[i]).filter(|&n| (n as usize) < free)).collect();
        Self { nodes, free, rest, mass, drag, chunks, springs, skin_node }
    }

    /// Elements, filling not counted.
    pub fn element_count(&self) -> usize {
        self.chunks.iter().map(|c| c.count).sum()
    }
}

struct Element {
    nodes: [u32; 4],
    mu: f32,
    eta: f32,
    volume: f32,
    surface: bool,
}

fn pack(elements: &[Element], rest: &[Vec3], bulk: f32) -> Chunk {
    let at = |lane: usize| &elements[lane.min(elements.len() - 1)];
    let lanes = |f: &dyn Fn(&Element) -> f32| Lanes(std::array::from_fn(|lane| f(at(lane))));
    let matrices: [_; LANES] = std::array::from_fn(|lane| edge_matrix(at(lane).nodes, rest));
    Chunk {
        nodes: std::array::from_fn(|corner| std::array::from_fn(|lane| at(lane).nodes[corner])),
        count: elements.len(),
        mu: lanes(&|e| e.mu),
        lambda: lanes(&|_| bulk),
        eta: lanes(&|e| e.eta),
        volume: Lanes(std::array::from_fn(|lane| elements.get(lane).map_or(0.0, |e| e.volume))),
        surface: std::array::from_fn(|lane| elements.get(lane).is_some_and(|e| e.surface)),
        rest: std::array::from_fn(|r| std::array::from_fn(|c| Lanes(std::array::from_fn(|l| matrices[l].col(c)[r])))),
    }
}

/// Edges and diagonals of the skin, each with its mirror image at half weight, as the elements are.
fn spring_pairs(body: &BodyModel) -> BTreeMap<[u32; 2], f32> {
    let sorted = |[a, b]: [u32; 2]| [a.min(b), a.max(b)];
    let mut pairs = body.topology.edges();
    pairs.extend(body.topology.quads.iter().flat_map(|&[a, b, c, d]| [sorted([a, c]), sorted([b, d])]));
    pairs.sort_unstable();
    pairs.dedup();
    let mut shares = BTreeMap::new();
    for pair in pairs {
        for pair in [pair, sorted(pair.map(|i| body.mirror.vertices[i as usize]))] {
            *shares.entry(pair).or_insert(0.0) += 0.5;
        }
    }
    shares
}

fn springs(columns: &Columns, body: &BodyModel, number: &[u32], mass: &[f32], material: &Material) -> Vec<SpringChunk> {
    let free_mass = |i: u32| mass.get(number[i as usize] as usize).copied();
    let springs: Vec<([u32; 2], [f32; 2])> = spring_pairs(body)
        .into_iter()
        .filter(|(p, _)| {
            p.iter().any(|&i| columns.free[i as usize]) && p.iter().all(|&i| number[i as usize] != u32::MAX)
        })
        .map(|([a, b], share)| {
            let length = (columns.rest[a as usize] - columns.rest[b as usize]).length();
            let breast = 0.5 * (columns.breast[a as usize] + columns.breast[b as usize]);
            let factor = share * length * material.stiffness * (1.0 + (material.breast_skin - 1.0) * breast);
            let lightest = [a, b].iter().filter_map(|&i| free_mass(i)).fold(f32::INFINITY, f32::min);
            // about eight springs meet in a node: k dt^2 / m of each stays well under the step's limit of 4 / 8
            let cap = 0.15 * lightest * length / (DESIGN_STEP * DESIGN_STEP);
            let tension = [(factor * material.skin).min(cap), factor * material.skin_growth];
            ([number[a as usize], number[b as usize]], tension)
        })
        .collect();
    springs
        .chunks(LANES)
        .map(|s| SpringChunk {
            nodes: std::array::from_fn(|end| std::array::from_fn(|l| s[l.min(s.len() - 1)].0[end])),
            linear: Lanes(std::array::from_fn(|l| s.get(l).map_or(0.0, |s| s.1[0]))),
            cubic: Lanes(std::array::from_fn(|l| s.get(l).map_or(0.0, |s| s.1[1]))),
        })
        .collect()
}
