use crate::descriptor::DescriptorConfig;
use crate::{Player, Regressor, Subspace};
use glam::Vec3;
use serde::{Deserialize, Serialize};
use softtissue_body::BodyModel;
use softtissue_geometry::Frames;

/// Everything that adds soft-tissue motion to a skeletal motion of one body model.
#[derive(Clone, Debug)]
pub struct Bundle {
    /// Where it came from and what it can do.
    pub info: BundleInfo,
    /// The body that moves.
    pub body: BodyModel,
    /// From poses to features.
    pub descriptor: DescriptorConfig,
    /// From features to latent. Its limits are those of the training data.
    pub regressor: Regressor,
    /// From latent to deltas. The descriptor's modes are the first rows of its basis.
    pub subspace: Subspace,
    /// A short input and its output.
    pub self_check: SelfCheck,
}

/// What a reader of the manifest wants to know.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BundleInfo {
    /// Name of the method and its variant, as in metrics.
    pub method: String,
    /// Licence of the learned numbers, which follows that of the data.
    pub licence: String,
    /// Where the data came from: sets, subjects, clips, seeds, versions.
    pub provenance: serde_json::Value,
    /// Errors measured on clips that training had not seen.
    pub measured: serde_json::Value,
    /// Largest delta of a vertex in the training data, metres.
    pub largest_delta_m: f32,
}

/// A short motion and what the model made of it, run when a bundle is opened: it finds a player that computes
/// something else, be it through a bug or through flipped bits in memory.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SelfCheck {
    /// Shape.
    pub beta: Vec<f32>,
    /// Joint rotations `[T, J]`, radians.
    pub rotations: Frames,
    /// Root translations `[T]`, metres.
    pub translations: Vec<Vec3>,
    /// Vertices whose deltas are kept, `[C]`, ascending.
    pub vertices: Vec<u32>,
    /// Deltas of these vertices `[T, C]`, metres.
    pub deltas: Frames,
}

/// Most latent numbers, components, hidden units and features of a bundle: far above what is useful, far below what
/// hurts.
const LARGEST_WIDTH: usize = 1 << 16;
/// Most shape terms, and their highest power.
const MOST_TERMS: (usize, u8) = (64, 4);
/// Most frames of a self-check: it runs whenever a bundle is opened.
const LONGEST_CHECK: usize = 600;

impl SelfCheck {
    /// Plays a motion and keeps the deltas of `count` vertices spread evenly over those that the basis moves at all.
    pub fn record(
        bundle: &Bundle,
        beta: &[f32],
        rotations: &Frames,
        translations: &[Vec3],
        count: usize,
    ) -> crate::Result<Self> {
        let moving = |v: &usize| {
            let basis = &bundle.subspace.basis.directions;
            (0..basis.rows()).any(|k| basis.row(k)[3 * v..3 * v + 3].iter().any(|x| *x != 0.0))
        };
        let moving: Vec<usize> = (0..bundle.body.vertex_count()).filter(moving).collect();
        let count = count.min(moving.len());
        let vertices: Vec<u32> = (0..count).map(|i| moving[i * moving.len() / count] as u32).collect();
        let mut deltas = Frames::new(count);
        let mut kept = Vec::with_capacity(count);
        Player::new(bundle, beta)?.play(rotations, translations, |_, player| {
            kept.clear();
            kept.extend(vertices.iter().map(|v| player.deltas()[*v as usize]));
            deltas.push(&kept);
        })?;
        Ok(Self {
            beta: beta.to_vec(),
            rotations: rotations.clone(),
            translations: translations.to_vec(),
            vertices,
            deltas,
        })
    }

    /// Largest departure allowed, metres: 10 micrometres and a thousandth of the largest delta, far under what is seen
    /// and above what the order of f32 sums changes.
    pub fn tolerance(&self) -> f32 {
        1e-5 + 1e-3 * self.deltas.points().iter().fold(0.0, |m: f32, d| m.max(d.length()))
    }

    /// Plays the motion again: the worst departure as (frame, place in `vertices`, metres).
    pub fn worst(&self, bundle: &Bundle) -> crate::Result<(usize, usize, f32)> {
        let mut worst = (0, 0, 0.0f32);
        Player::new(bundle, &self.beta)?.play(&self.rotations, &self.translations, |t, player| {
            for (i, (v, expected)) in self.vertices.iter().zip(self.deltas.frame(t)).enumerate() {
                let difference = player.deltas()[*v as usize].distance(*expected);
                // A departure that is no number is the worst there is.
                let difference = if difference.is_nan() { f32::INFINITY } else { difference };
                if difference > worst.2 {
                    worst = (t, i, difference);
                }
            }
        })?;
        Ok(worst)
    }

