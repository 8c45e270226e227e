use crate::blocks::{BLOCK, ByteRows};
use crate::descriptor::{FeatureScaling, PoseEncoder};
use crate::feedback::{FeedbackModel, FeedbackPerson};
use crate::limits::Limits as Range;
use crate::manifest::{AcquaintanceForm, AutoregressiveForm, FeedbackForm, ModelForm, PersonForm, RecurrentForm};
use crate::{
    Acquaintance, Ar2, AutoregressiveModel, Bundle, BundleError, Decoder, DeltaBasis, Encoder, Gru, Linear, Matrix,
    Model, PersonDynamics, Precision, Recurrent, RecurrentModel, Regressor, ResidualUnit, ResonatorBank, Result,
    SelfCheck, Subspace, ThreeLayers, Trust, half,
};
use softtissue_body::BodyBuild;
use softtissue_geometry::Frames;
use softtissue_store::{DType, Limits, TensorFile, TensorFileWriter};
use std::cell::RefCell;
use std::collections::BTreeSet;
use std::sync::Arc;

/// Above any bundle (eight people of Casas and Otaduy at 6890 vertices: 2.2 GB), far below what hurts.
pub(crate) const LIMITS: Limits = Limits { header_bytes: 1 << 20, file_bytes: 4 << 30, tensors: 1024 };

/// Largest bank.
const MOST_CHANNELS: usize = 1 << 12;
/// Most poles of a bank.
const MOST_RESONATORS: usize = 1 << 10;

/// The arrays of a bundle, in `model.safetensors`.
pub(crate) struct Arrays {
    pub(crate) model: Model,
    pub(crate) trust: Trust,
    pub(crate) self_check: SelfCheck,
}

/// Gives every array of a bundle its name and shape. The error names an array that is not finite.
pub(crate) fn collect(bundle: &Bundle) -> std::result::Result<TensorFileWriter<'_>, String> {
    let Bundle { model, trust, self_check: check, .. } = bundle;
    let mut writer = Writer { file: TensorFileWriter::new(), problem: None };
    writer.file.meta("kind", "softtissue-bundle");
    match model {
        Model::Recurrent(model) => writer.recurrent(model),
        Model::Feedback(model) => model.people.iter().enumerate().for_each(|(i, p)| writer.person(i, p)),
        Model::Autoregressive(model) => writer.autoregressive(model),
    }
    writer.vector("trust.mean", &trust.mean);
    writer.vector("trust.scale", &trust.scale);
    writer.range("trust.shape", &trust.shape);
    writer.numbers("trust.shape_reach", &[1], std::slice::from_ref(&trust.shape_reach));
    let (t, j, c) = (check.translations.len(), check.rotations.points_per_frame(), check.vertices.len());
    writer.vector("check.beta", &check.beta);
    writer.numbers("check.rotations", &[t, j, 3], bytemuck::cast_slice(check.rotations.points()));
    writer.numbers("check.translations", &[t, 3], bytemuck::cast_slice(&check.translations));
    writer.file.u32("check.vertices", &[c], &check.vertices);
    writer.numbers("check.deltas", &[t, c, 3], bytemuck::cast_slice(check.deltas.points()));
    writer.problem.map_or(Ok(writer.file), Err)
}

struct Writer<'a> {
    file: TensorFileWriter<'a>,
    problem: Option<String>,
}

