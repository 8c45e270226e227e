//! The verbs: arguments, configuration, progress and exit codes. The only room that knows clap, anyhow and which
//! backend computes.

mod args;
mod config;
mod exit;
mod memory;
mod pipeline;
mod run_folder;
mod settings;
mod signals;
mod terminal;
mod verbs;

use crate::args::{Cli, Verb};
use crate::exit::{Exit, exit_of};
use crate::signals::Signals;
use clap::{CommandFactory, Parser};
use std::io::Write;
use std::process::ExitCode;

/// Runs the command line and returns its exit code.
pub fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => {
            let code = if error.use_stderr() { ExitCode::from(Exit::Usage) } else { ExitCode::SUCCESS };
            let _ = error.print();
            return code;
        }
    };
    let signals = match Signals::install() {
        Ok(signals) => signals,
        Err(error) => return fail(&anyhow::Error::new(error).context("signal handlers cannot be installed"), false),
    };
    match run(&cli.verb, &signals) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => fail(&error, signals.terminated()),
    }
}

fn run(verb: &Verb, signals: &Signals) -> anyhow::Result<()> {
    match verb {
        Verb::Train(args) => verbs::train::run(args, signals),
        Verb::Eval(args) => verbs::eval::run(args, signals),
        Verb::Animate(args) => verbs::animate::run(args, signals),
        Verb::Export(args) => verbs::export::run(args, signals),
        Verb::View(args) => verbs::view::run(args, signals),
        Verb::Synth(args) => verbs::synth::run(args, signals),
        Verb::Fit(args) => verbs::fit::run(args, signals),
        Verb::Tune(args) => verbs::tune::run(args, signals),
        Verb::Import(args) => verbs::import::run(args, signals),
        Verb::Inspect(args) => verbs::inspect::run(args),
        Verb::Config(args) => verbs::config::run(args),
        Verb::Completions { shell } => {
            let mut text = Vec::new();
            clap_complete::generate(*shell, &mut Cli::command(), "softtissue", &mut text);
            print_bytes(&text);
            Ok(())
        }
        Verb::Man => {
            let mut text = Vec::new();
            clap_mangen::Man::new(Cli::command()).render(&mut text)?;
            print_bytes(&text);
            Ok(())
        }
    }
}

/// One sentence for the user, and the exit code.
fn fail(error: &anyhow::Error, terminated: bool) -> ExitCode {
    let message: Vec<String> = error.chain().map(ToString::to_string).collect();
    let _ = writeln!(std::io::stderr(), "softtissue: {}", sentence(&message));
    let exit = exit_of(error);
    ExitCode::from(if exit == Exit::Interrupted && terminated { Exit::Terminated } else { exit })
}

/// Joins the causes, leaving out one whose text the one before already holds.
fn sentence(causes: &[String]) -> String {
    let mut text = String::new();
    for cause in causes {
        if text.is_empty() {
            text.push_str(cause);
        } else if !text.contains(cause.as_str()) {
            text.push_str(": ");
            text.push_str(cause);
        }
    }
    text.replace('\n', " ")
}

/// Prints to standard output; a closed pipe ends the printing, not the program with a panic.
pub(crate) fn print_line(line: &str) {
    let _ = writeln!(std::io::stdout(), "{line}");
}

fn print_bytes(bytes: &[u8]) {
    let _ = std::io::stdout().write_all(bytes);
}
