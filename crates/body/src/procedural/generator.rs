use super::anatomy::Anatomy;
use super::assembly::{Stage, align_axes, assemble, mirror_rows};
use super::atlas::atlas;
use super::figure::Figure;
use super::joint_rows::solve_symmetric;
use super::parameters::{PARAMETERS, ShapeParameters, sample_people};
use super::parts;
use super::relax::{Net, fit_figure};
use super::shape_space::{Scores, principal_scores};
use super::skeleton::JOINTS;
use super::subdivision::{SubdivisionMap, subdivide};
use super::surface_nets::{Grid, QuadMesh, planes, surface_net, symmetric_planes};
use super::weights::dense_weights;
use crate::{BodyError, BodyModel, Result};
use glam::Vec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use softtissue_geometry::Topology;

/// What body to make.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ProceduralConfig {
    /// Subdivision level: 0 is about 1.7k vertices, 1 about 6.9k. Default 1.
    pub level: u8,
    /// People sampled for the shape space. Default 120; more cost time, fewer than 40 make it coarse.
    pub people: usize,
    /// Shape coefficients `S`. Default 10; beyond 10 they are mostly noise of the sampling.
    pub shapes: usize,
    /// Seed of the sampled people. Default 1.
    pub seed: u64,
}

impl Default for ProceduralConfig {
    fn default() -> Self {
        Self { level: 1, people: 120, shapes: 10, seed: 1 }
    }
}

/// A body and what lies under its skin.
#[derive(Clone, Debug)]
pub struct ProceduralBody {
    /// The parametric body.
    pub model: BodyModel,
    /// Bones, fat, measures.
    pub anatomy: Anatomy,
}

/// Both levels of one body.
#[derive(Clone, Debug)]
pub struct Levels {
    /// Level 0.
    pub coarse: ProceduralBody,
    /// Level 1.
    pub fine: ProceduralBody,
    /// Lifts fields from level 0 to level 1.
    pub subdivision: SubdivisionMap,
}

/// Makes the body at the level asked for.
pub fn generate(config: &ProceduralConfig) -> Result<ProceduralBody> {
    match config.level {
        0 => Ok(Coarse::new(config)?.finish()?.0),
        1 => Ok(generate_levels(config)?.fine),
        level => Err(BodyError::Generator(format!("level {level} does not exist, choose 0 or 1"))),
    }
}

/// Makes both levels, which share `beta`.
pub fn generate_levels(config: &ProceduralConfig) -> Result<Levels> {
    let coarse = Coarse::new(config)?;
    let (mesh, subdivision) = subdivide(&coarse.mesh);
    let net = Net::new(&mesh);
    let base = Figure::new(ShapeParameters::default());
    let faces = split_quads(&mesh).faces;
    let positions = net.relax(&base, &net.march(&base, &mesh.positions, &faces, 6), None, 2);
    let fine_mesh = QuadMesh { positions: net.project(&base, &positions, 3), ..mesh };
    // what the fine neutral mesh has beyond the lifted coarse one goes with every sample
    let lifted = subdivision.lift(&coarse.mesh.positions);
    let beyond: Vec<Vec3> = fine_mesh.positions.iter().zip(&lifted).map(|(p, l)| *p - *l).collect();
    let samples: Vec<Vec<Vec3>> = coarse
        .figures
        .par_iter()
        .zip(&coarse.samples)
        .map(|(figure, sample)| {
            let start: Vec<Vec3> = subdivision.lift(sample).iter().zip(&beyond).map(|(p, b)| *p + *b).collect();
            let on_surface = net.relax(figure, &net.project(figure, &start, 3), Some(&start), 1);
            net.project(figure, &on_surface, 2)
        })
        .collect();
    let dense: Vec<[f32; JOINTS]> = (0..fine_mesh.positions.len())
        .map(|v| {
            let mut row = [0.0; JOINTS];
            for (c, w) in subdivision.row(v) {
                row.iter_mut().zip(&coarse.dense[*c as usize]).for_each(|(r, x)| *r += x * w);
            }
            row
        })
        .collect();
    let dense = mirror_rows(&net, dense);
    let (coarse_body, scores) = coarse.finish()?;
    let fine = Level { mesh: &fine_mesh, net: &net, dense: &dense, samples: &samples, figures: &coarse.figures };
    Ok(Levels { coarse: coarse_body, fine: fine.body(&scores, config.seed)?, subdivision })
}

