//! Principal components of the training clips' scan deltas, mirrored clips included.

use super::context::{Context, Place};
use anyhow::Result;
use softtissue_body::BodyModel;
use softtissue_bundle::DeltaBasis;
use softtissue_clips::{ClipId, FitSet, Split};
use softtissue_geometry::Frames;
use softtissue_model::{FrameSource, ModelError, Pca, coefficients_of};
use softtissue_random::Draws;
use softtissue_store::{TensorFile, TensorFileWriter};
use std::path::Path;

/// Training deltas, each clip followed by its mirror image if asked for.
struct TrainingDeltas<'a> {
    fit: &'a FitSet,
    body: &'a BodyModel,
    clips: &'a [ClipId],
    mirror: bool,
}

impl FrameSource for TrainingDeltas<'_> {
    fn width(&self) -> usize {
        3 * self.fit.vertex_count()
    }
    fn chunk_count(&self) -> usize {
        self.clips.len()
    }
    fn chunk(&self, i: usize) -> Result<Vec<f32>, ModelError> {
        let deltas = self.fit.deltas(&self.clips[i])?.deltas;
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
    if path.exists() {
        return read(&path);
    }
    let config = &context.config.subspace;
    let source = TrainingDeltas { fit, body, clips: &split.train, mirror: config.mirror };
    let mut draws = Draws::new(context.config.seed, &place.stage("basis"), 0, 0);
    let pca = Pca::fit(&source, &config.pca, &mut draws, context.monitor)?;
    write(&pca, &path)?;
    Ok(pca)
}

fn write(pca: &Pca, path: &Path) -> Result<()> {
    let (k, width) = (pca.basis.directions.rows(), pca.basis.directions.cols());
    let mut file = TensorFileWriter::new();
    file.f32("mean", &[width], &pca.basis.mean).f32("directions", &[k, width], pca.basis.directions.data());
    file.f32("coefficient_mean", &[pca.basis.coefficient_mean.len()], &pca.basis.coefficient_mean);
    file.f64("variances", &[k], &pca.variances).f64("total_variance", &[1], &[pca.total_variance]);
    file.meta("frames", pca.frames.to_string());
    Ok(file.write(path)?)
}

fn read(path: &Path) -> Result<Pca> {
    let file = TensorFile::open(path)?;
    let shape = file.require_shape("directions", 2)?.to_vec();
    let directions = softtissue_bundle::Matrix::new(shape[0], shape[1], file.f32("directions")?);
    Ok(Pca {
        basis: DeltaBasis { mean: file.f32("mean")?, directions, coefficient_mean: file.f32("coefficient_mean")? },
        variances: file.f64("variances")?,
        total_variance: file.f64("total_variance")?.first().copied().unwrap_or(0.0),
        frames: file.require_meta("frames")?.parse().unwrap_or(0),
    })
}

/// Coefficients `[T, K]` of a clip, mirrored if asked for.
pub fn clip_coefficients(basis: &DeltaBasis, body: &BodyModel, deltas: &Frames, mirrored: bool) -> Vec<f32> {
    if mirrored { coefficients_of(basis, &body.mirror.fields(deltas)) } else { coefficients_of(basis, deltas) }
}
