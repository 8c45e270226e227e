use super::ladder::{Ladder, LadderModel, Rule};
use crate::{ModelError, plain};
use serde::{Deserialize, Serialize};
use softtissue_bundle::descriptor::{DescriptorConfig, FeatureScaling};
use softtissue_bundle::{Ar2, DeltaBasis, Hardening, MassLaw, Matrix, Resonator, ResonatorBank};
use softtissue_store::{StoreError, TensorFile, TensorFileWriter};
use std::path::Path;

/// What the header says of a rung; its arrays follow under its number.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    name: String,
    descriptor: Option<DescriptorConfig>,
    rule: RuleEntry,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case", tag = "kind")]
enum RuleEntry {
    Body,
    Mean {
        subjects: Vec<String>,
    },
    Readout {
        input: FeatureScaling,
        shape: FeatureScaling,
        shape_terms: Vec<Vec<u8>>,
        mass: MassLaw,
        resonators: Vec<Resonator>,
        channels: usize,
        fps: f32,
        hardening: Option<Hardening>,
        direct: bool,
    },
    Ar2 {
        scaling: FeatureScaling,
        subjects: Vec<String>,
    },
}

impl Ladder {
    /// Writes the ladder as one tensor file.
    pub fn write(&self, path: &Path) -> Result<(), ModelError> {
        let mut file = TensorFileWriter::new();
        let entries: Vec<Entry> = self.models.iter().map(entry_of).collect();
        let text = serde_json::to_string(&entries).map_err(|e| ModelError::Data(format!("{}: {e}", path.display())))?;
        file.meta("softtissue", "1").meta("kind", "ladder").meta("models", text);
        let DeltaBasis { mean, directions, coefficient_mean } = &self.basis;
        file.f32("basis.mean", &[mean.len()], mean).f32(
            "basis.coefficient_mean",
            &[coefficient_mean.len()],
            coefficient_mean,
        );
        write_matrix(&mut file, "basis.directions", directions);
        for (i, model) in self.models.iter().enumerate() {
            match &model.rule {
                Rule::Body => {}
                Rule::Mean { subjects, pooled } => {
                    file.f32(&format!("{i}.pooled"), &[pooled.len()], pooled);
                    for (j, (_, mean)) in subjects.iter().enumerate() {
                        file.f32(&format!("{i}.subject.{j}"), &[mean.len()], mean);
                    }
                }
                Rule::Readout(regressor) => {
                    write_matrix(&mut file, &format!("{i}.weight"), &regressor.shortcut.weight);
                    file.f32(&format!("{i}.bias"), &[regressor.shortcut.bias.len()], &regressor.shortcut.bias);
                }
                Rule::Ar2 { subjects, pooled, .. } => {
                    write_ar2(&mut file, &format!("{i}.pooled"), pooled);
                    for (j, (_, model)) in subjects.iter().enumerate() {
                        write_ar2(&mut file, &format!("{i}.subject.{j}"), model);
                    }
                }
            }
        }
        Ok(file.write(path)?)
    }

    /// Reads a ladder; arrays that do not fit together are refused.
    pub fn read(path: &Path) -> Result<Self, ModelError> {
        let file = TensorFile::open(path)?;
        let bad = |reason: String| ModelError::Store(StoreError::corrupt(path, reason));
        if file.require_meta("kind")? != "ladder" {
            return Err(bad(format!("it is a {} file, expected a ladder", file.require_meta("kind")?)));
        }
        let entries: Vec<Entry> = serde_json::from_str(file.require_meta("models")?)
            .map_err(|e| bad(format!("its list of models is broken ({e}); fit it again")))?;
        let basis = DeltaBasis {
            mean: file.f32("basis.mean")?,
            directions: matrix(&file, "basis.directions")?,
            coefficient_mean: file.f32("basis.coefficient_mean")?,
        };
        let (k, w) = (basis.directions.rows(), basis.directions.cols());
        if basis.mean.len() != w || basis.coefficient_mean.len() != k {
            return Err(bad(format!("its mean does not fit {k} directions of {w} numbers; fit it again")));
        }
        let models = entries
            .into_iter()
            .enumerate()
            .map(|(i, entry)| {
                let rule = read_rule(&file, i, entry.rule, k)?.ok_or_else(|| {
                    bad(format!("arrays of its model {:?} do not fit together; fit it again", entry.name))
                })?;
                Ok(LadderModel { name: entry.name, descriptor: entry.descriptor, rule })
            })
            .collect::<Result<_, ModelError>>()?;
        Ok(Self { basis, models })
    }
}