impl<'a> Writer<'a> {
    fn recurrent(&mut self, RecurrentModel { regressor, subspace, pose_encoder }: &'a RecurrentModel) {
        self.basis(&subspace.basis);
        self.units("encoder", &subspace.encoder.units);
        self.linear("encoder.project", &subspace.encoder.project);
        self.linear("decoder.lift", &subspace.decoder.lift);
        self.units("decoder", &subspace.decoder.units);
        self.scaling("regressor.input", &regressor.input);
        self.scaling("regressor.shape", &regressor.shape);
        self.linear("regressor.shortcut", &regressor.shortcut);
        if let Some(Recurrent { gru, readout }) = &regressor.recurrent {
            self.matrix("regressor.gru.w_ih", &gru.w_ih);
            self.matrix("regressor.gru.w_hh", &gru.w_hh);
            self.vector("regressor.gru.b_ih", &gru.b_ih);
            self.vector("regressor.gru.b_hh", &gru.b_hh);
            self.linear("regressor.readout", readout);
        }
        if let Some(known) = &regressor.acquaintance {
            self.linear("regressor.around", &known.around);
            self.matrix("regressor.people", &known.people);
        }
        for (i, layer) in pose_encoder.iter().flat_map(|e| e.layers.iter().enumerate()) {
            self.linear(&format!("pose_encoder.{i}"), layer);
        }
    }
    fn person(&mut self, i: usize, person: &'a FeedbackPerson) {
        let name = |part: &str| format!("person.{i}.{part}");
        self.vector(&name("beta"), &person.beta);
        for (layer, linear) in person.encoder.0.iter().enumerate() {
            self.linear(&name(&format!("encoder.{layer}")), linear);
        }
        self.linear(&name("hidden"), &person.hidden);
        self.linear(&name("output"), &person.output);
        self.range(&name("poses"), &person.pose_limits);
        if let Some(limits) = &person.latent_limits {
            self.range(&name("latents"), limits);
        }
    }
    fn range(&mut self, name: &str, range: &'a Range) {
        self.vector(&format!("{name}.lower"), &range.lower);
        self.vector(&format!("{name}.upper"), &range.upper);
    }
    fn autoregressive(&mut self, model: &'a AutoregressiveModel) {
        self.basis(&model.basis);
        self.scaling("autoregression.input", &model.input);
        self.vector("build.rooted_weight", &model.build.rooted_weight);
        self.vector("build.height", &model.build.height);
        for (i, PersonDynamics { dynamics, .. }) in model.people.iter().enumerate() {
            self.matrix(&format!("person.{i}.lags"), &dynamics.lags);
            self.matrix(&format!("person.{i}.weight"), &dynamics.weight);
            self.vector(&format!("person.{i}.bias"), &dynamics.bias);
        }
    }
    fn basis(&mut self, basis: &'a DeltaBasis) {
        let DeltaBasis { mean, directions, coefficient_mean } = basis;
        let v = mean.len() / 3;
        self.numbers("basis.mean", &[v, 3], mean);
        match directions.byte_rows() {
            Some(ByteRows { lines, bytes, scale }) => {
                let bytes = bytes.into_iter().map(i8::cast_unsigned).collect();
                self.file.raw("basis.directions", DType::I8, &[lines, v, 3], bytes);
                let scales = scale.iter().flat_map(|s| s.to_le_bytes()).collect();
                self.file.raw("basis.directions.scale", DType::F32, &[lines, directions.blocks()], scales);
            }
            None => self.matrix_of_shape("basis.directions", &[directions.rows(), v, 3], directions),
        }
        self.vector("basis.coefficient_mean", coefficient_mean);
    }
    fn numbers(&mut self, name: &str, shape: &[usize], numbers: &'a [f32]) {
        if let Some(i) = numbers.iter().position(|x| !x.is_finite()) {
            self.problem = Some(format!("{name} holds {} at place {i}; train again", numbers[i]));
        }
        self.file.f32(name, shape, numbers);
    }
    fn vector(&mut self, name: &str, numbers: &'a [f32]) {
        self.numbers(name, &[numbers.len()], numbers);
    }
    fn matrix(&mut self, name: &str, matrix: &'a Matrix) {
        self.matrix_of_shape(name, &[matrix.rows(), matrix.cols()], matrix);
    }
    fn matrix_of_shape(&mut self, name: &str, shape: &[usize], matrix: &'a Matrix) {
        match matrix.whole() {
            Some(numbers) => self.numbers(name, shape, numbers),
            None => {
                self.file.raw(name, DType::F16, shape, half::to_bytes(&matrix.numbers()));
            }
        }
    }
    fn linear(&mut self, name: &str, linear: &'a Linear) {
        self.matrix(&format!("{name}.weight"), &linear.weight);
        self.vector(&format!("{name}.bias"), &linear.bias);
    }
    fn units(&mut self, name: &str, units: &'a [ResidualUnit]) {
        for (i, unit) in units.iter().enumerate() {
            self.linear(&format!("{name}.unit.{i}.inner"), &unit.inner);
            self.linear(&format!("{name}.unit.{i}.outer"), &unit.outer);
        }
    }
    fn scaling(&mut self, name: &str, scaling: &'a FeatureScaling) {
        self.file.u32(&format!("{name}.kept"), &[scaling.len()], &scaling.kept);
        self.vector(&format!("{name}.lower"), &scaling.lower);
        self.vector(&format!("{name}.upper"), &scaling.upper);
        self.vector(&format!("{name}.scale"), &scaling.scale);
    }
}

