use std::process::{Command, Stdio};

/// Asks the system to show an address or a file; where it cannot, the printed one is there to be clicked.
pub fn open(address: &str) {
    let (program, before): (_, &[&str]) = match std::env::consts::OS {
        "macos" => ("open", &[]),
        "windows" => ("cmd", &["/C", "start", ""]),
        _ => ("xdg-open", &[]),
    };
    let silent = || Stdio::null();
    let _ = Command::new(program).args(before).arg(address).stdin(silent()).stdout(silent()).stderr(silent()).spawn();
}