fn entry_of(model: &LadderModel) -> Entry {
    let names = |n: &mut dyn Iterator<Item = &String>| n.cloned().collect();
    let rule = match &model.rule {
        Rule::Body => RuleEntry::Body,
        Rule::Mean { subjects, .. } => RuleEntry::Mean { subjects: names(&mut subjects.iter().map(|s| &s.0)) },
        Rule::Readout(r) => RuleEntry::Readout {
            input: r.input.clone(),
            shape: r.shape.clone(),
            shape_terms: r.shape_terms.clone(),
            mass: r.mass,
            resonators: r.bank.as_ref().map_or(vec![], |b| b.resonators().to_vec()),
            channels: r.bank.as_ref().map_or(0, ResonatorBank::channels),
            fps: r.bank.as_ref().map_or(0.0, ResonatorBank::fps),
            hardening: r.bank.as_ref().and_then(ResonatorBank::hardening),
            direct: r.direct,
        },
        Rule::Ar2 { scaling, subjects, .. } => {
            RuleEntry::Ar2 { scaling: scaling.clone(), subjects: names(&mut subjects.iter().map(|s| &s.0)) }
        }
    };
    Entry { name: model.name.clone(), descriptor: model.descriptor.clone(), rule }
}

/// `None` where sizes do not fit.
fn read_rule(file: &TensorFile, i: usize, entry: RuleEntry, k: usize) -> Result<Option<Rule>, ModelError> {
    Ok(match entry {
        RuleEntry::Body => Some(Rule::Body),
        RuleEntry::Mean { subjects } => {
            let mean = |name: String| file.f32(&name);
            let pooled = mean(format!("{i}.pooled"))?;
            let subjects: Vec<(String, Vec<f32>)> = subjects
                .into_iter()
                .enumerate()
                .map(|(j, s)| Ok((s, mean(format!("{i}.subject.{j}"))?)))
                .collect::<Result<_, StoreError>>()?;
            let fits = pooled.len() == k && subjects.iter().all(|(_, m)| m.len() == k);
            fits.then_some(Rule::Mean { subjects, pooled })
        }
        RuleEntry::Readout { input, shape, shape_terms, mass, resonators, channels, fps, hardening, direct } => {
            if input.check().is_err() || shape.check().is_err() || channels > input.len() {
                return Ok(None);
            }
            if resonators.iter().any(|r| r.pole(fps).is_none()) || resonators.len() > 4096 {
                return Ok(None);
            }
            if hardening.is_some_and(|law| law.check().is_err()) {
                return Ok(None);
            }
            let bank = (!resonators.is_empty())
                .then(|| ResonatorBank::new(resonators, channels, fps).with_hardening(hardening));
            let shortcut =
                plain::Linear { weight: matrix(file, &format!("{i}.weight"))?, bias: file.f32(&format!("{i}.bias"))? };
            let regressor = plain::Regressor {
                input,
                shape,
                shape_terms,
                mass,
                bank,
                direct,
                shortcut,
                recurrent: None,
                acquaintance: None,
            };
            let inputs = regressor.shape_terms.len() * regressor.memory_count() + regressor.shape_count();
            let weight = &regressor.shortcut.weight;
            let fits = weight.rows() == k && weight.cols() == inputs && regressor.shortcut.bias.len() == k;
            fits.then_some(Rule::Readout(regressor))
        }
        RuleEntry::Ar2 { scaling, subjects } => {
            if scaling.check().is_err() {
                return Ok(None);
            }
            let pooled = read_ar2(file, &format!("{i}.pooled"))?;
            let subjects: Vec<(String, Ar2)> = subjects
                .into_iter()
                .enumerate()
                .map(|(j, s)| Ok((s, read_ar2(file, &format!("{i}.subject.{j}"))?)))
                .collect::<Result<_, ModelError>>()?;
            let fits = |m: &Ar2| {
                let (lags, weight) = ((m.lags.rows(), m.lags.cols()), (m.weight.rows(), m.weight.cols()));
                lags == (k, 2) && weight == (k, scaling.len()) && m.bias.len() == k
            };
            (fits(&pooled) && subjects.iter().all(|(_, m)| fits(m))).then_some(Rule::Ar2 { scaling, subjects, pooled })
        }
    })
}

fn write_matrix<'a>(file: &mut TensorFileWriter<'a>, name: &str, matrix: &'a Matrix) {
    file.f32(name, &[matrix.rows(), matrix.cols()], matrix.data());
}

fn matrix(file: &TensorFile, name: &str) -> Result<Matrix, ModelError> {
    let shape = file.require_shape(name, 2)?;
    Ok(Matrix::new(shape[0], shape[1], file.f32(name)?))
}

fn write_ar2<'a>(file: &mut TensorFileWriter<'a>, name: &str, model: &'a Ar2) {
    write_matrix(file, &format!("{name}.lags"), &model.lags);
    write_matrix(file, &format!("{name}.weight"), &model.weight);
    file.f32(&format!("{name}.bias"), &[model.bias.len()], &model.bias);
}

fn read_ar2(file: &TensorFile, name: &str) -> Result<Ar2, ModelError> {
    Ok(Ar2 {
        lags: matrix(file, &format!("{name}.lags"))?,
        weight: matrix(file, &format!("{name}.weight"))?,
        bias: file.f32(&format!("{name}.bias"))?,
    })
}
