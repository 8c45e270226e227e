//! Bodies of other people's making, into ours ([`softtissue_body::BodyModel`]).

mod anny;
mod mirror;
mod problems;
mod smpl;

pub use anny::{AnnyConfig, import_anny};
pub use problems::examine_body;
pub use smpl::{SmplConfig, import_smpl};

use softtissue_body::BodyModel;

/// A body that came in.
#[derive(Clone, Debug)]
pub struct ImportedBody {
    /// The body.
    pub model: BodyModel,
    /// What it was: "SMPL", "SMPL-H", "SMPL-X", "Anny".
    pub source: &'static str,
    /// What was left out, folded or derived; one clause each.
    pub notes: Vec<String>,
}
