//! `view`: the page of a bundle, served on this machine.

use crate::args::ViewArgs;
use crate::signals::Signals;
use crate::terminal::Terminal;
use crate::verbs::page;
use anyhow::Result;
use softtissue_page::Server;
use std::process::{Command, Stdio};

/// Runs the verb.
pub fn run(args: &ViewArgs, signals: &Signals) -> Result<()> {
    let terminal = Terminal::new(signals.clone(), false);
    let site = page::site(&args.bundle, &args.motions, &terminal)?;
    let server = Server::new(site, args.port)?;
    crate::print_line(&format!("{} (Ctrl-C ends it)", server.address()));
    if !args.no_browser {
        open(&server.address());
    }
    Ok(server.run(|| signals.should_stop())?)
}

/// Asks the system to show an address; where it cannot, the printed one is there to be clicked.
fn open(address: &str) {
    let (program, before): (_, &[&str]) = match std::env::consts::OS {
        "macos" => ("open", &[]),
        "windows" => ("cmd", &["/C", "start", ""]),
        _ => ("xdg-open", &[]),
    };
    let silent = || Stdio::null();
    let _ = Command::new(program).args(before).arg(address).stdin(silent()).stdout(silent()).stderr(silent()).spawn();
}
