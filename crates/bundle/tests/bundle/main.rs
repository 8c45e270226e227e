//! `autoregressive`: bundles of Dyna's model, against its equations in f64, and what is refused of them.
//! `descriptor`: features against closed forms.
//! `batch`: many characters against players of their own.
//! `detail`: less of the flesh, against the sums that are left.
//! `format`: writing, reading back, pinned bytes.
//! `live`: motions at any rate, broken, unknown, starting and ending anywhere.
//! `player`: the player against sums written out in f64, and against bad input.
//! `precision`: bundles in fewer bits, what they lose and what is refused of them.
//! `reference`: these sums.
//! `refusals`: bundles that must not open.
//! `tiny`: a small body and a small bundle made from draws.

mod autoregressive;
mod batch;
mod controls;
#[path = "../../examples/crowd.rs"]
#[expect(dead_code, reason = "its `main` is for the command line")]
mod crowd;
mod descriptor;
mod detail;
mod feedback;
mod format;
mod live;
#[path = "../../examples/play.rs"]
#[expect(dead_code, reason = "its `main` is for the command line")]
mod play;
mod player;
mod precision;
mod reference;
mod refusals;
mod tiny;
