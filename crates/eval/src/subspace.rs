use crate::judge::check_size;
use crate::measures::Moments;
use crate::over_time::rounded;
use crate::{Codec, EvalError, Result, Scene, SubspaceMetrics};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use softtissue_clips::ClipId;
use softtissue_geometry::Frames;
use softtissue_monitor::Monitor;
use std::collections::{BTreeMap, BTreeSet};

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

/// The subspaces' errors.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SubspaceTable {
    /// All clips together, by latent size (SoftSMPL table 1).
    pub pooled: BTreeMap<u32, SubspaceMetrics>,
    /// Person by person.
    pub by_subject: BTreeMap<String, BTreeMap<u32, SubspaceMetrics>>,
    /// Clip by clip, frame by frame.
    pub over_time: BTreeMap<ClipId, BTreeMap<u32, CodecCurves>>,
}

/// Mean error over all vertices in each frame of a clip, mm: against truth where there is any, otherwise against the
/// input.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CodecCurves {
    /// PCA.
    pub pca_mm: Vec<f64>,
    /// Autoencoder.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub ae_mm: Vec<f64>,
}

/// Reconstruction errors of a clip.
#[derive(Clone, Default)]
struct CodecErrors {
    reference: Moments,
    input: Moments,
    /// Against the reference, mean of each frame, mm.
    frames: Vec<f32>,
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
) -> Result<SubspaceTable> {
    monitor.begin("judge subspaces", clips.len() as u64, "clips");
    let judged: Result<Vec<(&ClipId, Vec<PairErrors>)>> = clips
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
            Ok((id, errors))
        })
        .collect();
    monitor.end();
    let judged = judged?;
    let truth = scene.truth.is_some();
    let rows = |wanted: &dyn Fn(&ClipId) -> bool| {
        let taken: Vec<&Vec<PairErrors>> = judged.iter().filter(|(id, _)| wanted(id)).map(|(_, e)| e).collect();
        pairs.iter().enumerate().map(|(i, pair)| (pair.latent, row(pair, taken.iter().map(|e| &e[i]), truth))).collect()
    };
    let subjects: BTreeSet<&String> = clips.iter().map(|id| &id.subject).collect();
    let curves = |errors: &Vec<PairErrors>| -> BTreeMap<u32, CodecCurves> {
        let of = |(pair, (pca, autoencoder)): (&CodecPair, &PairErrors)| {
            let ae_mm = autoencoder.as_ref().map_or(vec![], |e| rounded(&e.frames));
            (pair.latent, CodecCurves { pca_mm: rounded(&pca.frames), ae_mm })
        };
        pairs.iter().zip(errors).map(of).collect()
    };
    Ok(SubspaceTable {
        pooled: rows(&|_| true),
        by_subject: subjects.into_iter().map(|s| (s.clone(), rows(&|id| id.subject == *s))).collect(),
        over_time: judged.iter().map(|(id, errors)| ((*id).clone(), curves(errors))).collect(),
    })
}

/// One pair's errors over some clips.
fn row<'a>(pair: &CodecPair, clips: impl Iterator<Item = &'a PairErrors>, truth: bool) -> SubspaceMetrics {
    let mut pca = [Moments::default(); 2];
    let mut autoencoder = pair.autoencoder.map(|_| pca);
    for (one, other) in clips {
        add(&mut pca, one);
        if let Some((sum, other)) = autoencoder.as_mut().zip(other.as_ref()) {
            add(sum, other);
        }
    }
    let against_truth = |m: [Moments; 2]| m[0].mean().filter(|_| truth);
    SubspaceMetrics {
        pca_mm: against_truth(pca),
        ae_mm: autoencoder.and_then(against_truth),
        scan_pca_mm: pca[1].mean(),
        scan_ae_mm: autoencoder.and_then(|a| a[1].mean()),
        residual_kept: pair.residual_kept,
    }
}

fn add(sum: &mut [Moments; 2], clip: &CodecErrors) {
    sum[0].merge(&clip.reference);
    sum[1].merge(&clip.input);
}

fn errors(codec: &dyn Codec, name: &str, id: &ClipId, scan: &Frames, reference: &Frames) -> Result<CodecErrors> {
    let rebuilt = codec.reconstruct(&id.subject, scan).map_err(|source| EvalError::Method {
        method: name.to_owned(),
        clip: id.clone(),
        source,
    })?;
    check_size(id, &format!("the reconstruction of {name}"), &rebuilt, scan.len(), scan.points_per_frame())?;
    let mut errors = CodecErrors::default();
    for (t, frame) in rebuilt.iter().enumerate() {
        let against = |other: &Frames| {
            let mut moments = Moments::default();
            let distances = frame.iter().zip(other.frame(t)).map(|(a, b)| f64::from((*a - *b).length()) * 1e3);
            distances.for_each(|mm| moments.add(mm));
            moments
        };
        let of_frame = against(reference);
        errors.frames.push(of_frame.mean().unwrap_or(0.0) as f32);
        errors.reference.merge(&of_frame);
        errors.input.merge(&against(scan));
    }
    Ok(errors)
}
