//! Principal components of the training clips' scan deltas, mirrored clips included.

use super::context::{Context, Place, damaged};
use anyhow::Result;
use softtissue_body::BodyModel;
use softtissue_bundle::DeltaBasis;
use softtissue_clips::{ClipId, FitSet, Split, TruthSet};
use softtissue_eval::ComponentMetrics;
use softtissue_geometry::Frames;
use softtissue_model::{FrameSource, ModelError, Pca, coefficients_of};
use softtissue_random::Draws;
use softtissue_store::{TensorFile, TensorFileWriter};
use std::path::Path;

/// Deltas of clips, each followed by its mirror image if asked for.
struct Deltas<'a> {
    of: &'a (dyn Fn(&ClipId) -> Result<Frames, ModelError> + Sync),
    body: &'a BodyModel,
    clips: &'a [ClipId],
    mirror: bool,
}

impl FrameSource for Deltas<'_> {
    fn width(&self) -> usize {
        3 * self.body.vertex_count()
    }
    fn chunk_count(&self) -> usize {
        self.clips.len()
    }
    fn chunk(&self, i: usize) -> Result<Vec<f32>, ModelError> {
        let deltas = (self.of)(&self.clips[i])?;
        let mut numbers = deltas.to_numbers();
        if self.mirror {
            numbers.extend(self.body.mirror.fields(&deltas).to_numbers());
        }
        Ok(numbers)
    }
}

/// Learns the basis, or takes it from where an earlier attempt left it.
pub fn learn_basis(context: &Context, place: &Place, body: &BodyModel, fit: &FitSet, split: &Split) -> Result<Pca> {
    let path = context.run.stage(&place.stage("basis"));
    if context.has(&path)? {
        let file = TensorFile::open(&path)?;
        place.check(&path, file.require_meta("fingerprint")?)?;
        return read(&file, 3 * fit.vertex_count())?
            .ok_or_else(|| damaged(&path, "its arrays do not fit together".into()));
    }
    let config = &context.config.subspace;
    let of = |id: &ClipId| Ok(fit.deltas(id)?.deltas);
    let source = Deltas { of: &of, body, clips: &split.train, mirror: config.mirror };
    let mut draws = Draws::new(context.config.seed, &place.stage("basis"), 0, 0);
    let pca = Pca::fit(&source, &config.pca, &mut draws, context.monitor)?;
    write(&pca, &place.fingerprint, &path)?;
    Ok(pca)
}

/// Components for 95 % of the variance: of the learned basis and, where there is truth, of the same clips' true deltas.
pub fn count_components(
    context: &Context,
    body: &BodyModel,
    pca: &Pca,
    truth: Option<&TruthSet>,
    split: &Split,
) -> Result<ComponentMetrics> {
    let count = |pca: &Pca| pca.components_for(0.95).unwrap_or_else(|| pca.components()) as u32;
    let config = &context.config.subspace;
    let of_truth = |truth: &TruthSet| -> Result<u32> {
        let of = |id: &ClipId| Ok(truth.deltas(id)?.deltas);
        let source = Deltas { of: &of, body, clips: &split.train, mirror: config.mirror };
        let mut draws = Draws::new(context.config.seed, "true components", 0, 0);
        Ok(count(&Pca::fit(&source, &config.pca, &mut draws, context.monitor)?))
    };
    Ok(ComponentMetrics { scan: Some(count(pca)), truth: truth.map(of_truth).transpose()? })
}

fn write(pca: &Pca, fingerprint: &str, path: &Path) -> Result<()> {
    let (k, width) = (pca.basis.directions.rows(), pca.basis.directions.cols());
    let mut file = TensorFileWriter::new();
    file.f32("mean", &[width], &pca.basis.mean).f32("directions", &[k, width], pca.basis.directions.data());
    file.f32("coefficient_mean", &[pca.basis.coefficient_mean.len()], &pca.basis.coefficient_mean);
    file.f64("variances", &[k], &pca.variances).f64("total_variance", &[1], &[pca.total_variance]);
    file.meta("frames", pca.frames.to_string()).meta("fingerprint", fingerprint);
    Ok(file.write(path)?)
}

/// The basis in a file, or `None` where its arrays are not `[K, width]`, `[width]` and `[K]`.
fn read(file: &TensorFile, width: usize) -> Result<Option<Pca>> {
    let shape = file.require_shape("directions", 2)?.to_vec();
    let vectors = [("mean", width), ("coefficient_mean", shape[0]), ("variances", shape[0]), ("total_variance", 1)];
    for (name, length) in vectors {
        if file.require_shape(name, 1)? != [length] {
            return Ok(None);
        }
    }
    let Ok(frames) = file.require_meta("frames")?.parse() else { return Ok(None) };
    if shape[1] != width {
        return Ok(None);
    }
    let directions = softtissue_bundle::Matrix::new(shape[0], width, file.f32("directions")?);
    Ok(Some(Pca {
        basis: DeltaBasis { mean: file.f32("mean")?, directions, coefficient_mean: file.f32("coefficient_mean")? },
        variances: file.f64("variances")?,
        total_variance: file.f64("total_variance")?[0],
        frames,
    }))
}

/// Coefficients `[T, K]` of a clip, mirrored if asked for.
pub fn clip_coefficients(basis: &DeltaBasis, body: &BodyModel, deltas: &Frames, mirrored: bool) -> Vec<f32> {
    if mirrored { coefficients_of(basis, &body.mirror.fields(deltas)) } else { coefficients_of(basis, deltas) }
}
