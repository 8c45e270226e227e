use softtissue_bundle::BundleError;
use softtissue_store::StoreError;

/// Why there is no page; one sentence each.
#[derive(Debug, thiserror::Error)]
pub enum PageError {
    /// From the disk.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The bundle is refused.
    #[error(transparent)]
    Bundle(#[from] BundleError),
    /// This build cannot make pages.
    #[error(
        "this build has no player for web pages: run `rustup target add wasm32-unknown-unknown` and build with \
         `--features web`"
    )]
    NoPlayer,
    /// Somebody else listens there.
    #[error("port {port} cannot be listened on: {reason}; choose another with --port, or 0 for any that is free")]
    Port {
        /// Which.
        port: u16,
        /// Why not.
        reason: String,
    },
    /// The connection to the browsers is gone.
    #[error("the page cannot be served any longer: {reason}; start again")]
    Serving {
        /// Why not.
        reason: String,
    },
}
