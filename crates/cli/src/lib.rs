//! The verbs: arguments, configuration, progress and exit codes.
/// Runs the command line.
pub fn main() -> std::process::ExitCode { std::process::ExitCode::SUCCESS }
