//! Bundles in every precision: one of a small bundle's three files changed in some places and cut, with a manifest that knows its new hash.

#![no_main]

#[path = "../../crates/bundle/tests/bundle/tiny.rs"]
#[allow(dead_code, reason = "the tests of bundles use the rest")]
mod tiny;

use libfuzzer_sys::fuzz_target;
use softtissue_bundle::{Bundle, Precision};
use softtissue_fuzz::{home, laid, sentence};
use softtissue_store::sha256_bytes;
use std::sync::LazyLock;

const FILES: [&str; 3] = ["body.safetensors", "model.safetensors", "manifest.json"];

/// The three files of a small bundle, in every precision.
static WHOLE: LazyLock<[[Vec<u8>; 3]; 3]> = LazyLock::new(|| {
    let dir = home().join("whole");
    let whole = tiny::bundle(tiny::Parts::default());
    Precision::ALL.map(|precision| {
        whole.reduced(precision).expect("fewer bits").write(&dir).expect("a bundle");
        FILES.map(|name| std::fs::read(dir.join(name)).expect("a file"))
    })
});

fuzz_target!(|data: &[u8]| {
    let Some((&[which, cut, by], changes)) = data.split_first_chunk() else { return };
    let (precision, which) = (usize::from(which) / FILES.len() % WHOLE.len(), usize::from(which) % FILES.len());
    let mut files = WHOLE[precision].clone();
    let file = &mut files[which];
    for [high, low, byte] in changes.as_chunks().0 {
        let at = usize::from(u16::from_be_bytes([*high, *low])) % file.len();
        file[at] = *byte;
    }
    if cut == 1 {
        file.truncate(file.len() - usize::from(by));
    }
    let data = file.clone();
    if which < 2 {
        let mut manifest: serde_json::Value = serde_json::from_slice(&files[2]).expect("JSON");
        manifest["files"][which]["bytes"] = data.len().into();
        manifest["files"][which]["sha256"] = sha256_bytes(&data).into();
        files[2] = manifest.to_string().into_bytes();
    }
    FILES.iter().zip(&files).for_each(|(name, bytes)| drop(laid(&format!("bundle/{name}"), bytes)));
    let dir = home().join("bundle");
    match Bundle::read(&dir) {
        Ok(bundle) => drop(bundle.manifest()),
        Err(e) => sentence(&dir, &e.to_string()),
    }
});