/// Everything of level 0 that level 1 builds on.
struct Coarse {
    config: ProceduralConfig,
    mesh: QuadMesh,
    net: Net,
    dense: Vec<[f32; JOINTS]>,
    figures: Vec<Figure>,
    samples: Vec<Vec<Vec3>>,
}

impl Coarse {
    fn new(config: &ProceduralConfig) -> Result<Self> {
        if config.shapes < 2 || config.people < 2 * config.shapes.max(PARAMETERS) {
            return Err(BodyError::Generator(format!(
                "{} people are too few for {} shape coefficients (at least 2, and twice as many people)",
                config.people, config.shapes
            )));
        }
        let base = Figure::new(ShapeParameters::default());
        let (mesh, net) = neutral_mesh(&base, &grid())?;
        let dense = dense_weights(&base, &net, &mesh.positions);
        let figures: Vec<Figure> = sample_people(config.seed, config.people).into_iter().map(Figure::new).collect();
        let samples = figures.par_iter().map(|f| fit_figure(&net, &mesh.positions, &dense, f, 4)).collect();
        Ok(Self { config: config.clone(), mesh, net, dense, figures, samples })
    }

    fn finish(&self) -> Result<(ProceduralBody, Scores)> {
        let mut scores = principal_scores(&self.samples, self.config.shapes);
        align_axes(&mut scores, &self.samples, &split_quads(&self.mesh));
        fix_signs(&mut scores, &self.figures);
        let level = Level {
            mesh: &self.mesh,
            net: &self.net,
            dense: &self.dense,
            samples: &self.samples,
            figures: &self.figures,
        };
        Ok((level.body(&scores, self.config.seed)?, scores))
    }
}

/// The net of the neutral figure, evened out on its surface.
fn neutral_mesh(base: &Figure, grid: &Grid) -> Result<(QuadMesh, Net)> {
    let mut mesh = surface_net(base.left_half(), grid, &|p| base.warp(p))?;
    let net = Net::new(&mesh);
    let faces = split_quads(&mesh).faces;
    mesh.positions = net.march(base, &net.smooth(&mesh.positions), &faces, 4);
    mesh.positions = net.relax(base, &mesh.positions, None, 4);
    mesh.positions = net.march(base, &mesh.positions, &faces, 2);
    Ok((mesh, net))
}

/// Node planes: finer across the feet than along the legs. The spacings are tuned to give 1724 vertices, which
/// subdivide to the 6890 of SMPL; nothing depends on the count.
fn grid() -> Grid {
    Grid {
        x: symmetric_planes(0.74, |x| if x > 0.40 { 0.0422 } else { 0.0382 }),
        y: planes(-0.05, 1.78, |y| {
            if y < 0.10 {
                0.028
            } else if y < 0.75 {
                0.0508
            } else {
                0.0388
            }
        }),
        z: planes(-0.26, 0.28, |_| 0.0354),
    }
}

/// `beta[0]` positive = taller, `beta[1]` negative = heavier, the rest by their largest knob.
fn fix_signs(scores: &mut Scores, figures: &[Figure]) {
    let correlation = |scores: &Scores, k: usize, knob: usize| -> f64 {
        figures.iter().zip(&scores.values).map(|(f, row)| f64::from(f.parameters.to_array()[knob]) * row[k]).sum()
    };
    for k in 0..scores.values[0].len() {
        let sum = match k {
            0 => correlation(scores, 0, 0),
            1 => -correlation(scores, 1, 1),
            _ => {
                let all: Vec<f64> = (0..PARAMETERS).map(|knob| correlation(scores, k, knob)).collect();
                all.into_iter().fold(0.0, |m: f64, x| if x.abs() > m.abs() { x } else { m })
            }
        };
        if sum < 0.0 {
            scores.values.iter_mut().for_each(|row| row[k] = -row[k]);
        }
    }
}

