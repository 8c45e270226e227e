use super::config::{FleshConfig, FleshLaw, Material};
use super::elements::{Tetrahedron, edge_matrix, mirror_rank, smallest_altitude, split_prisms};
use super::folds::Folds;
use glam::Vec3;
use softtissue_body::procedural::{Anatomy, BoneField};
use softtissue_body::{BodyModel, Region, ShapedBody};
use softtissue_geometry::Adjacency;

/// What lies under each skin vertex: a column of nodes from the skin to the core.
#[derive(Clone, Debug)]
pub struct Columns {
    /// Rest positions `[layers + 1, V]`.
    pub rest: Vec<Vec3>,
    /// Layers of prisms.
    pub layers: usize,
    /// Which nodes move by themselves, `[layers + 1, V]`.
    pub free: Vec<bool>,
    /// Shear modulus `[layers, V]`, Pa.
    pub shear: Vec<f32>,
    /// Viscosity over shear modulus `[V]`, s.
    pub viscosity: Vec<f32>,
    /// 1 on the breast, 0 elsewhere, `[V]`.
    pub breast: Vec<f32>,
    /// Tetrahedra that fill the layers.
    pub tetrahedra: Vec<Tetrahedron>,
    /// Volume of cut elements that weighs on each node, `[layers + 1, V]`, m^3: a cut unties flesh, it does not
    /// take it away, and a node without its mass would be too light for the skin that pulls it.
    pub untied: Vec<f32>,
}

/// Length of a step of the walk to the core, m.
const STEP: f32 = 0.002;
/// Least altitude of an element, m.
const FLATTEST: f32 = 0.003;
/// The same as a part of a column's depth.
const FLATTEST_PART: f32 = 0.1;
/// Rounds of mending inverted elements.
const ROUNDS: usize = 150;
/// Width of the smooth union of the bones, m.
const BLEND: f32 = 0.030;

/// What lies under the skin of one person.
#[derive(Clone, Debug)]
pub struct Tissue {
    /// Bones in rest space.
    pub bones: BoneField,
    /// Thickness of fat `[V]`, m.
    pub fat: Vec<f32>,
    /// Share of breast tissue `[V]`.
    pub breast: Vec<f32>,
    /// Share of viscera under the fat `[V]`.
    pub viscera: Vec<f32>,
    /// Body mass in standard units of the population, positive = heavier.
    pub mass: f32,
}

impl Tissue {
    /// From the anatomy of the procedural body.
    pub fn new(anatomy: &Anatomy, beta: &[f32], shaped: &ShapedBody) -> Self {
        Self {
            bones: anatomy.bones(beta, &shaped.joints),
            fat: anatomy.fat_thickness(beta),
            breast: anatomy.breast().to_vec(),
            viscera: anatomy.viscera().to_vec(),
            mass: anatomy.parameters(beta).mass,
        }
    }

    /// Walks inward from `p` along the gradient of the smooth bone distance until the core or `depth`.
    fn walk_inward(&self, p: Vec3, depth: f32) -> Vec3 {
        let mut at = p;
        let mut walked = 0.0;
        while walked + STEP <= depth {
            let (d, g) = self.bones.distance(at, BLEND);
            let length = g.length();
            // the gradient vanishes on the middle surfaces between bones: the walk ends there
            if d <= 0.0 || length < 0.25 {
                break;
            }
            at -= g / length * STEP;
            walked += STEP;
        }
        at
    }
}

impl Columns {
    /// Builds the columns of a shaped body.
    pub fn new(
        body: &BodyModel,
        shaped: &ShapedBody,
        tissue: &Tissue,
        material: &Material,
        config: &FleshConfig,
    ) -> Self {
        let v = body.vertex_count();
        let adjacency = Adjacency::new(&body.topology);
        let mut inward: Vec<Vec3> = shaped.vertices.iter().map(|p| tissue.walk_inward(*p, config.depth) - *p).collect();
        smooth(&adjacency, &mut inward, 4);
        symmetrise(body, &mut inward);

        let layers = if config.law == FleshLaw::Second { 3 } else { 2 };
        let rank = mirror_rank(&body.mirror.vertices);
        let tetrahedra = split_prisms(&body.topology.faces, v, layers, &body.mirror.vertices, &rank);
        let rest = place(body, shaped, &adjacency, &mut inward, &tissue.fat, layers, &tetrahedra);

        let mut columns = Self {
            rest,
            layers,
            free: vec![false; (layers + 1) * v],
            shear: vec![0.0; layers * v],
            viscosity: tissue
                .breast
                .iter()
                .map(|b| material.viscosity + (material.breast_viscosity - material.viscosity) * b)
                .collect(),
            breast: tissue.breast.clone(),
            tetrahedra,
            untied: vec![0.0; (layers + 1) * v],
        };
        columns.set_moduli(tissue, material, &inward, &regional_stiffness(body, &adjacency, material));
        let folds = Folds::new(body, shaped, &columns);
        columns.set_free(body, config, &inward, &folds);
        columns
    }

    fn set_moduli(&mut self, tissue: &Tissue, material: &Material, inward: &[Vec3], regional: &[f32]) {
        let v = inward.len();
        let viscera = material.viscera + material.viscera_lean * (-(tissue.mass + 1.0)).exp();
        let fat = material.fat * (-material.softening * tissue.mass).exp();
        for i in 0..v {
            let soft = fat * (1.0 + (material.breast - 1.0) * tissue.breast[i]);
            let firm = material.muscle + (viscera - material.muscle) * tissue.viscera[i];
            let total = inward[i].length();
            for layer in 0..self.layers {
                let depth = |n: usize| (self.rest[n * v + i] - self.rest[i]).length().min(total);
                let (top, bottom) = (depth(layer), depth(layer + 1));
                let in_fat = ((tissue.fat[i] - top) / (bottom - top).max(1e-6)).clamp(0.0, 1.0);
                // springs in series: compliances add
                self.shear[layer * v + i] = regional[i] / (in_fat / soft + (1.0 - in_fat) / firm);
            }
        }
        self.shear.iter_mut().for_each(|x| *x *= material.stiffness);
    }

