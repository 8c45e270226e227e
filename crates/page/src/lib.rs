//! A web page that plays a bundle: a folder that any web server can host ([`Site::write`]), or the same from memory on this
//! machine ([`Server`]).
//!
//! The page runs the player itself, as WebAssembly, and draws with WebGL code of its own: it needs no network beyond the
//! folder that it came from.

mod error;
mod facts;
mod player;
mod server;
mod site;

pub use error::PageError;
pub use player::player_module;
pub use server::Server;
pub use site::{Site, SiteFile};

/// Result of this crate.
pub type Result<T> = std::result::Result<T, PageError>;
