use softtissue_body::BodyError;
use softtissue_clips::ClipError;
use softtissue_store::StoreError;

/// What can go wrong in the generator; one sentence each.
#[derive(Debug, thiserror::Error)]
pub enum SynthError {
    /// From the body.
    #[error(transparent)]
    Body(#[from] BodyError),
    /// From a clip or a set of clips.
    #[error(transparent)]
    Clip(#[from] ClipError),
    /// From the disk.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// No motion has this name.
    #[error("there is no motion {name:?}: write one of {known}")]
    UnknownMotion {
        /// The name.
        name: String,
        /// Names there are, separated by commas.
        known: String,
    },
    /// A skeleton that the motions do not fit.
    #[error("the motions need a standing body with SMPL's 24 joints: {reason}")]
    Skeleton {
        /// What is missing.
        reason: String,
    },
    /// A configuration value that makes no sense.
    #[error("synth.{field}: {reason}")]
    Config {
        /// Which field.
        field: &'static str,
        /// What is wrong and what to write.
        reason: String,
    },
    /// The flesh could not be simulated.
    #[error("the flesh of {clip} failed: {reason}")]
    Flesh {
        /// Which clip.
        clip: String,
        /// What happened and what to do.
        reason: String,
    },
    /// A folder that holds clips of another configuration.
    #[error("{} holds clips of another configuration; choose another folder or delete this one", path.display())]
    Foreign {
        /// Which folder.
        path: std::path::PathBuf,
    },
    /// The user asked to stop; what is written stays.
    #[error("stopped; the finished clips are kept, run the same command again to go on")]
    Stopped,
}
