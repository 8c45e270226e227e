use crate::{MotionSequence, Result, Shortcut, TrainError};
use softtissue_bundle as plain;
use softtissue_model::{Regressor, ShortcutStart, TrainingClip};

/// A clip as the recurrent unit around a linear regressor sees it: `around` (without recurrent part, latents in
/// metres) gives the scaling of features and shape and, for a fixed shortcut, its latents; for a trained one the
/// shortcut sees what the unit sees. `components` of the clip's coefficients are the target.
pub fn motion_sequence(
    clip: &TrainingClip,
    around: &plain::Regressor,
    trained_shortcut: bool,
    components: usize,
) -> MotionSequence {
    let (d, k) = (clip.feature_count(), clip.coefficient_count());
    assert!(components <= k, "{components} components of {k}");
    let shape = around.scaled_shape(&clip.beta);
    let scaled = around.input.apply_clip(&clip.features);
    let width = around.feature_count();
    let input: Vec<f32> = scaled.chunks_exact(width).flat_map(|x| x.iter().chain(&shape).copied()).collect();
    let shortcut = if trained_shortcut {
        input.clone()
    } else {
        let mut state = around.start(&clip.beta);
        let latents = clip.features.chunks_exact(d).flat_map(|features| {
            around.step(features, &mut state);
            state.latent().to_vec()
        });
        latents.collect()
    };
    let target = clip.coefficients.chunks_exact(k).flat_map(|c| c[..components].iter().copied()).collect();
    MotionSequence { input, input_width: width + shape.len(), shortcut, target }
}

/// The trained shortcut of the published form, starting from a linear regressor: its layer as it stands.
///
/// A layer behind a bank of resonators, or one that bends with the shape, does not see what the recurrent unit
/// sees; it can only be a fixed shortcut.
pub fn trained_shortcut(around: &plain::Regressor) -> Result<Shortcut> {
    let plain_terms = around.shape_terms.len() == 1 && around.shape_terms[0].iter().all(|power| *power == 0);
    if around.bank.is_some() || !plain_terms {
        return Err(TrainError::Config(
            "regressor: a shortcut behind resonators or with shape terms cannot be trained along; keep it fixed, or fit \
             it without them"
                .into(),
        ));
    }
    let weight = &around.shortcut.weight;
    let transposed = (0..weight.cols()).flat_map(|q| (0..weight.rows()).map(move |l| weight.row(l)[q]));
    Ok(Shortcut::Trained(ShortcutStart { weight: transposed.collect(), bias: around.shortcut.bias.clone() }))
}

/// The whole regressor in metres: `around` with the learned recurrent part and, if it was trained, its shortcut.
/// `scale` is the autoencoder's.
pub fn assembled(around: &plain::Regressor, learned: &Regressor, scale: f32) -> plain::Regressor {
    let shortcut = learned.to_shortcut(scale).unwrap_or_else(|| around.shortcut.clone());
    plain::Regressor { shortcut, recurrent: Some(learned.to_recurrent(scale)), ..around.clone() }
}
