//! With the feature `player`: the C library as a WebAssembly module, which the page runs.

use std::path::{Path, PathBuf};
use std::process::Command;

const TARGET: &str = "wasm32-unknown-unknown";
/// What the module is made of, beside the lock file.
const ROOMS: [&str; 8] = ["c", "bundle", "body", "geometry", "store", "clips", "import", "random"];

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    if std::env::var_os("CARGO_FEATURE_PLAYER").is_none() {
        return;
    }
    let at = |name: &str| PathBuf::from(std::env::var_os(name).unwrap_or_default());
    let root = at("CARGO_MANIFEST_DIR").join("../..");
    for room in ROOMS {
        println!("cargo::rerun-if-changed={}", root.join("crates").join(room).join("src").display());
    }
    println!("cargo::rerun-if-changed={}", root.join("Cargo.lock").display());
    if let Err(reason) = build(&root, &at("OUT_DIR")) {
        println!("cargo::error={reason}");
    }
}

fn build(root: &Path, out: &Path) -> Result<(), String> {
    if !target_is_installed() {
        return Err(format!("the page's player needs the Rust target {TARGET}: run `rustup target add {TARGET}`"));
    }
    let mut cargo = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    cargo.current_dir(root).args(["build", "--release", "--locked", "--quiet", "-p", "softtissue-c"]);
    cargo.args(["--features", "motion", "--target", TARGET, "--target-dir"]).arg(out.join("wasm"));
    for setting in ["lto = \"fat\"", "codegen-units = 1", "strip = \"symbols\""] {
        cargo.arg("--config").arg(format!("profile.release.{setting}"));
    }
    // What was meant for this machine's code is not for the module's.
    for name in ["CARGO_ENCODED_RUSTFLAGS", "RUSTC_WORKSPACE_WRAPPER", "CARGO_TARGET_DIR", "CARGO_BUILD_TARGET"] {
        cargo.env_remove(name);
    }
    cargo.env("RUSTFLAGS", "-C target-feature=+simd128");
    let done = cargo.status().map_err(|e| format!("cargo does not start for the page's player: {e}"))?;
    if !done.success() {
        return Err("the player does not compile to WebAssembly; the reason stands above".into());
    }
    let made = out.join("wasm").join(TARGET).join("release/softtissue_player.wasm");
    let kept = out.join("player.wasm");
    std::fs::copy(&made, &kept).map_err(|e| format!("{} cannot be copied: {e}", made.display()))?;
    Ok(())
}

fn target_is_installed() -> bool {
    let mut rustc = Command::new(std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into()));
    let asked = rustc.args(["--print", "target-libdir", "--target", TARGET]).output();
    asked.is_ok_and(|said| {
        let folder = String::from_utf8_lossy(&said.stdout);
        said.status.success() && Path::new(folder.trim()).is_dir()
    })
}
