//! The report and a view in a headless browser, and the animation before the Khronos validator. Both need Node.

use crate::support::{folder, softtissue, tiny_run};
use std::path::Path;
use std::process::Command;

/// Runs a script that prints `skipped: needs X` where X is missing; with `CI=true` a skip is a failure.
fn script(name: &str, argument: &Path) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let output = Command::new("bash").arg(root.join(name)).arg(argument).output().expect("bash");
    let said = String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
    if said.contains("skipped: needs") {
        println!("{}", said.trim());
        assert_ne!(std::env::var("CI").as_deref(), Ok("true"), "{said}");
        return;
    }
    assert!(output.status.success(), "{name}: {said}");
}

#[test]
fn the_report_plays_in_a_browser() {
    script("tests/browser/run.sh", &tiny_run().path.join("report/index.html"));
}

#[test]
fn a_view_of_a_run_plays_in_a_browser() {
    let page = folder("view-browser").join("page.html");
    let (run, out) = (tiny_run().path.display().to_string(), page.display().to_string());
    softtissue(&["view", &run, "--fit", "--no-browser", "--out", &out]).fine();
    script("tests/browser/view.sh", &page);
}

#[test]
fn the_animation_passes_the_khronos_validator() {
    script("scripts/validate-gltf.sh", &tiny_run().path.join("animation.glb"));
}