    fn set_free(&mut self, body: &BodyModel, config: &FleshConfig, inward: &[Vec3], folds: &Folds) {
        let v = body.vertex_count();
        for i in 0..v {
            let still = matches!(body.regions.0[i], Region::Head | Region::Hands | Region::Feet);
            let free = !still && inward[i].length() >= config.shallow;
            for layer in 0..self.layers {
                self.free[layer * v + i] = free && !folds.still[layer * v + i];
            }
        }
        for (t, _) in self.tetrahedra.iter().zip(&folds.cut).filter(|(_, cut)| **cut) {
            let volume = t.volume(&self.rest);
            t.nodes.iter().for_each(|&n| self.untied[n as usize] += 0.25 * volume);
        }
        let mut cut = folds.cut.iter();
        self.tetrahedra.retain(|_| !cut.next().copied().unwrap_or(false));
        let mut held = vec![false; self.free.len()];
        self.tetrahedra.iter().flat_map(|t| t.nodes).for_each(|n| held[n as usize] = true);
        self.free.iter_mut().zip(held).for_each(|(free, held)| *free &= held);
    }
}

/// Factor on all stiffness under each vertex `[V]`: that of its region, with soft borders.
fn regional_stiffness(body: &BodyModel, adjacency: &Adjacency, material: &Material) -> Vec<f32> {
    let factor = |region: &Region| match region {
        Region::Belly => material.belly,
        Region::Buttocks => material.buttocks,
        Region::Thighs => material.thighs,
        Region::UpperArms => material.upper_arms,
        _ => 1.0,
    };
    let mut field: Vec<f32> = body.regions.0.iter().map(factor).collect();
    smooth(adjacency, &mut field, 4);
    field
}

/// Node positions: the first interface at the fat's thickness where that leaves usable layers. Where an element
/// would be inverted or flat, its columns are made shallower until none is.
fn place(
    body: &BodyModel,
    shaped: &ShapedBody,
    adjacency: &Adjacency,
    inward: &mut [Vec3],
    fat: &[f32],
    layers: usize,
    tetrahedra: &[Tetrahedron],
) -> Vec<Vec3> {
    let v = shaped.vertices.len();
    let mut rest = Vec::new();
    for _ in 0..ROUNDS {
        rest.clear();
        for layer in 0..=layers {
            for i in 0..v {
                let total = inward[i].length().max(1e-6);
                let split = (fat[i] / total).clamp(0.3, 0.6);
                let part = match (layers, layer) {
                    (_, 0) => 0.0,
                    (3, 1) => 0.5 * split,
                    (3, 2) | (2, 1) => split,
                    _ => 1.0,
                };
                rest.push(shaped.vertices[i] + inward[i] * part);
            }
        }
        let mut bad = vec![false; v];
        let mut any = false;
        for t in tetrahedra {
            // a shallow column's elements are flat whatever their shape
            let depth = t.nodes.iter().map(|&n| inward[n as usize % v].length()).fold(f32::INFINITY, f32::min);
            let upright = edge_matrix(t.nodes, &rest).determinant() > 0.0;
            if !upright || smallest_altitude(t.nodes, &rest) < FLATTEST.min(FLATTEST_PART * depth) {
                any = true;
                t.nodes.iter().for_each(|&n| bad[n as usize % v] = true);
            }
        }
        if !any {
            break;
        }
        for i in 0..v {
            bad[i] |= bad[body.mirror.vertices[i] as usize];
        }
        let old = inward.to_vec();
        for i in (0..v).filter(|&i| bad[i]) {
            // paths that cross are combed by their neighbours before they are made shorter
            let neighbours = adjacency.neighbours(i);
            let mean = neighbours.iter().map(|&n| old[n as usize]).sum::<Vec3>() / neighbours.len() as f32;
            inward[i] = old[i].lerp(mean, 0.5) * 0.985;
        }
        symmetrise(body, inward);
    }
    rest
}

/// A few rounds of averaging with the neighbours.
fn smooth<T>(adjacency: &Adjacency, field: &mut [T], rounds: usize)
where
    T: Copy + std::ops::Add<Output = T> + std::ops::Mul<f32, Output = T>,
{
    for _ in 0..rounds {
        let old = field.to_vec();
        for (i, x) in field.iter_mut().enumerate() {
            let neighbours = adjacency.neighbours(i);
            let share = 0.5 / neighbours.len().max(1) as f32;
            *x = neighbours.iter().fold(old[i] * 0.5, |sum, &n| sum + old[n as usize] * share);
        }
    }
}

/// Makes a vector field equal to its mirror image, which rounding alone would not leave it.
fn symmetrise(body: &BodyModel, field: &mut [Vec3]) {
    for i in 0..field.len() {
        let m = body.mirror.vertices[i] as usize;
        if i <= m {
            let image = Vec3::new(-field[m].x, field[m].y, field[m].z);
            let mean = (field[i] + image) * 0.5;
            field[i] = mean;
            field[m] = Vec3::new(-mean.x, mean.y, mean.z);
        }
    }
}