/// One level of the mesh with the people who were sampled on it.
struct Level<'a> {
    mesh: &'a QuadMesh,
    net: &'a Net,
    dense: &'a [[f32; JOINTS]],
    samples: &'a [Vec<Vec3>],
    figures: &'a [Figure],
}

impl Level<'_> {
    fn body(&self, scores: &Scores, seed: u64) -> Result<ProceduralBody> {
        let marks = Figure::new(ShapeParameters::default()).landmarks();
        let topology = split_quads(self.mesh);
        let labels = parts::chart_labels(&marks, &topology, &self.mesh.positions, self.dense);
        let stage = Stage {
            uv: atlas(&topology, &self.mesh.positions, &labels),
            topology,
            net: self.net,
            neutral: &self.mesh.positions,
            dense: self.dense,
            samples: self.samples,
            joints: &self.figures.iter().map(|f| f.joints).collect::<Vec<_>>(),
            marks,
            seed,
        };
        let (model, tissue) = assemble(stage, scores)?;
        let anatomy = Anatomy::new(&model, knob_regression(scores, self.figures), tissue);
        Ok(ProceduralBody { model, anatomy })
    }
}

/// `[8][S + 1]`: the knobs as affine functions of the scores, by least squares.
fn knob_regression(scores: &Scores, figures: &[Figure]) -> Vec<Vec<f32>> {
    let s = scores.values[0].len();
    let rows: Vec<Vec<f64>> =
        scores.values.iter().map(|r| std::iter::once(1.0).chain(r.iter().copied()).collect()).collect();
    let mut a = vec![vec![0.0; s + 1]; s + 1];
    for r in &rows {
        for i in 0..=s {
            for j in 0..=s {
                a[i][j] += r[i] * r[j];
            }
        }
    }
    (0..PARAMETERS)
        .map(|knob| {
            let b = (0..=s)
                .map(|i| rows.iter().zip(figures).map(|(r, f)| r[i] * f64::from(f.parameters.to_array()[knob])).sum())
                .collect();
            solve_symmetric(a.clone(), b).into_iter().map(|x| x as f32).collect()
        })
        .collect()
}

/// Splits each quad along its shorter diagonal, alike on both sides of the mirror plane.
fn split_quads(mesh: &QuadMesh) -> Topology {
    let p = |i: u32| mesh.positions[i as usize];
    // ties are broken by an index that does not know left from right
    let neutral = |i: u32| i.min(mesh.mirror[i as usize]);
    let mut faces = Vec::with_capacity(mesh.quads.len() * 2);
    for q in &mesh.quads {
        let [a, b, c, d] = *q;
        let (ac, bd) = (p(a).distance_squared(p(c)), p(b).distance_squared(p(d)));
        let first = ac < bd || (ac == bd && neutral(a).min(neutral(c)) < neutral(b).min(neutral(d)));
        faces.extend(if first { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] });
    }
    Topology { vertex_count: mesh.positions.len(), faces, quads: mesh.quads.clone() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_regressor_finds_the_joints_that_the_figures_were_built_on() {
        let config = ProceduralConfig { people: 30, level: 0, ..Default::default() };
        let coarse = Coarse::new(&config).unwrap();
        let (body, _) = coarse.finish().unwrap();
        let mut worst = (0.0, 0);
        for (figure, sample) in coarse.figures.iter().zip(&coarse.samples) {
            let joints = body.model.joint_regressor.joints(sample);
            for (j, (found, truth)) in joints.iter().zip(figure.joints).enumerate() {
                worst = if found.distance(truth) > worst.0 { (found.distance(truth), j) } else { worst };
            }
        }
        let (off, joint) = worst;
        assert!(off < 0.006, "joint {joint} is {off} m off");
    }

    #[test]
    fn too_few_people_and_unknown_levels_are_refused() {
        let few = generate(&ProceduralConfig { people: 8, ..Default::default() }).unwrap_err().to_string();
        assert!(few.contains("8 people are too few"), "{few}");
        let level = generate(&ProceduralConfig { level: 2, ..Default::default() }).unwrap_err().to_string();
        assert!(level.contains("level 2 does not exist"), "{level}");
    }
}
