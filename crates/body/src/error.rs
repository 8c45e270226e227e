use softtissue_store::StoreError;

/// What can go wrong with a body; one sentence each.
#[derive(Debug, thiserror::Error)]
pub enum BodyError {
    /// From the disk or a file's form.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// A body whose parts do not fit together.
    #[error("the body is not usable: {0}")]
    Inconsistent(String),
    /// A blended skinning matrix that cannot be inverted.
    #[error(
        "the skinning matrix of vertex {vertex} has determinant {determinant:.3}, so the frame cannot be unposed: the pose folds the body there"
    )]
    Singular {
        /// Which vertex.
        vertex: usize,
        /// Its determinant.
        determinant: f32,
    },
    /// The procedural generator failed.
    #[error("the body generator failed: {0}")]
    Generator(String),
}
