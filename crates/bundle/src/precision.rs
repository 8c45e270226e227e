use crate::{
    AutoregressiveModel, Bundle, BundleError, FeedbackModel, Matrix, Model, Player, RecurrentModel, Result, SelfCheck,
    error::plain, half,
};
use glam::Vec3;
use serde::{Deserialize, Serialize};
use softtissue_geometry::Frames;
use std::str::FromStr;

/// What a bundle keeps its large matrices in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "&'static str")]
pub enum Precision {
    /// 32-bit floats, as learned.
    #[default]
    F32,
    /// 16-bit floats: networks and delta modes.
    F16,
    /// Bytes for the delta modes, in strips with a factor each, the first [`REFINED`] modes in two bytes; networks in
    /// 16-bit floats.
    I8,
}

/// Delta modes of a bundle in bytes that have a second byte for what the first one leaves: they hold most of the motion.
pub const REFINED: usize = 64;

impl Precision {
    /// All of them, most bits first.
    pub const ALL: [Self; 3] = [Self::F32, Self::F16, Self::I8];

    /// Name in files and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::F32 => "f32",
            Self::F16 => "f16",
            Self::I8 => "i8",
        }
    }
}

impl FromStr for Precision {
    type Err = String;
    fn from_str(name: &str) -> std::result::Result<Self, String> {
        let known = Self::ALL.into_iter().find(|p| p.name() == name);
        known.ok_or_else(|| format!("precision is {:?}, expected f32, f16 or i8", plain(name)))
    }
}

impl TryFrom<String> for Precision {
    type Error = String;
    fn try_from(name: String) -> std::result::Result<Self, String> {
        name.parse()
    }
}

impl From<Precision> for &'static str {
    fn from(precision: Precision) -> Self {
        precision.name()
    }
}

/// How far a bundle of fewer bits is from the one it was made of: distances of posed vertices of soft regions over played
/// frames.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PrecisionLoss {
    sum_m: f64,
    count: usize,
    max_m: f32,
    frames: usize,
}

impl PrecisionLoss {
    /// Mean distance, millimetres.
    pub fn mean_mm(&self) -> f64 {
        1e3 * self.sum_m / self.count.max(1) as f64
    }
    /// Largest distance, millimetres.
    pub fn max_mm(&self) -> f64 {
        1e3 * f64::from(self.max_m)
    }
    /// Frames that were compared.
    pub fn frames(&self) -> usize {
        self.frames
    }
    /// Plays a motion with both, from its start: rotations `[T, J]`, radians, and translations `[T]`, metres.
    pub fn add(
        &mut self,
        whole: &Bundle,
        reduced: &Bundle,
        beta: &[f32],
        rotations: &Frames,
        translations: &[Vec3],
    ) -> Result<()> {
        let expected = Player::new(whole, beta)?.rollout_vertices(rotations, translations)?;
        let soft = whole.body.regions.soft();
        Player::new(reduced, beta)?.play(rotations, translations, |t, player| {
            let found = player.vertices();
            for v in soft.iter().map(|v| *v as usize) {
                let distance = found[v].distance(expected.frame(t)[v]);
                self.sum_m += f64::from(distance);
                self.max_m = self.max_m.max(distance);
            }
            self.count += soft.len();
            self.frames += 1;
            Ok(())
        })?;
        Ok(())
    }
}

impl Bundle {
    /// The same with its large matrices in fewer bits, and with a self-check of what it makes of the same motion.
    ///
    /// # Errors
    /// A bundle that has fewer than 32 bits already, or a number that 16-bit floats do not reach.
    pub fn reduced(&self, precision: Precision) -> Result<Self> {
        let found = self.model.precision();
        if found != Precision::F32 {
            return Err(BundleError::Input(format!(
                "a bundle in {} to keep in {}; begin with the one in f32 that it was made of",
                found.name(),
                precision.name()
            )));
        }
        let model = self.model.reduced(precision).map_err(BundleError::Input)?;
        let mut reduced = Self { model, ..self.clone() };
        let SelfCheck { beta, rotations, translations, vertices, .. } = &self.self_check;
        let mut deltas = Frames::new(vertices.len());
        Player::new(&reduced, beta)?.play(rotations, translations, |_, player| {
            let kept: Vec<Vec3> = vertices.iter().map(|v| player.deltas()[*v as usize]).collect();
            deltas.push(&kept);
            Ok(())
        })?;
        reduced.self_check.deltas = deltas;
        Ok(reduced)
    }
}

impl Model {
    /// What its large matrices are kept in.
    pub fn precision(&self) -> Precision {
        match self {
            Self::Recurrent(m) => m.subspace.basis.directions.precision(),
            Self::Feedback(m) => m.people.first().map_or(Precision::F32, |p| p.output.weight.precision()),
            Self::Autoregressive(m) => m.basis.directions.precision(),
        }
    }

    fn reduced(&self, precision: Precision) -> std::result::Result<Self, String> {
        let mut model = self.clone();
        if precision == Precision::F32 {
            return Ok(model);
        }
        match &mut model {
            Self::Recurrent(RecurrentModel { regressor, subspace, .. }) => {
                reduce_modes(&mut subspace.basis.directions, precision)?;
                let units = subspace.encoder.units.iter_mut().chain(&mut subspace.decoder.units);
                for layer in units.flat_map(|u| [&mut u.inner, &mut u.outer]) {
                    halve(&mut layer.weight)?;
                }
                let around = regressor.acquaintance.iter_mut().map(|known| &mut known.around);
                let layers = [&mut subspace.encoder.project, &mut subspace.decoder.lift, &mut regressor.shortcut];
                for layer in layers.into_iter().chain(around) {
                    halve(&mut layer.weight)?;
                }
                if let Some(recurrent) = &mut regressor.recurrent {
                    let gru = &mut recurrent.gru;
                    for matrix in [&mut gru.w_ih, &mut gru.w_hh, &mut recurrent.readout.weight] {
                        halve(matrix)?;
                    }
                }
            }
            Self::Feedback(_) if precision == Precision::I8 => {
                return Err("a bundle without delta modes to keep in i8; choose f16".into());
            }
            Self::Feedback(FeedbackModel { people }) => {
                for person in people {
                    let mut layers = person.encoder.0.iter_mut().chain([&mut person.hidden, &mut person.output]);
                    layers.try_for_each(|l| halve(&mut l.weight))?;
                }
            }
            // The rest are few numbers, among them poles that rounding could make unstable.
            Self::Autoregressive(AutoregressiveModel { basis, .. }) => reduce_modes(&mut basis.directions, precision)?,
        }
        Ok(model)
    }
}

/// A network's matrix as a file of 16-bit floats keeps it.
fn halve(matrix: &mut Matrix) -> std::result::Result<(), String> {
    *matrix = Matrix::new(matrix.rows(), matrix.cols(), rounded(matrix)?).halved();
    Ok(())
}

fn reduce_modes(modes: &mut Matrix, precision: Precision) -> std::result::Result<(), String> {
    *modes = match precision {
        Precision::F32 => return Ok(()),
        Precision::F16 => Matrix::new(modes.rows(), modes.cols(), rounded(modes)?).halved_blocks(),
        Precision::I8 => modes.quantised(REFINED),
    };
    Ok(())
}

fn rounded(matrix: &Matrix) -> std::result::Result<Vec<f32>, String> {
    half::rounded(&matrix.numbers())
        .map_err(|x| format!("a matrix with {x} in it, beyond 16-bit floats; keep it in f32"))
}
