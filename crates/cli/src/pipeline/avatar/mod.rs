//! AutoAvatar: one person's neural field, learned from raw scans and judged by the paper's table.

mod judge;
mod learn;
mod report;
mod scene;
mod show;

pub use judge::{Rivals, judge_avatars};
pub use learn::train_avatar;
pub use report::write_avatar_report;
pub use scene::{AvatarScene, Part, open_raw};
pub use show::AvatarShow;
