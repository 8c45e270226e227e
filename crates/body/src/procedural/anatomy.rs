use super::bones::{BoneField, bones};
use super::parameters::{MASS_STEP, NEUTRAL_BMI, NEUTRAL_STATURE, PARAMETERS, STATURE_STEP, ShapeParameters};
use super::parts::{Landmarks, Tissue, tissue};
use super::relax::Net;
use crate::{BODY_DENSITY, BodyError, BodyModel, Result, Skeleton};
use glam::Vec3;
use serde::{Deserialize, Serialize};

/// What lies under the skin, at any shape: bones, fat, and the body's measures. Small, serialisable; made with the
/// body and kept beside it. Vertex arrays are `[V]` of the level it was made for.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Anatomy {
    /// Affine map from `[1, beta]` to the eight knobs, `[8][S + 1]`.
    knobs: Vec<Vec<f32>>,
    /// Rest volume as a cubic in `[1, beta]`: coefficients of monomials `i <= j <= k`, cubic metres.
    volume: Vec<f64>,
    /// Stature as an affine function of `[1, beta]`, metres.
    stature: Vec<f32>,
    /// Fat thickness at neutral mass, metres.
    fat: Vec<f32>,
    /// Share of breast tissue, 0..1.
    breast: Vec<f32>,
    /// Share of viscera below, 0..1.
    viscera: Vec<f32>,
}

impl Anatomy {
    pub(super) fn new(model: &BodyModel, knobs: Vec<Vec<f32>>, tissue: Tissue) -> Self {
        Self {
            knobs,
            volume: volume_cubic(model),
            stature: stature(model),
            fat: tissue.fat,
            breast: tissue.breast,
            viscera: tissue.viscera,
        }
    }

    /// Of any body with SMPL's 24 joints, whoever made it: bones between its joints, fat by its regions. Of the knobs
    /// only stature and mass are known; the others stay at zero.
    ///
    /// # Errors
    /// Another skeleton, an open mesh without volume, or a body outside of human size.
    pub fn of(model: &BodyModel) -> Result<Self> {
        if model.skeleton.parents != Skeleton::smpl().parents {
            return Err(BodyError::Inconsistent(format!(
                "its {} joints are not those of SMPL's skeleton, which bones and fat are known for",
                model.joint_count()
            )));
        }
        let marks = Landmarks::of(model)?;
        let net = Net::of_polygons(&model.topology.faces, &model.mirror.vertices, &model.template);
        let tissue = tissue(&marks, &net, &model.template, &model.regions);
        let mut anatomy = Self::new(model, vec![vec![0.0; model.shape_count() + 1]; PARAMETERS], tissue);
        let (volume, neutral) = (anatomy.volume(&[]), f64::from(anatomy.stature[0]));
        if volume.is_nan() || volume < 0.01 {
            return Err(BodyError::Inconsistent(format!(
                "its volume is {:.1} l: its surface is open or turned inside out",
                volume * 1e3
            )));
        }
        let stature = |s: f32| s / (NEUTRAL_STATURE * STATURE_STEP);
        let mut height: Vec<f32> = anatomy.stature.iter().map(|s| stature(*s)).collect();
        height[0] -= 1.0 / STATURE_STEP;
        let log_bmi =
            |volume: f64, stature: f64| (volume * BODY_DENSITY / stature.powi(2) / NEUTRAL_BMI).ln() / MASS_STEP.ln();
        let mut mass = vec![log_bmi(volume, neutral) as f32];
        for k in 0..model.shape_count() {
            let mut beta = vec![0.0; k + 1];
            let mut at = |b: f32| {
                beta[k] = b;
                log_bmi(anatomy.volume(&beta).max(1e-3), anatomy.height(&beta).max(0.1))
            };
            mass.push(((at(1.5) - at(-1.5)) / 3.0) as f32);
        }
        (anatomy.knobs[0], anatomy.knobs[1]) = (height, mass);
        Ok(anatomy)
    }

    /// Shape coefficients `S`.
    pub fn shape_count(&self) -> usize {
        self.stature.len() - 1
    }

    /// `[1, beta]`, missing coefficients zero, surplus ones ignored.
    fn homogeneous(&self, beta: &[f32]) -> Vec<f32> {
        let mut h = vec![0.0; self.stature.len()];
        h[0] = 1.0;
        h[1..].iter_mut().zip(beta).for_each(|(h, b)| *h = *b);
        h
    }

    /// The eight knobs that `beta` amounts to (regression over the sampled people).
    pub fn parameters(&self, beta: &[f32]) -> ShapeParameters {
        let h = self.homogeneous(beta);
        let mut out = [0.0; PARAMETERS];
        for (o, row) in out.iter_mut().zip(&self.knobs) {
            *o = row.iter().zip(&h).map(|(a, b)| a * b).sum();
        }
        ShapeParameters::from_array(out)
    }

    /// The coefficients nearest to the given knobs (least norm), `[S]`.
    pub fn beta_for(&self, parameters: ShapeParameters) -> Vec<f32> {
        let s = self.shape_count();
        let target = parameters.to_array();
        let n = PARAMETERS;
        // least norm: beta = K^T (K K^T)^-1 (target - offset), with a trace of ridge
        let mut a = vec![vec![0.0; n]; n];
        for (i, p) in self.knobs.iter().enumerate() {
            for (j, q) in self.knobs.iter().enumerate() {
                a[i][j] = p[1..].iter().zip(&q[1..]).map(|(x, y)| f64::from(x * y)).sum();
            }
            a[i][i] += 1e-3;
        }
        let b = (0..n).map(|i| f64::from(target[i] - self.knobs[i][0])).collect();
        let x = super::joint_rows::solve_symmetric(a, b);
        (0..s).map(|k| (0..n).map(|i| f64::from(self.knobs[i][k + 1]) * x[i]).sum::<f64>() as f32).collect()
    }

