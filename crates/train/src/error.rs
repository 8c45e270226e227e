use softtissue_body::BodyError;
use softtissue_clips::ClipError;
use softtissue_store::StoreError;
use std::path::PathBuf;

/// What can go wrong in training; one sentence each.
#[derive(Debug, thiserror::Error)]
pub enum TrainError {
    /// From the disk or a file's form.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// From a clip or a split.
    #[error(transparent)]
    Clip(#[from] ClipError),
    /// From the body.
    #[error(transparent)]
    Body(#[from] BodyError),
    /// The loss left the finite numbers.
    #[error(
        "{stage} diverged at step {step} (loss {loss}) after the good state of step {rolled_back_to}; train again with a \
         lower {} into another --out",
        rate_key(stage)
    )]
    Diverged {
        /// Which stage.
        stage: String,
        /// At which step.
        step: u64,
        /// The loss.
        loss: f64,
        /// The last good step.
        rolled_back_to: u64,
    },
    /// The user stopped the work; it is saved.
    #[error("stopped in {stage} after {step} steps; `--resume` goes on from there")]
    Stopped {
        /// Which stage.
        stage: String,
        /// Steps done.
        step: u64,
    },
    /// A checkpoint that is broken or of another run.
    #[error("the checkpoint {path} does not fit: {reason}")]
    Checkpoint {
        /// Which checkpoint.
        path: PathBuf,
        /// Why, and what to do.
        reason: String,
    },
    /// Settings that cannot work.
    #[error("{0}")]
    Config(String),
    /// The numerics refused (too few frames, singular system, device without a feature, ...).
    #[error("{0}")]
    Numeric(String),
}

/// The setting that holds a stage's learning rate: `subspace.training.learning_rate` for `fold/subspace-25`,
/// `casas_otaduy.regressor.learning_rate` for `casas-otaduy/s00/regressor`, `autoavatar.teacher.learning_rate` for
/// `autoavatar/pose/teacher`.
fn rate_key(stage: &str) -> String {
    let name = stage.rsplit('/').next().unwrap_or(stage);
    let part = name.split('-').next().unwrap_or(name);
    let within = |section: &str| stage.split('/').any(|folder| folder == section);
    if within("casas-otaduy") {
        format!("casas_otaduy.{part}.learning_rate")
    } else if within("autoavatar") {
        format!("autoavatar.{part}.learning_rate")
    } else {
        format!("{part}.training.learning_rate")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn divergence_names_the_setting_to_lower() {
        let diverged =
            |stage: &str| TrainError::Diverged { stage: stage.into(), step: 3, loss: f64::NAN, rolled_back_to: 0 };
        assert!(diverged("a.b/subspace-25").to_string().contains("lower subspace.training.learning_rate"));
        let personal = diverged("fold/casas-otaduy/s00/autoencoder-50").to_string();
        assert!(personal.contains("lower casas_otaduy.autoencoder.learning_rate"), "{personal}");
        let avatar = diverged("autoavatar/pose/teacher").to_string();
        assert!(avatar.contains("lower autoavatar.teacher.learning_rate"), "{avatar}");
        assert!(diverged("regressor").to_string().contains("lower regressor.training.learning_rate"));
    }
}
