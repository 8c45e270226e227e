use crate::judge::check_size;
use crate::measures::Moments;
use crate::{Codec, EvalError, Result, Scene, SubspaceMetrics};
use rayon::prelude::*;
use softtissue_clips::ClipId;
use softtissue_geometry::Frames;
use softtissue_monitor::Monitor;
use std::collections::BTreeMap;

/// PCA and, where there is one, the autoencoder of one latent size.
pub struct CodecPair<'a> {
    /// Latent size.
    pub latent: u32,
    /// PCA.
    pub pca: &'a dyn Codec,
    /// Autoencoder.
    pub autoencoder: Option<&'a dyn Codec>,
    /// Whether validation kept the residual branches.
    pub residual_kept: Option<bool>,
}

/// Reconstruction errors in mm.
#[derive(Clone, Copy, Default)]
struct CodecErrors {
    reference: Moments,
    input: Moments,
}

/// One clip's errors of one pair: PCA, autoencoder.
type PairErrors = (CodecErrors, Option<CodecErrors>);

/// The subspace table: scan deltas in, mean error over all vertices and frames of the clips, against truth where there
/// is any and against the input.
pub fn judge_subspace(
    scene: &Scene,
    pairs: &[CodecPair],
    clips: &[ClipId],
    monitor: &dyn Monitor,
) -> Result<BTreeMap<u32, SubspaceMetrics>> {
    monitor.begin("judge subspaces", clips.len() as u64, "clips");
    let per_clip: Result<Vec<Vec<PairErrors>>> = clips
        .par_iter()
        .map(|id| {
            if monitor.should_stop() {
                return Err(EvalError::Stopped);
            }
            let (reference, scan, _) = scene.deltas(id)?;
            let of = |codec: &dyn Codec, name: &str| errors(codec, name, id, &scan, &reference);
            let both = |pair: &CodecPair| {
                let autoencoder = pair.autoencoder.map(|c| of(c, "the autoencoder")).transpose()?;
                Ok((of(pair.pca, "PCA")?, autoencoder))
            };
            let errors = pairs.iter().map(both).collect::<Result<Vec<_>>>()?;
            monitor.advance(1, &id.to_string());
            Ok(errors)
        })
        .collect();
    monitor.end();
    let per_clip = per_clip?;
    let table = pairs.iter().enumerate().map(|(i, pair)| {
        let mut pca = CodecErrors::default();
        let mut autoencoder = pair.autoencoder.map(|_| CodecErrors::default());
        for clip in &per_clip {
            pca.merge(&clip[i].0);
            if let Some((sum, one)) = autoencoder.as_mut().zip(clip[i].1.as_ref()) {
                sum.merge(one);
            }
        }
        let truth = |m: &CodecErrors| m.reference.mean().filter(|_| scene.truth.is_some());
        let metrics = SubspaceMetrics {
            pca_mm: truth(&pca),
            ae_mm: autoencoder.as_ref().and_then(truth),
            scan_pca_mm: pca.input.mean(),
            scan_ae_mm: autoencoder.and_then(|a| a.input.mean()),
            residual_kept: pair.residual_kept,
        };
        (pair.latent, metrics)
    });
    Ok(table.collect())
}

impl CodecErrors {
    fn merge(&mut self, other: &Self) {
        self.reference.merge(&other.reference);
        self.input.merge(&other.input);
    }
}

fn errors(codec: &dyn Codec, name: &str, id: &ClipId, scan: &Frames, reference: &Frames) -> Result<CodecErrors> {
    let rebuilt = codec.reconstruct(&id.subject, scan).map_err(|source| EvalError::Method {
        method: name.to_owned(),
        clip: id.clone(),
        source,
    })?;
    check_size(id, &format!("the reconstruction of {name}"), &rebuilt, scan.len(), scan.points_per_frame())?;
    let against = |other: &Frames| {
        let mut moments = Moments::default();
        let distances = rebuilt.points().iter().zip(other.points()).map(|(a, b)| f64::from((*a - *b).length()) * 1e3);
        distances.for_each(|mm| moments.add(mm));
        moments
    };
    Ok(CodecErrors { reference: against(reference), input: against(scan) })
}