    fn check(&self, body: &BodyModel) -> Result<(), String> {
        let t = self.translations.len();
        fits(
            "self-check rotations",
            &[self.rotations.len(), self.rotations.points_per_frame()],
            &[t, body.joint_count()],
        )?;
        fits("self-check deltas", &[self.deltas.len(), self.deltas.points_per_frame()], &[t, self.vertices.len()])?;
        if !(1..=LONGEST_CHECK).contains(&t) || self.vertices.is_empty() {
            return Err(format!("its self-check has {t} frames, expected 1 to {LONGEST_CHECK}; export it again"));
        }
        match self.vertices.iter().find(|v| **v as usize >= body.vertex_count()) {
            Some(v) => Err(format!("its self-check names vertex {v} of {}; export it again", body.vertex_count())),
            None => Ok(()),
        }
    }
}

impl Bundle {
    /// Whether all parts fit together; the sentence says what does not. Finite numbers are the reader's concern.
    pub fn check(&self) -> Result<(), String> {
        let Self { body, descriptor, regressor, subspace, .. } = self;
        fits("basis", &[subspace.basis.mean.len()], &[3 * body.vertex_count()])?;
        check_subspace(subspace)?;
        check_regressor(regressor)?;
        fits("regressor and decoder, latent", &[regressor.latent_count()], &[subspace.latent_count()])?;
        if let Some(bank) = &regressor.bank {
            fits("resonator bank, channels", &[bank.channels().min(regressor.feature_count())], &[bank.channels()])?;
            if bank.fps() != descriptor.fps {
                return Err(format!(
                    "its resonators are for {} frames a second, its features for {}; export it again",
                    bank.fps(),
                    descriptor.fps
                ));
            }
        }
        if descriptor.look_ahead > 600 {
            return Err(format!(
                "it looks {} frames ahead, expected at most 600; export it again",
                descriptor.look_ahead
            ));
        }
        self.self_check.check(body)
    }
}

fn check_subspace(subspace: &Subspace) -> Result<(), String> {
    let (k, l) = (subspace.components(), subspace.latent_count());
    let basis = &subspace.basis;
    for (what, width) in [("components", k), ("latent numbers", l)] {
        if !(1..=LARGEST_WIDTH).contains(&width) {
            return Err(format!("it has {width} {what}, expected 1 to {LARGEST_WIDTH}; export it again"));
        }
    }
    fits("basis directions", &[basis.directions.cols()], &[basis.mean.len()])?;
    fits("coefficient mean", &[basis.coefficient_mean.len()], &[k])?;
    check_linear("decoder.lift", &subspace.decoder.lift, l, k)?;
    check_linear("encoder.project", &subspace.encoder.project, k, l)?;
    for unit in subspace.encoder.units.iter().chain(&subspace.decoder.units) {
        check_linear("residual unit, inner", &unit.inner, k, unit.inner_width())?;
        check_linear("residual unit, outer", &unit.outer, unit.inner_width(), k)?;
    }
    Ok(())
}

fn check_regressor(regressor: &Regressor) -> Result<(), String> {
    regressor.input.check()?;
    regressor.shape.check()?;
    let (d, b, l) = (regressor.feature_count(), regressor.shape_count(), regressor.latent_count());
    let a = regressor.memory_count();
    let widest = [d, a, b, regressor.input.input_size, regressor.shape.input_size].into_iter().max().unwrap_or(0);
    if widest > LARGEST_WIDTH {
        return Err(format!("its regressor has {widest} inputs, expected at most {LARGEST_WIDTH}; export it again"));
    }
    let (terms, power) = MOST_TERMS;
    let rows = &regressor.shape_terms;
    if rows.len() > terms || rows.iter().any(|row| row.len() > b || row.iter().any(|p| *p > power)) {
        return Err(format!(
            "its shape terms are more than {terms}, name a shape input past {b} or a power above {power}; export it again"
        ));
    }
    check_linear("shortcut", &regressor.shortcut, rows.len() * a + b, l)?;
    if let Some(recurrent) = &regressor.recurrent {
        let h = recurrent.gru.width();
        let gru = &recurrent.gru;
        fits("gru.w_ih", &[gru.w_ih.rows(), gru.w_ih.cols()], &[3 * h, d + b])?;
        fits("gru.w_hh", &[gru.w_hh.rows(), h], &[3 * h, h])?;
        fits("gru biases", &[gru.b_ih.len(), gru.b_hh.len()], &[3 * h, 3 * h])?;
        check_linear("readout", &recurrent.readout, h, l)?;
    }
    Ok(())
}

fn check_linear(name: &str, linear: &crate::Linear, inputs: usize, outputs: usize) -> Result<(), String> {
    fits(name, &[linear.outputs(), linear.inputs(), linear.bias.len()], &[outputs, inputs, outputs])
}

fn fits(what: &str, found: &[usize], expected: &[usize]) -> Result<(), String> {
    if found == expected {
        return Ok(());
    }
    Err(format!("its {what} has size {found:?}, expected {expected:?}; export it again"))
}