/// Reads all arrays: every one that the manifest asks for, finite, and none besides. Sizes are checked against each
/// other by the bundle.
pub(crate) fn read(file: &TensorFile, form: &ModelForm, fps: f32, precision: Precision) -> Result<Arrays> {
    let reader = Reader { file, precision, read: RefCell::default() };
    let model = match form {
        ModelForm::Recurrent(form) => Model::Recurrent(reader.recurrent(form, fps)?),
        ModelForm::Feedback(form) => Model::Feedback(reader.feedback(form)?),
        ModelForm::Autoregressive(form) => Model::Autoregressive(reader.autoregressive(form)?),
    };
    let arrays = Arrays { model, trust: reader.trust()?, self_check: reader.self_check()? };
    match file.names().find(|name| !reader.read.borrow().contains(*name)) {
        Some(name) => Err(reader.refused(&format!("it holds an unknown array {name:?}; export the bundle again"))),
        None => Ok(arrays),
    }
}

struct Reader<'a> {
    file: &'a TensorFile,
    precision: Precision,
    read: RefCell<BTreeSet<String>>,
}

impl Reader<'_> {
    fn recurrent(&self, form: &RecurrentForm, fps: f32) -> Result<RecurrentModel> {
        let units = form.encoder_units.saturating_add(form.decoder_units);
        let layers = form.pose_encoder_layers.unwrap_or(0);
        if units.max(layers) > LIMITS.tensors {
            return Err(self.refused(&format!(
                "the manifest asks for {units} residual units and {layers} layers; export the bundle again"
            )));
        }
        let encoder = form.pose_encoder_layers.map(|_| {
            let layers = (0..layers).map(|i| self.linear(&format!("pose_encoder.{i}")));
            Ok::<_, BundleError>(Arc::new(PoseEncoder { layers: layers.collect::<Result<_>>()? }))
        });
        Ok(RecurrentModel {
            subspace: self.subspace(form)?,
            regressor: self.regressor(form, fps)?,
            pose_encoder: encoder.transpose()?,
        })
    }

    fn feedback(&self, FeedbackForm { people, latent_limits }: &FeedbackForm) -> Result<FeedbackModel> {
        if self.precision == Precision::I8 {
            return Err(
                self.refused("it is in i8, which a bundle without delta modes cannot be; export the bundle again")
            );
        }
        let person = |(i, name): (usize, &String)| {
            let part = |part: &str| format!("person.{i}.{part}");
            Ok(FeedbackPerson {
                name: name.clone(),
                beta: self.vector(&part("beta"))?,
                encoder: ThreeLayers([
                    self.network(&part("encoder.0"))?,
                    self.network(&part("encoder.1"))?,
                    self.network(&part("encoder.2"))?,
                ]),
                hidden: self.network(&part("hidden"))?,
                output: self.network(&part("output"))?,
                pose_limits: self.range(&part("poses"))?,
                latent_limits: latent_limits.then(|| self.range(&part("latents"))).transpose()?,
            })
        };
        Ok(FeedbackModel { people: people.iter().enumerate().map(person).collect::<Result<_>>()? })
    }

    fn range(&self, name: &str) -> Result<Range> {
        Ok(Range { lower: self.vector(&format!("{name}.lower"))?, upper: self.vector(&format!("{name}.upper"))? })
    }

    fn subspace(&self, form: &RecurrentForm) -> Result<Subspace> {
        let basis = self.basis()?;
        let encoder =
            Encoder { units: self.units("encoder", form.encoder_units)?, project: self.network("encoder.project")? };
        let decoder =
            Decoder { lift: self.network("decoder.lift")?, units: self.units("decoder", form.decoder_units)? };
        Ok(Subspace { basis, encoder, decoder })
    }

    fn basis(&self) -> Result<DeltaBasis> {
        let [lines, v, _] = self.shape("basis.directions")?;
        let mean = self.numbers("basis.mean", &[v, 3])?;
        let coefficient_mean = self.vector("basis.coefficient_mean")?;
        let shape = [lines, v, 3];
        let directions = match self.precision {
            Precision::F32 => Matrix::new(lines, 3 * v, self.numbers("basis.directions", &shape)?),
            Precision::F16 => Matrix::new(lines, 3 * v, self.halves("basis.directions", &shape)?).halved_blocks(),
            Precision::I8 => self.byte_rows(coefficient_mean.len(), lines, v)?,
        };
        Ok(DeltaBasis { mean, directions, coefficient_mean })
    }

    /// `k` delta modes in `lines` rows of bytes.
    fn byte_rows(&self, k: usize, lines: usize, v: usize) -> Result<Matrix> {
        if !(k..=k.saturating_mul(2)).contains(&lines) {
            return Err(self.refused(&format!(
                "basis.directions has {lines} rows of bytes for {k} modes, expected one or two for each; export the bundle again"
            )));
        }
        self.expect("basis.directions", &[lines, v, 3])?;
        let bytes = self.file.bytes("basis.directions", DType::I8, None)?;
        let scale = self.numbers("basis.directions.scale", &[lines, (3 * v).div_ceil(BLOCK)])?;
        // A factor in the range of ordinary numbers is a step of something.
        if let Some(i) = scale.iter().position(|s| !(s.is_normal() && *s > 0.0)) {
            return Err(self.refused(&format!(
                "basis.directions.scale holds {} at place {i}, expected a number above 0; export the bundle again",
                scale[i]
            )));
        }
        let bytes = bytes.into_iter().map(u8::cast_signed).collect();
        Ok(Matrix::from_byte_rows(k, 3 * v, &ByteRows { lines, bytes, scale }))
    }

    fn autoregressive(&self, form: &AutoregressiveForm) -> Result<AutoregressiveModel> {
        let person = |(i, form): (usize, &PersonForm)| {
            let dynamics = Ar2 {
                lags: self.matrix(&format!("person.{i}.lags"))?,
                weight: self.matrix(&format!("person.{i}.weight"))?,
                bias: self.vector(&format!("person.{i}.bias"))?,
            };
            Ok(PersonDynamics { name: form.name.clone(), bmi: form.bmi, dynamics })
        };
        Ok(AutoregressiveModel {
            input: self.scaling("autoregression.input", form.features)?,
            basis: self.basis()?,
            build: BodyBuild {
                rooted_weight: self.vector("build.rooted_weight")?,
                height: self.vector("build.height")?,
            },
            tau: form.tau,
            people: form.people.iter().enumerate().map(person).collect::<Result<_>>()?,
        })
    }

    fn regressor(&self, form: &RecurrentForm, fps: f32) -> Result<Regressor> {
        let bank = match &form.bank {
            Some(bank) => {
                if bank.channels > MOST_CHANNELS || bank.resonators.len() > MOST_RESONATORS {
                    return Err(self.refused(&format!(
                        "the manifest asks for {} resonators on {} channels, at most {MOST_RESONATORS} on {MOST_CHANNELS}; export the bundle again",
                        bank.resonators.len(),
                        bank.channels
                    )));
                }
                if let Some(r) = bank.resonators.iter().find(|r| r.pole(fps).is_none()) {
                    return Err(self.refused(&format!(
                        "the manifest's resonator of {} Hz and damping ratio {} is not stable at {fps} frames a second; export the bundle again",
                        r.frequency, r.damping
                    )));
                }
                if let Some(Err(what)) = bank.hardening.map(|law| law.check()) {
                    return Err(self.refused(&what));
                }
                let linear = ResonatorBank::new(bank.resonators.clone(), bank.channels, fps);
                Some(linear.with_hardening(bank.hardening))
            }
            None => None,
        };
        let recurrent = match form.recurrent {
            true => {
                let gru = Gru {
                    w_ih: self.network_matrix("regressor.gru.w_ih")?,
                    w_hh: self.network_matrix("regressor.gru.w_hh")?,
                    b_ih: self.vector("regressor.gru.b_ih")?,
                    b_hh: self.vector("regressor.gru.b_hh")?,
                };
                Some(Recurrent { gru, readout: self.network("regressor.readout")? })
            }
            false => None,
        };
        let acquaintance = form.acquaintance.map(|AcquaintanceForm { share, stranger }| {
            let (around, people) = (self.network("regressor.around")?, self.matrix("regressor.people")?);
            Ok::<_, BundleError>(Acquaintance { around, share, stranger, people })
        });
        Ok(Regressor {
            input: self.scaling("regressor.input", form.features)?,
            shape: self.scaling("regressor.shape", form.beta_count)?,
            shape_terms: form.shape_terms.clone(),
            mass: form.mass,
            bank,
            direct: form.direct,
            shortcut: self.network("regressor.shortcut")?,
            recurrent,
            acquaintance: acquaintance.transpose()?,
        })
    }

    fn trust(&self) -> Result<Trust> {
        Ok(Trust {
            mean: self.vector("trust.mean")?,
            scale: self.vector("trust.scale")?,
            shape: self.range("trust.shape")?,
            shape_reach: self.numbers("trust.shape_reach", &[1])?[0],
        })
    }

    fn self_check(&self) -> Result<SelfCheck> {
        let [t, joints, _] = self.shape("check.rotations")?;
        let vertices = self.indices("check.vertices")?;
        if t == 0 || joints == 0 || vertices.is_empty() {
            return Err(self.refused("its self-check is empty; export the bundle again"));
        }
        let translations = Frames::from_numbers(1, &self.numbers("check.translations", &[t, 3])?).points().to_vec();
        let rotations = Frames::from_numbers(joints, &self.numbers("check.rotations", &[t, joints, 3])?);
        let deltas = Frames::from_numbers(vertices.len(), &self.numbers("check.deltas", &[t, vertices.len(), 3])?);
        Ok(SelfCheck { beta: self.vector("check.beta")?, rotations, translations, vertices, deltas })
    }

    fn scaling(&self, name: &str, input_size: usize) -> Result<FeatureScaling> {
        Ok(FeatureScaling {
            input_size,
            kept: self.indices(&format!("{name}.kept"))?,
            lower: self.vector(&format!("{name}.lower"))?,
            upper: self.vector(&format!("{name}.upper"))?,
            scale: self.vector(&format!("{name}.scale"))?,
        })
    }

    fn units(&self, name: &str, count: usize) -> Result<Vec<ResidualUnit>> {
        let part = |i: usize, part: &str| self.network(&format!("{name}.unit.{i}.{part}"));
        (0..count).map(|i| Ok(ResidualUnit { inner: part(i, "inner")?, outer: part(i, "outer")? })).collect()
    }

    fn linear(&self, name: &str) -> Result<Linear> {
        Ok(Linear { weight: self.matrix(&format!("{name}.weight"))?, bias: self.vector(&format!("{name}.bias"))? })
    }

    /// A layer whose matrix has fewer bits in a bundle of fewer bits.
    fn network(&self, name: &str) -> Result<Linear> {
        let weight = self.network_matrix(&format!("{name}.weight"))?;
        Ok(Linear { weight, bias: self.vector(&format!("{name}.bias"))? })
    }

    fn network_matrix(&self, name: &str) -> Result<Matrix> {
        if self.precision == Precision::F32 {
            return self.matrix(name);
        }
        let [rows, cols] = self.shape(name)?;
        Ok(Matrix::new(rows, cols, self.halves(name, &[rows, cols])?).halved())
    }

    fn matrix(&self, name: &str) -> Result<Matrix> {
        let [rows, cols] = self.shape(name)?;
        Ok(Matrix::new(rows, cols, self.numbers(name, &[rows, cols])?))
    }

    fn vector(&self, name: &str) -> Result<Vec<f32>> {
        let [count] = self.shape(name)?;
        self.numbers(name, &[count])
    }

    fn numbers(&self, name: &str, expected: &[usize]) -> Result<Vec<f32>> {
        self.expect(name, expected)?;
        let numbers = self.file.f32(name)?;
        match numbers.iter().position(|x| !x.is_finite()) {
            Some(i) => Err(self.refused(&format!("{name} holds {} at place {i}; train and export again", numbers[i]))),
            None => Ok(numbers),
        }
    }

    /// 16-bit floats.
    fn halves(&self, name: &str, expected: &[usize]) -> Result<Vec<f32>> {
        self.expect(name, expected)?;
        let numbers = half::from_bytes(&self.file.bytes(name, DType::F16, None)?);
        let damaged = || format!("{name} holds a number that is not finite; train and export again");
        numbers.ok_or_else(|| self.refused(&damaged()))
    }

    /// An array of this shape, which counts as read.
    fn expect(&self, name: &str, expected: &[usize]) -> Result<()> {
        let shape = self.file.require_shape(name, expected.len())?;
        if shape != expected {
            return Err(
                self.refused(&format!("{name} has shape {shape:?}, expected {expected:?}; export the bundle again"))
            );
        }
        self.read.borrow_mut().insert(name.to_owned());
        Ok(())
    }

    fn indices(&self, name: &str) -> Result<Vec<u32>> {
        let [_] = self.shape(name)?;
        self.read.borrow_mut().insert(name.to_owned());
        Ok(self.file.u32(name)?)
    }

    fn shape<const N: usize>(&self, name: &str) -> Result<[usize; N]> {
        let shape = self.file.require_shape(name, N)?;
        Ok(shape.try_into().expect("as many axes as asked for"))
    }

    fn refused(&self, reason: &str) -> BundleError {
        BundleError::refused(self.file.path(), reason)
    }
}
