//! `import`: one module for each kind of thing that comes in.

mod body;
mod motion;
mod scans;

use crate::args::{Import, ImportArgs};
use crate::signals::Signals;
use anyhow::Result;

/// Runs the verb.
pub fn run(args: &ImportArgs, signals: &Signals) -> Result<()> {
    match &args.what {
        Import::Body(args) => body::run(args, signals),
        Import::Scans(args) => scans::run(args, signals),
        Import::Motion(args) => motion::run(args, signals),
    }
}
