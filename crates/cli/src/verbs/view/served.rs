//! The page of a bundle, served on this machine.

use super::browser;
use crate::args::ViewArgs;
use crate::signals::Signals;
use crate::terminal::Terminal;
use crate::verbs::page;
use anyhow::Result;
use softtissue_page::Server;

/// Where it is served unless said otherwise.
const PORT: u16 = 4747;

/// Serves the page until the user ends it.
pub fn run(args: &ViewArgs, signals: &Signals) -> Result<()> {
    let terminal = Terminal::new(signals.clone(), false);
    let site = page::site(&args.path, &args.motions, &terminal)?;
    let server = Server::new(site, args.port.unwrap_or(PORT))?;
    crate::print_line(&format!("{} (Ctrl-C ends it)", server.address()));
    if !args.no_browser {
        browser::open(&server.address());
    }
    Ok(server.run(|| signals.should_stop())?)
}
