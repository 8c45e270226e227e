//! Principal components of the training clips' scan deltas, mirrored clips included.

use super::context::{Context, Place, damaged};
use crate::exit::InputError;
use anyhow::Result;
use softtissue_body::{BodyModel, Region};
use softtissue_bundle::DeltaBasis;
use softtissue_clips::{ClipId, FitSet, Split, TruthSet};
use softtissue_eval::ComponentMetrics;
use softtissue_geometry::{Adjacency, Frames};
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
    /// Factor on each vertex, `[V]`.
    shares: &'a [f32],
}

impl FrameSource for Deltas<'_> {
    fn width(&self) -> usize {
        3 * self.body.vertex_count()
    }
    fn chunk_count(&self) -> usize {
        self.clips.len()
    }
    fn chunk(&self, i: usize) -> Result<Vec<f32>, ModelError> {
        let mut deltas = (self.of)(&self.clips[i])?;
        for frame in deltas.points_mut().chunks_exact_mut(self.shares.len()) {
            frame.iter_mut().zip(self.shares).for_each(|(delta, share)| *delta *= *share);
        }
        let mut numbers = deltas.to_numbers();
        if self.mirror {
            numbers.extend(self.body.mirror.fields(&deltas).to_numbers());
        }
        Ok(numbers)
    }
}

/// Variance of all vertices together, m^2, under which nothing moves: a micrometre.
const LEAST_VARIANCE: f64 = 1e-12;
/// Rings of vertices round a still region over which deltas come back.
const RAMP: usize = 3;

/// Factor on each vertex's delta, `[V]`: 0 in the regions that stay still, which rises to 1 over a few rings of vertices
/// round them. Soft regions are never held, which is why the player's still regions are blended otherwise: a level of detail
/// may hold what is soft, and its edge then lies in what moves.
fn moving_shares(body: &BodyModel, still: &[Region]) -> Vec<f32> {
    let adjacency = Adjacency::new(&body.topology);
    let regions = &body.regions.0;
    let mut shares: Vec<f32> = regions.iter().map(|r| f32::from(u8::from(!still.contains(r)))).collect();
    let mut ring: Vec<usize> = (0..shares.len()).filter(|v| shares[*v] == 0.0).collect();
    let mut reached: Vec<bool> = shares.iter().map(|s| *s == 0.0).collect();
    for step in 1..=RAMP {
        let round: Vec<usize> =
            ring.iter().flat_map(|v| adjacency.neighbours(*v)).map(|n| *n as usize).filter(|n| !reached[*n]).collect();
        for v in &round {
            reached[*v] = true;
            if !regions[*v].is_soft() {
                shares[*v] = step as f32 / (RAMP + 1) as f32;
            }
        }
        ring = round;
    }
    shares
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
    let shares = moving_shares(body, config.still_of(context.config.method));
    let source = Deltas { of: &of, body, clips: &split.train, mirror: config.mirror, shares: &shares };
    let mut draws = Draws::new(context.config.seed, &place.stage("basis"), 0, 0);
    let pca = Pca::fit(&source, &config.pca, &mut draws, context.monitor)?;
    if pca.total_variance < LEAST_VARIANCE {
        let message = "there is no soft tissue to learn: what is left of the training clips after the fit does not move \
                       outside the regions of subspace.still; take regions out of it, or train on scans that move";
        return Err(InputError(message.into()).into());
    }
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
        let whole = vec![1.0; body.vertex_count()];
        let source = Deltas { of: &of, body, clips: &split.train, mirror: config.mirror, shares: &whole };
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

#[cfg(test)]
mod tests {
    use super::*;
    use softtissue_body::procedural::{ProceduralConfig, generate};

    #[test]
    fn regions_without_flesh_are_still_and_soft_ones_move_whole() {
        let body = generate(&ProceduralConfig::default()).unwrap().model;
        let still = [Region::Head, Region::Hands, Region::Feet];
        let shares = moving_shares(&body, &still);
        let mut between = 0;
        for (region, share) in body.regions.0.iter().zip(&shares) {
            match region {
                r if still.contains(r) => assert_eq!(*share, 0.0, "{r:?}"),
                r if r.is_soft() => assert_eq!(*share, 1.0, "{r:?}"),
                _ => between += usize::from(*share < 1.0),
            }
        }
        assert!(between > 20, "{between} vertices between still and moving");
        let adjacency = Adjacency::new(&body.topology);
        let soft = |v: usize| body.regions.0[v].is_soft();
        for v in (0..shares.len()).filter(|v| !soft(*v)) {
            for n in adjacency.neighbours(v).iter().map(|n| *n as usize).filter(|n| !soft(*n)) {
                assert!((shares[v] - shares[n]).abs() <= 0.2501, "{} beside {}", shares[v], shares[n]);
            }
        }
        assert_eq!(moving_shares(&body, &[]), vec![1.0; body.vertex_count()]);
    }
}