    /// Rest volume, cubic metres: the exact volume of the model's rest mesh at `beta`.
    pub fn volume(&self, beta: &[f32]) -> f64 {
        let h = self.homogeneous(beta);
        let mut sum = 0.0;
        let mut at = 0;
        for i in 0..h.len() {
            for j in i..h.len() {
                for k in j..h.len() {
                    sum += self.volume[at] * f64::from(h[i]) * f64::from(h[j]) * f64::from(h[k]);
                    at += 1;
                }
            }
        }
        sum
    }

    /// Body mass, kilograms: volume times [`BODY_DENSITY`].
    pub fn mass(&self, beta: &[f32]) -> f64 {
        self.volume(beta) * BODY_DENSITY
    }

    /// Stature, metres: crown above soles.
    pub fn height(&self, beta: &[f32]) -> f64 {
        self.stature.iter().zip(self.homogeneous(beta)).map(|(a, b)| f64::from(a * b)).sum()
    }

    /// Body mass index, kg/m^2.
    pub fn bmi(&self, beta: &[f32]) -> f64 {
        self.mass(beta) / self.height(beta).powi(2)
    }

    /// `beta` with `beta[1]` chosen so that the body has the BMI asked for, other coefficients as given (missing
    /// ones zero). Fails where no `beta[1]` in -8..8 does it.
    pub fn beta_for_bmi(&self, bmi: f64, others: &[f32]) -> Result<Vec<f32>> {
        let mut beta = vec![0.0; self.shape_count()];
        beta.iter_mut().zip(others).for_each(|(b, o)| *b = *o);
        // negative is heavier
        let (mut heavy, mut light) = (-8.0f32, 8.0f32);
        let at = |x: f32, beta: &mut Vec<f32>| {
            beta[1] = x;
            self.bmi(beta)
        };
        let (most, least) = (at(heavy, &mut beta), at(light, &mut beta));
        if !(least..=most).contains(&bmi) {
            return Err(BodyError::Generator(format!("a BMI of {bmi:.1} is outside {least:.1} to {most:.1}")));
        }
        for _ in 0..40 {
            let middle = 0.5 * (heavy + light);
            if at(middle, &mut beta) > bmi { heavy = middle } else { light = middle }
        }
        at(0.5 * (heavy + light), &mut beta);
        Ok(beta)
    }

    /// Bones between the rest joints `[24]` of a body at `beta`.
    pub fn bones(&self, beta: &[f32], joints: &[Vec3]) -> BoneField {
        bones(joints, self.parameters(beta).scale())
    }

    /// Subcutaneous fat at `beta`, metres, `[V]`: thickness grows as `exp(0.62 m)` with the mass knob `m`, the
    /// breast is `50 + 12 m` mm thick.
    pub fn fat_thickness(&self, beta: &[f32]) -> Vec<f32> {
        let m = self.parameters(beta).mass;
        let (growth, breast) = ((0.62 * m).exp(), (0.050 + 0.012 * m).max(0.015));
        self.fat.iter().zip(&self.breast).map(|(f, b)| f * growth * (1.0 - b) + breast * b).collect()
    }

    /// Share of breast tissue a vertex, 0..1, `[V]`.
    pub fn breast(&self) -> &[f32] {
        &self.breast
    }

    /// Share of viscera under a vertex (belly and flanks), 0..1, `[V]`.
    pub fn viscera(&self) -> &[f32] {
        &self.viscera
    }
}

/// Coefficients of the signed volume in `[1, beta]`, monomials `i <= j <= k` in lexicographic order.
fn volume_cubic(model: &BodyModel) -> Vec<f64> {
    let (v, n) = (model.vertex_count(), model.shape_count() + 1);
    let at = |i: usize, vertex: u32| {
        let x = if i == 0 {
            model.template[vertex as usize]
        } else {
            model.shape_directions[(i - 1) * v + vertex as usize]
        };
        x.as_dvec3()
    };
    let mut full = vec![0.0; n * n * n];
    for f in &model.topology.faces {
        let corners: Vec<[glam::DVec3; 3]> = (0..n).map(|i| f.map(|c| at(i, c))).collect();
        for i in 0..n {
            for j in 0..n {
                let cross = corners[i][0].cross(corners[j][1]) / 6.0;
                for k in 0..n {
                    full[(i * n + j) * n + k] += cross.dot(corners[k][2]);
                }
            }
        }
    }
    let mut index = std::collections::BTreeMap::new();
    for i in 0..n {
        for j in i..n {
            for k in j..n {
                index.insert([i, j, k], index.len());
            }
        }
    }
    let mut out = vec![0.0; index.len()];
    for i in 0..n {
        for j in 0..n {
            for k in 0..n {
                let mut key = [i, j, k];
                key.sort_unstable();
                out[index[&key]] += full[(i * n + j) * n + k];
            }
        }
    }
    out
}

/// Height of the template's highest vertex above its lowest, carried along the shape directions.
fn stature(model: &BodyModel) -> Vec<f32> {
    let v = model.vertex_count();
    let extreme = |sign: f32| {
        (0..v).max_by(|a, b| (sign * model.template[*a].y).total_cmp(&(sign * model.template[*b].y))).unwrap_or(0)
    };
    let (crown, sole) = (extreme(1.0), extreme(-1.0));
    let mut out = vec![model.template[crown].y - model.template[sole].y];
    out.extend(model.shape_directions.chunks_exact(v).map(|d| d[crown].y - d[sole].y));
    out
}
