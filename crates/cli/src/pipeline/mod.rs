//! The stages of the main job, each from files to files: body, scans, fit, basis, subspaces, regressor, ladder,
//! bundle, judgement.

mod avatar;
mod basis;
mod body;
mod bundle;
mod casas_otaduy;
mod context;
mod dyna;
mod fits;
mod foreign;
mod job;
mod judge;
mod kept;
mod ladder;
mod leak;
mod learn;
mod motions;
mod oracle;
mod others;
mod probes;
mod recurrent;
mod report;
mod scans;
mod softsmpl;
mod softtissue;
mod subspaces;

pub use avatar::{AvatarScene, AvatarShow, Part, Rivals, judge_avatars, open_raw, train_avatar, write_avatar_report};
pub use body::load_body;
pub use bundle::BundleMethod;
pub use context::Context;
pub use fits::fit_clips;
pub use foreign::bring_in;
pub use job::{Opened, Prepared, fold, needs_test_clips, open, prepare};
pub use judge::{Judgement, heaviest, judge_run, oracle, over_time};
pub use kept::{Kept, kept};
pub use learn::{Learned, learn};
pub use others::open_others;
pub use report::{shown, write_protocol_report, write_report};
pub use scans::import_or_open;
